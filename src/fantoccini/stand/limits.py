"""Limits of an axis: margins that a motion leaves of its travel, speed, motor and controller.

With the motor's angle n per unit of position, w = n pdot, and the inertia J_m of everything that
turns with it:

    torque = (F / n) e + J_m n pddot + viscous w + coulomb w / sqrt(w^2 + speed^2)

e = 1 / efficiency where the motor drives its load, efficiency where the load drives it.

An axis is a motor of the stand with its gear, at the position p and with the force F on its load; n
is the angle of the motor per unit of p. A margin is the remaining part of a bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask, Times
from fantoccini.stand.axes import Axis, Series
from fantoccini.stand.catches import CatchImpulse, Impacts, catch_impulses
from fantoccini.stand.motors import Stepper
from fantoccini.stand.stand_file import Stand

QUANTITIES = ("travel", "speed", "acceleration", "step rate", "torque", "catch")
"""Checked quantities, in order."""

MAX_RATIO = 10.0
"""Largest reported ratio of demand to bound; beyond its torque curve a motor's bound is 0."""
RELATIVE_ROUNDING = 1e-9
"""Relative excess over a bound that counts as rounding."""


@dataclass(frozen=True)
class Limit:
    """Margin of an axis to one of its bounds, where it is smallest.

    Attributes:
        axis: name of the axis.
        quantity: one of :data:`QUANTITIES`.
        unit: unit of value and bound.
        value: the demand, or the position nearest to an end of the travel.
        bound: the bound at that time.
        margin: remaining part of the bound [%]; below 0 the limit is broken.
        t: time of this value [s].
        broken: first time at which the limit is broken [s]; None if it holds.
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
        available_text = f"{self.bound:.4g}" if self.bound > 0.0 else "none at that speed and load"
        demand = f"{self.value:.4g} {self.unit} of {self.quantity}"
        return f"{self.axis} needs {demand}, and has {available_text}"

    @property
    def excess_text(self) -> str:
        """Largest excess over the bound, as text."""
        if -self.margin >= 100.0 * (MAX_RATIO - 1.0):
            return f"over {MAX_RATIO:.0f} times"
        return f"{max(-self.margin, 0.0):.0f} %"


@dataclass(frozen=True, eq=False)
class Load:
    """A motor's load.

    Attributes:
        torque, available: (T,) required torque, and the largest available [N m].
        known: (T,) whether the motion determines the torque.
        catches: catches of strings that hit the motor.
    """

    torque: Array
    available: Array
    known: Mask
    catches: list[CatchImpulse]


def axis_load(
    axis: Axis,
    k: int,
    t: Times,
    series: Series,
    force: Array,
    impacts: Impacts | None,
    unknown: Mask,
) -> Load:
    """The load of an axis.

    Args:
        axis: the axis.
        k: its number.
        t: (T,) times [s].
        series: its position, velocity and acceleration.
        force: (T,) on its load [N or N m].
        impacts: impacts of the run.
        unknown: (T,) whether the motion does not determine the force.
    """
    torque = axis_torque(axis, series, force)
    available = axis.motor.max_torque(axis.ratio * series[1], torque)
    catches = catch_impulses(impacts, axis, k, t, series[1], torque, unknown)
    return Load(torque, available, ~unknown, catches)


def axis_limits(stand: Stand, axis: Axis, t: Times, series: Series, load: Load) -> list[Limit]:
    """The limits of one axis; arguments as for :func:`axis_load`, with the stand."""
    p, v, acc = series
    unit, file = axis.unit, axis.file
    low, high = axis.travel
    end_distances = np.minimum(p - low, high - p)
    nearest = int(np.argmin(end_distances))
    nearest_end = low if p[nearest] - low < high - p[nearest] else high
    limits = [
        Limit(
            axis.name,
            "travel",
            unit,
            float(p[nearest]),
            nearest_end,
            100.0 * float(end_distances[nearest]) / (high - low),
            float(t[nearest]),
            _first_time(t, end_distances < -RELATIVE_ROUNDING * (high - low)),
        )
    ]
    assert file.speed is not None and file.acceleration is not None
    demands = [
        ("speed", f"{unit}/s", np.abs(v), np.full(len(t), file.speed)),
        ("acceleration", f"{unit}/s^2", np.abs(acc), np.full(len(t), file.acceleration)),
    ]
    max_step_rate = getattr(stand.controller_of(axis.name), "step_rate", None)
    if isinstance(axis.motor, Stepper) and max_step_rate is not None:
        rate = np.abs(v) * axis.counts_per_unit
        demands.append(("step rate", "steps/s", rate, np.full(len(t), max_step_rate)))
    if np.any(load.known):
        torque = np.where(load.known, np.abs(load.torque), 0.0)
        demands.append(("torque", "N m", torque, load.available))
    for quantity, demand_unit, demand, bound in demands:
        limits.append(_demand_limit(axis.name, quantity, demand_unit, t, demand, bound))
    if load.catches:
        worst = min(load.catches, key=lambda catch: catch.margin)
        broken = [catch.t for catch in load.catches if catch.margin < 0.0]
        limits.append(
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
    return limits


def _demand_limit(
    axis: str, quantity: str, unit: str, t: Array, demand: Array, bound: Array
) -> Limit:
    """The limit of a demand (T,) under a bound (T,)."""
    ratio = demand / np.maximum(bound, 1e-12 * max(1.0, float(np.max(bound))))
    worst = int(np.argmax(ratio))
    margin = 100.0 * (1.0 - min(float(ratio[worst]), MAX_RATIO))
    return Limit(
        axis,
        quantity,
        unit,
        float(demand[worst]),
        float(bound[worst]),
        margin,
        float(t[worst]),
        _first_time(t, demand > bound * (1.0 + RELATIVE_ROUNDING)),
    )


def _first_time(t: Array, broken: Mask) -> float | None:
    return float(t[np.argmax(broken)]) if np.any(broken) else None


def axis_torque(axis: Axis, series: Series, force: Array) -> Array:
    """(T,) torque of an axis' motor for the force (T,) on its load [N m]."""
    n, (_, v, acc) = axis.ratio, series
    load = force / n
    direction = np.sign(load * v)  # 1 where the motor drives its load
    gain = axis.file.efficiency**-direction
    torque = load * gain + axis.inertia * n * acc
    friction = axis.file.friction
    if friction is not None:
        w = n * v
        torque = torque + friction.viscous * w
        torque = torque + friction.coulomb * w / np.sqrt(w**2 + friction.speed**2)
    return np.asarray(torque)
