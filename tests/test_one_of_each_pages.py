"""One builder of pages and one place for each formula: a second one fails here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from fantoccini.output.html import Page, Table

SOURCE = Path(__file__).resolve().parents[1] / "src" / "fantoccini"
MARKUP = re.compile(r"</?(html|body|h[1-6]|p|div|span|table|tr|td|th|ul|li|img|svg|style)\b")


def constants(tree: ast.AST) -> Iterator[str]:
    """The texts of a module, docstrings left out."""
    told = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told:
            yield node.value


def test_only_the_builder_writes_markup():
    writers = {
        file.relative_to(SOURCE).as_posix()
        for room in ("lab", "output", "stand")
        for file in (SOURCE / room).rglob("*.py")
        if any(MARKUP.search(text) for text in constants(ast.parse(file.read_text("utf-8"))))
    }
    assert writers == set()


def test_every_text_of_a_page_is_escaped():
    hostile = "<b onload='x'>\"&\x1b\ud800"
    page = Page(hostile, hostile)
    for add in (page.section, page.subsection, page.text, page.note):
        add(hostile)
    page.verdict(hostile, holds=False)
    page.items([hostile])
    page.table(Table((hostile, "right>"), ((hostile, hostile),), frozenset({0})))
    text = page.to_html()
    assert "<b" not in text.replace("<body", "") and "\x1b" not in text
    assert text.encode("utf-8").count(b"&lt;b onload") == 11


@pytest.mark.parametrize("add", ["text", "note"])
def test_empty_texts_are_left_out(add):
    page = Page("a", "b")
    getattr(page, add)("")
    page.items([])
    assert not {"<p", "<ul"} & set(re.findall(r"<\w+", page.to_html()))
