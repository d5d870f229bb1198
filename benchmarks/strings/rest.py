"""Section 5: a mass at rest on its string, and the catch of a dropped one, compared with MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from oracles import point_mass_events

from . import mujoco_peer, scenarios
from .plots import COLOUR, picture
from .report import Mark, Picture, Section, Table, number
from .scenarios import DROP_X, GRAVITY, LENGTH, MASS

STEP = 0.002
"""Step of every method with a fixed one [s]."""

REST_SECONDS, DROP_SECONDS = 5.0, 1.0
WEIGHT = MASS * GRAVITY
LINES = {
    "event": "-",
    "timestepping": "--",
    "MuJoCo, default": "-",
    "MuJoCo, stiffest": "--",
    "MuJoCo, overdamped": ":",
}


@dataclass(frozen=True)
class Motion:
    """A motion of the point mass.

    Attributes:
        t: (n,) [s].
        q, v: (n, 2) place and velocity [m], [m/s].
        tension: (n,) [N].
    """

    t: Array
    q: Array
    v: Array
    tension: Array

    @property
    def over(self) -> Array:
        """(n,) extension of the string beyond its length; negative while slack [m]."""
        return np.hypot(*self.q.T) - LENGTH

    @property
    def outward(self) -> Array:
        """(n,) outward radial speed [m/s]."""
        return np.sum(self.q * self.v, axis=1) / np.hypot(*self.q.T)


def motions(x: float, z: float, seconds: float) -> dict[str, Motion]:
    """The mass released at rest, by every method."""
    x0, by_method = scenarios.pendulum_start(x, z), {}
    grid = STEP * np.arange(round(seconds / STEP) + 1)
    for method in ("event", "timestepping"):
        exact = method == "event"
        run = fan.simulate(
            scenarios.pendulum(),
            x0,
            t_end=seconds,
            save_at=grid[1:] if exact else None,
            method=fan.Event() if exact else fan.TimeStepping(dt=STEP),
        )
        by_method[method] = Motion(run.t, run.q_D, run.v_D, run.tension["line"])
    for setting in mujoco_peer.DAMPING:
        for integrator in ("Euler", "RK4"):
            peer = mujoco_peer.pendulum(STEP, setting, integrator).put([x, z], [0.0, 0.0])
            course = Motion(grid, *peer.course(len(grid)))
            by_method[f"MuJoCo, {setting}, {integrator}"] = course
    return by_method


def section() -> Section:
    """Tables of both, and a picture."""
    resting = motions(0.0, -LENGTH, REST_SECONDS)
    falling = motions(DROP_X, 0.0, DROP_SECONDS)
    out = Section("5. At rest, and caught: compared with MuJoCo")
    rows = []
    for name, course in resting.items():
        late = course.tension[course.t > 1.0]
        off = [float(np.max(np.abs(tension - WEIGHT))) for tension in (course.tension, late)]
        sag = float(np.max(course.over))
        rows.append([name, *map(number, (*off, np.ptp(late), sag))])
        if name == "event":
            out.marks.append(Mark("tension at rest less m g (N)", off[0], 1e-12))
    head = ["method", "largest tension off m g (N)", "after 1 s", "its range after 1 s", "sag (m)"]
    out.parts += [
        f"A mass of {MASS:g} kg hangs at rest on its string for {REST_SECONDS:g} s. Its tension "
        f"is m g = {WEIGHT:g} N. The sag is its displacement below the string's length. Fixed "
        f"steps are {STEP * 1e3:g} ms; MuJoCo's settings are those of section 1.",
        Table(head, rows),
    ]
    exact = point_mass_events.simulate([DROP_X, 0.0, 0.0, 0.0], DROP_SECONDS, LENGTH, GRAVITY)
    t_catch = exact.events[0][0]
    rows = []
    for name, course in falling.items():
        caught = (course.t > t_catch - STEP) & (course.t < t_catch + 0.15)
        rebound = max(0.0, -float(np.min(course.outward[caught & (course.t > t_catch + STEP)])))
        rows.append(
            [
                name,
                number(max(0.0, float(np.max(course.over))) * 1e3),
                number(rebound if rebound > 1e-9 else 0.0),
                number(float(np.max(course.tension[caught])) / WEIGHT),
                number(float(np.max(np.abs(course.q[-1] - exact.state[:2])))),
            ]
        )
    head = ["method", "stretch (mm)", "rebound (m/s)", "peak tension / m g"]
    out.parts += [
        f"The same mass is dropped {DROP_X:g} m beside its pivot and is caught after "
        f"{t_catch:.3f} s. A massless string that does not stretch takes the radial speed at "
        "once: no stretch, no rebound. In `event` the catch is an impulse, so the peak tension "
        "is that of the swing after it; in `timestepping` the catch is spread over two steps.",
        Table([*head, f"error of position at {DROP_SECONDS:g} s (m)"], rows),
        Picture("strings_rest.png", "Tension at rest, and stretch of the string in a catch"),
    ]
    _draw(resting, falling, t_catch)
    return out


def _draw(resting: dict[str, Motion], falling: dict[str, Motion], t_catch: float) -> None:
    with picture("strings_rest.png", columns=2, height=3.8) as (rest, drop):
        for name, style in LINES.items():
            key = f"{name}, RK4" if name.startswith("MuJoCo") else name
            look = {"color": COLOUR[name], "linestyle": style, "label": name}
            course = resting[key]
            first = course.t < 0.1
            rest.plot(course.t[first] * 1e3, course.tension[first] / WEIGHT, **look)
            course = falling[key]
            near = abs(course.t - t_catch - 0.045) < 0.06
            drop.plot((course.t[near] - t_catch) * 1e3, course.over[near] * 1e3, **look)
        rest.set(title="let go at rest", xlabel="time (ms)", ylabel="tension / m g")
        rest.set_ylim(bottom=-0.05)
        drop.set(
            title="dropped and caught",
            xlabel="time after the catch (ms)",
            ylabel="distance from the pivot less L (mm)",
            ylim=(-20, 30),
        )
        rest.legend(loc="lower right")
