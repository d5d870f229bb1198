"""The contract between Python and compiled code: every function and structure, declared once.

In every array of the contract the linear part of a spatial quantity comes before the angular part:
velocities (v, w), wrenches (force, torque), free joints' velocities and configurations. Only inside
``equations`` motions and wrenches are pairs (angular, linear), in the link's frame.

Names end in D for dynamic coordinates (q_D, v_D, acc_D), which move by the equations of motion, and
in K for driven ones (q_K, v_K, acc_K), given as functions of time: ends and lengths of strings,
driven joints. n_qD, n_vD, n_qK and n_vK are the numbers of coordinates and velocities. A row is a
string or a joint limit with its gap h <= 0, of which there are n_rows. A winch changes the length
of a string; its slip is the length that it has let out.
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
