"""Remedies for a stand that cannot do a run: another ratio, another motor, smoother inputs.

They are computed for the run's motion. Each passes the whole check of its axis, because a smaller
drum also needs more steps per second and changes the catches. Numbers are rounded to the safe side.
Only a slower tempo changes the motion and is simulated again (:mod:`fantoccini.stand.tempo`).

A stand is the machine that moves a puppet, an axis one of its motors with its gear, and a catch the
impulse of a string that becomes taut.
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

TRIED_RATIOS = np.geomspace(0.25, 4.0, 241)
"""Tried factors of an axis' travel per turn."""
TORQUE_RESERVE = 1.0 / 0.9
"""Ratio of a suggested motor's torque to the required torque: a tenth of it is kept in reserve."""
MAX_PEAKS = 3
"""Maximum number of acceleration peaks that are named."""
MICROSTEP_OPTIONS = (256, 128, 64, 32, 16, 8, 4, 2, 1)
"""Microsteps per full step that stepper drivers offer."""
MOTOR_QUANTITIES = ("step rate", "torque", "catch")
"""Quantities that depend on motor and transmission."""
RELATIVE_ROUNDING = 1e-9
"""Relative rounding error of a number before it is rounded to the safe side."""
MIN_PEAK_INTERVAL = 0.1
"""Peaks closer than this count as one [s]."""
MAX_REST_SPEED = 0.005
"""Largest speed of a motor that counts as rest [turns/s]."""
LARGE_INERTIA_SHARE = 0.5
"""Share of the torque that accelerates the axis itself, above which smoother inputs help."""


def remedies(check: StandCheck) -> tuple[str, ...]:
    """Remedies, one line for each axis with a broken limit."""
    lines = []
    for k, axis in enumerate(check.axes):
        broken = {
            name
            for name, limit in check.limits_of_axis(axis.name).items()
            if limit.broken is not None
        }
        texts = []
        if "travel" in broken:
            texts.append(_travel_text(check, axis, k))
        if "speed" in broken:
            texts.append(_speed_text(check, axis))
        if "acceleration" in broken:
            texts.append(_smoother_text(check, axis, k))
        if broken.intersection(MOTOR_QUANTITIES):
            texts += _motor_remedies(check, axis, k, broken)
        if texts:
            lines.append(f"{axis.name}: {'; '.join(texts)}")
    return tuple(lines)


def lost_step_lines(check: StandCheck) -> tuple[str, ...]:
    """Sentences about lost steps, one for each stepper that loses some."""
    lines = []
    for name, lost in check.lost.items():
        count = f"at least {lost.steps} full steps" if lost.steps else "perhaps no step"
        lag = f"; it lags by up to {lost.lag:.3g} of them" if lost.lag > 0.1 else ""
        lines.append(f"{name} loses {count}, from t = {lost.since:.3f} s on{lag}")
    return tuple(lines)


def _travel_text(check: StandCheck, axis: Axis, k: int) -> str:
    position, unit = check.motion.position[:, k], axis.unit
    low, high = _round_down(np.min(position)), _round_up(np.max(position))
    return (
        f"a travel of at least [{low}, {high}] {unit}; it is "
        f"[{axis.travel[0]:g}, {axis.travel[1]:g}] {unit}"
    )


def _speed_text(check: StandCheck, axis: Axis) -> str:
    limit = check.limits_of_axis(axis.name)["speed"]
    return (
        f"a top speed of {_round_up(limit.value)} {limit.unit}, or a motion that takes at least "
        f"{_round_up(limit.value / limit.bound)} times as long"
    )


def _smoother_text(check: StandCheck, axis: Axis, k: int) -> str:
    limit = check.limits_of_axis(axis.name)["acceleration"]
    peaks = largest_peaks(check.motion.t, np.abs(check.motion.acceleration[:, k]))
    times = ", ".join(f"{t:.2f} s ({height:.3g} {limit.unit})" for t, height in peaks)
    return (
        f"smoother inputs where its acceleration peaks, at {times}; {limit.bound:g} "
        f"{limit.unit} are available, so a move there must take at least "
        f"{_round_up(np.sqrt(limit.value / limit.bound))} times as long"
    )


def _motor_remedies(check: StandCheck, axis: Axis, k: int, broken: set[str]) -> list[str]:
    """Demands on the motor and the controller, and other transmissions that meet them."""
    limits = check.limits_of_axis(axis.name)
    texts = []
    if "step rate" in broken:
        texts.append(f"a controller that generates {_round_up(limits['step rate'].value)} steps/s")
    if "torque" in broken:
        texts.append(_stronger_motor(check, axis, k))
    if "catch" in broken:
        texts.append(_catch_text(check, axis))
    alternatives = _alternative_texts(check, axis, k)
    texts += [f"or {text}" for text in alternatives]
    if "torque" in broken:
        if not alternatives:
            texts.append(f"no {VARIED_PARTS[axis.transmission.type]} makes this motor suffice")
        texts += _inertia_text(check, axis, k)
    return texts


def _stronger_motor(check: StandCheck, axis: Axis, k: int) -> str:
    demand, available = check.checked_torque[:, k], check.available[:, k]
    worst, largest = _worst_sample(check, k), int(np.argmax(demand))
    text = f"a motor with {_torque_text(check, axis, k, worst)}"
    if available[worst] > 0.0:
        factor = _round_up(demand[worst] / available[worst] * TORQUE_RESERVE, 3)
        text += f", {factor} times its torque at that speed"
    if demand[largest] > demand[worst] * (1.0 + RELATIVE_ROUNDING):
        text += f", and {_torque_text(check, axis, k, largest)}"
    return f"{text} (with a tenth in reserve)"


def _worst_sample(check: StandCheck, k: int) -> int:
    """The sample at which the torque exceeds the motor's by the largest factor."""
    demand, available = check.checked_torque[:, k], check.available[:, k]
    return int(np.argmax(np.where(demand > available, demand / np.maximum(available, 1e-9), 0.0)))


def _torque_text(check: StandCheck, axis: Axis, k: int, i: int) -> str:
    turns = abs(axis.ratio * check.motion.velocity[i, k]) / (2.0 * np.pi)
    when = "at rest" if turns < MAX_REST_SPEED else f"at {turns:.3g} turns/s"
    return f"{_round_up(abs(check.torque[i, k]) * TORQUE_RESERVE, 3)} N m {when}"


def _inertia_text(check: StandCheck, axis: Axis, k: int) -> list[str]:
    worst = _worst_sample(check, k)
    inertia_torque = axis.inertia * axis.ratio * abs(check.motion.acceleration[worst, k])
    demand = abs(check.torque[worst, k])
    if inertia_torque <= LARGE_INERTIA_SHARE * demand:
        return []
    share = 100.0 * inertia_torque / demand
    return [
        f"smoother inputs at {check.motion.t[worst]:.2f} s, where {share:.0f} % of the torque "
        "accelerates its own rotor and transmission"
    ]


def _catch_text(check: StandCheck, axis: Axis) -> str:
    limit = check.limits_of_axis(axis.name)["catch"]
    catches = [catch for catch in check.catches if catch.axis == axis.name]
    worst = min(catches, key=lambda catch: catch.margin)
    count = sum(catch.margin < 0.0 for catch in catches)
    return (
        f"softer catches of {', '.join(worst.strings)} ({count} are too hard, the worst at t = "
        f"{limit.t:.3f} s), a spring in the string, or a motor that withstands "
        f"{_round_up(limit.value, 3)} {limit.unit} then instead of {limit.bound:.3g}"
    )


# -- other transmissions and microsteps --------------------------------------------------------

VARIED_PARTS = {"drum": "drum", "belt": "pulley", "screw": "lead", "shaft": "gear"}
"""Transmission -> name of its part or number that is varied."""


@dataclass(frozen=True)
class Variant:
    """An axis with another number in its file: a radius, teeth, a lead or a gear."""

    number: float
    axis: Axis


def _alternative_texts(check: StandCheck, axis: Axis, k: int) -> list[str]:
    """Fewer microsteps, and other transmissions, that pass the whole check."""
    texts = []
    motors = _fewer_microsteps(check, axis)
    for motor in motors[1:]:
        if _passes(check, dataclasses.replace(axis, motor=motor), k):
            texts.append(_microsteps_text(axis, motor))
            break
    # Fewer microsteps only lower the step rate: if the fewest fail, all numbers fail.
    variants = _variants(dataclasses.replace(axis, motor=motors[-1]))
    passing = [i for i, other in enumerate(variants) if _passes(check, other.axis, k)]
    for motor in motors if passing else []:
        variant_range = _nearest_range(check, dataclasses.replace(axis, motor=motor), k, passing)
        if variant_range:
            text = _variant_text(axis, variant_range[0].number, variant_range[-1].number)
            texts.append(
                text if motor is axis.motor else f"{text} with {_microsteps_text(axis, motor)}"
            )
            break
    return texts


def _fewer_microsteps(check: StandCheck, axis: Axis) -> list[Motor]:
    """The axis' motor; then, if the step rate is bounded, with ever fewer microsteps."""
    motor = axis.motor
    if not isinstance(motor, Stepper) or "step rate" not in check.limits_of_axis(axis.name):
        return [motor]
    fewer = [n for n in MICROSTEP_OPTIONS if n < motor.microsteps]
    return [motor, *(motor.model_copy(update={"microsteps": n}) for n in fewer)]


def _microsteps_text(axis: Axis, motor: Motor) -> str:
    assert isinstance(axis.motor, Stepper) and isinstance(motor, Stepper)
    return f"{motor.microsteps} microsteps instead of {axis.motor.microsteps}"


def _passes(check: StandCheck, changed: Axis, k: int) -> bool:
    """Whether a changed axis keeps all limits that depend on its motor or transmission.

    A tenth of the torque is kept in reserve, or the present reserve if it is smaller and enough.
    """
    current_limits = check.limits_of_axis(changed.name)
    limits = {limit.quantity: limit for limit in check.limits_with(k, changed)}
    if any(limits[name].broken is not None for name in MOTOR_QUANTITIES if name in limits):
        return False
    return _keeps_reserve(limits.get("torque"), current_limits.get("torque"))


def _keeps_reserve(changed: Limit | None, current: Limit | None) -> bool:
    if changed is None or current is None:
        return True
    min_margin = 100.0 * (1.0 - 1.0 / TORQUE_RESERVE)
    if current.broken is None:
        min_margin = min(min_margin, current.margin)
    return changed.margin >= min_margin - 100.0 * RELATIVE_ROUNDING


def _nearest_range(check: StandCheck, axis: Axis, k: int, candidates: list[int]) -> list[Variant]:
    """Passing transmissions without a gap, in the range nearest to the axis' own number."""
    variants = _variants(axis)
    passing = {i for i in candidates if _passes(check, variants[i].axis, k)}
    if not passing:
        return []
    current_number = _changed_number(axis)
    nearest = min(passing, key=lambda i: abs(math.log(variants[i].number / current_number)))
    first = last = nearest
    while first - 1 in passing:
        first -= 1
    while last + 1 in passing:
        last += 1
    return variants[first : last + 1]


def _changed_number(axis: Axis) -> float:
    """The number of a transmission that is varied."""
    transmission = axis.transmission
    if isinstance(transmission, Drum):
        return transmission.travel_per_turn / (2.0 * math.pi)
    if isinstance(transmission, Belt):
        return float(transmission.teeth)
    return transmission.lead if isinstance(transmission, Screw) else axis.file.gear


def _variants(axis: Axis) -> list[Variant]:
    """The axis with other numbers, rounded as in the message, in increasing order."""
    transmission, current_number = axis.transmission, _changed_number(axis)
    if isinstance(transmission, Belt):
        fewest = max(4, math.ceil(TRIED_RATIOS[0] * current_number))
        largest = min(10_000, int(TRIED_RATIOS[-1] * current_number))
        return [_variant(axis, n, teeth=n) for n in range(fewest, largest + 1)]
    numbers = sorted({float(f"{current_number * ratio:.3g}") for ratio in TRIED_RATIOS.tolist()})
    if isinstance(transmission, Drum):
        return [_variant(axis, r, radius=r, diameter=None) for r in numbers]
    if isinstance(transmission, Screw):
        return [_variant(axis, lead, lead=lead) for lead in numbers]
    return [Variant(gear, with_axis(axis, gear=gear)) for gear in numbers]


def _variant(axis: Axis, number: float, **changes: Any) -> Variant:
    transmission = axis.transmission.model_copy(update=changes)
    return Variant(number, dataclasses.replace(axis, transmission=transmission))


def _variant_text(axis: Axis, low: float, high: float) -> str:
    """Suggestion of a transmission with a number from ``low`` to ``high``."""
    transmission, current_number = axis.transmission, _changed_number(axis)
    range_text = f"{low:g} to {high:g}" if high > low else f"{low:g}"
    if isinstance(transmission, Drum):
        size = (
            "smaller"
            if high < current_number
            else "larger"
            if low > current_number
            else "different"
        )
        return f"a {size} drum, radius {range_text} m instead of {current_number:.3g} m"
    if isinstance(transmission, Belt):
        return f"a pulley of {range_text} teeth instead of {transmission.teeth}"
    if isinstance(transmission, Screw):
        return f"a lead of {range_text} m instead of {transmission.lead:g} m"
    return f"a gear of {range_text} instead of {current_number:g}"


# -- numbers -------------------------------------------------------------------------------------


def _round_up(x: float, digits: int = 4) -> str:
    """A number rounded up to this many significant digits."""
    text = f"{x:.{digits}g}"
    if float(text) < x - RELATIVE_ROUNDING * abs(x):
        text = f"{x + 10.0 ** (math.floor(math.log10(abs(x))) - digits + 1):.{digits}g}"
    return text


def _round_down(x: float) -> str:
    """A number rounded down."""
    text = _round_up(-x)
    return text[1:] if text.startswith("-") else f"-{text}"


def largest_peaks(t: Array, heights: Array) -> list[tuple[float, float]]:
    """Times [s] and heights of the largest peaks of a curve (T,), in order of time."""
    remaining = np.array(heights)
    peaks = []
    for _ in range(MAX_PEAKS):
        i = int(np.argmax(remaining))
        if remaining[i] < 0.5 * np.max(heights) or remaining[i] <= 0.0:
            break
        peaks.append((float(t[i]), float(heights[i])))
        remaining[np.abs(t - t[i]) < MIN_PEAK_INTERVAL] = 0.0
    return sorted(peaks)
