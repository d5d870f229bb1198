"""The contract between Python and compiled code: every function and structure, declared once."""

from fantoccini.contract.codes import EventKind, GoalKind, Hold, SolidKind, Solved
from fantoccini.contract.functions import COLUMN, FUNCTIONS, LIBRARIES, Function, compiled
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity
from fantoccini.contract.rows import BOOKS, EVENT, PARTS, ROW, width
from fantoccini.contract.structures import STRUCTURES, Structure

__all__ = [
    "BOOKS",
    "COLUMN",
    "EVENT",
    "FUNCTIONS",
    "LIBRARIES",
    "PARTS",
    "ROW",
    "SIZES",
    "STRUCTURES",
    "EventKind",
    "Function",
    "GoalKind",
    "Hold",
    "Quantity",
    "SolidKind",
    "Solved",
    "Structure",
    "compiled",
    "digest",
    "width",
]
