"""Equations -> source text: the model that is compiled here, and C99 to take elsewhere."""

from fantoccini.codegen.c99 import c99_files
from fantoccini.codegen.model import (
    STEM,
    VERSION,
    Generated,
    generate,
    generate_lanes,
    model_text,
    tables_text,
)

__all__ = [
    "STEM",
    "VERSION",
    "Generated",
    "c99_files",
    "generate",
    "generate_lanes",
    "model_text",
    "tables_text",
]
