"""What would help a stand that cannot do a run: another ratio, another motor, smoother inputs.

All of it is computed for the motion as it is. Only a slower tempo changes the motion, which is
simulated again (:mod:`fantoccini.stand.tempo`).
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.stand.axes import Axis, with_axis
from fantoccini.stand.check import StandCheck, torque_of
from fantoccini.stand.motors import Belt, Drum, Screw, Stepper

RATIOS = np.geomspace(0.25, 4.0, 241)
"""Factors of what a turn moves that are tried."""
SPARE = 1.0 / 0.9
"""Of the torque: a tenth of it is kept back."""
MAX_PEAKS = 3
"""Peaks of acceleration that are named."""
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
        if "step rate" in broken:
            found.append(_microsteps(check, axis))
        if "acceleration" in broken:
            found.append(_smoother(check, axis, k))
        if "torque" in broken:
            found += _torque(check, axis, k)
        elif "catch" in broken:
            found.append(_catch(check, axis))
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
        f"a travel of at least [{np.min(p):.4g}, {np.max(p):.4g}] {unit}; it is "
        f"[{axis.travel[0]:g}, {axis.travel[1]:g}] {unit}"
    )


def _speed(check: StandCheck, axis: Axis) -> str:
    limit = check.of(axis.name)["speed"]
    longer = 1.0 - limit.margin / 100.0
    return f"{limit.value:.4g} {limit.unit} of speed, or a path {longer:.3g} times as long in time"


def _microsteps(check: StandCheck, axis: Axis) -> str:
    limit, motor = check.of(axis.name)["step rate"], axis.motor
    assert isinstance(motor, Stepper)
    fewer = int(motor.microsteps * limit.bound / limit.value)
    text = f"a controller that makes {limit.value:.4g} steps/s"
    return f"{text}, or {fewer} microsteps instead of {motor.microsteps}" if fewer else text


def _smoother(check: StandCheck, axis: Axis, k: int) -> str:
    limit = check.of(axis.name)["acceleration"]
    peaks = peaks_of(check.motion.t, np.abs(check.motion.acceleration[:, k]))
    where = ", ".join(f"{t:.2f} s ({size:.3g} {limit.unit})" for t, size in peaks)
    return (
        f"smoother inputs where its acceleration peaks, at {where}; {limit.bound:g} "
        f"{limit.unit} are there, so that a move there may take "
        f"{np.sqrt(1.0 - limit.margin / 100.0):.3g} times as long"
    )


def _torque(check: StandCheck, axis: Axis, k: int) -> list[str]:
    demand, there = np.abs(check.torque[:, k]), check.available[:, k]
    over = demand > there
    i = int(np.argmax(np.where(over, demand / np.maximum(there, 1e-9), 0.0)))
    w = abs(axis.ratio * check.motion.velocity[i, k]) / (2.0 * np.pi)
    factor = demand[i] / there[i] if there[i] > 0.0 else np.inf
    when = "at rest" if w < _STILL else f"at {w:.3g} turns/s"
    text = f"a motor with {demand[i] * SPARE:.3g} N m {when}"
    if np.isfinite(factor):
        text += f", {factor * SPARE:.3g} times what it has there"
    found = [f"{text} (a tenth to spare)"]
    good = [s for s in RATIOS if _turns_suffice(check, axis, k, float(s))]
    if good:
        near = min(good, key=lambda s: abs(np.log(s)))
        run = [s for s in good if (s > 1.0) == (near > 1.0)]
        found.append("or " + _of_ratio(axis, float(min(run)), float(max(run))))
    else:
        found.append("no drum, pulley or gear makes this motor suffice")
    own = axis.inertia * axis.ratio * np.abs(check.motion.acceleration[:, k])
    if own[i] > _LARGE_SHARE * demand[i]:
        found.append(
            f"smoother inputs at {check.motion.t[i]:.2f} s, where "
            f"{100.0 * own[i] / demand[i]:.0f} % of the torque turn its own rotor and drum"
        )
    return found


def _turns_suffice(check: StandCheck, axis: Axis, k: int, s: float) -> bool:
    """Whether the torque suffices, with a tenth to spare, where a turn moves s times as much."""
    made = with_axis(axis, gear=axis.file.gear / s)
    torque = torque_of(made, check.motion, check.force, k)
    w = made.ratio * check.motion.velocity[:, k]
    return bool(np.all(np.abs(torque) * SPARE <= made.motor.largest(w, torque)))


def _of_ratio(axis: Axis, low: float, high: float) -> str:
    """What to change so that a turn moves from ``low`` to ``high`` times as much."""
    part = axis.transmission
    if isinstance(part, Drum):
        r = part.way / (2.0 * np.pi)
        which = "smaller" if high < 1.0 else "bigger"
        return f"a {which} drum, radius {low * r:.3g} to {high * r:.3g} m instead of {r:.3g} m"
    if isinstance(part, Belt):
        return (
            f"a pulley of {int(np.ceil(low * part.teeth))} to {int(high * part.teeth)} teeth "
            f"instead of {part.teeth}"
        )
    if isinstance(part, Screw):
        return f"a lead of {low * part.lead:.3g} to {high * part.lead:.3g} m, not {part.lead:g} m"
    gear = axis.file.gear
    return f"a gear of {gear / high:.3g} to {gear / low:.3g} instead of {gear:g}"


def _catch(check: StandCheck, axis: Axis) -> str:
    limit = check.of(axis.name)["catch"]
    worst = min((h for h in check.kicks if h.axis == axis.name), key=lambda h: h.margin)
    n = sum(h.axis == axis.name and h.margin < 0.0 for h in check.kicks)
    return (
        f"softer catches of {', '.join(worst.strings)} ({n} are too hard, the worst "
        f"at t = {limit.t:.3f} s), a spring in the string, or a motor that takes "
        f"{-limit.margin + 100.0:.0f} % of this one's impulse"
    )


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
