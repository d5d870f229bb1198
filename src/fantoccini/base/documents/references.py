"""Names in a file that must exist elsewhere."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from fantoccini.base import did_you_mean
from fantoccini.base.documents.limits import LIMITS
from fantoccini.base.documents.located import Finding, shown
from fantoccini.base.documents.yaml_text import Path


def unknown_names(
    names: Iterable[str], known: Collection[str], template: str, parent_path: Path = ()
) -> Iterator[Finding]:
    """Findings of names that are not known, each with the nearest known one.

    Args:
        names: keys of a mapping in the file.
        known: allowed names.
        template: the message, with braces for the name: ``no axis moves {}``.
        parent_path: path of the mapping.
    """
    for k, name in enumerate(name for name in names if name not in known):
        gets_hint = k < LIMITS.max_hints and len(known) <= LIMITS.max_hint_names
        yield (
            (*parent_path, name),
            template.format(shown(name)) + (did_you_mean(name[:64], known) if gets_hint else ""),
        )
