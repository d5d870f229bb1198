"""Checks of plans: second simulations from their start and inputs alone.

q_D are the dynamic coordinates of the puppet; the driven ones follow the inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, Status, check_positive
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.tasks import StateArrays, TouchEvent, carried_share
from fantoccini.dynamics.compiled import Event, Method, MethodName, TimeStepping, as_method
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

BACKENDS = {"fantoccini": 0.5, "mujoco": 0.25}
"""Programs that can check a plan -> default step, relative to the planner's."""


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances of checks."""

    integration: float = 1e-8
    """Values of rtol and atol for the event-driven runs that confirm plans."""
    jam_share: float = 0.01
    """Tension of a jammed string, relative to the largest allowed: 1e3 times the weight."""
    time_rounding: float = 1e-9
    """Rounding error of the end of a run [s]."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True)
class Check:
    """The result of a second simulation of a plan.

    Attributes:
        arrives: whether the run is DONE, ends within the tolerance and makes only allowed touches.
            Obstacles may be nearer than the margin.
        distance: distance from the goal at the end.
        clearance: least clearance of the run, also between its samples [m].
        deviation: largest difference of a dynamic coordinate from the plan's own run, at its nodes.
        run: the trajectory.
        touches: touches of a puppet's bodies with other parts, in order of time.
        share: share of the puppets' weight that other parts carry at the end.
        fault: description of why it does not arrive; empty if it does.
    """

    arrives: bool
    distance: float
    clearance: float
    deviation: float
    run: Trajectory
    touches: tuple[TouchEvent, ...] = ()
    share: float = 0.0
    fault: str = ""

    @property
    def forbidden(self) -> tuple[TouchEvent, ...]:
        """Touches that the plan does not allow."""
        return tuple(touch for touch in self.touches if not touch.allowed)


def check_plan(
    plan: PlanPath,
    dt_factor: float | None = None,
    method: Method | MethodName = "timestepping",
    backend: str = "fantoccini",
    effort: bool = True,
) -> Check:
    """Result of a second simulation of a plan; see :meth:`PlanResult.verify`."""
    if backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}; it must be {' or '.join(map(repr, BACKENDS))}")
    dt_factor = BACKENDS[backend] if dt_factor is None else dt_factor
    dt = plan.rollouts.options.dt * dt_factor
    if backend == "mujoco":
        _check_mujoco(dt_factor, method)
        if plan.problem.touches.expected:
            raise ValueError(
                "backend='mujoco' does not support contact, and this plan may touch something"
            )
        run = plan.simulate_in_mujoco(dt)
    else:
        if method == "timestepping":
            method = TimeStepping(dt=dt, extrapolate=False)
        run = plan.simulate(as_method(method), effort)
    distance = float(plan.goal.distance(StateArrays.of(run.state(-1)))[0])
    clearance = plan.rollouts.clearance.least(run).distance
    node_indices = _nearest_indices(run.t, plan.times)
    deviation = float(np.max(np.abs(run.q_D[node_indices] - plan.states.q_D)))
    marionette, goal = plan.problem.marionette, plan.goal
    is_complete = run.status is Status.DONE and run.t[-1] >= plan.end - _TOLERANCES.time_rounding
    touches = plan.problem.touches.touch_events(run)
    share = carried_share(marionette, run)
    faults = [str(touch) for touch in touches if not touch.allowed]
    if not is_complete:
        faults.append(run.status.message)
    faults += jam_messages(marionette, run)
    if clearance < 0.0:
        faults.append("a body or string overlaps a solid that it must not touch")
    if not distance <= plan.tolerance:
        faults.append(f"it ends {distance:.3g} from the goal")
    if goal.share is not None and share < goal.share:
        faults.append(f"the touched solids carry {share:.2g} of the weight, not {goal.share:.2g}")
    fault = "; ".join(faults)
    return Check(not fault, distance, clearance, deviation, run, touches, share, fault)


def jam_messages(marionette: Marionette, run: Trajectory) -> list[str]:
    """Descriptions of jammed strings, whose tension against a contact has no limit."""
    if run.contact is None:
        return []
    jam_tension = _TOLERANCES.jam_share * marionette.tension_cap
    return [
        f"string {name} is jammed: it pulls with {np.max(tension):.3g} N"
        for name, tension in run.tension.items()
        if np.max(tension) >= jam_tension
    ]


def confirm_plan(plan: PlanPath) -> Check:
    """The simulation that decides whether a plan holds; see :class:`Check`.

    It is event-driven, or by time-stepping with half the planner's step if touches are possible.

    Raises:
        KeyboardInterrupt: Ctrl-C during the run, so that the result is unknown.
    """
    method: Method | MethodName = "timestepping"
    if not plan.problem.touches.expected:
        method = Event(rtol=_TOLERANCES.integration, atol=_TOLERANCES.integration)
    check = check_plan(plan, method=method, effort=False)
    if check.run.status is Status.STOPPED:
        raise KeyboardInterrupt
    return check


def _nearest_indices(t: Array, times: Array) -> Indices:
    """(n,) indices of the increasing times t that are nearest to ``times``."""
    next_index = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    return np.maximum(next_index - (times - t[next_index - 1] <= t[next_index] - times), 0)


def _check_mujoco(dt_factor: float, method: Method | MethodName) -> None:
    """Raises ValueError for options that MuJoCo does not support."""
    if method != "timestepping":
        raise ValueError(f"backend='mujoco' supports only method='timestepping', not {method!r}")
    check_positive(dt_factor=dt_factor)
