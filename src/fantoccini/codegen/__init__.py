"""Equations -> source text: the libraries that are compiled here, and C99 to take elsewhere."""

from fantoccini.codegen.c99 import c99_files
from fantoccini.codegen.libraries import generate
from fantoccini.codegen.model import STEM, Generated, model_text, operations, tables_text

__all__ = [
    "STEM",
    "Generated",
    "c99_files",
    "generate",
    "model_text",
    "operations",
    "tables_text",
]
