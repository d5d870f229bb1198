"""Gaits on a floor, made for the puppet at hand.

A gait is the cycle in which legs swing and stand. In a stance, a foot carries load on the floor.
"""

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
