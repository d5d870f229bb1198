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
    """Total number of values copied by aliases; nested aliases multiply them."""
    max_mistakes: int = 100
    """Mistakes listed in an error; further ones are only counted."""
    max_hints: int = 50
    """Number of 'did you mean' searches; each compares with every allowed name."""
    max_hint_names: int = 400
    """Largest number of allowed names for which such a search is made."""


LIMITS = DocumentLimits()
