"""Equations -> source text: the model that is compiled here, and C99 to take elsewhere."""

from fantoccini.codegen.c99 import c99_files
from fantoccini.codegen.derivatives import SIZES as DERIVATIVE_SIZES, generate_derivatives
from fantoccini.codegen.lanes import generate_clearance, generate_lanes, generate_motions
from fantoccini.codegen.model import (
    STEM,
    VERSION,
    Generated,
    generate,
    model_text,
    operations,
    tables_text,
)
from fantoccini.codegen.variational import generate_variational, generate_variational_lanes

__all__ = [
    "DERIVATIVE_SIZES",
    "STEM",
    "VERSION",
    "Generated",
    "c99_files",
    "generate",
    "generate_clearance",
    "generate_derivatives",
    "generate_lanes",
    "generate_motions",
    "generate_variational",
    "generate_variational_lanes",
    "model_text",
    "operations",
    "tables_text",
]
