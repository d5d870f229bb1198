"""Gaits on a floor, made for the puppet at hand."""

from fantoccini.theatre.gaits.gait import PREPARATION_STEPS, Gait
from fantoccini.theatre.gaits.gait_search import TunedGait, find_gait
from fantoccini.theatre.gaits.sliding import Footfalls, WalkStatus, footfalls
from fantoccini.theatre.gaits.standing import standing_lengths

__all__ = [
    "PREPARATION_STEPS",
    "Footfalls",
    "Gait",
    "TunedGait",
    "WalkStatus",
    "find_gait",
    "footfalls",
    "standing_lengths",
]
