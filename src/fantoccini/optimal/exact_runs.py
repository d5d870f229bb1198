"""Event-driven runs with their own derivatives, through the events in every interval."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.motion import Trajectory
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.shooting import EventRuns
from fantoccini.simulation.intervals import interval_derivatives

_TOLERANCE = 1e-8
"""Of the integration of derivatives."""


@dataclass(frozen=True, eq=False)
class RunEnds(Ends):
    """Where the intervals of a run lead.

    Attributes:
        run: the run.
    """

    run: Trajectory


@dataclass(frozen=True)
class ExactRuns(EventRuns):
    """One event-driven run from the start, with its own derivatives.

    Attributes:
        reasons: why the last derivatives were those of time steps; none where they were exact.
    """

    reasons: list[str] = field(default_factory=list, compare=False)

    def ends(self, nodes: Nodes, run: Trajectory) -> RunEnds:
        """Its intervals, which meet the nodes."""
        made = super().ends(nodes, run)
        return RunEnds(made.e, made.tension, made.taut, made.settled, run)

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.optimal.sqp.Shooting`.

        Tensions are differentiated by time steps.
        """
        found = super().linearise(nodes, ends)
        assert isinstance(ends, RunEnds)
        marionette = self.chosen.marionette(nodes.parameters)
        inputs = nodes.inputs().bound(nodes.q_K[0], nodes.start)
        try:
            exact = interval_derivatives(
                marionette, ends.run, inputs, rtol=_TOLERANCE, atol=_TOLERANCE
            )
        except StateError as error:
            self.reasons.append(str(error))
            return found
        self.reasons.clear()
        by_c = found.by_c.copy()
        by_c[..., 0] = self._later(nodes, ends.run)
        by_c[..., 1:] = exact.C[..., self.chosen.columns]
        return replace(found, A=exact.A, B=exact.B, by_c=by_c)

    def _later(self, nodes: Nodes, run: Trajectory) -> Array:
        """(N, n_z) rates of the states just before the ends of the intervals."""
        marionette = self.chosen.marionette(nodes.parameters)
        at = np.searchsorted(run.t, nodes.t[1:] - 1e-12)
        before = [run.state(int(i)) for i in at]
        acc_D = [
            marionette.forward_dynamics(x, acc_K=acc_K).acc_D
            for x, acc_K in zip(before, nodes.acc_K, strict=True)
        ]
        v_D, v_K = ([getattr(x, name) for x in before] for name in ("v_D", "v_K"))
        return np.concatenate([v_D, acc_D, v_K, nodes.acc_K], axis=1)
