"""Links between pages: written for the repository, rewritten for the site."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changes.md",
}
"""Files of the repository's root that are pages of the site."""

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]*)(#[^)\s]*)?\)")
"""A Markdown link or picture: mark, text, file, anchor."""


def site_path(path: str) -> str | None:
    """Page or picture of the site for a file of the repository, or None."""
    if path in PAGES:
        return PAGES[path]
    if path == "examples":
        return "examples/index.md"
    if re.fullmatch(r"examples/\w+\.py", path):
        return path.removesuffix(".py") + ".md"
    return path.removeprefix("docs/") if path.startswith("docs/") else None


def rewrite_links(markdown: str, source: str) -> str:
    """A page with its links rewritten; a link that leaves the site becomes plain text.

    Args:
        markdown: the page's text.
        source: its file, relative to the repository's root.
    """
    page = site_path(source) or source

    def rewrite(match: re.Match[str]) -> str:
        mark, text, file, anchor = match[1], match[2], match[3], match[4] or ""
        if not file or "://" in file:
            return match[0]
        linked = site_path(posixpath.normpath(posixpath.join(posixpath.dirname(source), file)))
        if linked is None:
            return text
        return (
            f"{mark}[{text}]({posixpath.relpath(linked, posixpath.dirname(page) or '.')}{anchor})"
        )

    return LINK.sub(rewrite, markdown)
