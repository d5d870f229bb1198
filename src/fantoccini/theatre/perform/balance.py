"""Balance: hands that damp a puppet's motion and keep it in place, by model predictive control.

    min  integral of  w_p sum_i m_i/m |c_i - c_i0|^2 + w_v |v_D|^2 + w_h |q_K - q_K0|^2 + smoothness

over the motion of the hands, within their bounds; c_i are the bodies' centres of mass.

m_i is the mass of a body and m the sum; v_D are the dynamic velocities, and q_K the driven
coordinates that the hands move, with the accelerations acc_K. A link is a body on its joint. A tick
is the interval at which a performance advances.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from fantoccini.base import FantocciniError, StateError, VecK
from fantoccini.control.optimal import MPC, refuse_winches
from fantoccini.control.tasks import Bounds, Smooth, Task, Track
from fantoccini.model.tree import link_inertia
from fantoccini.motion import State
from fantoccini.theatre.perform.performance import Performance


class _Weights(NamedTuple):
    """Cost rates of deviations."""

    place: float = 1000.0  # [1/m^2]
    speed: float = 0.3  # [s^2/rad^2 or s^2/m^2]
    hands: float = 1.0  # of driven coordinates [1/m^2 or 1/rad^2]
    smooth: Smooth = Smooth(acceleration=1e-3, jerk=1e-6)


WEIGHTS = _Weights()
_INTERVAL = 0.02
"""Approximate interval of updates, a multiple of the tick [s]."""
_TIME_TOLERANCE = 1e-9
"""Tolerance for equal times [s]."""
_POLL_INTERVAL = 0.001
"""Interval at which the thread checks whether an update is due [s]."""
_N_LATENCIES = 10
"""Number of last updates; the longest latency of them is expected of the next."""


class _Plan(NamedTuple):
    """Accelerations (N, n_vK) from a time [s]."""

    start: float
    acc_K: np.ndarray


class Balance:
    """Law of the hands that returns the puppet to its present pose after any push.

    ::

        live = fan.Performance(fan.puppets.marionette())
        live.set_hand_law(fan.theatre.Balance(live))
        live.push("torso", [0.5, 0.0, 0.0])
        live.advance(0.2)

    Updates are due at intervals of about 20 ms, a whole number of ticks. Without a thread the
    performance waits for them. With a thread it continues under the previous plan: the update
    starts from the state predicted for its completion, and updates that complete later than
    predicted, or take longer than an interval, are counted. Before the first plan the hands brake.

    Attributes:
        mpc: controller that counts updates, missed deadlines and skipped intervals, see
            :class:`fantoccini.MPC`; None until a thread has created it.
        late: number of updates that were completed later than predicted.
        message: reason why updates have ended; empty before.

    Args:
        performance: performance whose present pose is held.
        nodes: number of intervals in the horizon.
        threaded: whether updates are computed in a separate thread.

    Raises:
        StateError: the puppet has drives that slip, or no driven coordinates.
    """

    def __init__(self, performance: Performance, *, nodes: int = 50, threaded: bool = False):
        marionette, x = performance.marionette, performance.state
        refuse_winches(marionette, "Balance")
        if not marionette.coordinates.n_vK:
            raise StateError(f"{marionette.name} has nothing that hands could move")
        self._performance = performance
        self._interval = max(1, round(_INTERVAL / performance.tick)) * performance.tick
        self._task = _holding_task(performance, x, nodes * self._interval)
        self._nodes, self._threaded = nodes, threaded
        self.mpc: MPC | None = None
        self.late, self.message = 0, ""
        self._plans: tuple[_Plan, ...] = ()
        self._latencies: list[float] = []
        self._stop_event = threading.Event()
        self._thread = threading.Thread(target=self._run_updates, name="balance", daemon=True)
        if threaded:
            self._thread.start()
        else:
            self.mpc = self._new_mpc()

    def __repr__(self) -> str:
        return f"<Balance of {self._performance.marionette.name}: {self.summary}>"

    @property
    def summary(self) -> str:
        """Numbers of updates and late updates, in words."""
        mpc = self.mpc
        if self.message or mpc is None:
            return self.message or "getting ready"
        return (
            f"{mpc.updates} updates, {1e3 * mpc.seconds:.0f} ms the last, {mpc.missed} longer than "
            f"{1e3 * mpc.deadline:.0f} ms, {self.late} late, {mpc.skipped} left out"
        )

    def acceleration(self, x: State) -> VecK:
        """(n_vK,) accelerations of the plan in force at a state's time; braking without a plan."""
        if self.mpc is not None and not self._threaded and self._is_due(x.t, 0.0):
            self._update(self.mpc, x, x.t)
        started_plans = [plan for plan in self._plans if plan.start <= x.t + _TIME_TOLERANCE]
        if started_plans:
            plan = started_plans[-1]
            interval_index = int((x.t - plan.start + _TIME_TOLERANCE) / self._interval)
            if interval_index < len(plan.acc_K):
                return np.array(plan.acc_K[interval_index])
        return np.asarray(-x.v_K / self._performance.tick)

    def stop(self) -> None:
        """Ends the thread."""
        self._stop_event.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)

    def _new_mpc(self) -> MPC:
        marionette = self._performance.marionette
        return MPC(marionette, self._task, self._nodes * self._interval, self._nodes)

    def _is_due(self, t: float, latency: float) -> bool:
        if self.message:
            return False
        if not self._plans:
            return True
        return t + latency >= self._plans[-1].start + self._interval - _TIME_TOLERANCE

    def _update(self, mpc: MPC, x: State, t: float) -> None:
        try:
            acc_K = mpc.step(x, t)
        except FantocciniError as error:
            self.message = str(error)
            return
        plan = mpc.prediction
        accelerations = acc_K[None] if plan is None else plan.acc_K
        self._plans = (*self._plans[-1:], _Plan(t, accelerations))

    def _run_updates(self) -> None:
        try:
            mpc = self.mpc = self._new_mpc()
        except FantocciniError as error:
            self.message = str(error)
            return
        while not self._stop_event.is_set():
            state = self._performance.state
            latency = max(self._latencies, default=self._interval)
            if not self._is_due(state.t, latency):
                self._stop_event.wait(_POLL_INTERVAL)
                continue
            self._update(mpc, state, state.t + latency)
            elapsed = self._performance.t - state.t
            self.late += elapsed > latency + _TIME_TOLERANCE
            self._latencies = [*self._latencies[1 - _N_LATENCIES :], max(elapsed, 0.0)]


def _holding_task(performance: Performance, x: State, horizon: float) -> Task:
    """Task of staying at a state."""
    marionette = performance.marionette
    table = marionette.coordinates
    inertias = [link_inertia(link, marionette.number)[:2] for link in marionette.tree.links]
    total_mass = sum(mass for mass, _ in inertias) or 1.0
    tracks = [Track.velocity("*", weight=WEIGHTS.speed)]
    for link, (mass, com) in zip(marionette.tree.links, inertias, strict=True):
        if mass > 0.0:
            pose, local_centre = (
                marionette.pose(x, link.name),
                (float(com[0]), float(com[1]), float(com[2])),
            )
            centre, weight = pose[:3, 3] + pose[:3, :3] @ com, WEIGHTS.place * mass / total_mass
            tracks.append(Track.point(link.name, centre, at=local_centre, weight=weight))
    for q, _ in table.scalars_K:
        tracks.append(Track.coordinate(table.q_K[q], float(x.q_K[q]), weight=WEIGHTS.hands))
    bounds = performance.bounds
    return Task(
        marionette,
        x,
        horizon,
        tracks,
        WEIGHTS.smooth,
        Bounds(position=bounds.position, speed=bounds.speed, acceleration=bounds.acceleration),
    )
