"""Griffe extension: rewrites every docstring before mkdocstrings reads it."""

from __future__ import annotations

from typing import Any

from docs.site.docstrings import docstring_markdown
from griffe import Extension, Object


class Docstrings(Extension):
    """Replaces each docstring by Markdown."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        if obj.docstring:
            obj.docstring.value = docstring_markdown(obj.docstring.value)
