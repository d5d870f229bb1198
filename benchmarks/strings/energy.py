"""Section 6: energy and lengths over 1,000 s without damping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array

from . import scenarios
from .plots import COLOUR, picture
from .report import Mark, Picture, Section, Table, number

SECONDS = 1000.0
STEPS = (2e-3, 1e-3)
SAVED = 0.1
"""Interval of the samples of a time-stepping run [s]."""

DOUBLE = """
puppet: two_masses
bodies:
  - {name: upper, joint: {type: translation, axes: [x, z]}, mass: 0.5}
  - {name: lower, joint: {type: translation, axes: [x, z]}, mass: 0.3}
strings:
  - {name: first, path: [{body: upper, at: [0, 0, 0]}, {world: [0, 0, 0]}], length: 0.6}
  - name: second
    path: [{body: lower, at: [0, 0, 0]}, {body: upper, at: [0, 0, 0]}]
    length: 0.5
"""


@dataclass(frozen=True, eq=False)
class Swing:
    """An undamped swing on taut strings.

    Attributes:
        name: name in tables.
        marionette: the puppet.
        x0: its start.
        stretch: (n, n_qD) q_D -> (n, strings) relative errors of the lengths, of either sign.
    """

    name: str
    marionette: fan.Marionette
    x0: fan.State
    stretch: Callable[[Array], Array]


def swings() -> list[Swing]:
    """A pendulum, and two masses on two strings."""
    a = np.deg2rad(60.0)
    pendulum = Swing(
        "pendulum, 60 deg",
        scenarios.pendulum(),
        scenarios.pendulum_start(float(np.sin(a)), -float(np.cos(a))),
        lambda q: (np.hypot(q[:, 0], q[:, 1]) - 1.0)[:, None],
    )
    double, b = fan.loads(DOUBLE), np.deg2rad(25.0)
    x, z = 0.6 * np.sin(b), -0.6 * np.cos(b)
    values = {"upper.x": x, "upper.z": z, "lower.x": x, "lower.z": z - 0.5}
    two = Swing(
        "two masses, 25 deg",
        double,
        double.project(double.state(values)),
        lambda q: np.stack(
            [
                np.hypot(q[:, 0], q[:, 1]) / 0.6 - 1.0,
                np.hypot(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1]) / 0.5 - 1.0,
            ],
            axis=1,
        ),
    )
    return [pendulum, two]


def section() -> Section:
    """Drift of the energy, and the worst length, for both methods."""
    out = Section("6. Energy over 1,000 s")
    rows, curves = [], {}
    for swing in swings():
        depth = _depth(swing)
        runs = {"event": {}}
        for dt in STEPS:
            runs[f"timestepping, {dt * 1e3:g} ms"] = {
                "method": fan.TimeStepping(dt=dt),
                "save_every": round(SAVED / dt),
            }
        for name, options in runs.items():
            run = fan.simulate(swing.marionette, swing.x0, t_end=SECONDS, effort=False, **options)
            energy = run.ledger["kinetic"] + run.ledger["potential"]
            drift = (energy - energy[0]) / depth
            worst = float(np.max(np.abs(swing.stretch(run.q_D))))
            rows.append(
                [
                    swing.name,
                    name,
                    number(energy[-1] - energy[0]),
                    number(drift[-1]),
                    number(float(np.max(np.abs(drift)))),
                    number(worst),
                    len(run.events),
                ]
            )
            curves[swing.name, name] = (run.t, np.abs(drift))
            if name == "event":
                out.marks += [
                    Mark(f"length error over 1,000 s, relative: {swing.name}", worst, 1e-12),
                    Mark(
                        f"energy drift of `event` over 1,000 s, relative: {swing.name}",
                        float(np.max(np.abs(drift))),
                        1e-5,
                    ),
                ]
    out.parts = [
        "Undamped swings on taut strings, nothing driven. The drift is given in joules and "
        "relative to the energy of the swing (start less lowest point). `event` runs at default "
        "tolerance and its lengths are checked after every accepted step; `timestepping` every "
        f"{SAVED:g} s.",
        Table(
            [
                "motion",
                "method",
                "drift (J)",
                "relative",
                "largest",
                "length error, relative",
                "events",
            ],
            rows,
        ),
        Picture("strings_energy.png", "Drift of the energy over 1,000 s"),
    ]
    _draw(curves)
    return out


def _depth(swing: Swing) -> float:
    """Energy of the start relative to the hanging rest [J]."""
    m = swing.marionette
    return float(m.potential_energy(swing.x0) - m.potential_energy(m.rest(swing.x0)))


def _draw(curves: dict[tuple[str, str], tuple[Array, Array]]) -> None:
    names = list(dict.fromkeys(swing for swing, _ in curves))
    styles = {"1 ms": ":", "2 ms": "-"}
    with picture("strings_energy.png", columns=len(names)) as axes:
        for axis, swing in zip(axes, names, strict=True):
            for (which, name), (t, drift) in curves.items():
                if which != swing:
                    continue
                kind = name.split(",")[0]
                style = next((s for end, s in styles.items() if name.endswith(end)), "-")
                seconds, worst = _envelope(t, drift)
                axis.semilogy(seconds, worst, style, color=COLOUR[kind], label=name)
            axis.set(title=swing, xlabel="time (s)")
        axes[0].set_ylabel("largest drift so far, relative")
        axes[0].legend(loc="center right", bbox_to_anchor=(1.0, 0.6), fontsize=8.5)


def _envelope(t: Array, drift: Array) -> tuple[Array, Array]:
    """The running maximum on a few hundred times."""
    at = np.linspace(t[0] + 1.0, t[-1], 400)
    worst = np.maximum.accumulate(drift)
    return at, np.maximum(worst[np.searchsorted(t, at, side="right") - 1], 1e-16)
