"""Check of a run on a stand: travel, speed, acceleration, step rate and torque of every axis.

An axis at position p moves driven coordinates by its factors J (:mod:`fantoccini.stand.axes`). Its
motor turns by n per unit of position, at the speed w = n pdot, with the inertia J_m of everything
that turns with it, and needs

    torque = (F / n) e + J_m n pddot + viscous w + coulomb w / sqrt(w^2 + speed^2),   F = J^T f_K

f_K = M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda is the run's effort: strings, weight and inertia
of driven bodies. e = 1 / efficiency where the motor drives its load, efficiency where the load
drives it. The check assumes that winches follow exactly; a slipping one would change the motion.

A stand is the machine that moves a puppet, and an axis a motor with its gear and its drum, belt or
screw. The index K stands for driven coordinates (ends and lengths of strings), D for dynamic ones.
At a catch, a slack string becomes taut, with an impulse.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from fantoccini.base import Array, Mask, Status, Times
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import contact_effort
from fantoccini.dynamics.steppers import undetermined
from fantoccini.motion import Columns, Trajectory
from fantoccini.stand.axes import Axis, AxisMap, AxisMotion
from fantoccini.stand.catches import CatchImpulse, Impacts, impacts_of
from fantoccini.stand.limits import Limit, Load, axis_limits, axis_load
from fantoccini.stand.motors import Stepper
from fantoccini.stand.stand_file import Stand, load_stand
from fantoccini.stand.step_loss import LostSteps, lost_steps

CHECK_RATE = 1000.0
"""Rate of the times at which a run is checked, in addition to its own samples [1/s]."""
COARSE_SAMPLES = 0.02, 0.2
"""Time between samples [s], and change of a force between them relative to its largest value. If a
run exceeds both somewhere, peaks there may be missed."""

MAX_TIME_ROUNDING = 1e-9
"""Largest difference of times that count as equal [s]."""
INTERPOLATION_REACH = 3
"""Number of samples on either side on which an interpolated value depends."""
MIN_SMOOTH_SAMPLES = 3
"""Smallest number of samples for smooth interpolation; it is linear with fewer."""


@dataclass(frozen=True, eq=False)
class StandCheck:
    """Verdict on whether a stand can do a run; T samples, n axes.

    Attributes:
        map: map from the stand's axes to the puppet's driven coordinates.
        run: the checked run.
        marionette: the run's puppet.
        times: (T,) times of the check [s].
        limits: limits of every axis and quantity, in order.
        impacts: impacts of the run; None if it has none.
        catches: impulses of catches on axes.
        lost: axis -> steps that it loses, for steppers that lose some.
        unknown: (T, n) bool, when the motion does not determine the force of an axis; its torque
            and catches are not checked then.
        notes: remarks on the check itself.
    """

    map: AxisMap
    run: Trajectory
    marionette: Marionette
    times: Times
    limits: tuple[Limit, ...]
    impacts: Impacts | None
    catches: tuple[CatchImpulse, ...]
    lost: dict[str, LostSteps]
    unknown: Mask
    notes: tuple[str, ...]

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes."""
        return self.map.axes

    @cached_property
    def motion(self) -> AxisMotion:
        """Motion of the axes."""
        return self.map.motion_of(self.run, self.times)

    @cached_property
    def force(self) -> Array:
        """(T, n) F = J^T f_K of the axes on their loads [N or N m]."""
        return interpolate_smoothly(self.run.t, _forces(self.map, self.run), self.times)

    @cached_property
    def torque(self) -> Array:
        """(T, n) torques of the motors, positive towards growing positions [N m]."""
        return np.stack([load.torque for load in self._loads], axis=1)

    @cached_property
    def available(self) -> Array:
        """(T, n) the motors' largest torque at each time [N m]."""
        return np.stack([load.available for load in self._loads], axis=1)

    @cached_property
    def _loads(self) -> tuple[Load, ...]:
        return tuple(self._load(axis, k) for k, axis in enumerate(self.axes))

    def _load(self, axis: Axis, k: int) -> Load:
        series = self.motion.series_of_axis(axis.name)
        force, unknown = self.force[:, k], self.unknown[:, k]
        return axis_load(axis, k, self.times, series, force, self.impacts, unknown)

    @property
    def ok(self) -> bool:
        """Whether the stand can do the run: no limit is broken, and all forces are known."""
        return not self.broken and not self.undetermined

    @property
    def broken(self) -> tuple[Limit, ...]:
        """The broken limits, the earliest first."""
        broken = [limit for limit in self.limits if limit.broken is not None]
        return tuple(sorted(broken, key=lambda limit: limit.broken or 0.0))

    @property
    def first(self) -> Limit | None:
        """The limit that is broken first."""
        return self.broken[0] if self.broken else None

    @property
    def undetermined(self) -> dict[str, float]:
        """Axis -> first time at which the motion does not determine its force [s]."""
        return {
            axis.name: float(self.times[np.argmax(flags)])
            for axis, flags in zip(self.axes, self.unknown.T, strict=True)
            if np.any(flags)
        }

    @property
    def checked_torque(self) -> Array:
        """(T, n) magnitude of the torques that are checked; 0 where not determined [N m]."""
        return np.where(self.unknown, 0.0, np.abs(self.torque))

    @property
    def margin(self) -> float:
        """The smallest margin of all limits [%]."""
        return min(limit.margin for limit in self.limits)

    def limits_of_axis(self, axis: str) -> dict[str, Limit]:
        """The limits of an axis by quantity."""
        return {limit.quantity: limit for limit in self.limits if limit.axis == axis}

    def margin_text(self, axis: str, quantity: str) -> str:
        """The margin of an axis and quantity [%], with ``?`` if forces of the axis are unknown."""
        limit = self.limits_of_axis(axis).get(quantity)
        text = "" if limit is None else f"{limit.margin:.0f}"
        is_force = quantity in ("torque", "catch") and axis in self.undetermined
        return f"{text}?" if is_force else text

    def limits_with(self, k: int, axis: Axis) -> tuple[Limit, ...]:
        """The limits of axis ``k``, with another motor or transmission, for this motion."""
        series = self.motion.series_of_axis(axis.name)
        return tuple(axis_limits(self.map.stand, axis, self.times, series, self._load(axis, k)))

    def power(self) -> Array:
        """(T, n) power of the motors [W]."""
        n = np.array([axis.ratio for axis in self.axes])
        return np.asarray(self.torque * n * self.motion.velocity)

    def __repr__(self) -> str:
        verdict = "can" if self.ok else "cannot" if self.broken else "perhaps can"
        return f"<StandCheck: {self.map.stand.name} {verdict}, smallest margin {self.margin:.0f} %>"

    def summary(self) -> str:
        """The verdict in a sentence."""
        name, first = self.map.stand.name, self.first
        if first is None and self.undetermined:
            since, axes = min(self.undetermined.values()), ", ".join(self.undetermined)
            return (
                f"whether {name} can do it is not determined: from t = {since:.3f} s on, different "
                f"torques of {axes} give the same motion"
            )
        if first is None:
            worst = min(self.limits, key=lambda limit: limit.margin)
            return (
                f"{name} can do it: the smallest margin is {worst.margin:.0f} %, the "
                f"{worst.quantity} of {worst.axis} at t = {worst.t:.3f} s"
            )
        worst = min(self.broken, key=lambda limit: limit.margin)
        return (
            f"{name} cannot do it: at t = {first.broken:.3f} s the {first.quantity} of "
            f"{first.axis} is insufficient; at worst, at t = {worst.t:.3f} s, {worst} "
            f"({worst.excess_text} too much)"
        )


def check_stand(
    stand: Stand | str | os.PathLike[str], run: Trajectory, marionette: Marionette | None = None
) -> StandCheck:
    """Checks whether a stand can do a run.

    Args:
        stand: a stand, its file, or the name of a bundled one.
        run: run of a puppet whose driven coordinates follow their inputs exactly.
        marionette: the run's puppet; built from the run's own description by default.

    Raises:
        FileError: the stand does not fit the puppet, or its axes cannot make this motion.
        ValueError: the run does not contain its puppet and no marionette is given, or the given one
            has other coordinates.
    """
    if not isinstance(stand, Stand):
        stand = load_stand(stand)
    if marionette is None:
        if run.puppet is None:
            raise ValueError("the run does not contain its puppet; needed: its marionette")
        marionette = Marionette(run.puppet)
    elif (marionette.coordinates.q_D, marionette.coordinates.v_K) != (
        run.coordinates.q_D,
        run.coordinates.v_K,
    ):
        raise ValueError(f"the run is not of {marionette.name}: it has other coordinates")
    axis_map = AxisMap.from_stand(stand, run.coordinates)
    sampled_motion = axis_map.motion_of(run)
    if run.effort is None:
        run = with_effort(run, marionette)
    times = _check_times(run)
    forces = interpolate_smoothly(run.t, _forces(axis_map, run), times)
    impacts = impacts_of(axis_map, marionette, run)
    unknown = _undetermined_flags(axis_map, marionette, run, times)
    limits: list[Limit] = []
    catches: list[CatchImpulse] = []
    lost = {}
    # One axis after the other: arrays for all axes would need gigabytes for an hour's run.
    for k, axis in enumerate(axis_map.axes):
        series = sampled_motion.interpolated_axis(k, times)
        load = axis_load(axis, k, times, series, forces[:, k], impacts, unknown[:, k])
        limits += axis_limits(stand, axis, times, series, load)
        catches += load.catches
        lost_steps_of_axis = _steps_lost_by(axis, marionette, times, load)
        if lost_steps_of_axis is not None:
            lost[axis.name] = lost_steps_of_axis
    return StandCheck(
        axis_map,
        run,
        marionette,
        times,
        tuple(limits),
        impacts,
        tuple(sorted(catches, key=lambda catch: catch.t)),
        lost,
        unknown,
        _notes(run, marionette, axis_map, unknown),
    )


def _forces(axis_map: AxisMap, run: Trajectory) -> Array:
    """(T, n) forces of the axes on their loads at a run's samples [N or N m]."""
    assert run.effort is not None
    return axis_map.forces(run.effort.values)


def _undetermined_flags(
    axis_map: AxisMap, marionette: Marionette, run: Trajectory, times: Array
) -> Mask:
    """(len(times), n) bool, when the motion does not determine the force of an axis."""
    flags = run.undetermined
    if flags is None:
        flags = undetermined(marionette, run)
    flags_of_axes = flags.values[:, len(run.tension.names) :][:, axis_map.v]
    unknown = np.any(flags_of_axes[:, :, None] & (axis_map.J != 0.0), axis=1)
    near_unknown = np.array(unknown)
    for shift in range(1, INTERPOLATION_REACH + 1):
        near_unknown[shift:] |= unknown[:-shift]
        near_unknown[:-shift] |= unknown[shift:]
    repeated = run.t[1:] == run.t[:-1]
    unknown[1:][repeated] |= unknown[:-1][repeated]
    index = np.searchsorted(run.t, times, side="right") - 1
    is_sample = run.t[index] == times
    return np.where(is_sample[:, None], unknown[index], near_unknown[index])


def interpolate_smoothly(t: Array, values: Array, times: Array) -> Array:
    """Values (T, n) of a run at other times, interpolated smoothly (Akima) between impacts.

    At an impact, which is several samples at one time, the values are those after it.
    """
    interpolated = np.empty((len(times), values.shape[1]))
    impacts = np.flatnonzero(np.diff(t) <= 0.0) + 1
    for first, last in pairwise([0, *impacts, len(t)]):
        samples, stop = slice(first, last), len(times)
        if last < len(t):
            stop = int(np.searchsorted(times, t[last]))
        between_impacts = slice(int(np.searchsorted(times, t[first])), stop)
        if last - first < MIN_SMOOTH_SAMPLES:
            for k in range(values.shape[1]):
                interpolated[between_impacts, k] = np.interp(
                    times[between_impacts], t[samples], values[samples, k]
                )
        elif between_impacts.stop > between_impacts.start:
            interpolated[between_impacts] = Akima1DInterpolator(t[samples], values[samples])(
                times[between_impacts]
            )
    return interpolated


def with_effort(run: Trajectory, marionette: Marionette) -> Trajectory:
    """The run with its effort, the force on every driven coordinate."""
    force = marionette.effort(
        run.q_D, run.v_D, run.q_K, run.v_K, run.acc_D, run.acc_K, run.tension.values
    )
    if run.contact is not None:
        force = force + contact_effort(marionette, run.contact, run.q_D, run.q_K)
    columns = Columns(run.coordinates.v_K, force, "driven velocity")
    return dataclasses.replace(run, effort=columns)


def _check_times(run: Trajectory) -> Times:
    """Times at which a run is checked: its own samples, and evenly spaced ones between them."""
    n = max(2, round(run.duration * CHECK_RATE) + 1)
    even_times = np.linspace(run.t[0], run.t[-1], n)
    next_sample = np.clip(np.searchsorted(run.t, even_times), 1, len(run.t) - 1)
    distance = np.minimum(
        np.abs(run.t[next_sample] - even_times), np.abs(even_times - run.t[next_sample - 1])
    )
    return np.union1d(run.t, even_times[distance > MAX_TIME_ROUNDING])


def _steps_lost_by(
    axis: Axis, marionette: Marionette, times: Times, load: Load
) -> LostSteps | None:
    """Steps that the motor of an axis loses; None if it is no stepper, or its torque suffices."""
    if not isinstance(axis.motor, Stepper):
        return None
    puppet_inertia = marionette.mass / axis.ratio**2
    return lost_steps(
        axis.motor.steps,
        times,
        np.where(load.known, np.abs(load.torque), 0.0),
        load.available,
        axis.inertia + puppet_inertia,
        [catch.t for catch in load.catches if catch.margin < 0.0],
    )


def _notes(
    run: Trajectory, marionette: Marionette, axis_map: AxisMap, unknown: Mask
) -> tuple[str, ...]:
    notes = []
    axes = [a.name for a, flags in zip(axis_map.axes, unknown.T, strict=True) if np.any(flags)]
    if axes:
        share = 100.0 * float(np.max(np.mean(unknown, axis=0)))
        notes.append(
            f"the motion does not determine the forces of {', '.join(axes)} in up to {share:.3g} % "
            "of the run, because other tensions give the same motion: torques and catches are not "
            "checked there. Strings that stretch (--string-model chain), or fewer strings, have "
            "tensions that the motion determines"
        )
    assert run.effort is not None
    force, intervals = np.abs(run.effort.values), np.diff(run.t)
    change = np.max(np.abs(np.diff(force, axis=0)) / np.max(force, initial=1e-9), axis=1)
    coarse = np.flatnonzero((intervals > COARSE_SAMPLES[0]) & (change > COARSE_SAMPLES[1]))
    if len(coarse):
        notes.append(
            f"the run has samples {1e3 * np.max(intervals[coarse]):.0f} ms apart where its forces "
            f"change (at t = {run.t[coarse[0]]:.3f} s): peaks between them may be missed"
        )
    if run.contact is None and marionette.contacts is not None:
        notes.append(
            "the run has no contact points, like all runs of a batch: contact forces on driven "
            "bodies are left out, and forces shared by contacts and strings count as determined; "
            "check a run of `simulate` instead"
        )
    if run.status is not Status.DONE:
        notes.append(f"the run itself was not successful: {run.status.message}")
    if run.method != "event":
        notes.append(
            f"method {run.method}: catches are forces over one step, not separate impulses"
        )
    return tuple(notes)
