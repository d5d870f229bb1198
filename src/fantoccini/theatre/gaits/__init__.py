"""Gaits on a floor, made for the puppet at hand."""

from fantoccini.theatre.gaits.gait import PREPARATION, Gait
from fantoccini.theatre.gaits.gait_search import find_gait
from fantoccini.theatre.gaits.sliding import Footfalls, footfalls
from fantoccini.theatre.gaits.standing import standing_lengths

__all__ = ["PREPARATION", "Footfalls", "Gait", "find_gait", "footfalls", "standing_lengths"]
