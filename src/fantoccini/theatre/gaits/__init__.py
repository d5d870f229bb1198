"""Gaits on a floor, made for the puppet at hand.

A gait is the cycle in which legs swing and stand. In a stance, a foot carries load on the floor.
"""

from fantoccini.theatre.gaits.bundled_gaits import BUNDLED_GAITS
from fantoccini.theatre.gaits.gait import (
    CLOSING_STEPS,
    HANGING_PREPARATION_STEPS,
    PREPARATION_STEPS,
    RAISING_STEPS,
    Gait,
)
from fantoccini.theatre.gaits.gait_search import TunedGait, find_gait
from fantoccini.theatre.gaits.sliding import (
    MAX_SLIDE,
    MIN_STANDING_SHARE,
    Footfalls,
    WalkStatus,
    footfalls,
)
from fantoccini.theatre.gaits.standing import standing_lengths

__all__ = [
    "BUNDLED_GAITS",
    "CLOSING_STEPS",
    "HANGING_PREPARATION_STEPS",
    "MAX_SLIDE",
    "MIN_STANDING_SHARE",
    "PREPARATION_STEPS",
    "RAISING_STEPS",
    "Footfalls",
    "Gait",
    "TunedGait",
    "WalkStatus",
    "find_gait",
    "footfalls",
    "standing_lengths",
]
