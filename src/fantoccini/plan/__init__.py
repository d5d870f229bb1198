"""Planning: from here to there among obstacles."""

from fantoccini.plan.clearance import Clearance, Nearest
from fantoccini.plan.obstacles import HalfSpace

__all__ = ["Clearance", "HalfSpace", "Nearest"]
