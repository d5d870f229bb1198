"""simulate: a marionette, a start state and inputs -> Trajectory."""

from fantoccini.simulate.run import simulate
from fantoccini.simulate.scipy_run import INTEGRATORS

__all__ = ["INTEGRATORS", "simulate"]
