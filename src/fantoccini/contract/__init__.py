"""The contract between Python and compiled code: every function and structure, declared once.

In every array of the contract the linear part of a spatial quantity comes before the angular part:
velocities (v, w), wrenches (force, torque), free joints' velocities and configurations. Only inside
``equations`` motions and wrenches are pairs (angular, linear), in the link's frame.
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
