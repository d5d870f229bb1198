"""Impulses on the axes when strings snap taut, and the largest that a stepper withstands.

At such a catch, with the driven coordinates moving as commanded (Eqs. 13-15), an axis receives

    P = J^T (M_KD dv_D + A_K^T Lambda)

In the run, the motor does not yield. A real motor yields and moves together with the bodies on the
string, whose mass at the axis is m_e = P^2 / sum(Lambda hdot). A stepper loses no steps if the
kinetic energy does not carry it past the maximum of its torque T sin(steps/4 angle), with the load
M:

    1/2 (P/n)^2 / (J_m + m_e / n^2) <= (4/steps) (2 T cos a - M (pi - 2 a)),   sin a = M / T

P is the impulse on the axis, a motor of the stand; M_KD is the inertia between driven and dynamic
coordinates, dv_D the jump of the dynamic velocities, Lambda the impulses of the strings, and A_K
the derivatives of their lengths by the driven coordinates. n is the angle of the motor per unit of
the axis, J_m its inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mask, Times
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import EventKind, Trajectory
from fantoccini.stand.axes import Axis, AxisMap
from fantoccini.stand.motors import Stepper

MIN_IMPULSE = 1e-9
"""Smallest impulse at the motor that counts as a catch [N m s]."""
MAX_IMPULSE_RATIO = 10.0
"""Largest ratio of impulse to bound in reports; the bound can be 0, at a motor's largest torque."""


@dataclass(frozen=True)
class CatchImpulse:
    """Impulse of a catch on an axis.

    Attributes:
        axis: name of the axis.
        t: time [s].
        strings: the strings that snapped taut.
        impulse: impulse at the motor [N m s].
        bound: largest impulse that the stepper withstands without losing steps [N m s].
        margin: margin of the impulse below the bound [%].
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
        impulse: (I, n) impulses P of the axes on their loads [N s or N m s].
        lost_energy: (I,) energy lost, sum(Lambda hdot) of the strings that snapped taut [J].
        strings: for every impact, the strings that snapped taut.
    """

    t: Array
    impulse: Array
    lost_energy: Array
    strings: tuple[tuple[str, ...], ...]


def impacts_of(axis_map: AxisMap, marionette: Marionette, run: Trajectory) -> Impacts | None:
    """The impacts of a run with method ``event`` that has catches; None for other runs.

    Args:
        axis_map: map from the axes of the stand to driven coordinates.
        marionette: the run's puppet.
        run: a run that has samples at its impacts.
    """
    catches = [e for e in run.events if e.impulse and e.kind is EventKind.CATCH]
    if run.method != "event" or not catches:
        return None
    times, impulses = impulses_of(run, marionette)
    lost_energy, strings = np.zeros(len(times)), [dict[str, None]() for _ in times]
    for event in catches:
        i = int(np.searchsorted(times, event.t))
        if i < len(times) and times[i] == event.t:
            lost_energy[i] += event.impulse * abs(event.speed)
            strings[i][event.name] = None
    return Impacts(
        times, impulses[:, axis_map.v] @ axis_map.J, lost_energy, tuple(map(tuple, strings))
    )


def catch_impulses(
    impacts: Impacts | None,
    axis: Axis,
    k: int,
    t: Times,
    velocity: Array,
    torque: Array,
    unknown: Mask,
) -> list[CatchImpulse]:
    """The catches that act on a stepper, in order; none for other motors.

    Args:
        impacts: impacts of the run.
        axis: the axis.
        k: index of the axis.
        t: (T,) times [s].
        velocity: (T,) velocities of the axis [m/s or rad/s].
        torque: (T,) torques of its motor [N m].
        unknown: (T,) bool, times at which the motion does not determine the torque; catches there
            are left out.
    """
    if impacts is None or not isinstance(axis.motor, Stepper):
        return []
    index = np.minimum(np.searchsorted(t, impacts.t), len(t) - 1)
    impulses = np.abs(impacts.impulse[:, k]) / axis.ratio
    indices = np.flatnonzero(
        (impulses > MIN_IMPULSE) & (impacts.lost_energy > 0.0) & ~unknown[index]
    )
    samples, impulse = index[indices], impulses[indices]
    speed = velocity[samples] * axis.ratio
    bounds = max_impulse(
        axis, np.abs(torque[samples]), speed, impulse**2 / impacts.lost_energy[indices]
    )
    margin = 100.0 * (1.0 - impulse / np.maximum(bounds, impulse / MAX_IMPULSE_RATIO))
    return [
        CatchImpulse(
            axis.name, float(impacts.t[i]), impacts.strings[i], float(p), float(bound), float(share)
        )
        for i, p, bound, share in zip(indices, impulse, bounds, margin, strict=True)
    ]


def impulses_of(run: Trajectory, marionette: Marionette) -> tuple[Array, Array]:
    """Times (I,) of a run's impacts, and their impulses on the driven coordinates (I, n_vK)."""
    coordinates = run.coordinates
    names = run.tension.names
    # An impact is several samples at one time: before is the first of them, after the last.
    times = np.unique(run.t[np.flatnonzero(np.diff(run.t) == 0.0)])
    sample_before = np.searchsorted(run.t, times, side="left")
    sample_after = np.searchsorted(run.t, times, side="right") - 1
    dv_D = run.v_D[sample_after] - run.v_D[sample_before]
    tension = np.zeros((len(times), len(names)))
    for event in run.events:
        i = int(np.searchsorted(times, event.t))
        if event.impulse and event.name in names and i < len(times) and times[i] == event.t:
            tension[i, names.index(event.name)] += event.impulse
    q_D, zero_dynamic = run.q_D[sample_after], np.zeros_like(dv_D)
    zero_driven = np.zeros((len(times), coordinates.n_vK))
    state = q_D, zero_dynamic, run.q_K[sample_after], zero_driven
    with_impulse = marionette.effort(*state, dv_D, zero_driven, tension)
    without_impulse = marionette.effort(*state, zero_dynamic, zero_driven, np.zeros_like(tension))
    return times, np.asarray(with_impulse - without_impulse)


def max_impulse(axis: Axis, load: Array, speed: Array, load_inertia: Array) -> Array:
    """(...) largest impulses that a stepper withstands without losing steps [N m s].

    Args:
        axis: the stepper's axis.
        load: (...) torques that the motor holds [N m].
        speed: (...) speeds of the motor [rad/s].
        load_inertia: (...) inertia at the motor of the bodies on the string [kg m^2].
    """
    motor = axis.motor
    assert isinstance(motor, Stepper)
    torque = np.maximum(motor.max_torque(speed, load), 1e-300)
    a = np.arcsin(np.minimum(load / torque, 1.0))
    energy = 4.0 / motor.steps * (2.0 * torque * np.cos(a) - load * (np.pi - 2.0 * a))
    max_energy = np.where(load < torque, np.maximum(energy, 0.0), 0.0)
    return np.asarray(np.sqrt(2.0 * (axis.inertia + load_inertia) * max_energy))
