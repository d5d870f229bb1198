"""Sections 2 and 3: closed forms, and the reeled pendulum, at tight tolerance."""

from __future__ import annotations

import numpy as np

import fantoccini as fan
from fantoccini.motion import EventRecord
from oracles.string_pendulum import flight

from . import scenarios
from .report import Mark, Section, Table, number
from .scenarios import GRAVITY, LENGTH, MASS, SECONDS

TIGHT = 1e-13
LAUNCHES = (2.05, 2.2, 2.5, 3.0, 3.5, 4.0, 4.5, 4.8, 4.95)
"""v0^2 / (g L); between 2 and 5 the string goes slack above the middle."""
DROPS = ((0.6, 0.0), (0.1, 0.0), (0.95, 0.0), (0.3, -0.4), (0.0, -0.3))
"""Start (x, z) of the dropped mass [m]; the pivot is at (0, 0)."""
REELING_PIECES = 250
"""Number of quintic pieces that approximate the reeling pendulum's sines."""
TRANSVERSE = 0.1
"""Smallest relative loss of speed in a transverse catch."""


def launches() -> Section:
    """Release, catch and impulse of a launched pendulum and a dropped mass."""
    out = Section("2. Closed forms at tight tolerance")
    out.parts.append(
        f"rtol = atol = {number(TIGHT, 1)}. A point mass ({MASS:g} kg, string {LENGTH:g} m) is "
        "launched from the bottom with v0^2 = k g L. It leaves its circle at the angle psi with "
        "sin(psi) = (k - 2)/3 above the middle and is caught at -3 psi. `grazing` is the part of "
        "the speed that is lost in the catch: the smaller it is, the more an error in the flight "
        "shifts the catch."
    )
    rows, times, impulses = [], [], []
    for k in LAUNCHES:
        f = flight(k, LENGTH, MASS, GRAVITY)
        x0 = scenarios.pendulum_start(0.0, -LENGTH, float(np.sqrt(k * GRAVITY * LENGTH)))
        run = _tight(x0, f.t_catch + 1e-3)
        release, catch = _first_event(run, "release"), _first_event(run, "catch")
        after = np.flatnonzero(run.t == catch.t)[-1]
        at_release = np.searchsorted(run.t, release.t)
        lost = f.impulse / MASS / np.linalg.norm(f.v_before)
        d_release, d_catch = abs(release.t - f.t_release), abs(catch.t - f.t_catch)
        d_impulse = abs(catch.impulse / f.impulse - 1.0)
        angles = (
            abs(_polar_angle(run.q_D[at_release], f.psi)),
            abs(_polar_angle(run.q_D[after], -3.0 * f.psi)),
        )
        if lost >= TRANSVERSE:
            times += [d_release, d_catch]
            impulses.append(d_impulse)
        rows.append([f"{k:g}", number(lost), *map(number, (d_release, angles[0], d_catch))])
        rows[-1] += [number(angles[1]), number(d_impulse)]
    head = ["k", "grazing", "release time (s)", "release angle", "catch time (s)"]
    out.parts.append(Table([*head, "catch angle", "impulse, relative"], rows))

    out.parts.append(
        "A mass dropped from rest at (x, z) on a slack string from (0, 0): it falls until "
        "x^2 + z^2 = L^2."
    )
    rows = []
    for x, z in DROPS:
        low = -np.sqrt(LENGTH**2 - x**2)
        t, speed = np.sqrt(2.0 * (z - low) / GRAVITY), np.sqrt(2.0 * GRAVITY * (z - low))
        impulse = MASS * speed * -low / LENGTH
        catch = _first_event(_tight(scenarios.pendulum_start(x, z), t + 1e-3), "catch")
        times.append(abs(catch.t - t))
        impulses.append(abs(catch.impulse / impulse - 1.0))
        rows.append([f"({x:g}, {z:g})", f"{t:.6f}", f"{impulse:.6f}"])
        rows[-1] += [number(times[-1]), number(impulses[-1])]
    head = ["from (m)", "catch (s)", "impulse (N s)", "error of the time (s)"]
    out.parts.append(Table([*head, "error of the impulse, relative"], rows))
    out.marks = [
        Mark("times of transverse catches and releases, closed form (s)", max(times), 1e-11),
        Mark("impulses of transverse catches, closed form, relative", max(impulses), 1e-10),
    ]
    return out


def reeling() -> Section:
    """The reeled pendulum against its scalar equation."""
    scenario, solve = scenarios.reeling(REELING_PIECES)
    times = np.linspace(0.0, SECONDS, REELING_PIECES + 1)[::10]
    states, tensions = solve(times)
    rows, worst = [], 0.0
    for tolerance in (TIGHT, 1e-11, 1e-9):
        run = scenario.run(tolerance=tolerance, save_at=times)
        at = np.searchsorted(run.t, times)
        apart = [
            float(np.max(np.abs(ours - theirs)))
            for ours, theirs in (
                (run.q_D[at], states[:, :2]),
                (run.v_D[at], states[:, 2:]),
                (run.tension["line"][at], tensions),
            )
        ]
        if tolerance == TIGHT:
            worst = max(apart)
        rows.append([number(tolerance, 1), *map(number, apart)])
    out = Section("3. A moving pivot and a reeled string")
    out.parts = [
        "The pivot moves as X = 0.1 sin(4 t) m, the length is L = 0.8 + 0.2 sin(3 t) m, the "
        f"string stays taut ({tensions.min():.2f} to {tensions.max():.2f} N) and the pendulum "
        "obeys L a'' + 2 L' a' + g sin(a) + X'' cos(a) = 0. SciPy's DOP853 integrates that "
        f"equation at 1e-13. Both use the same {REELING_PIECES} quintic pieces, which differ from "
        "the sines by less than 1e-12 m; their breaks keep the steps short at every tolerance. "
        f"Largest differences at {len(times)} times over {SECONDS:g} s:",
        Table(["rtol = atol", "position (m)", "velocity (m/s)", "tension (N)"], rows),
    ]
    out.marks = [Mark("reeled pendulum: position, velocity, tension (SI units)", worst, 1e-10)]
    return out


def _tight(x0: fan.State, t_end: float) -> fan.Trajectory:
    return fan.simulate(
        scenarios.pendulum(), x0, t_end=t_end, method=fan.Event(rtol=TIGHT, atol=TIGHT)
    )


def _first_event(run: fan.Trajectory, kind: str) -> EventRecord:
    return next(event for event in run.events if event.kind == kind)


def _polar_angle(place, polar: float) -> float:
    """Polar angle of a place relative to ``polar``, in (-pi, pi] [rad]."""
    turn = np.arctan2(place[1], place[0]) - polar
    return float((turn + np.pi) % (2.0 * np.pi) - np.pi)
