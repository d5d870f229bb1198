"""Axes of a stand bound to a puppet: the linear map from axis positions to driven coordinates.

    q_K = zero + J p,   v_K = J pdot,   acc_K = J pddot,   F = J^T f_K

p are the positions of the axes, J the factors under `moves` in the file, f_K the forces on the
driven coordinates (virtual work). J has full column rank, so that p follows from q_K. If axes are
coupled, with more coordinates than axes, the residual q_K - zero - J p of a motion shows whether
the stand can do it.

A stand is the machine that moves a puppet, and an axis a motor with its gear and its drum, belt or
screw. Driven coordinates q_K are ends and lengths of strings and driven joints, v_K and acc_K their
velocities and accelerations. In names, D stands for dynamic coordinates, which move by the
equations of motion.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, ShortRepr, Times, did_you_mean, interpolate
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import Input, Trajectory
from fantoccini.stand.axis_rank import factor_matrix, joined_names
from fantoccini.stand.motors import Motor, Shaft, Transmission
from fantoccini.stand.stand_file import AxisFile, Stand

MAX_RESIDUAL = 1e-4
"""Largest residual q_K - zero - J p of a motion that the stand can do [m or rad]."""
_CHUNK_SIZE = 50_000
"""Number of times at which axes are interpolated together."""
MAX_HELD_CHANGE = 1e-6
"""Largest change of a coordinate that counts as held [m or rad]."""


@dataclass(frozen=True)
class Axis:
    """An axis of a stand.

    Attributes:
        name: name of the axis.
        motor, transmission: its motor and transmission.
        file: its entry in the stand file.
    """

    name: str
    motor: Motor
    transmission: Transmission
    file: AxisFile

    @property
    def unit(self) -> str:
        """Unit of its position: m or rad."""
        return "rad" if isinstance(self.transmission, Shaft) else "m"

    @property
    def kind(self) -> str:
        """Kind of motor: stepper, dc or servo."""
        return self.motor.type

    @property
    def ratio(self) -> float:
        """Motor angle n > 0 per unit of the axis' position [rad/m or 1]."""
        return 2.0 * math.pi * self.file.gear / self.transmission.travel_per_turn

    @property
    def inertia(self) -> float:
        """Inertia of rotor, transmission and carried mass, at the motor [kg m^2]."""
        load = self.transmission.inertia / self.file.gear**2 + self.file.mass / self.ratio**2
        return self.motor.inertia + load

    @property
    def travel(self) -> tuple[float, float]:
        """Lowest and highest position [m or rad]."""
        assert self.file.travel is not None
        return self.file.travel

    @property
    def counts_per_unit(self) -> float:
        """Microsteps, or counts of the encoder, per unit of position [1/m or 1/rad]."""
        return self.motor.counts * self.ratio / (2.0 * math.pi)

    def counts_at(self, position: Array) -> Array:
        """(...) microsteps or counts of the motor at positions (...), rounded."""
        return np.asarray(self.direction * np.rint(position * self.counts_per_unit))

    @property
    def direction(self) -> int:
        """1, or -1 if the motor turns backwards as the position grows."""
        return -1 if self.file.reversed else 1


Series = tuple[Array, Array, Array]
"""(T,) position, velocity and acceleration of an axis [m or rad, per s, per s^2]."""


@dataclass(frozen=True, eq=False, repr=False)
class AxisMotion(ShortRepr):
    """Positions of all axes over time; T samples, n axes.

    Attributes:
        axes: the axes.
        t: (T,) times [s].
        position, velocity, acceleration: (T, n) [m or rad, per s, per s^2].
    """

    axes: tuple[Axis, ...]
    t: Times
    position: Array
    velocity: Array
    acceleration: Array

    def __len__(self) -> int:
        return len(self.t)

    def series_of_axis(self, name: str) -> Series:
        """(T,) position, velocity and acceleration of an axis."""
        k = [axis.name for axis in self.axes].index(name)
        return self.position[:, k], self.velocity[:, k], self.acceleration[:, k]

    def interpolated_axis(self, k: int, times: Times) -> Series:
        """(m,) position, velocity and acceleration of axis ``k`` at times, interpolated.

        At the time of an impact they are those after it.
        """
        samples = (
            self.position[:, k : k + 1],
            self.velocity[:, k : k + 1],
            self.acceleration[:, k : k + 1],
        )
        series = np.empty((3, len(times)))
        # In pieces: the interpolation takes ten times the memory of its result.
        for begin in range(0, len(times), _CHUNK_SIZE):
            chunk = slice(begin, begin + _CHUNK_SIZE)
            left, right, s = interpolate.bracket(self.t, times[chunk], "right")
            values = interpolate.motion(self.t, samples, ((0, 0),), (), left, right, s)
            series[:, chunk] = [value[:, 0] for value in values]
        return series[0], series[1], series[2]

    def of_axes(self, axes: tuple[Axis, ...]) -> AxisMotion:
        """The motion of some of the axes, in their order."""
        series = zip(*(self.series_of_axis(axis.name) for axis in axes), strict=True)
        position, velocity, acceleration = (np.stack(columns, axis=1) for columns in series)
        return AxisMotion(axes, self.t, position, velocity, acceleration)


@dataclass(frozen=True, eq=False, repr=False)
class AxisMap(ShortRepr):
    """The axes of a stand, and the driven coordinates that they move.

    Attributes:
        stand: the stand.
        axes: n axes, in the file's order.
        names: names of the m driven coordinates that they move.
        held: names of the driven coordinates that nothing moves.
        q, v: (m,) indices of the moved coordinates in q_K and v_K.
        held_q: indices of the held coordinates in q_K.
        J: (m, n) changes of the coordinates per unit of the axes' positions.
        zero: (m,) values of the coordinates when all axes are at 0 [m or rad].
    """

    stand: Stand
    axes: tuple[Axis, ...]
    names: tuple[str, ...]
    held: tuple[str, ...]
    q: Array
    v: Array
    held_q: Array
    J: Array
    zero: Array

    @classmethod
    def from_stand(cls, stand: Stand, coordinates: CoordinateTable) -> AxisMap:
        """Binds a stand to the driven coordinates of a puppet.

        Raises:
            FileError: a coordinate is not driven, or the coordinates do not determine the axes.
        """
        indices = {coordinates.v_K[v]: (q, v) for q, v in coordinates.scalars_K}
        mistakes: list[tuple[tuple[str | int, ...], str]] = []
        for axis, file in stand.axes.items():
            for name in file.moves:
                if name not in indices:
                    text = _not_driven(name, coordinates, indices)
                    mistakes.append((("axes", axis, "moves", name), text))
        for i, name in enumerate(stand.elsewhere):
            if name not in coordinates.q_K:
                mistakes.append((("elsewhere", i), _not_driven(name, coordinates, indices)))
        stand.raise_if_any(mistakes)
        names, J = factor_matrix({name: axis.moves for name, axis in stand.axes.items()})
        held = [name for name in coordinates.q_K if name not in {*names, *stand.elsewhere}]
        return cls(
            stand,
            axes_of(stand),
            names,
            tuple(held),
            np.array([indices[n][0] for n in names], dtype=np.intp),
            np.array([indices[n][1] for n in names], dtype=np.intp),
            np.array([coordinates.q_K.index(n) for n in held], dtype=np.intp),
            J,
            np.array([stand.zero.get(name, 0.0) for name in names]),
        )

    @cached_property
    def inverse(self) -> Array:
        """(n, m) pseudoinverse of J: p = inverse (q_K - zero)."""
        return np.asarray(np.linalg.pinv(self.J))

    def motion(self, t: Times, q_K: Array, v_K: Array, acc_K: Array) -> AxisMotion:
        """Motion of the axes that gives q_K (T, n_qK), v_K and acc_K (T, n_vK).

        Raises:
            FileError: the motion moves a coordinate without an axis, or coupled axes cannot do it.
        """
        q, v, acc = q_K[:, self.q] - self.zero, v_K[:, self.v], acc_K[:, self.v]
        mistakes = [*self._held_mistakes(t, q_K), *self._coupling_mistakes(t, q)]
        self.stand.raise_if_any(mistakes)
        p, pdot, pddot = (x @ self.inverse.T for x in (q, v, acc))
        return AxisMotion(self.axes, t, p, pdot, pddot)

    def motion_of(self, source: Trajectory | Input, times: Times | None = None) -> AxisMotion:
        """The axes' motion for a run or an input, at times [s]; at a run's samples by default."""
        if isinstance(source, Input):
            if times is None:
                raise ValueError("an input has no samples; needed: times")
            return self.motion(times, *source.evaluate(times))
        sampled_motion = self.motion(source.t, source.q_K, source.v_K, source.acc_K)
        if times is None:
            return sampled_motion
        columns = [sampled_motion.interpolated_axis(k, times) for k in range(len(self.axes))]
        p, v, acc = (np.stack(series, axis=1) for series in zip(*columns, strict=True))
        return AxisMotion(self.axes, times, p, v, acc)

    def check_held(self, t: Times, q_K: Array) -> None:
        """Raises a FileError if a motion (T, n_qK) moves a coordinate that no axis moves."""
        self.stand.raise_if_any(self._held_mistakes(t, q_K))

    def coordinates_of(self, position: Array) -> Array:
        """(..., m) driven coordinates [m or rad] at axis positions (..., n)."""
        return self.zero + position @ self.J.T

    def part(self, stand: Stand) -> AxisMap:
        """The map for a part of the stand, for :meth:`forces` only: not for motions."""
        names = [axis.name for axis in self.axes]
        J = self.J[:, [names.index(axis) for axis in stand.axes]]
        return dataclasses.replace(self, stand=stand, axes=axes_of(stand), J=J)

    def forces(self, effort: Array) -> Array:
        """(..., n) forces F = J^T f_K of the axes on their loads, for efforts f_K (..., n_vK)."""
        return effort[..., self.v] @ self.J

    def _held_mistakes(self, t: Times, q_K: Array) -> list[tuple[tuple[str | int, ...], str]]:
        """Mistakes of a motion that moves coordinates without an axis."""
        mistakes: list[tuple[tuple[str | int, ...], str]] = []
        for name, index in zip(self.held, self.held_q, strict=True):
            change = np.abs(q_K[:, index] - q_K[0, index])
            if np.max(change) > MAX_HELD_CHANGE:
                first_time = t[np.argmax(change > MAX_HELD_CHANGE)]
                text = (
                    f"no axis moves {name}, but the motion moves it from t = {first_time:.4g} s "
                    "on, by "
                    f"up to {np.max(change):.4g}; hold it still, let an axis move it, or list it "
                    "under `elsewhere` if another stand or a hand moves it"
                )
                mistakes.append((("axes",), text))
        return mistakes

    def _coupling_mistakes(self, t: Times, q: Array) -> list[tuple[tuple[str | int, ...], str]]:
        """The mistake of a motion that coupled axes cannot do."""
        residual = np.abs(q - q @ self.inverse.T @ self.J.T)
        if not residual.size or np.max(residual) <= MAX_RESIDUAL:
            return []
        sample, k = np.unravel_index(np.argmax(residual), residual.shape)
        axes = [axis.name for axis, factor in zip(self.axes, self.J[k], strict=True) if factor]
        text = (
            f"{joined_names(axes)} cannot move {self.names[k]} independently of their other "
            "coordinates; "
            f"at t = {t[sample]:.4g} s the motion needs {residual[sample, k]:.4g} more of it; "
            "check `zero`, or give it an axis of its own"
        )
        return [(("axes", axes[0], "moves"), text)]


def axes_of(stand: Stand) -> tuple[Axis, ...]:
    """The axes of a stand."""
    axes = []
    for name, file in stand.axes.items():
        assert file.motor is not None and file.transmission is not None
        axes.append(Axis(name, file.motor, file.transmission, file))
    return tuple(axes)


def with_axis(axis: Axis, **changes: object) -> Axis:
    """The axis with changed keys of its file, such as ``gear``."""
    return dataclasses.replace(axis, file=axis.file.model_copy(update=changes))


def _not_driven(
    name: str, coordinates: CoordinateTable, indices: dict[str, tuple[int, int]]
) -> str:
    """Reason why an axis cannot move a coordinate."""
    is_winch = name in coordinates.q_D and name.endswith(".length")
    if is_winch or name in coordinates.commands or name in coordinates.commands.values():
        return (
            f"{name} has a drive of its own in the puppet's file; a stand moves coordinates that "
            "follow their inputs exactly: remove the drive"
        )
    if name in coordinates.q_D:
        return f"{name} moves by forces, not by inputs; a stand moves driven coordinates"
    owner = name.split(".")[0]
    if any(rotation.startswith(f"{owner}.") for rotation in coordinates.rotations) and (
        name in coordinates.q_K or name in coordinates.v_K or name in coordinates.rotations
    ):
        return f"{name} is part of an orientation, which no axis moves; hold it still"
    return f"{name} is not a driven coordinate{did_you_mean(name, indices)}"
