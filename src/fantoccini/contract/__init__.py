"""The contract between Python and compiled code: every function and structure, declared once."""

from fantoccini.contract.codes import EventCode, GoalKind, Hold, SolidKind, Solved
from fantoccini.contract.functions import COLUMN, FUNCTIONS, LIBRARIES, Function, compiled
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity
from fantoccini.contract.rows import BOOKS, EVENT, EVENT_AT, PARTS, ROW, WINCH_AT, width
from fantoccini.contract.structures import STRUCTURES, Structure

__all__ = [
    "BOOKS",
    "COLUMN",
    "EVENT",
    "EVENT_AT",
    "FUNCTIONS",
    "LIBRARIES",
    "PARTS",
    "ROW",
    "SIZES",
    "STRUCTURES",
    "WINCH_AT",
    "EventCode",
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
