"""simulate: a marionette, a start state and inputs -> Trajectory."""

from fantoccini.simulate.run import simulate

__all__ = ["simulate"]
