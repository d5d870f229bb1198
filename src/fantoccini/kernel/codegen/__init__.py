"""Equations -> source text: of compiled libraries, and of exported C99.

C99 is a version of the language C. A library is the compiled code of one puppet for one purpose,
such as runs or derivatives.
"""

from fantoccini.kernel.codegen.c99 import c99_files
from fantoccini.kernel.codegen.libraries import generate, generate_main
from fantoccini.kernel.codegen.model import STEM, Generated, model_text, operations
from fantoccini.kernel.codegen.tables import tables_text

__all__ = [
    "STEM",
    "Generated",
    "c99_files",
    "generate",
    "generate_main",
    "model_text",
    "operations",
    "tables_text",
]
