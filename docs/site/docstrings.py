"""Rewrites docstrings as Markdown for mkdocstrings."""

from __future__ import annotations

import re

ROLE = re.compile(r":(?:class|func|meth|mod|data|attr):`~?([^`]+)`")
"""A reference such as ``:func:`simulate```."""

SHARED = re.compile(r"^( +)(\*?\w+(?:, \*?\w+)+): ", re.MULTILINE)
"""An entry for several arguments, ``rtol, atol: ...``."""


def split_arguments(match: re.Match[str]) -> str:
    """One entry for each argument; all but the last refer to it."""
    indent, names = match[1], match[2].split(", ")
    others = "".join(f"{indent}{name}: see `{names[-1]}`.\n" for name in names[:-1])
    return f"{others}{indent}{names[-1]}: "


def docstring_markdown(text: str) -> str:
    """Text of a docstring as Markdown, with one entry for each argument."""
    text = ROLE.sub(r"`\1`", text).replace("::\n\n", ":\n\n")
    head, mark, rest = text.partition("Args:")
    arguments, end, rest = rest.partition("\n\n")
    return head + mark + SHARED.sub(split_arguments, arguments) + end + rest
