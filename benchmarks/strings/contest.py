"""Section 9: classical methods compared with ours, error against cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import rivals, scenarios
from .plots import COLOUR, picture
from .report import Picture, Section, Table, number
from .scenarios import GRAVITY, LENGTH, MASS, SECONDS, evaluations

STIFFNESS = (1e3, 1e4, 1e5, 1e6, 1e7, 1e8)
RATES = (10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
STEPS = (2e-3, 5e-4, 1e-4, 5e-5)
TOLERANCES = (1e-6, 1e-9, 1e-12)
LOOKS = {
    "event": "o-",
    "timestepping": "s-",
    rivals.PENALTY: "^-",
    rivals.CLIPPED: "v-",
    rivals.IMPULSE: "v--",
}
"""Line styles of the methods in the picture."""


@dataclass(frozen=True)
class Entry:
    """One run.

    Attributes:
        method, setting: method and its setting.
        dt: step [s]; NaN for adaptive ones.
        cost: number of evaluations of the model.
        error: largest error of coordinates and velocities at the end.
        stretch: largest extension of the string beyond its length [m].
        lowest: lowest tension [N].
    """

    method: str
    setting: str
    dt: float
    cost: int
    error: float
    stretch: float
    lowest: float


def run_own_methods() -> list[Entry]:
    """Event-driven and time-stepping runs."""
    entries = []
    runs = [("event", f"rtol {number(t, 1)}", float("nan"), {"tolerance": t}) for t in TOLERANCES]
    for dt in STEPS:
        runs.append(("timestepping", "", dt, {"method": "timestepping", "dt": dt}))
    for method, setting, dt, options in runs:
        run = scenarios.chain().run(**options)
        stretch, lowest = np.max(run.violation["line"]), np.min(run.tension["line"])
        error = max(scenarios.chain().errors(run))
        entries.append(
            Entry(method, setting, dt, evaluations(run), error, float(stretch), float(lowest))
        )
    return entries


def run_rivals() -> list[Entry]:
    """Runs of all rivals with all settings and steps."""
    pairs = [(rivals.PENALTY, k) for k in STIFFNESS]
    pairs += [(method, a) for method in rivals.METHODS[1:] for a in RATES]
    method, setting = (np.array(column) for column in zip(*pairs, strict=True))
    lanes = rivals.Lanes(method, setting, LENGTH, MASS, GRAVITY)
    scenario, entries = scenarios.chain(), []
    start = np.concatenate([scenario.x0.q_D, scenario.x0.v_D])
    for dt in STEPS:
        ends, cost = lanes.run(start, SECONDS, dt), rivals.STAGES * round(SECONDS / dt)
        errors = np.max(np.abs(ends.state - scenario.reference), axis=1)
        for i, (name, value) in enumerate(pairs):
            symbol, unit = ("k", "N/m") if name == rivals.PENALTY else ("a", "1/s")
            text = f"{symbol} = {number(value, 1)} {unit}"
            figures = (errors[i], ends.stretch[i], ends.lowest[i])
            entries.append(Entry(name, text, dt, cost, *map(float, figures)))
    return entries


def best(entries: list[Entry]) -> list[Entry]:
    """The setting with the smallest error, for every method, step and cost."""
    smallest: dict[tuple, Entry] = {}
    for entry in entries:
        key = (entry.method, entry.cost)
        if entry.error == entry.error and (
            key not in smallest or entry.error < smallest[key].error
        ):
            smallest[key] = entry
    return list(smallest.values())


def section() -> Section:
    """Tables and a picture."""
    mine, all_theirs = run_own_methods(), run_rivals()
    chosen = mine + best(all_theirs)
    rows = [
        [
            e.method,
            e.setting,
            number(e.dt),
            e.cost,
            number(e.error),
            number(e.stretch),
            number(e.lowest),
        ]
        for e in sorted(chosen, key=lambda e: list((*LOOKS, rivals.UNCLIPPED)).index(e.method))
    ]
    out = Section("9. Two classical methods")
    out.parts = [
        "The motion is that of the thrown pendulum of section 1. The penalty method replaces the "
        "string by a stiff spring with a critical damper that acts while the string is too long. "
        "Baumgarte's stabilisation makes its length obey hddot + 2 a hdot + a^2 h = 0 while it "
        "is too long, with the tension clipped at 0, or not clipped, or with the catch as an "
        "impulse at the first step with a string that is too long. These are the methods of "
        "constrained dynamics in computer animation (Witkin, Baraff). They are in "
        "`benchmarks/strings/rivals.py`, use RK4, and every step below shows the best of "
        f"{len(STIFFNESS)} stiffnesses or {len(RATES)} rates, chosen with knowledge of the "
        "solution.",
        Table(
            [
                "method",
                "setting",
                "step (s)",
                "evaluations",
                "error after 5 s",
                "stretch (m)",
                "lowest tension (N)",
            ],
            rows,
        ),
        Picture("strings_rivals.png", "Error and stretch against evaluations of the model"),
        f"The penalty method with steps of {number(STEPS[-1])} s, and the number of settings and "
        "steps of each method that were lost (not finite or beyond 1 km):",
        *_settings(all_theirs),
        _conclusions(mine, all_theirs),
    ]
    _draw(chosen)
    return out


def _settings(entries: list[Entry]) -> list[Table]:
    finest = [e for e in entries if e.method == rivals.PENALTY and e.dt == STEPS[-1]]
    rows = [[e.setting, number(e.error), number(e.stretch)] for e in finest]
    lost = []
    for method in rivals.METHODS:
        tried = [e for e in entries if e.method == method]
        lost.append([method, sum(e.error != e.error for e in tried), len(tried)])
    return [
        Table(["penalty", "error after 5 s", "stretch (m)"], rows),
        Table(["method", "lost", "tried"], lost),
    ]


def _conclusions(mine: list[Entry], entries: list[Entry]) -> str:
    """The smallest errors, from the numbers."""
    alive = [e for e in entries if e.error == e.error]
    rival = min(alive, key=lambda e: e.error)
    event = [e for e in mine if e.method == "event"]
    cheapest = min(event, key=lambda e: e.cost)
    ahead = "less" if cheapest.error < rival.error else "not less"
    return (
        f"The smallest error of these methods is {number(rival.error)} ({rival.method}, "
        f"{rival.setting}, steps of {number(rival.dt)} s, {rival.cost} evaluations). `event` at "
        f"{cheapest.setting} has {number(cheapest.error)} with {cheapest.cost}: {ahead}. "
        "Computing times are not compared, because these methods are written in NumPy."
    )


def _draw(entries: list[Entry]) -> None:
    with picture("strings_rivals.png", columns=2, height=3.9) as (error, stretch):
        for method, line in LOOKS.items():
            points = sorted((e.cost, e.error, e.stretch) for e in entries if e.method == method)
            cost, errors, stretches = zip(*points, strict=True)
            error.loglog(cost, errors, line, color=COLOUR[method], label=method)
            stretch.loglog(cost, np.maximum(stretches, 1e-16), line, color=COLOUR[method])
        error.set(xlabel="evaluations of the model", ylabel="error after 5 s")
        stretch.set(xlabel="evaluations of the model", ylabel="longest stretch (m)")
        error.legend(fontsize=8.5)
