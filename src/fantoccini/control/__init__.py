"""Motion planning among obstacles, and optimal control.

A task is a motion to be computed: a puppet, its start, its costs or its goal, and bounds. The
unknowns are the accelerations of the driven coordinates: ends and lengths of strings, and driven
joints. A plan leads to a goal among obstacles; an optimum has the least cost.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
