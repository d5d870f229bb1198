"""The compiled puppet: the one package that speaks to the shared library, through ctypes."""

from fantoccini.runtime import memory
from fantoccini.runtime.batch import Batch, BatchLibrary, default_threads
from fantoccini.runtime.clearance import (
    BOX,
    HALF_SPACE,
    SEGMENT,
    SOLID,
    ClearanceLibrary,
    Solids,
)
from fantoccini.runtime.compiled import Complementarity, Library, Run
from fantoccini.runtime.functions import Loaded, whole
from fantoccini.runtime.outside import OutsideRun
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
from fantoccini.runtime.slopes import Slopes
from fantoccini.runtime.structures import RunOptions

__all__ = [
    "BOX",
    "HALF_SPACE",
    "POINT",
    "POSE",
    "SEGMENT",
    "SOLID",
    "STATE",
    "UNKNOWN",
    "Batch",
    "BatchLibrary",
    "ClearanceLibrary",
    "Complementarity",
    "Funnel",
    "GoalNumbers",
    "Library",
    "Loaded",
    "OutsideRun",
    "RolloutLibrary",
    "RolloutPool",
    "RolloutSettings",
    "Run",
    "RunOptions",
    "Segments",
    "Slopes",
    "Solids",
    "default_threads",
    "memory",
    "whole",
]
