"""Checks of plans: simulated again, from their start and inputs alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, Status, check_positive
from fantoccini.control.planning.plan_path import PlanPath
from fantoccini.control.tasks import Meeting, StateArrays, carried
from fantoccini.dynamics.compiled import Event, Method, MethodName, TimeStepping, as_method
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Trajectory

BACKENDS = {"fantoccini": 0.5, "mujoco": 0.25}
"""Programs that can check a plan -> default step, as part of the planner's."""


@dataclass(frozen=True)
class _Tolerances:
    """Tolerances of checks."""

    integration: float = 1e-8
    """rtol and atol of the event-driven runs that confirm plans."""
    jam: float = 0.01
    """Tension of a jammed string, relative to the largest that runs allow: 1e3 times the weight."""
    time: float = 1e-9
    """Time by which a run may end before the plan [s]: rounding."""


_TOLERANCES = _Tolerances()


@dataclass(frozen=True)
class Check:
    """The result of simulating a plan again.

    Attributes:
        arrives: whether the run is DONE, ends within the tolerance and touches nothing that it
            should keep off. It may use up the margin.
        distance: from the goal at the end.
        clearance: the least of the run, also between its samples [m].
        deviation: largest difference of a dynamic coordinate from the plan's own run, at its nodes.
        run: the trajectory.
        touches: what a body of a puppet touched that is not its own, in order.
        share: part of the puppets' weight that rests on what they touch at the end.
        fault: why it does not arrive, in words; empty where it does.
    """

    arrives: bool
    distance: float
    clearance: float
    deviation: float
    run: Trajectory
    touches: tuple[Meeting, ...] = ()
    share: float = 0.0
    fault: str = ""

    @property
    def unasked(self) -> tuple[Meeting, ...]:
        """Touches of what the plan should keep off."""
        return tuple(one for one in self.touches if not one.asked)


def checked(
    plan: PlanPath,
    dt_factor: float | None = None,
    method: Method | MethodName = "timestepping",
    backend: str = "fantoccini",
    effort: bool = True,
) -> Check:
    """Simulates a plan again; see :meth:`PlanResult.verify`."""
    if backend not in BACKENDS:
        raise ValueError(f"backend is {backend!r}; it must be {' or '.join(map(repr, BACKENDS))}")
    dt_factor = BACKENDS[backend] if dt_factor is None else dt_factor
    dt = plan.rollouts.options.dt * dt_factor
    if backend == "mujoco":
        _check_mujoco(dt_factor, method)
        if plan.problem.touches.expected:
            raise ValueError("backend='mujoco' knows no contact, and this plan may touch something")
        run = plan.simulate_in_mujoco(dt)
    else:
        if method == "timestepping":
            method = TimeStepping(dt=dt, extrapolate=False)
        run = plan.simulate(as_method(method), effort)
    distance = float(plan.goal.distance(StateArrays.of(run.state(-1)))[0])
    clearance = plan.rollouts.clearance.least(run).distance
    near = _nearest(run.t, plan.times)
    deviation = float(np.max(np.abs(run.q_D[near] - plan.states.q_D)))
    marionette, goal = plan.problem.marionette, plan.goal
    complete = run.status is Status.DONE and run.t[-1] >= plan.end - _TOLERANCES.time
    touches = plan.problem.touches.meetings(run)
    share = carried(marionette, run)
    faults = [str(one) for one in touches if not one.asked]
    if not complete:
        faults.append(run.status.message)
    faults += jammed(marionette, run)
    if clearance < 0.0:
        faults.append("something overlaps what it should keep off")
    if not distance <= plan.tolerance:
        faults.append(f"it ends {distance:.3g} from the goal")
    if goal.share is not None and share < goal.share:
        faults.append(f"what it touches carries {share:.2g} of the weight, not {goal.share:.2g}")
    fault = "; ".join(faults)
    return Check(not fault, distance, clearance, deviation, run, touches, share, fault)


def jammed(marionette: Marionette, run: Trajectory) -> list[str]:
    """The strings that pull as if nothing could give way, against what the puppet touches."""
    if run.contact is None:
        return []
    most = _TOLERANCES.jam * marionette.tension_cap
    return [
        f"string {name} is jammed: it pulls with {np.max(tension):.3g} N"
        for name, tension in run.tension.items()
        if np.max(tension) >= most
    ]


def confirmed(plan: PlanPath) -> Check:
    """The simulation that decides whether a plan holds; see :class:`Check`.

    Event-driven; by time-stepping with half the planner's step where something may touch.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the run, so that the result is unknown.
    """
    method: Method | MethodName = "timestepping"
    if not plan.problem.touches.expected:
        method = Event(rtol=_TOLERANCES.integration, atol=_TOLERANCES.integration)
    check = checked(plan, method=method, effort=False)
    if check.run.status is Status.STOPPED:
        raise KeyboardInterrupt
    return check


def _nearest(t: Array, times: Array) -> Indices:
    """(n,) indices of the increasing times t that are nearest to ``times``."""
    after = np.clip(np.searchsorted(t, times), 1, len(t) - 1)
    return np.maximum(after - (times - t[after - 1] <= t[after] - times), 0)


def _check_mujoco(dt_factor: float, method: Method | MethodName) -> None:
    """Raises ValueError for what MuJoCo cannot do."""
    if method != "timestepping":
        raise ValueError(
            f"backend='mujoco' steps through time: method must be 'timestepping', not {method!r}"
        )
    check_positive(dt_factor=dt_factor)
