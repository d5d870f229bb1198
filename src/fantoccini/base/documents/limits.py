"""Limits of YAML files, so that any file is read or refused within seconds."""

from __future__ import annotations

from typing import NamedTuple


class DocumentLimits(NamedTuple):
    """Largest sizes and counts. All are far beyond the files that people write."""

    max_file_bytes: int = 2_000_000
    """Size of a YAML file [bytes]."""
    max_depth: int = 40
    """Levels of nesting."""
    max_values: int = 100_000
    """Values in a file."""
    max_alias_values: int = 20_000
    """Values that all aliases of a file repeat: aliases of aliases multiply."""
    max_mistakes: int = 100
    """Mistakes that an error lists; it only counts the others."""
    max_hints: int = 50
    """Searches for the nearest name: each compares with every name."""
    max_hint_names: int = 400
    """Names that such a search compares with."""


LIMITS = DocumentLimits()
