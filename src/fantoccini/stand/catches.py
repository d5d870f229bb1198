"""Catches of strings as an axis feels them: impulses, and what a stepper can take.

Where strings snap taut while the driven coordinates move on (Eqs. 13-15), an axis takes

    P = J^T (M_KD dv_D + A_K^T Lambda)

on its side, as the run's winches do not give way. A motor that does moves on together with what
caught it, of mass m_e = P^2 / sum(Lambda hdot) as felt by the axis. A stepper stays in step if that
energy does not carry it over the hump of its torque T sin(steps/4 angle), held against the load M:

    1/2 (P/n)^2 / (J_m + m_e / n^2) <= (4/steps) (2 T cos a - M (pi - 2 a)),   sin a = M / T
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import EventKind, Trajectory
from fantoccini.stand.axes import Axis, AxisMap, AxisMotion
from fantoccini.stand.motors import Stepper

_LEAST = 1e-9
"""Impulse at the motor from which a catch is kept [N m s]."""
_MOST = 10.0
"""Impulse over bound that is told at most: a motor at its largest torque takes none."""


@dataclass(frozen=True)
class Kick:
    """A catch that hits an axis.

    Attributes:
        axis: its name.
        t: when [s].
        strings: that snapped taut.
        impulse: at the motor [N m s].
        bound: the largest that the stepper takes without losing steps [N m s].
        margin: [%]
    """

    axis: str
    t: float
    strings: tuple[str, ...]
    impulse: float
    bound: float
    margin: float


@dataclass(frozen=True, eq=False)
class Impacts:
    """The I impacts of a run, as they act on its n axes.

    Attributes:
        t: (I,) times [s].
        impulse: (I, n) P on the bodies moved by the axes [N s or N m s].
        lost: (I,) sum(Lambda hdot) of the strings that snapped taut [J].
        strings: for every impact, the strings that snapped taut.
    """

    t: Array
    impulse: Array
    lost: Array
    strings: tuple[tuple[str, ...], ...]


def impacts_of(bound: AxisMap, marionette: Marionette, run: Trajectory) -> Impacts | None:
    """The impacts of an event-driven run with catches; None for other runs.

    Args:
        bound: the stand.
        marionette: the run's puppet.
        run: with the samples of its impacts.
    """
    caught = [e for e in run.events if e.impulse and e.kind is EventKind.CATCH]
    if run.method != "event" or not caught:
        return None
    times, impulses = impulses_of(run, marionette)
    lost, strings = np.zeros(len(times)), [dict[str, None]() for _ in times]
    for event in caught:
        i = int(np.searchsorted(times, event.t))
        if i < len(times) and times[i] == event.t:
            lost[i] += event.impulse * abs(event.speed)
            strings[i][event.name] = None
    return Impacts(times, impulses[:, bound.v] @ bound.J, lost, tuple(map(tuple, strings)))


def kicks(
    impacts: Impacts | None, axis: Axis, k: int, motion: AxisMotion, torque: Array, unknown: Mask
) -> list[Kick]:
    """The catches that hit a stepper, in order; other motors have none.

    Args:
        impacts: of the run.
        axis: the axis.
        k: its number.
        motion: of the axes, (T, n).
        torque: (T,) of its motor [N m].
        unknown: (T,) where the motion does not determine it: catches there are left out.
    """
    if impacts is None or not isinstance(axis.motor, Stepper):
        return []
    at = np.minimum(np.searchsorted(motion.t, impacts.t), len(motion.t) - 1)
    size = np.abs(impacts.impulse[:, k]) / axis.ratio
    hit = np.flatnonzero((size > _LEAST) & (impacts.lost > 0.0) & ~unknown[at])
    here, own = at[hit], size[hit]
    w = motion.velocity[here, k] * axis.ratio
    most = taken(axis, np.abs(torque[here]), w, own**2 / impacts.lost[hit])
    margin = 100.0 * (1.0 - own / np.maximum(most, own / _MOST))
    return [
        Kick(axis.name, float(impacts.t[i]), impacts.strings[i], float(x), float(m), float(left))
        for i, x, m, left in zip(hit, own, most, margin, strict=True)
    ]


def impulses_of(run: Trajectory, marionette: Marionette) -> tuple[Array, Array]:
    """Times (I,) of a run's impacts, and their impulses on the driven coordinates (I, n_vK)."""
    table = run.coordinates
    names = run.tension.names
    first = np.flatnonzero(np.diff(run.t) == 0.0)
    # Of several samples at one time, from the first to the last.
    times = np.unique(run.t[first])
    before = np.searchsorted(run.t, times, side="left")
    after = np.searchsorted(run.t, times, side="right") - 1
    change = run.v_D[after] - run.v_D[before]
    tension = np.zeros((len(times), len(names)))
    for event in run.events:
        i = int(np.searchsorted(times, event.t))
        if event.impulse and event.name in names and i < len(times) and times[i] == event.t:
            tension[i, names.index(event.name)] += event.impulse
    at, still = run.q_D[after], np.zeros_like(change)
    driven = np.zeros((len(times), table.n_vK))
    given = at, still, run.q_K[after], driven
    pushed = marionette.effort(*given, change, driven, tension)
    rest = marionette.effort(*given, still, driven, np.zeros_like(tension))
    return times, np.asarray(pushed - rest)


def taken(axis: Axis, load: Array, speed: Array, caught: Array) -> Array:
    """(...) largest impulses that a stepper takes without losing steps [N m s].

    Args:
        axis: of the stepper.
        load: (...) of its motor [N m].
        speed: (...) of its motor [rad/s].
        caught: (...) inertia of what catches it, at the motor [kg m^2].
    """
    motor = axis.motor
    assert isinstance(motor, Stepper)
    most = np.maximum(motor.largest(speed, load), 1e-300)
    a = np.arcsin(np.minimum(load / most, 1.0))
    hump = 4.0 / motor.steps * (2.0 * most * np.cos(a) - load * (np.pi - 2.0 * a))
    held = np.where(load < most, np.maximum(hump, 0.0), 0.0)
    return np.asarray(np.sqrt(2.0 * (axis.inertia + caught) * held))
