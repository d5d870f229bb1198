"""Section 6: variational steps with impacts, compared with the two methods with contact.

A pendulum hits a wall and rebounds. If a step ends behind the wall, the impact is applied there
to variational steps, since any fixed step has it somewhere within.
"""

from __future__ import annotations

import time

import numpy as np

import fantoccini as fan
from fantoccini.motion import State

from ..speed.figures import Chapter
from ..strings.report import Section, Table, number

DURATION = 10.0
"""Duration [s]; fourteen impacts."""

RESTITUTION = 0.9
STEPS = (0.004, 0.002, 0.001, 0.0005)

KNOCKER = """
puppet: knocker
bodies:
- name: bob
  joint: {name: hinge, type: revolute, axis: [0, 1, 0], at: [0, 0, 1]}
  shapes: [{type: sphere, radius: 0.05, at: [0, 0, -0.5], mass: 1}]
pose: {hinge: 1.0}
"""

WALL = f"""
contact: {{friction: 0, restitution: {RESTITUTION}}}
obstacles:
- {{name: wall, type: box, size: [0.1, 1, 1], at: [0.1, 0, 0.5]}}
"""
"""Its face is where the pendulum hangs straight down."""


def chapter() -> Chapter:
    """Errors of angle and energy, by step and method."""
    walled, free = fan.loads(KNOCKER + WALL), fan.loads(KNOCKER)
    exact, wanted, knocks, _ = whole_run(walled, free, fan.Event(rtol=1e-13, atol=1e-13))
    again, energy, _, quick = whole_run(walled, free, fan.Event())
    rows = [["event", "-", number(abs(again - exact)), number(abs(energy - wanted)), _ms(quick)]]
    for dt in STEPS:
        angle, energy, _, spent = whole_run(walled, free, fan.TimeStepping(dt=dt))
        rows.append(
            [
                "time-stepping",
                f"{1e3 * dt:g} ms",
                number(abs(angle - exact)),
                number(abs(energy - wanted)),
                _ms(spent),
            ]
        )
    for dt in STEPS:
        angle, energy = variational_run(free, dt)
        rows.append(
            [
                "variational, impacts at the ends of steps",
                f"{1e3 * dt:g} ms",
                number(abs(angle - exact)),
                number(abs(energy - wanted)),
                "-",
            ]
        )
    text = (
        f"A pendulum that knocks on a wall {knocks} times in {number(DURATION)} s, with "
        f"restitution {RESTITUTION}: errors at the end, against an event-driven run at 1e-13, and "
        "the time of a run with all its samples. Variational steps, of second order between "
        "impacts, would not give a better angle than time-stepping, because both locate an "
        "impact only to within a step; their energy would be better. Event-driven runs have both "
        "to a tolerance. `variational` therefore refuses contact and names the other two."
    )
    header = ["method", "step", "angle [rad]", "energy [J]", "a run"]
    return Chapter(Section("6. Which methods", [text, Table(header, rows)]))


def whole_run(
    walled: fan.Marionette, free: fan.Marionette, method: fan.Event | fan.TimeStepping
) -> tuple[float, float, int, float]:
    """Angle and energy at the end, the number of impacts, and the time of the run [s]."""
    start = walled.state()
    began = time.perf_counter()
    run = fan.simulate(walled, start, t_end=DURATION, method=method)
    spent = time.perf_counter() - began
    knocks = sum(event.kind == "touch" for event in run.events)
    x = free.state().replace(q_D=run.q_D[-1], v_D=run.v_D[-1])
    return float(run.q_D[-1, 0]), _energy(free, x), knocks, spent


def variational_run(free: fan.Marionette, dt: float) -> tuple[float, float]:
    """Angle and energy at the end, of variational steps with added impacts."""
    x = free.state()
    stepper = free.stepper(x, method=fan.Variational(dt=dt))
    for _ in range(round(DURATION / dt)):
        stepper.advance(dt)
        x = stepper.state
        if x.q_D[0] < 0.0 and x.v_D[0] < 0.0:
            x = x.replace(v_D=-RESTITUTION * np.asarray(x.v_D))
            stepper = free.stepper(x, method=fan.Variational(dt=dt))
    return float(x.q_D[0]), _energy(free, x)


def _energy(free: fan.Marionette, x: State) -> float:
    at = {"q_D": x.q_D[None], "v_D": x.v_D[None], "q_K": x.q_K[None], "v_K": x.v_K[None]}
    energies = free.library.evaluate("energy", **at, p=free.p)
    return float(np.sum(energies.T + energies.V))


def _ms(seconds: float) -> str:
    return f"{number(1e3 * seconds)} ms"
