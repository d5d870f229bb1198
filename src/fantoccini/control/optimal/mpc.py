"""Model predictive control: the best inputs from a measured state over a horizon that goes along.

    min J(x, acc_K) over [t, t + horizon],   x_{i+1} = F(x_i, acc_i),   x_0 as measured

An update makes one step of sequential quadratic programming from the inputs of the update before
(the real-time iteration of Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005): predict,
linearise along the prediction, solve one program of stages, predict again along the step.
"""

from __future__ import annotations

import enum
import math
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, StateError, check_positive
from fantoccini.control.optimal.api import refuse_winches, tracks_of
from fantoccini.control.optimal.clamped import ClampedSteps
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.prediction import Predictions
from fantoccini.control.tasks import Bounds, Nodes, Smooth, Target, Task, Track
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

Targets = Mapping[str | tuple[str, tuple[float, float, float]], Target]

SPEED, ACCELERATION = 1.5, 10.0
"""Bounds of driven coordinates where there is no task: a brisk hand [m/s, m/s^2, rad/s ...]."""


class MPCStatus(enum.Enum):
    """What an update came to."""

    IMPROVED = "a step of the program lowered the cost of the prediction"
    KEPT = "no step lowered the cost; the inputs of the update before go on"
    BRAKES = "no prediction arrives; the driven coordinates brake"


@dataclass(frozen=True)
class MPCSettings:
    """Numbers of updates."""

    damping: float = 1e-5
    """Of the Hessian, in units of the cost."""
    price: float = 3.0
    """Of a unit of violation of a row, in units of the cost."""
    shares: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    """Of a step that are predicted."""
    kept: int = 32
    """Updates whose inputs, and times, are remembered."""


SETTINGS = MPCSettings()


@dataclass(frozen=True, eq=False)
class _Plan:
    """Accelerations (N, n_vK) from a time on, each over an interval [s]; 0 after them."""

    start: float
    interval: float
    acc_K: Array

    def at(self, t: float) -> Array:
        """(n_vK,)."""
        i = math.floor((t - self.start) / self.interval + 1e-9)
        return self.acc_K[i] if 0 <= i < len(self.acc_K) else np.zeros_like(self.acc_K[0])


class MPC:
    """Feedback from measured states: ``mpc.step(x)`` gives the accelerations of the inputs.

    ::

        mpc = fan.MPC(arm, {"lower": (0.3, 0.0, 0.5)})
        stepper = arm.stepper(arm.rest())
        while stepper.state.t < 2.0:
            stepper.advance(mpc.interval, mpc.step(stepper.state))

    The answer holds for ``interval`` from the time ``t`` at which it comes into force. Where that
    is later than the measurement, because the update takes time, the state is predicted until
    then under the answers given before. An answer that does not come in time is replaced by
    :meth:`acceleration`, what the update before had planned.

    Strings may be slack, and solids touch: predictions are time steps, and derivatives hold for
    the strings that pull in them and for the points that stick, slide or are open.

    Attributes:
        marionette: the puppet.
        interval: over which accelerations are constant: the horizon over the nodes [s].
        nodes: intervals of the horizon.
        deadline: time that an update may take [s].
        status: what the last update came to.
        prediction: states from the last update on; None before the first.
        cost: J of the prediction.
        updates: made.
        kept, braked: of those, the ones that ended as :class:`MPCStatus` says.
        missed: updates that took longer than the deadline.
        skipped: intervals that passed without an update.
        seconds: that the last update took [s].

    Args:
        marionette: the puppet.
        task: a :class:`Task`, of which tracks, smoothness, obstacles and bounds count, but those of
            tensions; paths go along with time. Or targets as :func:`follow` takes them.
        horizon: [s].
        nodes: see above.
        bounds, smooth: where no task is given.
        weight: of every target, likewise [1/m^2 or 1/rad^2].
        dt: longest time step of predictions [s]; half an interval when not given.
        deadline: the interval when not given [s].
        threads: for derivatives.

    Raises:
        StateError: the task is not well defined, its duration is free, it has an end, or the
            puppet has winches that slip.
        UnknownNameError: a name that is none.
    """

    def __init__(
        self,
        marionette: Marionette,
        task: Task | Targets,
        horizon: float = 1.0,
        nodes: int = 50,
        *,
        bounds: Bounds | None = None,
        smooth: Smooth | None = None,
        weight: float = 1e4,
        dt: float | None = None,
        deadline: float | None = None,
        threads: int | None = 1,
    ):
        check_positive(horizon=horizon, nodes=nodes)
        refuse_winches(marionette, "MPC")
        self.marionette, self.nodes, self.interval = marionette, nodes, horizon / nodes
        dt = 0.5 * self.interval if dt is None else dt
        check_positive(dt=dt)
        self.deadline = self.interval if deadline is None else deadline
        check_positive(deadline=self.deadline)
        if isinstance(task, Task):
            _check(task, marionette)
            tracks, bounds, smooth, x0 = task.tracks, task.bounds, task.smooth, task.x0
            obstacles = task.obstacles
        else:
            x0 = marionette.rest()
            tracks, obstacles = tracks_of(marionette, task, x0.t, 1.0, weight), ()
            bounds = Bounds(speed=SPEED, acceleration=ACCELERATION) if bounds is None else bounds
        self._task = Task(
            marionette,
            x0,
            horizon,
            tracks,
            smooth or Smooth(),
            bounds,
            interval=self.interval,
            dt=dt,
            obstacles=obstacles,
        )
        # A slack string has no derivative by which it would be pulled taut again.
        self._task = replace(self._task, bounds=replace(self._task.bounds, tension={}))
        self._objectives: dict[tuple[int, ...], Objective] = {}
        self._most = self._task.bounds.magnitudes(marionette, "acceleration")
        self._steps = ClampedSteps(marionette, dt, threads)
        self._solved_at = math.nan
        self._predictions = Predictions(marionette, dt, len(SETTINGS.shares))
        self._plans: deque[_Plan] = deque(maxlen=SETTINGS.kept)
        self._times: deque[float] = deque(maxlen=SETTINGS.kept)
        self.status: MPCStatus | None = None
        self.prediction: Nodes | None = None
        self.cost, self.seconds = math.nan, 0.0
        self.updates = self.kept = self.braked = self.missed = self.skipped = 0
        self._load()

    def __repr__(self) -> str:
        status = "not begun" if self.status is None else self.status.name
        return (
            f"<MPC of {self.marionette.name}: {self.nodes} intervals of {self.interval:g} s, "
            f"{status}, {self.updates} updates, {self.missed} late>"
        )

    @property
    def latency(self) -> float:
        """The longest that one of the last updates took [s]; 0 before the first.

        ``mpc.step(x, x.t + mpc.latency)`` is in time for a puppet that does not wait.
        """
        return max(self._times, default=0.0)

    def step(self, x: State, t: float | None = None) -> Array:
        """(n_vK,) the accelerations of the driven coordinates from ``t`` on, for an interval.

        Args:
            x: the state as measured, at its time.
            t: when the answer comes into force [s]; at the state's time when not given.

        Raises:
            StateError: the state is none of this puppet, or t lies before it.
        """
        began = time.perf_counter()
        self.marionette.check_state(x)
        t = x.t if t is None else float(t)
        if not x.t - 1e-9 <= t < math.inf:
            raise StateError(f"t is {t:g} s, before the state's time of {x.t:g} s")
        acc_K = self._update(x, t)
        self.seconds = time.perf_counter() - began
        self._times.append(self.seconds)
        self.missed += self.seconds > self.deadline
        return acc_K

    def acceleration(self, t: float) -> Array:
        """(n_vK,) what is planned for a time: 0 before the first update, and after the horizon."""
        in_force = [plan for plan in self._plans if plan.start <= t + 1e-9]
        if not in_force:
            return np.zeros(self.marionette.coordinates.n_vK)
        return in_force[-1].at(t).copy()

    def _update(self, x: State, t: float) -> Array:
        if self._plans:
            since = (t - self._plans[-1].start) / self.interval
            self.skipped += max(0, math.floor(since - 1.0 + 1e-6))
        h, N = self.interval, self.nodes
        first = self._ahead(x, t)
        times = t + h * np.arange(N)
        shifted = np.array([self.acceleration(at + 1e-6 * h) for at in times])
        made = None
        if first is not None:
            made = self._predictions.make(first, t, h, shifted[None])[0]
        if made is None and first is not None:
            shifted = np.repeat(self._braking(first)[None], N, axis=0)
            shifted[1:] = 0.0
            made = self._predictions.make(first, t, h, shifted[None])[0]
        if first is None or made is None:
            return self._end(MPCStatus.BRAKES, t, self._braking(x)[None], None, math.nan)
        objective = self._objective(made[0])
        nodes, cost, status = self._improved(objective, *made)
        return self._end(status, t, nodes.acc_K, nodes, cost)

    def _end(
        self, status: MPCStatus, t: float, acc_K: Array, nodes: Nodes | None, cost: float
    ) -> Array:
        self.status, self.prediction, self.cost = status, nodes, cost
        self.updates += 1
        self.kept += status is MPCStatus.KEPT
        self.braked += status is MPCStatus.BRAKES
        while self._plans and self._plans[-1].start >= t:
            self._plans.pop()
        self._plans.append(_Plan(t, self.interval, acc_K))
        return acc_K[0].copy()

    def _ahead(self, x: State, t: float) -> State | None:
        """The state at the time t, under the accelerations that are in force until then."""
        while x.t < t - 1e-9:
            starts = [plan.start for plan in self._plans if plan.start > x.t + 1e-9]
            until = min([t, x.t + self.interval, *starts])
            made = self._predictions.after(x, self.acceleration(x.t), until - x.t)
            if made is None:
                return None
            x = made
        return x

    def _objective(self, nodes: Nodes) -> Objective:
        """Of the tracks that count at the nodes of a prediction."""
        start, end = nodes.start, nodes.t[-1]

        def counts(one: Track) -> bool:
            return bool(one.start <= end + 1e-9 and one.end >= start - 1e-9)

        which = tuple(i for i, one in enumerate(self._task.tracks) if counts(one))
        if which not in self._objectives:
            tracks = [self._task.tracks[i] for i in which]
            self._objectives[which] = Objective(replace(self._task, tracks=tracks))
        return self._objectives[which]

    def _improved(
        self, objective: Objective, nodes: Nodes, ends: Ends
    ) -> tuple[Nodes, float, MPCStatus]:
        """The prediction after a step, its cost, and whether it is better."""
        slopes = self._steps.linearise(nodes, objective.has_pulls)
        shift = self._shift(nodes.start)
        found = self._steps.solve(objective, nodes, slopes, SETTINGS.damping, shift)
        objective.price = SETTINGS.price * objective.unit
        before = self._merit(objective, nodes, ends)
        if not np.all(np.isfinite(found.u)):
            return nodes, before, MPCStatus.KEPT
        shares = np.array(SETTINGS.shares)[:, None, None]
        tries = np.clip(nodes.acc_K + shares * found.u, -self._most, self._most)
        first = State(
            nodes.start,
            nodes.q_D[0],
            nodes.v_D[0],
            nodes.q_K[0],
            nodes.v_K[0],
            np.zeros(ends.taut.shape[1], bool),
        )
        best, least = nodes, before
        for made in self._predictions.make(first, nodes.start, nodes.interval, tries):
            if made is None:
                continue
            cost = self._merit(objective, *made)
            if cost < least:
                best, least = made[0], cost
        status = MPCStatus.KEPT if best is nodes else MPCStatus.IMPROVED
        return best, least, status

    def _load(self) -> None:
        """Loads and compiles what updates call, so that the first one is in time, too."""
        still = np.zeros((1, self.nodes, self.marionette.coordinates.n_vK))
        made = self._predictions.make(self._task.x0, self._task.x0.t, self.interval, still)[0]
        if made is not None:
            self._steps.linearise(made[0], False)

    def _shift(self, start: float) -> int:
        """Intervals by which the horizon went on since the last program; -1 before the first."""
        before, self._solved_at = self._solved_at, start
        if math.isnan(before):
            return -1
        return max(0, round((start - before) / self.interval))

    def _merit(self, objective: Objective, nodes: Nodes, ends: Ends) -> float:
        passed = float(np.sum(objective.rows.violation(nodes, ends)))
        return objective.cost(nodes, ends) + objective.price * passed

    def _braking(self, x: State) -> Array:
        """(n_vK,) that stop the driven coordinates within an interval, or as hard as they may."""
        return np.clip(-x.v_K / self.interval, -self._most, self._most)


def _check(task: Task, marionette: Marionette) -> None:
    if task.marionette is not marionette:
        raise StateError("MPC: the task is of another puppet")
    if task.is_free:
        raise StateError("MPC: the task's duration is free; needed: a given one")
    if task.parameters:
        raise StateError("MPC: the task chooses parameters; give best.marionette without them")
    if task.bounds.force or task.bounds.has_motors:
        raise StateError(
            "MPC: the task has bounds of forces, voltages or currents; give bounds of "
            "accelerations instead"
        )
    if task.touches:
        raise StateError("MPC: the task has touches; give a Track instead")
    if task.end is not None or task.periodic is not None:
        raise StateError("MPC: the task has an end; give a Track with end_weight instead")
