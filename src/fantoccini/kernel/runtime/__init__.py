"""The compiled puppet: the only package that calls the shared library, through ctypes.

q_D are the dynamic coordinates of the puppet and q_K the driven ones (ends and lengths of strings,
driven joints), v and acc their velocities and accelerations. A row is a string or a joint limit
with its gap. A winch changes the length of a string; its slip is the length that it has let out.
Lanes are runs that the vector unit of the processor advances together.
"""

from fantoccini.kernel.runtime import memory, solids
from fantoccini.kernel.runtime.batch import Batch, BatchLibrary, default_threads
from fantoccini.kernel.runtime.clamped_stages import ClampedOutcome, ClampedStages
from fantoccini.kernel.runtime.clearance import (
    BOX,
    HALF_SPACE,
    SEGMENT,
    ClearanceLibrary,
    Moves,
    Records,
    Solids,
    moved_by,
)
from fantoccini.kernel.runtime.compiled import Complementarity, Library, Piece, Run
from fantoccini.kernel.runtime.contact_decoding import contact_points
from fantoccini.kernel.runtime.contacts import Contacts
from fantoccini.kernel.runtime.flow_derivatives import DerivativeLibrary, FlowChanges
from fantoccini.kernel.runtime.frozen_flow import FrozenFlow
from fantoccini.kernel.runtime.functions import AnyArray, Functions, Loaded, checked_integer
from fantoccini.kernel.runtime.gradients import GradientLibrary, GradientRun
from fantoccini.kernel.runtime.hulls import Hull, mesh_hulls
from fantoccini.kernel.runtime.inputs import HeldInput
from fantoccini.kernel.runtime.lanes import LaneHistory, LaneRecord, LaneSteppers
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.kernel.runtime.reach import MAX_TARGETS, Reached, ReachLibrary
from fantoccini.kernel.runtime.rollouts import (
    POINT,
    POSE,
    STATE,
    UNKNOWN,
    GoalNumbers,
    LqrLaw,
    RolloutLibrary,
    RolloutPool,
    RolloutSettings,
    Segments,
)
from fantoccini.kernel.runtime.solids import SOLID, empty, half_space, hull_solid, solid, stacked
from fantoccini.kernel.runtime.stage_programs import StagePrograms
from fantoccini.kernel.runtime.step_derivatives import StepDerivatives
from fantoccini.kernel.runtime.touching_steps import StepTouches, step_touches

__all__ = [
    "BOX",
    "HALF_SPACE",
    "MAX_TARGETS",
    "POINT",
    "POSE",
    "SEGMENT",
    "SOLID",
    "STATE",
    "UNKNOWN",
    "AnyArray",
    "Batch",
    "BatchLibrary",
    "ClampedOutcome",
    "ClampedStages",
    "ClearanceLibrary",
    "Complementarity",
    "Contacts",
    "DerivativeLibrary",
    "FlowChanges",
    "FrozenFlow",
    "Functions",
    "GoalNumbers",
    "GradientLibrary",
    "GradientRun",
    "HeldInput",
    "Hull",
    "LaneHistory",
    "LaneRecord",
    "LaneSteppers",
    "Library",
    "Loaded",
    "LqrLaw",
    "Moves",
    "Piece",
    "ReachLibrary",
    "Reached",
    "Records",
    "RolloutLibrary",
    "RolloutPool",
    "RolloutSettings",
    "Run",
    "RunOptions",
    "Segments",
    "Solids",
    "StagePrograms",
    "StepDerivatives",
    "StepTouches",
    "checked_integer",
    "contact_points",
    "default_threads",
    "empty",
    "half_space",
    "hull_solid",
    "memory",
    "mesh_hulls",
    "moved_by",
    "solid",
    "solids",
    "stacked",
    "step_touches",
]
