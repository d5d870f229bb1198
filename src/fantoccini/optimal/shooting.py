"""How motions are made: as one event-driven run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, SimulationError, StateError
from fantoccini.motion import Trajectory
from fantoccini.optimal.chosen import Chosen
from fantoccini.optimal.dynamics import Ends, LinearEnds, TimeSteps
from fantoccini.optimal.nodes import Nodes
from fantoccini.simulation import simulate

_ROUNDING = 1e-9
"""Of times [s]."""


@dataclass(frozen=True)
class EventRuns:
    """One event-driven run from the start. Derivatives are those of time steps along it."""

    steps: TimeSteps
    chosen: Chosen

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.optimal.sqp.Shooting`."""
        found = self.steps.linearise(nodes)
        return replace(found, e=ends.e, tension=ends.tension)

    def moved(self, nodes: Nodes, z: Array, u: Array, c: Array) -> tuple[Nodes, Ends] | None:
        """See :class:`fantoccini.optimal.sqp.Shooting`."""
        made = self.run(nodes.moved(z, u, c))
        return None if made is None else (made[0], self.ends(*made))

    def run(self, nodes: Nodes) -> tuple[Nodes, Trajectory] | None:
        """The run of the nodes' inputs, and its states at the nodes."""
        t = nodes.t
        try:
            marionette = self.chosen.marionette(nodes.parameters)
            x0 = self.chosen.start(nodes.parameters)
            run = simulate(
                marionette, x0, nodes.inputs(), t[-1], save_at=t, effort=False, throw=False
            )
        except (SimulationError, StateError):
            return None
        if run.status not in ARRIVED or run.t[-1] < t[-1] - _ROUNDING:
            return None
        at = np.searchsorted(run.t, t + 1e-12, side="right") - 1
        states = {name: getattr(run, name)[at] for name in ("q_D", "v_D", "q_K", "v_K")}
        return replace(nodes, **states), run

    def ends(self, nodes: Nodes, run: Trajectory) -> Ends:
        """Its intervals, which meet the nodes."""
        N = len(nodes)
        at = np.searchsorted(run.t, nodes.t[:-1] + 1e-12, side="right") - 1
        tension = np.concatenate([run.tension.values[at], run.limit_force.values[at]], axis=1)
        e = np.zeros((N, nodes.n_z))
        return Ends(e, tension, tension > 0.0, np.ones(N, dtype=bool))
