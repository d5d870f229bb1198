"""How motions are made: as one event-driven run, or as one run of time steps."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fantoccini.base import ARRIVED, Array, Progress, SimulationError, StateError, Status
from fantoccini.control.optimal.dynamics import Ends, LinearEnds, TimeSteps
from fantoccini.control.tasks import Chosen, Nodes
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory

_ROUNDING = 1e-9
"""Of times [s]."""


def uninterrupted(
    marionette: Marionette, x0: State, inputs: Input, end: float, **options: Any
) -> Trajectory:
    """The run of given inputs, whatever its status.

    Raises:
        KeyboardInterrupt: Ctrl-C stopped it, so the motion must not count as impossible.
    """
    run = simulate(marionette, x0, inputs, end, effort=False, throw=False, **options)
    if run.status is Status.STOPPED:
        raise KeyboardInterrupt
    return run


@dataclass(frozen=True)
class EventRuns:
    """One event-driven run from the start. Derivatives are those of time steps along it.

    Attributes:
        steps: of the derivatives.
        chosen: the puppet and where it starts, by the parameters that are chosen.
        until: time of ``time.perf_counter`` at which a run is given up [s].
    """

    steps: TimeSteps
    chosen: Chosen
    until: float = np.inf

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`."""
        found = self.derivatives(nodes)
        return replace(found, e=ends.e, tension=ends.tension)

    def derivatives(self, nodes: Nodes) -> LinearEnds:
        """Derivatives of the intervals by time steps; contact modes may differ between steps."""
        if self.steps.marionette.contacts is not None:
            return self.steps.linearise(nodes)
        return self.steps.extrapolated(nodes)

    def moved(self, nodes: Nodes, z: Array, u: Array, c: Array) -> tuple[Nodes, Ends] | None:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`."""
        made = self.run(nodes.moved(z, u, c))
        return None if made is None else (made[0], self.ends(*made))

    def run(self, nodes: Nodes) -> tuple[Nodes, Trajectory] | None:
        """The run of the nodes' inputs, and its states at the nodes."""
        t = nodes.t
        try:
            marionette = self.chosen.marionette(nodes.parameters)
            x0 = self.chosen.start(nodes.parameters)
            run = uninterrupted(
                marionette, x0, nodes.inputs(), t[-1], save_at=t, progress=self._in_time
            )
        except (SimulationError, StateError, TimeoutError):
            return None
        if run.status not in ARRIVED or run.t[-1] < t[-1] - _ROUNDING:
            return None
        at = np.searchsorted(run.t, t + 1e-12, side="right") - 1
        states = {name: getattr(run, name)[at] for name in ("q_D", "v_D", "q_K", "v_K")}
        return replace(nodes, run=run, **states), run

    def _in_time(self, _: Progress) -> None:
        """Raises TimeoutError once the time is over."""
        if time.perf_counter() > self.until:
            raise TimeoutError

    def ends(self, nodes: Nodes, run: Trajectory) -> Ends:
        """Its intervals, which meet the nodes."""
        N = len(nodes)
        at = np.searchsorted(run.t, nodes.t[:-1] + 1e-12, side="right") - 1
        tension = np.concatenate([run.tension.values[at], run.limit_force.values[at]], axis=1)
        e = np.zeros((N, nodes.n_z))
        return Ends(e, tension, tension > 0.0, np.ones(N, dtype=bool))


@dataclass(frozen=True)
class StepRuns(EventRuns):
    """One run of the same time steps that are differentiated: for puppets with contact.

    Each landing is many events, and a motion on the way to the best one may jam; steps go on.
    """

    def run(self, nodes: Nodes) -> tuple[Nodes, Trajectory] | None:
        m, dt = self.steps.steps(nodes.interval)
        method = TimeStepping(dt=dt, extrapolate=False)
        try:
            run = uninterrupted(
                self.chosen.marionette(nodes.parameters),
                self.chosen.start(nodes.parameters),
                nodes.inputs(),
                nodes.t[-1],
                method=method,
            )
        except (SimulationError, StateError):
            return None
        if len(run) != m * len(nodes) + 1 or not np.all(np.isfinite(run.v_D[-1])):
            return None
        states = {name: getattr(run, name)[::m] for name in ("q_D", "v_D", "q_K", "v_K")}
        return replace(nodes, run=run, **states), run

    def ends(self, nodes: Nodes, run: Trajectory) -> Ends:
        m, _ = self.steps.steps(nodes.interval)
        tension = np.concatenate([run.tension.values, run.limit_force.values], axis=1)[1::m]
        e = np.zeros((len(nodes), nodes.n_z))
        return Ends(e, tension, tension > 0.0, np.ones(len(nodes), dtype=bool))
