"""Limits of an axis: how near a motion comes to what its motor and its travel allow.

With the motor's angle n per position, w = n pdot, and the inertia J_m of all that turns with it:

    torque = (F / n) e + J_m n pddot + viscous w + coulomb w / sqrt(w^2 + speed^2)

e = 1 / efficiency where the motor drives its load, efficiency where the load drives it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.stand.axes import Axis, AxisMotion
from fantoccini.stand.catches import Impacts, Kick, kicks
from fantoccini.stand.motors import Stepper
from fantoccini.stand.stand_file import Stand

QUANTITIES = ("travel", "speed", "acceleration", "step rate", "torque", "catch")
"""What may not be enough, in order."""

_MOST = 10.0
"""Demand over bound that is told at most: a motor beyond its curve has no torque at all."""
_ROUNDING = 1e-9
"""By how much a bound may be passed, relative to it."""


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
class Load:
    """A motor's load.

    Attributes:
        torque, available: (T,) required torque, and the largest available [N m].
        known: (T,) whether the motion determines the torque.
        kicks: catches of strings that hit the motor.
    """

    torque: Array
    available: Array
    known: Mask
    kicks: list[Kick]


def load_of(
    axis: Axis, k: int, motion: AxisMotion, force: Array, impacts: Impacts | None, unknown: Mask
) -> Load:
    """The load of axis number ``k``; arguments as of a check's attributes."""
    torque = torque_of(axis, motion, force, k)
    available = axis.motor.largest(axis.ratio * motion.velocity[:, k], torque)
    return Load(torque, available, ~unknown, kicks(impacts, axis, k, motion, torque, unknown))


def limits_of(stand: Stand, axis: Axis, k: int, motion: AxisMotion, load: Load) -> list[Limit]:
    """The limits of one axis."""
    p, v, acc = motion.position[:, k], motion.velocity[:, k], motion.acceleration[:, k]
    t, unit, file = motion.t, axis.unit, axis.file
    low, high = axis.travel
    room = np.minimum(p - low, high - p)
    i = int(np.argmin(room))
    end = low if p[i] - low < high - p[i] else high
    made = [
        Limit(
            axis.name,
            "travel",
            unit,
            float(p[i]),
            end,
            100.0 * float(room[i]) / (high - low),
            float(t[i]),
            _first(t, room < -_ROUNDING * (high - low)),
        )
    ]
    assert file.speed is not None and file.acceleration is not None
    rates = [
        ("speed", f"{unit}/s", np.abs(v), np.full(len(t), file.speed)),
        ("acceleration", f"{unit}/s^2", np.abs(acc), np.full(len(t), file.acceleration)),
    ]
    controller = stand.controller
    pulses = getattr(controller, "step_rate", None)
    if isinstance(axis.motor, Stepper) and pulses is not None:
        rate = np.abs(v) * axis.counts
        rates.append(("step rate", "steps/s", rate, np.full(len(t), pulses)))
    if np.any(load.known):
        torque = np.where(load.known, np.abs(load.torque), 0.0)
        rates.append(("torque", "N m", torque, load.available))
    for quantity, of, demand, bound in rates:
        made.append(_rate(axis.name, quantity, of, t, demand, bound))
    if load.kicks:
        worst = min(load.kicks, key=lambda hit: hit.margin)
        broken = [hit.t for hit in load.kicks if hit.margin < 0.0]
        made.append(
            Limit(
                axis.name,
                "catch",
                "N m s",
                worst.impulse,
                worst.bound,
                worst.margin,
                worst.t,
                min(broken, default=None),
            )
        )
    return made


def _rate(axis: str, quantity: str, unit: str, t: Array, demand: Array, bound: Array) -> Limit:
    """The limit of a demand (T,) with a bound (T,) of its own at every moment."""
    share = demand / np.maximum(bound, 1e-12 * max(1.0, float(np.max(bound))))
    i = int(np.argmax(share))
    margin = 100.0 * (1.0 - min(float(share[i]), _MOST))
    return Limit(
        axis,
        quantity,
        unit,
        float(demand[i]),
        float(bound[i]),
        margin,
        float(t[i]),
        _first(t, demand > bound * (1.0 + _ROUNDING)),
    )


def _first(t: Array, broken: Mask) -> float | None:
    return float(t[np.argmax(broken)]) if np.any(broken) else None


def torque_of(axis: Axis, motion: AxisMotion, force: Array, k: int) -> Array:
    """(T,) torque of the motor of axis number ``k`` that exerts forces (T, n) [N m]."""
    n, v, acc = axis.ratio, motion.velocity[:, k], motion.acceleration[:, k]
    load = force[:, k] / n
    drives = np.sign(load * v)  # 1 where the motor drives its load
    arrives = axis.file.efficiency**-drives
    torque = load * arrives + axis.inertia * n * acc
    friction = axis.file.friction
    if friction is not None:
        w = n * v
        torque = torque + friction.viscous * w
        torque = torque + friction.coulomb * w / np.sqrt(w**2 + friction.speed**2)
    return np.asarray(torque)
