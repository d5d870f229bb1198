"""Sections 4 and 8: the error at default tolerance, and the residual of the event ledger."""

from __future__ import annotations

import numpy as np

import fantoccini as fan

from . import scenarios
from .report import Mark, Section, Table, number
from .scenarios import SECONDS, Scenario

TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
BOUND = 1e-8
DEFAULT = fan.Event().rtol
STARTS = 40
"""Number of random slack poses from which the arm is dropped."""


def problems() -> list[Scenario]:
    """All motions with a known end."""
    return [
        scenarios.chain(),
        *(scenarios.launched_pendulum(k) for k in (2.05, 3.0, 4.5)),
        scenarios.drop(),
        scenarios.drop_below(),
        scenarios.reeling(25)[0],
        scenarios.arm_fall(),
        scenarios.arm_led(),
    ]


def defaults() -> Section:
    """The error after 5 s with default options."""
    out = Section("4. The error at default tolerance")
    rows = []
    for scenario in problems():
        run = scenario.run()
        place, speed = scenario.errors(run)
        enough = next(
            (
                tol
                for tol in TOLERANCES[3:]
                if max(scenario.errors(scenario.run(tolerance=tol))) <= BOUND
            ),
            None,
        )
        text = "none tried" if enough is None else number(enough, 1)
        values = map(number, (place, speed, scenario.growth()))
        rows.append([scenario.name, len(run.events), *values, text])
        out.marks.append(
            Mark(f"default tolerance, {SECONDS:g} s: {scenario.name}", max(place, speed), BOUND)
        )
    out.parts = [
        f"`fan.simulate(m, x0, inputs, t_end={SECONDS:g})` with default options (rtol = atol = "
        f"{number(DEFAULT, 1)}). `growth` is the factor by which the run magnifies a small change "
        "of the start: a property of the motion, not of the method, and a limit to the digits "
        "that any method can keep. The reeled pendulum is that of section 3 with 25 quintic "
        "pieces for both. The last column is the loosest tolerance that keeps both errors below "
        f"{number(BOUND, 1)}.",
        Table(
            [
                "motion",
                "events",
                "position (m, rad)",
                "velocity (m/s, rad/s)",
                "growth",
                "tolerance",
            ],
            rows,
        ),
        *_random_drops(),
    ]
    return out


def _random_drops() -> list[str | Table]:
    """The arm dropped from random poses: looser tolerances against the tightest."""
    rng, starts = np.random.default_rng(1), []
    while len(starts) < STARTS:
        values = {
            "shoulder": rng.uniform(-1.2, 0.9),
            "elbow": rng.uniform(-2.5, 2.5),
            "hand.length": rng.uniform(0.7, 1.1),
        }
        x0 = scenarios.arm().state(values)
        if scenarios.arm().constraint(x0)[0] < -0.01:
            starts.append(x0)
    best, rows, events, worse = [_drop_error(x0, 1e-13) for x0 in starts], [], 0, 0
    above = max(scenarios.arm_fall().errors(scenarios.arm_fall().run()))
    for tolerance in (1e-9, 1e-10, 1e-11, 1e-12):
        errors = []
        for x0, known in zip(starts, best, strict=True):
            run = _drop_error(x0, tolerance)
            events = max(events, len(run.events))
            apart = [run.q_D[-1] - known.q_D[-1], run.v_D[-1] - known.v_D[-1]]
            errors.append(float(np.max(np.abs(apart))))
        errors = np.sort(errors)
        worse = np.sum(errors > above) if tolerance == DEFAULT else worse
        shown = map(number, (np.median(errors), errors[int(0.9 * STARTS)], errors[-1]))
        rows.append([number(tolerance, 1), *shown, f"{np.sum(errors <= BOUND)} of {STARTS}"])
    return [
        "A double pendulum is chaotic, so one start is not representative. The same arm is "
        f"dropped from {STARTS} random slack poses (0 to {events} events) and compared with its "
        f"own run at 1e-13. At default tolerance {worse} of them have a larger error than the "
        "pose above:",
        Table(["rtol = atol", "median", "ninth tenth", "worst", f"below {number(BOUND, 1)}"], rows),
    ]


def _drop_error(x0: fan.State, tolerance: float) -> fan.Trajectory:
    return fan.simulate(
        scenarios.arm(),
        x0,
        t_end=SECONDS,
        method=fan.Event(rtol=tolerance, atol=tolerance),
        effort=False,
    )


def ledger() -> Section:
    """The ledger's residual by tolerance."""
    cases = [scenarios.chain(), scenarios.drop(), scenarios.arm_fall(), scenarios.arm_led()]
    rows, worst = [], []
    for tolerance in TOLERANCES:
        row = []
        for scenario in cases:
            residual = scenario.run(tolerance=tolerance).ledger["residual"]
            row.append(float(np.max(np.abs(residual))))
        rows.append([number(tolerance, 1), *map(number, row)])
        worst.append(max(row))
    out = Section("8. The event ledger closes to the tolerance")
    fell = worst[0] / worst[-1]
    out.parts = [
        "The ledger's residual is the part of the energy that kinetic and potential energy, the "
        "work of the inputs and the losses of catches do not explain: the largest over "
        f"{SECONDS:g} s, in joules.",
        Table(["rtol = atol", *(s.name for s in cases)], rows),
        f"From {number(TOLERANCES[0], 1)} to {number(TOLERANCES[-1], 1)} the largest residual "
        f"falls by a factor of {number(fell)}.",
    ]
    at_default = worst[TOLERANCES.index(DEFAULT)]
    out.marks = [
        Mark("ledger residual at default tolerance, 5 s (J)", at_default, 1e-7),
        Mark("ledger residual at 1e-13, 5 s (J)", worst[-1], 1e-11),
    ]
    return out
