"""Model predictive control: the best inputs from a measured state over a moving horizon.

    min J(x, acc_K) over [t, t + horizon],   x_{i+1} = F(x_i, acc_i),   x_0 measured

An update makes one step of sequential quadratic programming from the inputs of the last update (the
real-time iteration of Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005): predict,
linearise along the prediction, solve one program of stages, predict again along the step.

acc_K are the accelerations of the driven coordinates, the ends and lengths of strings, and n_vK is
their number. F is the map of the simulator over one interval. A marionette is a puppet with its
compiled equations; `marionette.puppet` is the description in its file. In names, D stands for
dynamic coordinates, which move by the equations of motion. A winch changes the length of a string.
A node is a time at which the inputs may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

import enum
import math
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from fantoccini.base import Array, StateError, check_positive
from fantoccini.control.optimal.api import refuse_winches, tracks_of
from fantoccini.control.optimal.clamped import ClampedSteps
from fantoccini.control.optimal.dynamics import Ends
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.prediction import Predictions, with_inputs_fitting_strings
from fantoccini.control.tasks import Bounds, Nodes, Smooth, Target, Task, Track
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

Targets = Mapping[str | tuple[str, tuple[float, float, float]], Target]

DEFAULT_SPEED, DEFAULT_ACCELERATION = 1.5, 10.0
"""Default bounds of driven coordinates without a task [m/s, m/s^2; rad/s, rad/s^2]."""


class MPCStatus(enum.Enum):
    """The outcome of an update."""

    IMPROVED = "a step of the program lowered the cost of the prediction"
    KEPT = "no step lowered the cost; the inputs of the previous update are kept"
    BRAKES = "no prediction reaches its end; the driven coordinates brake"


@dataclass(frozen=True)
class MPCSettings:
    """Parameters of updates."""

    damping: float = 1e-5
    """Damping of the Hessian, in units of the cost."""
    price: float = 3.0
    """Price of a unit of violation of a row, in units of the cost."""
    step_lengths: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    """Step lengths of the line search."""
    history: int = 32
    """Number of updates whose inputs and durations are kept."""


SETTINGS = MPCSettings()


@dataclass(frozen=True, eq=False)
class _Plan:
    """Accelerations (N, n_vK) from a start time, each for an interval [s]; 0 afterwards."""

    start: float
    interval: float
    acc_K: Array

    def acceleration(self, t: float) -> Array:
        """(n_vK,) accelerations at a time."""
        i = math.floor((t - self.start) / self.interval + 1e-9)
        return self.acc_K[i] if 0 <= i < len(self.acc_K) else np.zeros_like(self.acc_K[0])


class MPC:
    """Feedback from measured states: ``mpc.step(x)`` gives the accelerations of the inputs.

    ::

        mpc = fan.MPC(arm, {"lower": (0.3, 0.0, 0.5)})
        stepper = arm.stepper(arm.rest())
        while stepper.state.t < 2.0:
            stepper.advance(mpc.interval, mpc.step(stepper.state))

    The result applies for ``interval`` from a time ``t``. If ``t`` is later than the measurement,
    because the update takes time, the state is predicted until then under the earlier results. A
    result that comes too late is replaced by :meth:`acceleration`, the plan of the last update.

    Strings of the real puppet may be longer or shorter than those of the model, by millimetres:
    see :func:`~fantoccini.control.optimal.prediction.with_inputs_fitting_strings`. Positions then
    keep their bounds up to that difference.

    Strings may be slack, and solids may touch: predictions are time steps, and derivatives hold for
    the strings that pull in them and for the points that stick, slide or are open.

    Attributes:
        marionette: the puppet.
        interval: time over which accelerations are constant: horizon / nodes [s].
        nodes: number of intervals in the horizon.
        deadline: time limit of an update [s].
        status: outcome of the last update.
        prediction: states from the last update on, with the corrected driven coordinates; None
            before the first.
        cost: J of the prediction.
        updates: number of updates.
        kept, braked: numbers of updates with the :class:`MPCStatus` ``KEPT`` and ``BRAKES``.
        missed: number of updates that took longer than the deadline.
        skipped: number of intervals that passed without an update.
        seconds: duration of the last update [s].

    Args:
        marionette: the puppet; a task may add obstacles to it.
        task: a :class:`Task`, also of an :class:`Optimum`, of which tracks, smoothness, obstacles
            and bounds are used, except bounds of tensions; paths move along with time. Or targets
            as for :func:`follow`.
        horizon: length of the horizon [s].
        nodes: see above.
        bounds, smooth: bounds and smoothness if no task is given.
        weight: weight of every target if no task is given [1/m^2 or 1/rad^2].
        dt: longest time step of predictions [s]; by default half an interval.
        deadline: time limit of an update [s]; by default the interval.
        threads: number of threads for derivatives.

    Raises:
        StateError: ill-defined task, free duration, task with an end, or puppet with winches that
            slip.
        UnknownNameError: unknown name.
    """

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "an MPC cannot be pickled or copied: its predictions run in the compiled library; "
            "make one with the same arguments, which starts without earlier inputs"
        )

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
            _check_task(task, marionette)
            tracks, bounds, smooth, x0 = task.tracks, task.bounds, task.smooth, task.x0
            # The task of an optimum has its obstacles in its puppet.
            marionette, obstacles = task.world if task.obstacles else (task.marionette, ())
            self.marionette = marionette
        else:
            x0 = marionette.rest()
            tracks, obstacles = tracks_of(marionette, task, x0.t, 1.0, weight), ()
            bounds = (
                Bounds(speed=DEFAULT_SPEED, acceleration=DEFAULT_ACCELERATION)
                if bounds is None
                else bounds
            )
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
        # A slack string has no derivative that would pull it taut again.
        self._task = replace(self._task, bounds=replace(self._task.bounds, tension={}))
        self._objectives: dict[tuple[int, ...], Objective] = {}
        self._max_acceleration = self._task.bounds.magnitudes(marionette, "acceleration")
        self._steps = ClampedSteps(marionette, dt, threads)
        self._solved_at = math.nan
        self._predictions = Predictions(marionette, dt, len(SETTINGS.step_lengths))
        self._plans: deque[_Plan] = deque(maxlen=SETTINGS.history)
        self._update_times: deque[float] = deque(maxlen=SETTINGS.history)
        self.status: MPCStatus | None = None
        self.prediction: Nodes | None = None
        self.cost, self.seconds = math.nan, 0.0
        self.updates = self.kept = self.braked = self.missed = self.skipped = 0
        self._warm_up()

    def __repr__(self) -> str:
        status = "not begun" if self.status is None else self.status.name
        return (
            f"<MPC of {self.marionette.name}: {self.nodes} intervals of {self.interval:g} s, "
            f"{status}, {self.updates} updates, {self.missed} late>"
        )

    @property
    def latency(self) -> float:
        """The longest of the last updates [s]; 0 before the first.

        ``mpc.step(x, x.t + mpc.latency)`` is in time for a puppet that does not wait.
        """
        return max(self._update_times, default=0.0)

    def step(self, x: State, t: float | None = None) -> Array:
        """(n_vK,) accelerations of the driven coordinates from ``t`` on, for an interval.

        Args:
            x: the measured state, with its time.
            t: time at which the answer comes into force [s]; by default the state's time.

        Raises:
            StateError: state of another puppet, or t before its time.
        """
        began = time.perf_counter()
        self.marionette.check_state(x)
        x = with_inputs_fitting_strings(self.marionette, x)
        t = x.t if t is None else float(t)
        if not x.t - 1e-9 <= t < math.inf:
            raise StateError(f"t is {t:g} s, before the state's time of {x.t:g} s")
        acc_K = self._update(x, t)
        self.seconds = time.perf_counter() - began
        self._update_times.append(self.seconds)
        self.missed += self.seconds > self.deadline
        return acc_K

    def acceleration(self, t: float) -> Array:
        """(n_vK,) planned accelerations at a time; 0 before the first update and after the plan."""
        started_plans = [plan for plan in self._plans if plan.start <= t + 1e-9]
        if not started_plans:
            return np.zeros(self.marionette.coordinates.n_vK)
        return started_plans[-1].acceleration(t).copy()

    def _update(self, x: State, t: float) -> Array:
        if self._plans:
            intervals_since_update = (t - self._plans[-1].start) / self.interval
            self.skipped += max(0, math.floor(intervals_since_update - 1.0 + 1e-6))
        h, N = self.interval, self.nodes
        start_state = self._predicted_state(x, t)
        times = t + h * np.arange(N)
        accelerations = np.array([self.acceleration(t_node + 1e-6 * h) for t_node in times])
        prediction = None
        if start_state is not None:
            prediction = self._predictions.predict(start_state, t, h, accelerations[None])[0]
        if prediction is None and start_state is not None:
            accelerations = np.repeat(self._braking_acceleration(start_state)[None], N, axis=0)
            accelerations[1:] = 0.0
            prediction = self._predictions.predict(start_state, t, h, accelerations[None])[0]
        if start_state is None or prediction is None:
            return self._record(
                MPCStatus.BRAKES, t, self._braking_acceleration(x)[None], None, math.nan
            )
        objective = self._objective(prediction[0])
        nodes, cost, status = self._improve(objective, *prediction)
        return self._record(status, t, nodes.acc_K, nodes, cost)

    def _record(
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

    def _predicted_state(self, x: State, t: float) -> State | None:
        """The state at time t, under the accelerations in force until then; None without one."""
        while x.t < t - 1e-9:
            plan_starts = [plan.start for plan in self._plans if plan.start > x.t + 1e-9]
            step_end = min([t, x.t + self.interval, *plan_starts])
            next_state = self._predictions.state_after(x, self.acceleration(x.t), step_end - x.t)
            if next_state is None:
                return None
            x = next_state
        return x

    def _objective(self, nodes: Nodes) -> Objective:
        """The objective with the tracks that count at the nodes of a prediction."""
        start, end = nodes.start, nodes.t[-1]

        def is_active(track: Track) -> bool:
            return bool(track.start <= end + 1e-9 and track.end >= start - 1e-9)

        active = tuple(i for i, entry in enumerate(self._task.tracks) if is_active(entry))
        if active not in self._objectives:
            tracks = [self._task.tracks[i] for i in active]
            self._objectives[active] = Objective(replace(self._task, tracks=tracks))
        return self._objectives[active]

    def _improve(
        self, objective: Objective, nodes: Nodes, ends: Ends
    ) -> tuple[Nodes, float, MPCStatus]:
        """The prediction after a step, its cost, and whether the step improved it."""
        derivatives = self._steps.linearise(nodes, objective.tracks_tension)
        shift = self._shift(nodes.start)
        solution = self._steps.solve(objective, nodes, derivatives, SETTINGS.damping, shift)
        objective.price = SETTINGS.price * objective.unit
        cost_before = self._merit(objective, nodes, ends)
        if not np.all(np.isfinite(solution.u)):
            return nodes, cost_before, MPCStatus.KEPT
        step_lengths = np.array(SETTINGS.step_lengths)[:, None, None]
        trial_accelerations = np.clip(
            nodes.acc_K + step_lengths * solution.u, -self._max_acceleration, self._max_acceleration
        )
        start_state = State(
            nodes.start,
            nodes.q_D[0],
            nodes.v_D[0],
            nodes.q_K[0],
            nodes.v_K[0],
            np.zeros(ends.taut.shape[1], bool),
        )
        best_nodes, lowest_cost = nodes, cost_before
        for prediction in self._predictions.predict(
            start_state, nodes.start, nodes.interval, trial_accelerations
        ):
            if prediction is None:
                continue
            cost = self._merit(objective, *prediction)
            if cost < lowest_cost:
                best_nodes, lowest_cost = prediction[0], cost
        status = MPCStatus.KEPT if best_nodes is nodes else MPCStatus.IMPROVED
        return best_nodes, lowest_cost, status

    def _warm_up(self) -> None:
        """Loads and compiles the functions of updates, so that the first one is in time, too."""
        with_inputs_fitting_strings(self.marionette, self._task.x0)
        zeros = np.zeros((1, self.nodes, self.marionette.coordinates.n_vK))
        prediction = self._predictions.predict(
            self._task.x0, self._task.x0.t, self.interval, zeros
        )[0]
        if prediction is not None:
            self._steps.linearise(prediction[0], False)

    def _shift(self, start: float) -> int:
        """Intervals by which the horizon moved since the last program; -1 before the first."""
        previous, self._solved_at = self._solved_at, start
        if math.isnan(previous):
            return -1
        return max(0, round((start - previous) / self.interval))

    def _merit(self, objective: Objective, nodes: Nodes, ends: Ends) -> float:
        violation = float(np.sum(objective.rows.violation(nodes, ends)))
        return objective.cost(nodes, ends) + objective.price * violation

    def _braking_acceleration(self, x: State) -> Array:
        """(n_vK,) accelerations that stop the inputs in an interval, or the largest allowed."""
        return np.clip(-x.v_K / self.interval, -self._max_acceleration, self._max_acceleration)


def _check_task(task: Task, marionette: Marionette) -> None:
    if not _same_puppet(task.marionette, marionette):
        raise StateError(f"MPC: the task is of another puppet than {marionette.name}")
    missing = [
        o.name for o in marionette.puppet.obstacles if o not in task.marionette.puppet.obstacles
    ]
    if missing:
        raise StateError(
            f"MPC: the puppet has obstacles that the task lacks: {', '.join(missing)}; make the "
            "task with this puppet"
        )
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


def _same_puppet(first: Marionette, second: Marionette) -> bool:
    """Whether two puppets differ in their obstacles at most."""
    same_numbers = np.array_equal(first.p, second.p) and np.array_equal(
        first.winches, second.winches
    )
    return first.libraries is second.libraries and same_numbers
