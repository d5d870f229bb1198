"""Remedies for a stand that cannot do a run: another ratio, another motor, smoother inputs.

They are computed for the given motion, and must pass the whole check of the axis, because a smaller
drum also needs more steps a second and changes the catches. Numbers are rounded to the safe side.
Only a slower tempo changes the motion and is simulated again (:mod:`fantoccini.stand.tempo`).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array
from fantoccini.stand.axes import Axis, with_axis
from fantoccini.stand.check import StandCheck
from fantoccini.stand.limits import Limit
from fantoccini.stand.motors import Belt, Drum, Motor, Screw, Stepper

RATIOS = np.geomspace(0.25, 4.0, 241)
"""Factors of what a turn moves that are tried."""
SPARE = 1.0 / 0.9
"""Of the torque: a tenth of it is kept back."""
MAX_PEAKS = 3
"""Peaks of acceleration that are named."""
MICROSTEPS = (256, 128, 64, 32, 16, 8, 4, 2, 1)
"""Microsteps per full step that drivers of steppers have."""
_OF_MOTOR = ("step rate", "torque", "catch")
"""Quantities that another motor or transmission changes."""
_ROUNDING = 1e-9
"""Relative rounding error of a number before it is rounded to the safe side."""
_NEAR = 0.1
"""Peaks nearer than this are one [s]."""
_STILL = 0.005
"""Speed of a motor that counts as rest [turns/s]."""
_LARGE_SHARE = 0.5
"""Part of the torque that is the axis' own inertia, from which smoother inputs help."""


def remedies(check: StandCheck) -> tuple[str, ...]:
    """What would help, a line for each axis on which something is not enough."""
    lines = []
    for k, axis in enumerate(check.axes):
        broken = {name for name, limit in check.of(axis.name).items() if limit.broken is not None}
        found = []
        if "travel" in broken:
            found.append(_travel(check, axis, k))
        if "speed" in broken:
            found.append(_speed(check, axis))
        if "acceleration" in broken:
            found.append(_smoother(check, axis, k))
        if broken.intersection(_OF_MOTOR):
            found += _of_motor(check, axis, k, broken)
        if found:
            lines.append(f"{axis.name}: {'; '.join(found)}")
    return tuple(lines)


def lost_lines(check: StandCheck) -> tuple[str, ...]:
    """The steps that steppers lose, in words."""
    lines = []
    for name, lost in check.lost.items():
        count = f"at least {lost.steps} full steps" if lost.steps else "perhaps no step"
        how = f"; it lags by up to {lost.lag:.3g} of them" if lost.lag > 0.1 else ""
        lines.append(f"{name} loses {count}, from t = {lost.since:.3f} s on{how}")
    return tuple(lines)


def _travel(check: StandCheck, axis: Axis, k: int) -> str:
    p, unit = check.motion.position[:, k], axis.unit
    return (
        f"a travel of at least [{_down(np.min(p))}, {_up(np.max(p))}] {unit}; it is "
        f"[{axis.travel[0]:g}, {axis.travel[1]:g}] {unit}"
    )


def _speed(check: StandCheck, axis: Axis) -> str:
    limit = check.of(axis.name)["speed"]
    return (
        f"{_up(limit.value)} {limit.unit} of speed, or a path at least "
        f"{_up(limit.value / limit.bound)} times as long in time"
    )


def _smoother(check: StandCheck, axis: Axis, k: int) -> str:
    limit = check.of(axis.name)["acceleration"]
    peaks = peaks_of(check.motion.t, np.abs(check.motion.acceleration[:, k]))
    where = ", ".join(f"{t:.2f} s ({size:.3g} {limit.unit})" for t, size in peaks)
    return (
        f"smoother inputs where its acceleration peaks, at {where}; {limit.bound:g} "
        f"{limit.unit} are there, so that a move there must take at least "
        f"{_up(np.sqrt(limit.value / limit.bound))} times as long"
    )


def _of_motor(check: StandCheck, axis: Axis, k: int, broken: set[str]) -> list[str]:
    """Demands on the motor and the controller, and other transmissions that meet them."""
    limits = check.of(axis.name)
    found = []
    if "step rate" in broken:
        found.append(f"a controller that makes {_up(limits['step rate'].value)} steps/s")
    if "torque" in broken:
        found.append(_motor(check, axis, k))
    if "catch" in broken:
        found.append(_catch(check, axis))
    others = _alternatives(check, axis, k)
    found += [f"or {text}" for text in others]
    if "torque" in broken:
        if not others:
            found.append(f"no {_WORDS[axis.transmission.type]} makes this motor suffice")
        found += _own_inertia(check, axis, k)
    return found


def _motor(check: StandCheck, axis: Axis, k: int) -> str:
    demand, there = check.judged[:, k], check.available[:, k]
    i, most = _worst(check, k), int(np.argmax(demand))
    text = f"a motor with {_torque_at(check, axis, k, i)}"
    if there[i] > 0.0:
        text += f", {_up(demand[i] / there[i] * SPARE, 3)} times what it has there"
    if demand[most] > demand[i] * (1.0 + _ROUNDING):
        text += f", and {_torque_at(check, axis, k, most)}"
    return f"{text} (a tenth to spare)"


def _worst(check: StandCheck, k: int) -> int:
    """The sample at which the torque exceeds the motor's by the largest factor."""
    demand, there = check.judged[:, k], check.available[:, k]
    return int(np.argmax(np.where(demand > there, demand / np.maximum(there, 1e-9), 0.0)))


def _torque_at(check: StandCheck, axis: Axis, k: int, i: int) -> str:
    w = abs(axis.ratio * check.motion.velocity[i, k]) / (2.0 * np.pi)
    when = "at rest" if w < _STILL else f"at {w:.3g} turns/s"
    return f"{_up(abs(check.torque[i, k]) * SPARE, 3)} N m {when}"


def _own_inertia(check: StandCheck, axis: Axis, k: int) -> list[str]:
    i = _worst(check, k)
    own = axis.inertia * axis.ratio * abs(check.motion.acceleration[i, k])
    demand = abs(check.torque[i, k])
    if own <= _LARGE_SHARE * demand:
        return []
    return [
        f"smoother inputs at {check.motion.t[i]:.2f} s, where {100.0 * own / demand:.0f} % of the "
        "torque turn its own rotor and drum"
    ]


def _catch(check: StandCheck, axis: Axis) -> str:
    limit = check.of(axis.name)["catch"]
    worst = min((h for h in check.kicks if h.axis == axis.name), key=lambda h: h.margin)
    n = sum(h.axis == axis.name and h.margin < 0.0 for h in check.kicks)
    return (
        f"softer catches of {', '.join(worst.strings)} ({n} are too hard, the worst at t = "
        f"{limit.t:.3f} s), a spring in the string, or a motor that takes {_up(limit.value, 3)} "
        f"{limit.unit} there instead of {limit.bound:.3g}"
    )


# -- other transmissions and microsteps --------------------------------------------------------

_WORDS = {"drum": "drum", "belt": "pulley", "screw": "lead", "shaft": "gear"}
"""Transmission -> its part that is changed."""


@dataclass(frozen=True)
class _Other:
    """An axis with another number in its file: a radius, teeth, a lead or a gear."""

    number: float
    axis: Axis


def _alternatives(check: StandCheck, axis: Axis, k: int) -> list[str]:
    """Fewer microsteps, and another transmission, each of which passes the whole check."""
    found = []
    motors = _motors(check, axis)
    for motor in motors[1:]:
        if _passes(check, dataclasses.replace(axis, motor=motor), k):
            found.append(_microsteps(axis, motor))
            break
    # Fewer microsteps only lower the step rate: if the fewest fail, all numbers fail.
    last = _others(dataclasses.replace(axis, motor=motors[-1]))
    places = [i for i, other in enumerate(last) if _passes(check, other.axis, k)]
    for motor in motors if places else []:
        run = _nearest_run(check, dataclasses.replace(axis, motor=motor), k, places)
        if run:
            text = _in_words(axis, run[0].number, run[-1].number)
            found.append(text if motor is axis.motor else f"{text} with {_microsteps(axis, motor)}")
            break
    return found


def _motors(check: StandCheck, axis: Axis) -> list[Motor]:
    """The axis' motor, then with decreasing microsteps if the step rate is bounded."""
    own = axis.motor
    if not isinstance(own, Stepper) or "step rate" not in check.of(axis.name):
        return [own]
    fewer = [n for n in MICROSTEPS if n < own.microsteps]
    return [own, *(own.model_copy(update={"microsteps": n}) for n in fewer)]


def _microsteps(axis: Axis, motor: Motor) -> str:
    assert isinstance(axis.motor, Stepper) and isinstance(motor, Stepper)
    return f"{motor.microsteps} microsteps instead of {axis.motor.microsteps}"


def _passes(check: StandCheck, made: Axis, k: int) -> bool:
    """Whether a changed axis keeps all limits that depend on its motor or transmission.

    A tenth of the torque is kept in reserve, or the present reserve if that is smaller and holds.
    """
    now = check.of(made.name)
    limits = {limit.quantity: limit for limit in check.limits_with(k, made)}
    if any(limits[name].broken is not None for name in _OF_MOTOR if name in limits):
        return False
    return _has_spare(limits.get("torque"), now.get("torque"))


def _has_spare(made: Limit | None, now: Limit | None) -> bool:
    if made is None or now is None:
        return True
    least = 100.0 * (1.0 - 1.0 / SPARE)
    if now.broken is None:
        least = min(least, now.margin)
    return made.margin >= least - 100.0 * _ROUNDING


def _nearest_run(check: StandCheck, axis: Axis, k: int, places: list[int]) -> list[_Other]:
    """The contiguous range of transmissions that pass, nearest to the axis' own."""
    others = _others(axis)
    good = {i for i in places if _passes(check, others[i].axis, k)}
    if not good:
        return []
    own = _number(axis)
    near = min(good, key=lambda i: abs(math.log(others[i].number / own)))
    first = last = near
    while first - 1 in good:
        first -= 1
    while last + 1 in good:
        last += 1
    return others[first : last + 1]


def _number(axis: Axis) -> float:
    """The number of a transmission that is changed."""
    part = axis.transmission
    if isinstance(part, Drum):
        return part.way / (2.0 * math.pi)
    if isinstance(part, Belt):
        return float(part.teeth)
    return part.lead if isinstance(part, Screw) else axis.file.gear


def _others(axis: Axis) -> list[_Other]:
    """The axis with other numbers, rounded as in the message, in increasing order."""
    part, own = axis.transmission, _number(axis)
    if isinstance(part, Belt):
        least, most = max(4, math.ceil(RATIOS[0] * own)), min(10_000, int(RATIOS[-1] * own))
        return [_other(axis, n, teeth=n) for n in range(least, most + 1)]
    numbers = sorted({float(f"{own * ratio:.3g}") for ratio in RATIOS.tolist()})
    if isinstance(part, Drum):
        return [_other(axis, r, radius=r, diameter=None) for r in numbers]
    if isinstance(part, Screw):
        return [_other(axis, lead, lead=lead) for lead in numbers]
    return [_Other(gear, with_axis(axis, gear=gear)) for gear in numbers]


def _other(axis: Axis, number: float, **changes: Any) -> _Other:
    part = axis.transmission.model_copy(update=changes)
    return _Other(number, dataclasses.replace(axis, transmission=part))


def _in_words(axis: Axis, low: float, high: float) -> str:
    """A transmission with a number from ``low`` to ``high`` instead of its own."""
    part, own = axis.transmission, _number(axis)
    span = f"{low:g} to {high:g}" if high > low else f"{low:g}"
    if isinstance(part, Drum):
        which = "smaller" if high < own else "bigger" if low > own else "different"
        return f"a {which} drum, radius {span} m instead of {own:.3g} m"
    if isinstance(part, Belt):
        return f"a pulley of {span} teeth instead of {part.teeth}"
    if isinstance(part, Screw):
        return f"a lead of {span} m instead of {part.lead:g} m"
    return f"a gear of {span} instead of {own:g}"


# -- numbers -------------------------------------------------------------------------------------


def _up(x: float, digits: int = 4) -> str:
    """A number rounded up to the given digits."""
    text = f"{x:.{digits}g}"
    if float(text) < x - _ROUNDING * abs(x):
        text = f"{x + 10.0 ** (math.floor(math.log10(abs(x))) - digits + 1):.{digits}g}"
    return text


def _down(x: float) -> str:
    """A number rounded down."""
    text = _up(-x)
    return text[1:] if text.startswith("-") else f"-{text}"


def peaks_of(t: Array, size: Array) -> list[tuple[float, float]]:
    """The largest local maxima of a curve (T,), their times [s] and sizes."""
    left = np.array(size)
    found = []
    for _ in range(MAX_PEAKS):
        i = int(np.argmax(left))
        if left[i] < 0.5 * np.max(size) or left[i] <= 0.0:
            break
        found.append((float(t[i]), float(size[i])))
        left[np.abs(t - t[i]) < _NEAR] = 0.0
    return sorted(found)
