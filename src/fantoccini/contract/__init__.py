"""The contract between Python and compiled code: every function and structure, declared once."""

from fantoccini.contract.functions import COLUMN, FUNCTIONS, LIBRARIES, Function, compiled
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity
from fantoccini.contract.rows import BOOKS, EVENT, PARTS, ROW, width

__all__ = [
    "BOOKS",
    "COLUMN",
    "EVENT",
    "FUNCTIONS",
    "LIBRARIES",
    "PARTS",
    "ROW",
    "SIZES",
    "Function",
    "Quantity",
    "compiled",
    "digest",
    "width",
]
