"""Whether a stand can do a run: travel, speed, acceleration, step rate and torque of every axis.

An axis at p moves driven coordinates by J (:mod:`fantoccini.stand.axes`), and needs at its motor,
which turns by n per position at w = n pdot, with the inertia J_m of all that turns with it:

    torque = (F / n) e + J_m n pddot + viscous w + coulomb w / sqrt(w^2 + speed^2),   F = J^T f_K

f_K = M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda is the run's effort: strings, weight and inertia
of driven bodies. e = 1 / efficiency where the motor drives its load, efficiency where the load
drives it. The run's winches hold exactly; what gives way changes the motion.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from fantoccini.arrays import Array, Mask
from fantoccini.errors import Status
from fantoccini.marionette import Marionette
from fantoccini.motion import Columns, Trajectory
from fantoccini.simulation.contact_effort import contact_effort
from fantoccini.stand.axes import Axis, AxisMap, AxisMotion
from fantoccini.stand.catches import Kick, kicks
from fantoccini.stand.losing import LostSteps, lost_steps
from fantoccini.stand.motors import Stepper
from fantoccini.stand.stand_file import Stand, load_stand

RATE = 1000.0
"""Samples per second at which a run is looked at, its own samples beside them."""
COARSE = 0.02, 0.2
"""Time between samples of a run [s], and change of a force from one to the next over its largest,
from which both on peaks may be missed between them."""

_LEAST_SMOOTH = 3
"""Samples through which a smooth curve goes; a line goes through fewer."""

_MOST = 10.0
"""Demand over bound that is told at most: a motor beyond its curve has no torque at all."""

QUANTITIES = ("travel", "speed", "acceleration", "step rate", "torque", "catch")
"""What may not be enough, in order."""


@dataclass(frozen=True)
class Limit:
    """How near an axis comes to one of its bounds.

    Attributes:
        axis: its name.
        quantity: one of :data:`QUANTITIES`.
        unit: of value and bound.
        value: the largest demand, or the position nearest to an end of the travel.
        bound: what is there at that moment.
        margin: what is left of the bound [%]; below 0 it is broken.
        t: when that is [s].
        broken: when it is first broken [s]; None where it holds.
    """

    axis: str
    quantity: str
    unit: str
    value: float
    bound: float
    margin: float
    t: float
    broken: float | None

    def __str__(self) -> str:
        if self.quantity == "travel":
            text = f"{self.axis} is at {self.value:.4g} {self.unit}, its travel ends at "
            return f"{text}{self.bound:.4g}"
        has = f"{self.bound:.4g}" if self.bound > 0.0 else "none at that speed and load"
        return f"{self.axis} needs {self.value:.4g} {self.unit} of {self.quantity}, and has {has}"

    @property
    def over(self) -> str:
        """By how much it is broken at worst."""
        much = -self.margin >= 100.0 * (_MOST - 1.0)
        return f"over {_MOST:.0f} times" if much else f"{max(-self.margin, 0.0):.0f} %"


@dataclass(frozen=True, eq=False)
class StandCheck:
    """A stand's verdict on a run; T samples, n axes.

    Attributes:
        map: the stand, bound to the run's puppet.
        run: what it is to do.
        marionette: the run's puppet.
        motion: of the axes.
        force: (T, n) F = J^T f_K of the axes on what they move [N or N m].
        torque: (T, n) of the motors, with the sign of the axis' position [N m].
        available: (T, n) their largest torque at that moment [N m].
        limits: of every axis and quantity, in order.
        kicks: catches of strings that hit an axis.
        lost: axis -> steps that it loses, for steppers that lose some.
        notes: what to know of the check itself.
    """

    map: AxisMap
    run: Trajectory
    marionette: Marionette
    motion: AxisMotion
    force: Array
    torque: Array
    available: Array
    limits: tuple[Limit, ...]
    kicks: tuple[Kick, ...]
    lost: dict[str, LostSteps]
    notes: tuple[str, ...]

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes."""
        return self.map.axes

    @property
    def ok(self) -> bool:
        """Whether the stand can do it."""
        return not self.broken

    @property
    def broken(self) -> tuple[Limit, ...]:
        """The limits that are broken, the earliest first."""
        found = [limit for limit in self.limits if limit.broken is not None]
        return tuple(sorted(found, key=lambda limit: limit.broken or 0.0))

    @property
    def first(self) -> Limit | None:
        """The limit that is broken first."""
        return self.broken[0] if self.broken else None

    @property
    def margin(self) -> float:
        """The smallest margin [%]."""
        return min(limit.margin for limit in self.limits)

    def of(self, axis: str) -> dict[str, Limit]:
        """The limits of an axis by quantity."""
        return {limit.quantity: limit for limit in self.limits if limit.axis == axis}

    def power(self) -> Array:
        """(T, n) power of the motors [W]."""
        n = np.array([axis.ratio for axis in self.axes])
        return np.asarray(self.torque * n * self.motion.velocity)

    def __repr__(self) -> str:
        verdict = "can" if self.ok else "cannot"
        return f"<StandCheck: {self.map.stand.name} {verdict}, least margin {self.margin:.0f} %>"

    def summary(self) -> str:
        """The verdict in a sentence."""
        name, first = self.map.stand.name, self.first
        if first is None:
            worst = min(self.limits, key=lambda limit: limit.margin)
            return (
                f"{name} can do it: the least margin is {worst.margin:.0f} %, the "
                f"{worst.quantity} of {worst.axis} at t = {worst.t:.3f} s"
            )
        return (
            f"{name} cannot do it: at t = {first.broken:.3f} s the {first.quantity} of "
            f"{first.axis} is not enough; at worst, at t = {first.t:.3f} s, {first} "
            f"({first.over} too much)"
        )


def check_stand(
    stand: Stand | str | os.PathLike[str], run: Trajectory, marionette: Marionette | None = None
) -> StandCheck:
    """Whether a stand can do a run: margins of travel, speed, acceleration, step rate and torque.

    Args:
        stand: as :func:`load_stand` gives it, or its file, or the name of a bundled one.
        run: of a puppet whose driven coordinates follow their inputs exactly.
        marionette: the run's puppet; made of what the run says of it when not given.

    Raises:
        FileError: the stand is not one for this puppet, or moves what this run moves otherwise.
        ValueError: the run does not say what its puppet is, and none is given; or it is another.
    """
    if not isinstance(stand, Stand):
        stand = load_stand(stand)
    if marionette is None:
        if run.puppet is None:
            raise ValueError("the run does not say what moved; needed: its marionette")
        marionette = Marionette(run.puppet)
    elif (marionette.coordinates.q_D, marionette.coordinates.v_K) != (
        run.coordinates.q_D, run.coordinates.v_K
    ):  # fmt: skip
        raise ValueError(f"the run is not one of {marionette.name}: it has other coordinates")
    bound = AxisMap.of(stand, run.coordinates)
    bound.motion_of(run)  # refuses what the stand's axes do not move
    if run.effort is None:
        run = with_effort(run, marionette)
    assert run.effort is not None
    times = _times(run)
    motion = bound.motion_of(run, times)
    force = between(run.t, bound.forces(run.effort.values), times)
    torque = np.stack(
        [torque_of(axis, motion, force, k) for k, axis in enumerate(bound.axes)], axis=1
    )
    available = np.stack(
        [
            axis.motor.largest(axis.ratio * motion.velocity[:, k], torque[:, k])
            for k, axis in enumerate(bound.axes)
        ],
        axis=1,
    )
    hits = kicks(bound, marionette, run, motion, torque)
    limits = [
        limit
        for k, axis in enumerate(bound.axes)
        for limit in _limits(stand, axis, motion, torque[:, k], available[:, k], k, hits)
    ]
    return StandCheck(
        bound, run, marionette, motion, force, torque, available, tuple(limits), hits,
        _lost(bound, marionette, motion, torque, available, hits), _notes(run),
    )  # fmt: skip


def torque_of(axis: Axis, motion: AxisMotion, force: Array, k: int) -> Array:
    """(T,) torque of the motor of axis number ``k`` that exerts forces (T, n) [N m]."""
    n, v, acc = axis.ratio, motion.velocity[:, k], motion.acceleration[:, k]
    load = force[:, k] / n
    drives = np.sign(load * v)  # 1 where the motor drives its load
    arrives = axis.file.efficiency ** -drives
    torque = load * arrives + axis.inertia * n * acc
    friction = axis.file.friction
    if friction is not None:
        w = n * v
        torque = torque + friction.viscous * w
        torque = torque + friction.coulomb * w / np.sqrt(w**2 + friction.speed**2)
    return np.asarray(torque)


def between(t: Array, values: Array, times: Array) -> Array:
    """Values (T, n) of a run at other times, smooth between its samples (Akima) but for impacts.

    At an impact, which is several samples at one time, they are those after it.
    """
    out = np.empty((len(times), values.shape[1]))
    impacts = np.flatnonzero(np.diff(t) <= 0.0) + 1
    for first, last in pairwise([0, *impacts, len(t)]):
        own, end = slice(first, last), len(times)
        if last < len(t):
            end = int(np.searchsorted(times, t[last]))
        at = slice(int(np.searchsorted(times, t[first])), end)
        if last - first < _LEAST_SMOOTH:
            for k in range(values.shape[1]):
                out[at, k] = np.interp(times[at], t[own], values[own, k])
        elif at.stop > at.start:
            out[at] = Akima1DInterpolator(t[own], values[own])(times[at])
    return out


def with_effort(run: Trajectory, marionette: Marionette) -> Trajectory:
    """The run with the force on every driven coordinate."""
    force = marionette.effort(
        run.q_D, run.v_D, run.q_K, run.v_K, run.acc_D, run.acc_K, run.tension.values
    )
    if run.contact is not None:
        force = force + contact_effort(marionette.model, run.contact, run.q_D, run.q_K)
    columns = Columns(run.coordinates.v_K, force, "driven velocity")
    return dataclasses.replace(run, effort=columns)


def _times(run: Trajectory) -> Array:
    """Times at which a run is looked at: its own, and those of a clock."""
    n = max(2, round(run.duration * RATE) + 1)
    return np.union1d(run.t, np.linspace(run.t[0], run.t[-1], n))


def _limits(
    stand: Stand, axis: Axis, motion: AxisMotion, torque: Array, available: Array, k: int,
    hits: tuple[Kick, ...],
) -> list[Limit]:  # fmt: skip
    """The limits of one axis."""
    p, v, acc = motion.position[:, k], motion.velocity[:, k], motion.acceleration[:, k]
    t, unit, file = motion.t, axis.unit, axis.file
    low, high = axis.travel
    room = np.minimum(p - low, high - p)
    i = int(np.argmin(room))
    end = low if p[i] - low < high - p[i] else high
    made = [
        Limit(
            axis.name, "travel", unit, float(p[i]), end, 100.0 * float(room[i]) / (high - low),
            float(t[i]), _first(t, room < -_ROUNDING * (high - low)),
        )
    ]  # fmt: skip
    assert file.speed is not None and file.acceleration is not None
    rates = [
        ("speed", f"{unit}/s", np.abs(v), np.full(len(t), file.speed)),
        ("acceleration", f"{unit}/s^2", np.abs(acc), np.full(len(t), file.acceleration)),
    ]
    controller = stand.file.controller
    pulses = getattr(controller, "step_rate", None)
    if isinstance(axis.motor, Stepper) and pulses is not None:
        rate = np.abs(v) * axis.counts
        rates.append(("step rate", "steps/s", rate, np.full(len(t), pulses)))
    rates.append(("torque", "N m", np.abs(torque), available))
    for quantity, of, demand, bound in rates:
        made.append(_rate(axis.name, quantity, of, t, demand, bound))
    own = [hit for hit in hits if hit.axis == axis.name]
    if own:
        worst = min(own, key=lambda hit: hit.margin)
        broken = [hit.t for hit in own if hit.margin < 0.0]
        made.append(
            Limit(
                axis.name, "catch", "N m s", worst.impulse, worst.bound, worst.margin, worst.t,
                min(broken, default=None),
            )
        )
    return made


_ROUNDING = 1e-9
"""By how much a bound may be passed, relative to it."""


def _rate(axis: str, quantity: str, unit: str, t: Array, demand: Array, bound: Array) -> Limit:
    """The limit of a demand (T,) with a bound (T,) of its own at every moment."""
    share = demand / np.maximum(bound, 1e-12 * max(1.0, float(np.max(bound))))
    i = int(np.argmax(share))
    margin = 100.0 * (1.0 - min(float(share[i]), _MOST))
    return Limit(
        axis, quantity, unit, float(demand[i]), float(bound[i]), margin, float(t[i]),
        _first(t, demand > bound * (1.0 + _ROUNDING)),
    )  # fmt: skip


def _first(t: Array, broken: Mask) -> float | None:
    return float(t[np.argmax(broken)]) if np.any(broken) else None


def _lost(
    bound: AxisMap, marionette: Marionette, motion: AxisMotion, torque: Array, available: Array,
    hits: tuple[Kick, ...],
) -> dict[str, LostSteps]:  # fmt: skip
    found = {}
    for k, axis in enumerate(bound.axes):
        if isinstance(axis.motor, Stepper):
            carried = marionette.mass / axis.ratio**2
            lost = lost_steps(
                axis.motor.steps, motion.t, np.abs(torque[:, k]), available[:, k],
                axis.inertia + carried, [hit.t for hit in hits
                                         if hit.axis == axis.name and hit.margin < 0.0],
            )  # fmt: skip
            if lost is not None:
                found[axis.name] = lost
    return found


def _notes(run: Trajectory) -> tuple[str, ...]:
    notes = []
    assert run.effort is not None
    force, gap = np.abs(run.effort.values), np.diff(run.t)
    change = np.max(np.abs(np.diff(force, axis=0)) / np.max(force, initial=1e-9), axis=1)
    coarse = np.flatnonzero((gap > COARSE[0]) & (change > COARSE[1]))
    if len(coarse):
        notes.append(
            f"the run has samples {1e3 * np.max(gap[coarse]):.0f} ms apart where its forces change "
            f"(at t = {run.t[coarse[0]]:.3f} s): peaks between them are not seen"
        )
    if run.status is not Status.DONE:
        notes.append(f"the run itself did not end well: {run.status.message}")
    if run.method != "event":
        notes.append(
            f"method {run.method}: a catch is a force over one step, not an impulse of its own"
        )
    return tuple(notes)
