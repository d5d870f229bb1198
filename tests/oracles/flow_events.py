"""Event-driven simulation with any SciPy integrator, for comparison with the compiled one.

Between events the active set is fixed and the motion is the ordinary differential equation of
`marionette.flow` (Sec. III-C: any numeric integrator will do). Its rate, guards, active set and
mass matrix are the package's. SciPy makes the steps. An event is the time at which a guard turns
positive, located by integration. Impulses are found by trying every set of closed strings and
limits (Eqs. 13-15):

    v+ = v- - M^-1 A_D^T Lambda,   0 <= Lambda  complementary to  -(hdot+ + e hdot-) >= 0
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain, combinations

import numpy as np
from scipy import integrate
from scipy.optimize import brentq

from fantoccini.dynamics.compiled import Evaluation
from fantoccini.kernel.contract import WINCH_AT

CLOSED = 1e-9
"""Gap at which a row takes part in an impulse, relative to its length."""
PAST = 1e-10
"""Time step past a release, or past the start or end of a slip [s], so that the sign of the tension
or of the winch speed is unambiguous."""
NOISE = 10.0
"""Guard values below this multiple of rtol are integration error."""
NODES = np.linspace(0.0, 1.0, 9)[1:]
"""Shares of the step at which guards are evaluated."""


@dataclass(frozen=True)
class Happened:
    """An event, with the attributes of `fan.motion.EventRecord`."""

    t: float
    kind: str
    name: str = ""
    impulse: float = 0.0
    speed: float = 0.0


@dataclass
class Run:
    """A run in progress.

    Attributes:
        x: the state reached.
        events: events in order.
        n_steps: steps of the integrator.
        stopped: reason for an early end; empty without one.
    """

    x: object
    events: list[Happened] = field(default_factory=list)
    n_steps: int = 0
    stopped: str = ""


def simulate(
    marionette,
    x0,
    inputs,
    t_end,
    integrator="DOP853",
    rtol=1e-10,
    atol=1e-10,
    max_step=0.02,
    max_events=1000,
):
    """The run from a state, by a method of SciPy or a subclass of its ``OdeSolver``.

    Args:
        marionette, x0, inputs, t_end: arguments of ``fan.simulate``.
        integrator: name or class.
        rtol, atol: its tolerances.
        max_step: its largest step [s]; guards are evaluated eight times in each step.
        max_events: number of events at which the run stops.
    """
    solver = getattr(integrate, integrator) if isinstance(integrator, str) else integrator
    run, slipping = Run(x0), set()
    while run.x.t < t_end and not run.stopped and len(run.events) < max_events:  # type: ignore[attr-defined]
        _one_flow(marionette, run, inputs, t_end, slipping, (solver, rtol, atol, max_step))
    return run


def _one_flow(marionette, run, inputs, t_end, slipping, how):
    """Integrate to the next event or the end of the flow, and apply the event."""
    flow = marionette.flow(run.x, inputs)
    rows, n = flow.rows, len(marionette.tree.strings)
    held = flow.taut.copy()
    end = min(flow.t_end, t_end)
    t, y, row = _followed(marionette, run, flow, end, how)
    x = _back_on_rows(marionette, flow.state(t, y), held, slipping)
    if row is None:
        if run.stopped or t >= t_end:
            run.x = x
            return
        if _jumps(inputs, t):
            run.events.append(Happened(t, "breakpoint"))
        caught = {}
    elif held[row]:
        caught = {}
        x = _back_on_rows(marionette, flow.state(*_past(flow, t, y)), held, slipping)
    else:
        x, caught = _struck(marionette, x, held, rows[row])
        run.events += [Happened(t, "catch", rows[i], *at) for i, at in sorted(caught.items())]
    now = marionette.flow(x, inputs).taut if t < t_end else held
    for i, name in enumerate(rows):
        before = held[i] or i in caught
        if before and not now[i]:
            run.events.append(Happened(t, "release", name))
            slipping.discard(i)
        elif now[i] and not before:
            run.events.append(Happened(t, "catch", name))
        elif i < n and now[i] and np.isfinite(marionette.max_forces[i]):
            if i in caught or (i == row and i not in slipping):
                speed = caught[i][1] if i in caught else 0.0
                run.events.append(Happened(t, "slip", name, 0.0, speed))
                slipping.add(i)
            elif i == row:
                run.events.append(Happened(t, "grip", name))
                slipping.discard(i)
    run.x = x


def _followed(marionette, run, flow, end, how):
    """Time, y and row of the flow's first event; its end and None without an event."""
    make, rtol, atol, max_step = how
    noise = NOISE * rtol
    n = len(flow.rows)
    armed = flow.guards(flow.t0, flow.y0)[:n] < -noise
    solver = make(flow.rate, flow.t0, flow.y0, end, rtol=rtol, atol=atol, max_step=max_step)
    cap = marionette.tension_cap / marionette.weight
    while solver.status == "running":
        t0, y0 = solver.t, solver.y.copy()
        solver.step()
        if solver.status == "failed":
            run.stopped = "the integrator failed"
            return t0, y0, None
        run.n_steps += 1
        dense = solver.dense_output()
        for t in t0 + NODES * (solver.t - t0):
            guards = flow.guards(t, dense(t))[:n]
            fired = np.flatnonzero(guards > np.where(armed, 0.0, noise))
            if len(fired):
                return _root(flow, (t0, y0, t), fired, np.where(armed, 0.0, noise), how)
            armed |= guards < -noise
        if np.min(guards) < -cap:
            run.stopped = "a tension is out of bounds"
            return t0, y0, None
    return solver.t, solver.y, None


def _root(flow, step, fired, limits, how):
    """Time, y and row of the first guard that turns positive in a step."""
    t0, y0, t1 = step
    first = t1, None, int(fired[0])
    for row in map(int, fired):

        def over(t, row=row):
            return flow.guards(t, _reached(flow, t0, y0, t, how))[row] - limits[row]

        if over(first[0]) <= 0.0:
            continue
        if over(t0) >= 0.0:
            return t0, y0, row
        first = brentq(over, t0, first[0], xtol=1e-15, rtol=1e-15), None, row
    return first[0], _reached(flow, t0, y0, first[0], how), first[2]


def _reached(flow, t0, y0, t, how):
    """y (n_y,) at a time, integrated from a step's beginning."""
    if not t > t0:
        return y0
    make, rtol, atol, _ = how
    solver = make(flow.rate, t0, y0, t, rtol=rtol, atol=atol, first_step=t - t0)
    while solver.status == "running":
        solver.step()
    return solver.y


def _past(flow, t, y):
    """Time and y shortly after."""
    return t + PAST, y + PAST * flow.rate(t, y)


def _back_on_rows(marionette, x, held, slipping):
    """The state with h = 0 and hdot = 0 on the held rows, and no other row beyond its bound."""
    firm = held & ~np.isin(np.arange(len(held)), list(slipping))
    for _ in range(2):
        evaluation = Evaluation.at_state(marionette, x)
        rows = firm | (~held & (evaluation.h > 0.0))
        x = x.replace(q_D=marionette.integrate(x.q_D, _correction(evaluation, rows, evaluation.h)))
    evaluation = Evaluation.at_state(marionette, x)
    return x.replace(v_D=x.v_D + _correction(evaluation, firm, evaluation.hdot))


def _correction(at, rows, off):
    """Smallest change of v_D, in the metric of M_DD, that cancels ``off`` on the given rows."""
    W = at.W[:, rows]
    return -at.solve_factor(W @ np.linalg.lstsq(W.T @ W, off[rows], rcond=None)[0])


def _struck(marionette, x, held, name):
    """The state after the impulse of a catch; row -> (impulse, speed) of the caught rows."""
    marionette, evaluation = marionette, Evaluation.at_state(marionette, x)
    row = marionette.tree.row_names.index(name)
    closed = held | (np.abs(evaluation.h) <= CLOSED * marionette.row_scales(x.q_D, x.q_K))
    firm = np.flatnonzero(closed & ~np.isfinite(marionette.max_forces))
    restitution = np.zeros(len(held))
    n = len(marionette.tree.strings)
    restitution[:n] = marionette.winches[:, WINCH_AT["restitution"]]
    b = evaluation.hdot + restitution * np.maximum(evaluation.hdot, 0.0)
    impulse = np.zeros(len(held))
    impulse[firm] = _least_impulse(evaluation.W[:, firm], b[firm])
    rows = np.flatnonzero(closed & ~held & ((impulse > 0.0) | (np.arange(len(held)) == row)))
    caught = {int(i): (impulse[i], evaluation.hdot[i]) for i in rows}
    return x.replace(v_D=x.v_D - evaluation.solve_factor(evaluation.W @ impulse)), caught


def _least_impulse(W, b):
    """x >= 0 with s = W^T W x - b >= 0 and x s = 0, by trying every set of rows with x > 0."""
    G, n = W.T @ W, len(b)
    tiny = 1e-9 * np.max(np.abs(b), initial=0.0)
    for rows in chain.from_iterable(combinations(range(n), k) for k in range(n + 1)):
        x, own = np.zeros(n), list(rows)
        if own:
            x[own] = np.linalg.solve(G[np.ix_(own, own)], b[own])
        if np.all(x >= 0.0) and np.all(G @ x - b >= -tiny):
            return x
    raise AssertionError("no set of rows takes the impulse")


def _jumps(inputs, t):
    """Whether the inputs' accelerations jump at a time."""
    if inputs is None:
        return False
    before, after = (inputs.evaluate(at)[2] for at in (np.nextafter(t, -np.inf), t))
    return bool(np.any(np.abs(after - before) > 1e-9 * (1.0 + np.abs(after) + np.abs(before))))
