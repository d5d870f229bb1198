"""The contract between Python and compiled code: every function and structure, declared once.

In every array of the contract the linear part of a spatial quantity comes before the angular part:
velocities (v, w), wrenches (force, torque), free joints' velocities and configurations. Only inside
``equations`` motions and wrenches are pairs (angular, linear), in the link's frame.
"""

from fantoccini.contract.codes import (
    EventCode,
    GoalKind,
    Hold,
    ReachEnd,
    SolidKind,
    Solved,
    StepEdge,
)
from fantoccini.contract.constants import (
    CLOSED_GAP,
    CONSTANTS,
    HULL_VERTICES,
    LEAST_LENGTH,
    REST_SPEED,
    START_GAP,
    TENSION_CAP,
    WINCH_DECELERATION,
)
from fantoccini.contract.functions import COLUMN, FUNCTIONS, LIBRARIES, Function, compiled
from fantoccini.contract.identity import digest
from fantoccini.contract.quantity import SIZES, Quantity
from fantoccini.contract.samples import (
    BOOKS,
    CONTACT,
    EVENT,
    EVENT_AT,
    PARTS,
    SAMPLE,
    WINCH_AT,
    width,
)
from fantoccini.contract.structure import Structure
from fantoccini.contract.structures import STRUCTURES

__all__ = [
    "BOOKS",
    "CLOSED_GAP",
    "COLUMN",
    "CONSTANTS",
    "CONTACT",
    "EVENT",
    "EVENT_AT",
    "FUNCTIONS",
    "HULL_VERTICES",
    "LEAST_LENGTH",
    "LIBRARIES",
    "PARTS",
    "REST_SPEED",
    "SAMPLE",
    "SIZES",
    "START_GAP",
    "STRUCTURES",
    "TENSION_CAP",
    "WINCH_AT",
    "WINCH_DECELERATION",
    "EventCode",
    "Function",
    "GoalKind",
    "Hold",
    "Quantity",
    "ReachEnd",
    "SolidKind",
    "Solved",
    "StepEdge",
    "Structure",
    "compiled",
    "digest",
    "width",
]
