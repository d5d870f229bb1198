"""The contract between Python and compiled code: every function and structure, declared once.

Order of spatial quantities: a **motion or wrench inside the equations** is a pair (angular, linear)
about the link's origin, in the link's frame. **Arrays that cross the contract** stack the linear
part before the angular one: velocities (v, w), wrenches (force, torque), poses (R, r) and free
joints' coordinates apart. See docs/symbols.md.
"""

from fantoccini.contract.codes import EventCode, GoalKind, Hold, SolidKind, Solved
from fantoccini.contract.functions import COLUMN, FUNCTIONS, LIBRARIES, Function, compiled
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity
from fantoccini.contract.samples import BOOKS, EVENT, EVENT_AT, PARTS, SAMPLE, WINCH_AT, width
from fantoccini.contract.structures import STRUCTURES, Structure

__all__ = [
    "BOOKS",
    "COLUMN",
    "EVENT",
    "EVENT_AT",
    "FUNCTIONS",
    "LIBRARIES",
    "PARTS",
    "SAMPLE",
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
