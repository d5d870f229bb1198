"""Simulations of motions: as one event-driven run, or as one run of time steps.

An event-driven run locates the times at which strings become slack or taut; time steps have a fixed
length. v_D and v_K are the dynamic and the driven velocities. A node is a time at which the inputs
may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fantoccini.base import ARRIVED, Array, Progress, SimulationError, StateError, Status
from fantoccini.control.optimal.dynamics import Ends, LinearEnds, TimeSteps
from fantoccini.control.tasks import ChosenParameters, Nodes
from fantoccini.dynamics.compiled import TimeStepping
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import simulate
from fantoccini.motion import Input, State, Trajectory

_TIME_ROUNDING = 1e-9
"""Rounding error of times [s]."""


def simulate_uninterrupted(
    marionette: Marionette, x0: State, inputs: Input, end: float, **options: Any
) -> Trajectory:
    """The run of given inputs, with any status.

    Raises:
        KeyboardInterrupt: Ctrl-C during the run, so that the motion does not count as impossible.
    """
    run = simulate(marionette, x0, inputs, end, effort=False, throw=False, **options)
    if run.status is Status.STOPPED:
        raise KeyboardInterrupt
    return run


@dataclass(frozen=True)
class EventRuns:
    """Event-driven runs from the start, with derivatives of time steps along them.

    Attributes:
        steps: time steps for the derivatives.
        free_parameters: the puppet and its start, as functions of the chosen parameters.
        deadline: time of ``time.perf_counter`` at which a run is abandoned [s].
    """

    steps: TimeSteps
    free_parameters: ChosenParameters
    deadline: float = np.inf

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`."""
        linear = self.derivatives(nodes)
        return replace(linear, e=ends.e, tension=ends.tension)

    def derivatives(self, nodes: Nodes) -> LinearEnds:
        """Derivatives of the intervals by time steps; contact modes may differ between steps."""
        if self.steps.marionette.contacts is not None:
            return self.steps.linearise(nodes)
        return self.steps.extrapolated(nodes)

    def after_step(self, nodes: Nodes, z: Array, u: Array, c: Array) -> tuple[Nodes, Ends] | None:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`."""
        nodes_and_run = self.run(nodes.after_step(z, u, c))
        return None if nodes_and_run is None else (nodes_and_run[0], self.ends(*nodes_and_run))

    def run(self, nodes: Nodes) -> tuple[Nodes, Trajectory] | None:
        """The run of the nodes' inputs, and the nodes with its states; None if it fails."""
        t = nodes.t
        try:
            marionette = self.free_parameters.marionette(nodes.parameters)
            x0 = self.free_parameters.start(nodes.parameters)
            run = simulate_uninterrupted(
                marionette, x0, nodes.inputs(), t[-1], save_at=t, progress=self._check_time
            )
        except (SimulationError, StateError, TimeoutError):
            return None
        if run.status not in ARRIVED or run.t[-1] < t[-1] - _TIME_ROUNDING:
            return None
        samples = np.searchsorted(run.t, t + 1e-12, side="right") - 1
        states = {name: getattr(run, name)[samples] for name in ("q_D", "v_D", "q_K", "v_K")}
        return replace(nodes, run=run, **states), run

    def _check_time(self, _: Progress) -> None:
        """Raises TimeoutError after the time limit."""
        if time.perf_counter() > self.deadline:
            raise TimeoutError

    def ends(self, nodes: Nodes, run: Trajectory) -> Ends:
        """The intervals of a run, which meet the nodes."""
        N = len(nodes)
        samples = np.searchsorted(run.t, nodes.t[:-1] + 1e-12, side="right") - 1
        tension = np.concatenate(
            [run.tension.values[samples], run.limit_force.values[samples]], axis=1
        )
        e = np.zeros((N, nodes.n_z))
        return Ends(e, tension, tension > 0.0, np.ones(N, dtype=bool))


@dataclass(frozen=True)
class StepRuns(EventRuns):
    """Runs of the same time steps that are differentiated, for puppets with contact.

    A landing is many events, and an intermediate motion of a search may jam; time steps go on.
    """

    def run(self, nodes: Nodes) -> tuple[Nodes, Trajectory] | None:
        m, dt = self.steps.split(nodes.interval)
        method = TimeStepping(dt=dt, extrapolate=False)
        try:
            run = simulate_uninterrupted(
                self.free_parameters.marionette(nodes.parameters),
                self.free_parameters.start(nodes.parameters),
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
        m, _ = self.steps.split(nodes.interval)
        tension = np.concatenate([run.tension.values, run.limit_force.values], axis=1)[1::m]
        e = np.zeros((len(nodes), nodes.n_z))
        return Ends(e, tension, tension > 0.0, np.ones(len(nodes), dtype=bool))
