"""The contract between Python and compiled code: every function and structure, declared once.

In every array of the contract the linear part of a spatial quantity comes before the angular part:
velocities (v, w), wrenches (force, torque), free joints' velocities and configurations. Only inside
``equations`` motions and wrenches are pairs (angular, linear), in the link's frame.
"""

from fantoccini.kernel.contract.arguments import ARGUMENTS
from fantoccini.kernel.contract.codes import (
    EventCode,
    GoalKind,
    Hold,
    ReachEnd,
    SolidKind,
    Solved,
    StepEdge,
)
from fantoccini.kernel.contract.constants import (
    CLOSED_GAP,
    CONSTANTS,
    HULL_VERTICES,
    MIN_SCALE_LENGTH,
    REST_SPEED,
    START_GAP,
    TENSION_CAP,
    WINCH_DECELERATION,
)
from fantoccini.kernel.contract.function import DERIVATIVES, LIBRARIES, MODEL, Function
from fantoccini.kernel.contract.functions import COLUMN, FUNCTIONS, compiled, needed
from fantoccini.kernel.contract.identity import digest
from fantoccini.kernel.contract.lanes import LANE
from fantoccini.kernel.contract.quantity import SIZES, Quantity
from fantoccini.kernel.contract.samples import (
    CONTACT,
    ENERGY_TERMS,
    EVENT,
    EVENT_AT,
    PARTS,
    SAMPLE,
    SUMS,
    WINCH_AT,
    width,
)
from fantoccini.kernel.contract.structure import Field, Structure
from fantoccini.kernel.contract.structures import STRUCTURES

__all__ = [
    "ARGUMENTS",
    "CLOSED_GAP",
    "COLUMN",
    "CONSTANTS",
    "CONTACT",
    "DERIVATIVES",
    "ENERGY_TERMS",
    "EVENT",
    "EVENT_AT",
    "FUNCTIONS",
    "HULL_VERTICES",
    "LANE",
    "LIBRARIES",
    "MIN_SCALE_LENGTH",
    "MODEL",
    "PARTS",
    "REST_SPEED",
    "SAMPLE",
    "SIZES",
    "START_GAP",
    "STRUCTURES",
    "SUMS",
    "TENSION_CAP",
    "WINCH_AT",
    "WINCH_DECELERATION",
    "EventCode",
    "Field",
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
    "needed",
    "width",
]
