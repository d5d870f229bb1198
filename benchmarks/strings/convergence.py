"""Section 1: convergence of the error through many slack and taut phases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import mujoco_peer, scenarios
from .mujoco_peer import COST, DAMPING
from .plots import COLOUR, picture
from .report import Picture, Section, Table, number, order
from .scenarios import SECONDS, Scenario, evaluations

TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
STEPS = (0.1, 0.07, 0.05, 0.035, 0.025)
"""Fixed steps of the event-driven method [s]."""
TIME_STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2e-5)
PEERS = tuple(f"MuJoCo, {setting}" for setting in DAMPING)
LOOSE = 1e3
"""A tolerance that never shortens a step."""


@dataclass(frozen=True)
class Point:
    """One run: its setting, cost in evaluations of the model, and error at the end."""

    setting: float
    cost: int
    error: float
    events: int


def own_points(scenario: Scenario, settings, options: Callable[[float], dict]) -> list[Point]:
    """Our runs with several settings."""
    points = []
    for setting in settings:
        run = scenario.run(**options(setting))
        error = max(scenario.errors(run))
        points.append(Point(setting, evaluations(run), error, len(run.events)))
    return points


def mujoco_points(scenario: Scenario, make, setting: str, integrator: str = "RK4") -> list[Point]:
    """MuJoCo's runs with all steps."""
    points = []
    for dt in TIME_STEPS:
        peer = make(dt, setting, integrator).put(scenario.x0.q_D, scenario.x0.v_D)
        steps = round(SECONDS / dt)
        error = max(scenario.apart(*peer.advance(steps)))
        points.append(Point(dt, COST[integrator] * steps, error, 0))
    return points


def measure(scenario: Scenario, make) -> dict[str, list[Point]]:
    """Runs of every method on one scenario."""
    fixed = {"tolerance": LOOSE}
    return {
        "event": own_points(scenario, TOLERANCES, lambda tol: {"tolerance": tol}),
        "event, fixed steps": own_points(scenario, STEPS, lambda h: {**fixed, "max_step": h}),
        "timestepping": own_points(
            scenario, TIME_STEPS, lambda dt: {"method": "timestepping", "dt": dt}
        ),
        **{name: mujoco_points(scenario, make, name.split(", ")[1]) for name in PEERS},
    }


def section() -> Section:
    """Tables and a picture for the thrown pendulum and the dropped arm."""
    cases = [(scenarios.chain(), mujoco_peer.pendulum), (scenarios.arm_fall(), mujoco_peer.arm)]
    out = Section("1. Convergence through slack and taut")
    out.parts.append(
        "Two motions of 5 s, string ends and lengths fixed so that MuJoCo can follow. The error "
        "is the largest of all coordinates and velocities at the end (m, m/s or rad, rad/s). "
        "MuJoCo runs with RK4; its strings are tendons with a limited length. `default` keeps "
        "their default softness, `stiffest` has the shortest time constant that its safeguard "
        "allows (two steps) and the highest impedance, `overdamped` is `stiffest` with a damping "
        "ratio of 2 (not 1). Evaluations count evaluations of the model: for `event` 14 per step "
        "and about 150 to locate an event; 1 per time step; 4 per step of RK4."
    )
    results = {scenario.name: measure(scenario, make) for scenario, make in cases}
    for scenario, _ in cases:
        out.parts += _tables(scenario, results[scenario.name])
    _draw(results)
    out.parts.append(Picture("strings_convergence.png", "Error after 5 s against evaluations"))
    return out


def _tables(scenario: Scenario, found: dict[str, list[Point]]) -> list:
    events = len(scenario.events)
    parts = [f"### {scenario.name[0].upper()}{scenario.name[1:]}: {events} events"]
    parts.append(f"Reference: {scenario.exact}{_reference_text(scenario)}.")
    rows = [[number(p.setting, 1), p.cost, p.events, number(p.error)] for p in found["event"]]
    parts.append(Table(["`event`: rtol = atol", "evaluations", "events", "error"], rows))
    points = found["event, fixed steps"]
    orders = order([p.error for p in points], [p.setting for p in points])
    rows = [
        [number(p.setting), p.cost, number(p.error), o] for p, o in zip(points, orders, strict=True)
    ]
    head = ["`event`, steps fixed by `max_step` (s)", "evaluations", "error", "order"]
    parts.append(Table(head, rows))
    points = found["timestepping"]
    orders = order([p.error for p in points], [p.setting for p in points])
    peers = zip(*(found[name] for name in PEERS), strict=True)
    rows = [
        [number(p.setting), number(p.error), o, *(number(theirs.error) for theirs in rivals)]
        for p, o, rivals in zip(points, orders, peers, strict=True)
    ]
    head = ["step (s)", "`timestepping`", "order", *PEERS]
    parts += [Table(head, rows), _conclusions(found)]
    return parts


def _reference_text(scenario: Scenario) -> str:
    if scenario.exact == "closed form":
        return " (circle arcs by elliptic functions, flights by parabolas)"
    return (
        "'s DOP853 at 1e-13, written independently of the package, with events located by "
        f"integration; at 1e-12 it ends {number(scenario.doubt)} elsewhere"
    )


def _conclusions(found: dict[str, list[Point]]) -> str:
    """Conclusions from the last steps of each method, as text."""
    sentences = [
        f"`event` reaches {number(min(p.error for p in found['event']))}, `timestepping` "
        f"{number(min(p.error for p in found['timestepping']))}."
    ]
    for name in PEERS:
        errors = [p.error for p in found[name]]
        best = int(np.argmin(errors))
        verdict = "still shrinks" if best == len(errors) - 1 else "no longer shrinks"
        sentences.append(
            f"{name}: the smallest error is {number(errors[best])} at {number(TIME_STEPS[best])} "
            f"s, that of the finest step {number(errors[-1])}; it {verdict}."
        )
    return " ".join(sentences)


def _draw(found: dict[str, dict[str, list[Point]]]) -> None:
    with picture("strings_convergence.png", columns=len(found), height=4.0) as axes:
        for axis, (title, methods) in zip(axes, found.items(), strict=True):
            for name, points in methods.items():
                mark = "o" if name.startswith("event") else "s"
                cost, error = [p.cost for p in points], [p.error for p in points]
                axis.loglog(cost, error, mark + "-", color=COLOUR[name], label=name)
            axis.set(title=title, xlabel="evaluations of the model", ylim=(1e-13, 30))
        axes[0].set_ylabel("error after 5 s")
        axes[0].legend(loc="lower right", fontsize=8.5)
