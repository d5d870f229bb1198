"""The compiled puppet: the only package that calls the shared library, through ctypes."""

from fantoccini.runtime import memory
from fantoccini.runtime.batch import Batch, BatchLibrary, default_threads
from fantoccini.runtime.clamped_stages import ClampedOutcome, ClampedStages
from fantoccini.runtime.clearance import (
    BOX,
    HALF_SPACE,
    SEGMENT,
    ClearanceLibrary,
    Moves,
    Solids,
    moved_by,
)
from fantoccini.runtime.compiled import Complementarity, Library, Piece, Run
from fantoccini.runtime.contact_points import contact_points
from fantoccini.runtime.contacts import Contacts
from fantoccini.runtime.flow_derivatives import DerivativeLibrary, FlowChanges
from fantoccini.runtime.frozen_flow import FrozenFlow
from fantoccini.runtime.functions import AnyArray, Functions, Loaded, whole
from fantoccini.runtime.gradients import GradientLibrary, GradientRun
from fantoccini.runtime.lane_steppers import LaneSteppers
from fantoccini.runtime.options import RunOptions
from fantoccini.runtime.reach import MAX_TARGETS, Reached, ReachLibrary
from fantoccini.runtime.rollouts import (
    POINT,
    POSE,
    STATE,
    UNKNOWN,
    Funnel,
    GoalNumbers,
    RolloutLibrary,
    RolloutPool,
    RolloutSettings,
    Segments,
)
from fantoccini.runtime.solids import SOLID
from fantoccini.runtime.stage_programs import StagePrograms
from fantoccini.runtime.step_derivatives import StepDerivatives
from fantoccini.runtime.structures import HeldInput
from fantoccini.runtime.touching_steps import StepTouches, step_touches

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
    "Funnel",
    "GoalNumbers",
    "GradientLibrary",
    "GradientRun",
    "HeldInput",
    "LaneSteppers",
    "Library",
    "Loaded",
    "Moves",
    "Piece",
    "ReachLibrary",
    "Reached",
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
    "contact_points",
    "default_threads",
    "memory",
    "moved_by",
    "step_touches",
    "whole",
]
