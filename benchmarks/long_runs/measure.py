"""Measurements as tables."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from benchmarks.growth.puppets import marionette as grown
from benchmarks.long_runs import subject
from benchmarks.strings.report import Table, number

import fantoccini as fan
from fantoccini import puppets
from fantoccini.kernel.equations import Variational
from fantoccini.kernel.runtime import Run
from fantoccini.motion import EventKind, State

TREP = (150.0, 850.0)
"""Cost of trep's step on a puppet of 25 degrees of freedom [us]."""
TREP_DRIFT = 2.4e-4
"""Drift of its energy over 10 s in steps of 10 ms [J]."""
GENTLE, VIGOROUS = 0.02, 0.5
"""Amplitudes of swings [rad/s, m/s]."""
FIXED_STEP_METHODS = ("variational", "timestepping")
METHODS: dict[str, Any] = {
    "variational, 10 ms": fan.Variational(dt=0.01),
    "variational, 1/30 s": fan.Variational(dt=1.0 / 30.0),
    "timestepping, 2 ms": fan.TimeStepping(dt=0.002),
    "timestepping, 10 ms": fan.TimeStepping(dt=0.01),
    "event, rtol 1e-11": fan.Event(),
}


def energy_errors(amplitude: float, seconds: float) -> Table:
    """Energy errors of a swing by all methods."""
    rows, x = [], subject.random_swing(amplitude)
    for name, method in METHODS.items():
        saved = (
            {"save_at": np.arange(0.0, seconds, 0.1)[1:]}
            if isinstance(method, fan.Event)
            else {"save_every": round(0.1 / method.dt)}
        )
        began = time.process_time()
        run = fan.simulate(
            subject.undamped(), x, t_end=seconds, method=method, effort=False, throw=False, **saved
        )
        took = time.process_time() - began
        T, E = run.ledger["kinetic"], run.ledger["kinetic"] + run.ledger["potential"]
        slope, error = fit_trend(run.t, E)
        catches = sum(e.kind in (EventKind.CATCH, EventKind.LIMIT_ON) for e in run.events)
        rows.append(
            [
                name,
                number(np.ptp(E)),
                number(np.max(np.abs(E[run.t <= 10.0] - E[0]))),
                f"{slope / T.mean():.1e} +- {error / T.mean():.0e}",
                number(np.max(np.abs(run.ledger["residual"]))),
                str(catches),
                number(np.max(run.violation.values)),
                f"{took:.1f}",
            ]
        )
    return Table(
        [
            "method",
            "range of E [J]",
            "within 10 s [J]",
            "slope of E / mean T [1/s]",
            "ledger residual [J]",
            "catches",
            "violation [m]",
            "processor [s]",
        ],
        rows,
    )


def long_run_slope(amplitude: float, seconds: float) -> str:
    """The slope of the variational integrator's energy, and its standard error, as text."""
    run = fan.simulate(
        subject.undamped(),
        subject.random_swing(amplitude),
        t_end=seconds,
        effort=False,
        method=fan.Variational(dt=0.01),
        save_every=20,
    )
    T = run.ledger["kinetic"]
    slope, error = fit_trend(run.t, T + run.ledger["potential"])
    return f"{slope / T.mean():.0e} +- {error / T.mean():.0e}"


def fit_trend(t: np.ndarray, E: np.ndarray) -> tuple[float, float]:
    """Slope of a straight line through the means of 40 stretches, and its standard error."""
    blocks = np.array_split(np.arange(len(t)), 40)
    means = [[t[b].mean(), E[b].mean()] for b in blocks]
    (slope, _), covariance = np.polyfit(*np.transpose(means), 1, cov=True)
    return float(slope), float(covariance[0, 0] ** 0.5)


def convergence_orders() -> Table:
    """Errors against the event-driven motion, and their order."""
    still = subject.random_swing(0.1)
    bob = puppets.string_pendulum()
    flight = bob.rest().replace(v_D=np.array([5.2, 0.0]))
    cases = {
        "marionette, undamped": (subject.undamped(), still, None, 0.4),
        "damped": (subject.damped(), still, None, 0.4),
        "damped, moving inputs": (subject.damped(), still, subject.swaying_inputs(still), 0.4),
        "bob through a flight and a catch": (bob, flight, None, 2.0),
    }
    steps, rows = (0.02, 0.01, 0.005, 0.0025, 0.00125), []
    for name, (puppet, x, inputs, t_end) in cases.items():
        exact = fan.simulate(puppet, x, inputs, t_end, method=fan.Event(rtol=1e-12, atol=1e-12))
        errors = []
        for dt in steps:
            run = fan.simulate(puppet, x, inputs, t_end, method=fan.Variational(dt=dt))
            errors.append(np.max(np.abs(run.q_D[-1] - exact.q_D[-1])))
        order = np.log2(errors[0] / errors[-1]) / (len(errors) - 1)
        rows.append([name, *(f"{e:.1e}" for e in errors), f"{order:.2f}"])
    return Table(["case", *(f"{1e3 * dt:g} ms" for dt in steps), "order"], rows)


def catch_errors() -> Table:
    """Errors through many catches that nearly coincide: the marionette dropped onto its strings."""
    steps, t_end, rows = [1e-2 / 4**k for k in range(6)], 0.06, []
    for name, swing in (("at rest", 0.0), ("swinging a little", 0.03)):
        x = subject.lifted_state(0.01, swing)
        exact = fan.simulate(
            subject.damped(), x, t_end=t_end, method=fan.Event(rtol=1e-12, atol=1e-12)
        )
        caught = [e.t for e in exact.events if e.kind is EventKind.CATCH]
        errors, loss = [], []
        for dt in steps:
            run = fan.simulate(
                subject.damped(), x, t_end=t_end, method=fan.Variational(dt=dt), effort=False
            )
            errors.append(np.max(np.abs(run.q_D[-1] - exact.q_D[-1])))
            loss.append(abs(run.ledger["impact"][-1] / exact.ledger["impact"][-1] - 1.0))
        span = f"{len(caught)} catches within {1e3 * (caught[-1] - caught[0]):.0f} ms"
        rows.append([f"{name}, {span}: configuration", *(f"{e:.1e}" for e in errors)])
        rows.append([f"{name}: energy lost in catches, relative", *(f"{e:.1e}" for e in loss)])
    return Table(["dropped", *(f"{1e3 * dt:.2g} ms" for dt in steps)], rows)


def momentum_drift() -> Table:
    """Drift of conserved momenta over 100 s."""
    flyer = fan.loads(subject.FLYER)
    v_D = 2.0 * np.random.default_rng(0).normal(size=flyer.coordinates.n_vD)
    loose = flyer.with_parameters({"g": 0.0})
    starts = {
        "free in no gravity, all six": (
            loose,
            loose.state({"line.length": 1e6}).replace(v_D=v_D),
            slice(0, 6),
        ),
        "on a string, about the vertical": (
            flyer,
            subject.swinging_state(flyer, flyer.rest(), v_D),
            slice(5, 6),
        ),
    }
    rows = []
    for name, (puppet, x, conserved) in starts.items():
        for dt in (0.01, 1.0 / 30.0):
            run = fan.simulate(puppet, x, t_end=100.0, method=fan.Variational(dt=dt), save_every=10)
            J = momentum_map(puppet, run)[:, conserved]
            deviation = number(np.ptp(J, axis=0).max())
            rows.append([name, f"{1e3 * dt:.3g}", number(np.abs(J[0]).max()), deviation])
    return Table(["body with a leg", "step [ms]", "largest momentum", "deviation"], rows)


def momentum_map(puppet: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    """(T, 6) linear momentum and angular momentum about the origin of a puppet on a free joint."""
    values = []
    for q, v in zip(run.q_D, run.v_D, strict=True):
        p = puppet.mass_matrix(puppet.state().replace(q_D=q, v_D=v)) @ v
        w, u = q[3], q[4:7]
        turn = p[3:6] + 2.0 * np.cross(u, w * p[3:6] + np.cross(u, p[3:6]))
        values.append([*p[:3], *(np.cross(q[:3], p[:3]) + turn)])
    return np.array(values)


def step_costs() -> tuple[Table, float]:
    """Time of a step of the marionette [us], and the slowest at 10 ms."""
    rows, slowest = [], 0.0
    for amplitude in (GENTLE, 0.1, VIGOROUS):
        x = subject.random_swing(amplitude)
        for dt in (0.002, 0.01, 1.0 / 30.0):
            own, other = (
                step_time(subject.damped(), x, method, dt) for method in FIXED_STEP_METHODS
            )
            slowest = max(slowest, own) if dt == 0.01 else slowest
            cells = (f"{own:.1f}", f"{other:.1f}", f"{own / other:.1f}")
            rows.append([f"{amplitude:g}", f"{1e3 * dt:.3g}", *cells])
    header = ["swing [rad/s]", "step [ms]", "variational [us]", "timestepping [us]", "ratio"]
    return Table(header, rows), slowest


def step_time(puppet: fan.Marionette, x: State, method: str, dt: float, n: int = 1000) -> float:
    """Processor time of a step [us], the shortest of five runs."""
    options = puppet.run_options(dt=dt, save_every=10**9, save_steps=False)
    hold, took = fan.Input.hold(puppet).bound(x.q_K), []
    for _ in range(5):
        run = Run(
            puppet.libraries.library_of(method), method, options, x, puppet.p, puppet.winches, hold
        )
        began = time.process_time()
        for _ in run.advance(n * dt):
            pass
        took.append((time.process_time() - began) / run.progress[0])
    return 1e6 * min(took)


def lane_cost_text(n: int = 64, dt: float = 0.01) -> str:
    """The cost of a step in a batch, compared with a single run, on one thread, as text."""
    rng, puppet = np.random.default_rng(0), subject.damped()
    starts = [
        subject.swinging_state(puppet, subject.taut_rest(), VIGOROUS * rng.normal(size=25))
        for _ in range(n)
    ]
    took = []
    for _ in range(5):
        began = time.process_time()
        fan.simulate_batch(
            puppet, starts, t_end=2.0, method=fan.Variational(dt=dt), save_every=10**6, threads=1
        )
        took.append(time.process_time() - began)
    own = 1e6 * min(took) * dt / (2.0 * n)
    single = np.mean([step_time(puppet, x, "variational", dt, round(2.0 / dt)) for x in starts[:8]])
    return (
        f"In a batch of {n}, in lanes on one thread, a step at {1e3 * dt:g} ms takes {own:.1f} us "
        f"per trajectory, compared with {single:.1f} us for single runs: {single / own:.1f} times "
        "as fast."
    )


def cost_by_size() -> Table:
    """Cost of a step over the degrees of freedom: chains of hinges on three strings."""
    rows = []
    for dof in (5, 10, 25, 50, 100):
        puppet = grown("chain", dof)
        x = puppet.state()
        v_D = 0.3 * np.random.default_rng(0).normal(size=dof)
        moving = puppet.project(x.replace(v_D=v_D))
        own = Variational(puppet.equations).functions()
        solves = sum(
            puppet.equations[name].n_instructions()
            for name in ("solve_factor_transposed", "solve_factor")
        )
        per_step = own["node"].n_instructions()
        took = [
            f"{step_time(puppet, moving, method, dt, 300):.1f}"
            for dt in (0.002, 0.01)
            for method in FIXED_STEP_METHODS
        ]
        per_correction = own["midpoint_rule"].n_instructions() + solves
        rows.append([str(dof), str(per_step), str(per_correction), *took])
    return Table(
        [
            "DOF",
            "operations per step",
            "per correction",
            "variational, 2 ms [us]",
            "timestepping, 2 ms [us]",
            "variational, 10 ms [us]",
            "timestepping, 10 ms [us]",
        ],
        rows,
    )
