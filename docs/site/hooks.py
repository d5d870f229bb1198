"""MkDocs hooks: add the generated pages, fill the navigation, rewrite links."""

from __future__ import annotations

from pathlib import Path

from docs.site import examples, reference
from docs.site.links import PAGES, ROOT, rewrite_links
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

GENERATED = ("examples/", "api/")
SOURCES = {page: file for file, page in PAGES.items()}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Replaces the folders of generated pages in the navigation by their pages."""
    files = sorted(path.stem for path in examples.FOLDER.glob("*.py"))
    pages = {
        "examples/": ["examples/index.md", *(f"examples/{stem}.md" for stem in files)],
        "api/": ["api/index.md", *(f"api/{package}.md" for package in reference.TITLES)],
    }
    config.nav = [
        {title: pages.get(entry, entry) if isinstance(entry, str) else entry}
        for section in config.nav or ()
        for title, entry in section.items()
    ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages of the repository's root, the examples and the API reference."""

    def add(uri: str, content: str) -> None:
        files.append(File.generated(config, uri, content=content))

    for file, uri in PAGES.items():
        add(uri, (ROOT / file).read_text(encoding="utf-8"))
    executed = [examples.execute(file) for file in sorted(examples.FOLDER.glob("*.py"))]
    for example in executed:
        add(f"examples/{example.file.stem}.md", example.page())
        for picture in example.pictures:
            files.append(
                File.generated(config, f"examples/{picture.name}", abs_src_path=str(picture))
            )
    add("examples/index.md", examples.index(executed))
    for package, names in reference.paths().items():
        add(f"api/{package}.md", reference.page(package, names))
    add("api/index.md", reference.index())
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Rewrites the links of pages that are written for the repository."""
    uri = page.file.src_uri
    if uri.startswith(GENERATED):
        return markdown
    return rewrite_links(markdown, SOURCES.get(uri, str(Path("docs") / uri)))
