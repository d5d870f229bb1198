"""The documentation site: navigation, links, reference and build."""

from __future__ import annotations

import importlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from docs import architecture
from docs.site import examples, reference
from docs.site.docstrings import docstring_markdown
from docs.site.links import LINK, PAGES, rewrite_links
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[1]
WRITTEN_PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])


def navigation(entries: list | dict | str) -> Iterator[str]:
    """Pages of a navigation."""
    if isinstance(entries, str):
        yield entries
    elif isinstance(entries, dict):
        for value in entries.values():
            yield from navigation(value)
    else:
        for entry in entries:
            yield from navigation(entry)


def test_the_navigation_lists_every_page_once():
    config = YAML(typ="safe").load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    listed = sorted(navigation(config["nav"]))
    pages = [path.name for path in (ROOT / "docs").glob("*.md")]
    assert listed == sorted([*pages, *PAGES.values(), "api/", "examples/"])


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.M)
    plain = (re.sub(r"[^\w\s-]", "", LINK.sub(r"\2", h)).strip().lower() for h in headings)
    return {re.sub(r"[\s-]+", "-", heading) for heading in plain}


@pytest.mark.parametrize("page", WRITTEN_PAGES, ids=lambda p: p.stem)
def test_links_lead_to_files_and_anchors(page):
    for _, _, file, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        if "://" in file:
            continue
        target = page.parent / file if file else page
        assert target.exists(), file
        assert not anchor or anchor[1:] in anchors(target), (file, anchor)


@pytest.mark.parametrize("page", WRITTEN_PAGES, ids=lambda p: p.stem)
def test_a_page_opens_with_a_title_and_a_sentence(page):
    title, text = page.read_text(encoding="utf-8").split("\n\n")[:2]
    assert re.fullmatch(r"# [^\n]+", title)
    assert re.match(r"[\w`]", text), "the first sentence must say what the page is for"


def test_links_are_rewritten_for_the_site():
    text = "[a](docs/live.md#replay) [b](LICENSE) [c](examples/1.py) ![d](docs/pictures/e.png)"
    assert rewrite_links(text, "README.md") == (
        "[a](live.md#replay) b [c](examples/1.md) ![d](pictures/e.png)"
    )
    assert rewrite_links("[a](../README.md) [b](#x)", "docs/live.md") == "[a](index.md) [b](#x)"


def test_the_reference_has_every_public_name_by_a_path_that_imports():
    paths = [path for page in reference.paths().values() for path in page]
    assert len(set(paths)) == len(paths)
    for path in paths:
        holder, name = path.rsplit(".", 1)
        assert hasattr(importlib.import_module(holder), name), path
    fantoccini = importlib.import_module("fantoccini")
    others = {"__version__", "errors", "puppets", *reference.TITLES}
    public = {f"fantoccini.{name}" for name in fantoccini.__all__ if name not in others}
    assert public <= set(paths)


@pytest.mark.parametrize("page", WRITTEN_PAGES, ids=lambda p: p.stem)
def test_the_reference_has_the_names_that_the_guide_uses(page):
    paths = {path for page in reference.paths().values() for path in page}
    if page.stem not in ("equations", "CHANGELOG"):  # these pages name private functions
        used = re.findall(r"`(fantoccini\.[\w.]*\w)(?=[`(])", page.read_text(encoding="utf-8"))
        assert [name for name in used if name not in paths and "hpp" not in name] == []


def test_a_docstring_becomes_markdown():
    text = "As :func:`simulate`::\n\n    code\n\nArgs:\n    a, b: two.\n\nRaises:\n    A, B: no."
    assert docstring_markdown(text) == (
        "As `simulate`:\n\n    code\n\nArgs:\n    a: see `b`.\n    b: two.\n\n"
        "Raises:\n    A, B: no."
    )


def test_an_examples_key_follows_its_source(tmp_path):
    first, second = tmp_path / "one.py", tmp_path / "other.py"
    first.write_text("print(1)\n")
    second.write_text("print(2)\n")
    assert examples.key(first) == examples.key(first) != examples.key(second)


def test_the_architecture_page_is_up_to_date():
    """The page and its picture are up to date; `make architecture` writes them."""
    assert architecture.PAGE.read_text(encoding="utf-8") == architecture.page()
    assert architecture.PICTURE.read_text(encoding="utf-8") == architecture.drawing()


@pytest.mark.parametrize("task", architecture.TASKS, ids=lambda t: t.title)
def test_the_files_that_a_task_touches_exist(task):
    files = [file for _, files in task.steps for file in files]
    root = {True: ROOT, False: ROOT / "src" / "fantoccini"}
    assert [f for f in files if not (root[f[0] == "/"] / f.lstrip("/")).is_file()] == []


@pytest.mark.parametrize(
    "places",
    [*architecture.CODE_PATHS.values(), [entry[1:4] for entry in architecture.SEPARATE_SOLVERS]],
    ids=[*architecture.CODE_PATHS, "equilibria"],
)
def test_files_of_the_architecture_define_what_it_names(places):
    for file, name, _ in places:
        text = (ROOT / "src" / "fantoccini" / file).read_text(encoding="utf-8")
        assert re.search(rf"^ *(def|class|struct) {name}\b", text, re.MULTILINE), (file, name)


def test_the_architecture_page_fits_on_two_screens():
    assert len(architecture.page().splitlines()) < 90


@pytest.mark.slow
@pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("mkdocs", "mkdocstrings"))),
    reason="the docs extra is not installed",
)
def test_the_site_builds_without_warnings(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "api" / "dynamics.html").is_file()
