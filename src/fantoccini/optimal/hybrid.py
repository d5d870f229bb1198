"""Event-driven runs with the exact derivatives of their intervals, through releases and catches.

    z_{i+1} = A_i z_i + B_i u_i,   z = (dq_D, dv_D, dq_K, dv_K)

Between events the variational equation holds; at a catch z jumps by the saltation matrix, in which
the time of the event, an unknown of the hybrid problem, is eliminated by its guard h = 0
(:mod:`fantoccini.simulation.intervals`).
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import Trajectory
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.shooting import EventRuns
from fantoccini.simulation import simulate
from fantoccini.simulation.intervals import interval_derivatives

_SAME_TIME = 1e-12
"""Distance of times that are one [s]."""


class HybridRuns(EventRuns):
    """Event-driven runs, with the exact derivatives of their intervals."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.optimal.sqp.Shooting`; the parameters are taken as given.

        Raises:
            SimulationError, StateError: a catch has no derivative.
        """
        marionette, inputs = self.chosen.marionette(nodes.parameters), nodes.inputs()
        x0 = self.chosen.start(nodes.parameters)
        run = simulate(marionette, x0, inputs, nodes.t[-1], effort=False)  # with samples at breaks
        found = interval_derivatives(marionette, run, inputs)
        before = np.searchsorted(run.t, nodes.t[1:] - _SAME_TIME)  # breaks and events have two
        later = (run.v_D[before], run.acc_D[before], run.v_K[before], nodes.acc_K)
        pull = np.zeros((len(nodes), ends.tension.shape[1], nodes.n_z + nodes.acc_K.shape[1]))
        if self.steps.pulls:
            pull = _pulls(marionette, run, nodes)
        return LinearEnds(
            ends.e, ends.tension, ends.taut, ends.settled, found.A, found.B, pull,
            by_c=np.concatenate(later, axis=1)[..., None],
            pull_c=np.zeros((*pull.shape[:2], 1)), start_c=np.zeros((nodes.n_z, 1)),
        )  # fmt: skip


def _pulls(marionette: Marionette, run: Trajectory, nodes: Nodes) -> Array:
    """(N, n_rows, n_z + n_vK) derivatives of the tensions just after the nodes but the last."""
    after = np.searchsorted(run.t, nodes.t[:-1] + _SAME_TIME, side="right") - 1
    names, two_sided = marionette.tree.row_names, marionette.model.two_sided
    out = []
    for i, acc_K in zip(after, nodes.acc_K, strict=True):
        force = run.limit_force.values[i] > 0.0
        held = np.concatenate([run.taut.values[i], force]) | two_sided
        rows = [name for name, holds in zip(names, held, strict=True) if holds]
        by = marionette.linearise(run.state(int(i)), acc_K, rows=rows).pull
        out.append(np.concatenate([by.q_D, by.v_D, by.q_K, by.v_K, by.acc_K], axis=1))
    return np.array(out)
