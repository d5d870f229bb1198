"""Inputs: the motion q_K(t) of the driven coordinates, and the forces u_D(t) of Eq. 8.

Driven coordinates are ends and lengths of strings and driven joints; v_K and acc_K are their
velocities and accelerations. Breaks are the times at which the polynomials of the motion meet, and
`coef` their coefficients. In names, D stands for dynamic coordinates, which move by the equations
of motion.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fantoccini.base import Array, ConfigK, MaskRows, Times, VecD, VecK, floats, polynomial
from fantoccini.base.documents import Mistakes
from fantoccini.motion import arrays, binding, channel, files, pieces, reading
from fantoccini.motion.arrays import InputArrays
from fantoccini.motion.channel import SAME_TIME, Channel
from fantoccini.motion.reading import Table

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable


_MAX_NAMES = 4
"""Number of names in ``repr``."""


@dataclass(frozen=True, eq=False, repr=False)
class Input:
    """Piecewise quintic motion of the driven coordinates, C^1 at the breaks.

    A scalar coordinate is q(t) = sum_k coef[..., k] (t - breaks[i])^k on piece i. The three
    entries of a rotation are its rotation vector phi(t): R(t) = R(base) exp([phi(t)]x), with the
    angular velocity w = J_r(phi) phidot in the turning frame. phi begins at 0 unless the piece was
    cut from a longer one. Before the first and after the last break everything is held at rest and
    the forces are 0.

    Attributes:
        coordinates: names and indices of the coordinates.
        breaks: (n_seg + 1,) increasing [s].
        coef: (n_seg, n_vK, 6) ascending powers of the time since the piece began [m or rad, s].
        base: (n_seg, n_qK) reference configuration: start value of a scalar [m or rad], unit
            quaternion of a rotation [1].
        named: (n_vK,) bool, coordinates that the user named; :meth:`bound` fills in the rest.
        force: (n_seg, n_vD, 6) generalised forces u_D [N or N m], or None.
        name: name of the performance.
    """

    coordinates: CoordinateTable
    breaks: Times
    coef: Array
    base: Array
    named: MaskRows
    force: Array | None = None
    name: str = ""

    def __post_init__(self) -> None:
        checked = arrays.checked_arrays(self.coordinates, self._arrays)
        for field, value in checked._asdict().items():
            object.__setattr__(self, field, value)

    def __repr__(self) -> str:
        slices = pieces.channel_names(self.coordinates)
        names = [name for name, (_, v) in slices.items() if self.named[v.start]]
        shown = ", ".join(names[:_MAX_NAMES]) + (", ..." if len(names) > _MAX_NAMES else "")
        name = f" {self.name!r}" if self.name else ""
        forces = "" if self.force is None else ", with forces"
        return (
            f"<Input{name}: {self.start:g} to {self.end:g} s, {shown or 'all hold still'}, "
            f"{len(self.coef)} piece{'s' * (len(self.coef) != 1)}{forces}>"
        )

    @property
    def start(self) -> float:
        """Time of the first break [s]."""
        return float(self.breaks[0])

    @property
    def end(self) -> float:
        """Time of the last break [s]."""
        return float(self.breaks[-1])

    @property
    def duration(self) -> float:
        """Time from the first to the last break [s]."""
        return self.end - self.start

    # -- constructors -----------------------------------------------------------------------

    @classmethod
    def hold(cls, table: Table, duration: float = 1.0) -> Input:
        """Constant inputs, at the start state's values.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            duration: [s] > 0; inputs are constant afterwards, too.
        """
        table = reading.table_of(table)
        try:
            duration = reading.number(duration)
        except ValueError as error:
            arrays.raise_input_error("duration", str(error))
        if not duration > 0:
            arrays.raise_input_error(
                "duration", f"is {duration}; it must be a positive number of seconds"
            )
        return cls(table, *pieces.on_common_breaks(table, {}, (0.0, duration)))

    @classmethod
    def waypoints(
        cls,
        table: Table,
        points: Mapping[str, Sequence[Any]],
        smooth: Literal["minimum-jerk"] = "minimum-jerk",
    ) -> Input:
        """A smooth motion through waypoints, without overshoot, at rest at both ends.

        ``Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})``. Two points give the
        minimum-jerk move; at the points between the acceleration is 0. A rotation
        (``bar.rotation``) is given by quaternions (w, x, y, z) or rotation vectors, and takes the
        shortest path.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            points: name -> list of (t [s], value [m, rad, or a rotation]).
            smooth: the kind of motion; there is one.
        """
        table, mistakes = reading.table_of(table), Mistakes.of_inputs()
        if smooth != "minimum-jerk":
            mistakes.add(("smooth",), f"is {smooth!r}; it must be 'minimum-jerk'")
        checked_points = reading.waypoints(table, points, mistakes)
        motion = cls.of_channels(table, pieces.through_waypoints(table, checked_points), mistakes)
        mistakes.raise_if_any()
        return motion

    @classmethod
    def samples(
        cls, table: Table, t: Times, columns: Mapping[str, Array], rest: bool = True
    ) -> Input:
        """Recorded motion: cubic splines through all samples.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            t: (n,) times [s], increasing.
            columns: name -> (n,) values [m or rad]; a rotation as (n, 4) under
                ``bar.rotation``, or as ``bar.qw`` ... ``bar.qz``.
            rest: the motion starts and ends at rest; otherwise the spline's ends are free, and the
                start state must have the velocity with which the samples begin.
        """
        table, mistakes = reading.table_of(table), Mistakes.of_inputs()
        checked_columns = reading.samples(table, t, columns, mistakes)
        motion = cls.of_channels(
            table, pieces.through_samples(table, checked_columns, rest), mistakes
        )
        mistakes.raise_if_any()
        return motion

    @classmethod
    def of_channels(
        cls, table: CoordinateTable, channels: Mapping[str, Channel], mistakes: Mistakes
    ) -> Input:
        """An input from channels on one clock; records lengths that reach 0 as mistakes."""
        motion = cls(table, *pieces.on_common_breaks(table, channels))
        binding.report_lengths(table, motion.breaks[None], motion.coef[None], mistakes)
        return motion

    @classmethod
    def segments(cls, table: Table, t: Times, q_K: Array, v_K: Array, acc_K: Array) -> Input:
        """Constant acceleration on every segment, as in plans.

        On a segment q = q_0 + v_0 s + acc s^2/2; a rotation's acc is that of its rotation vector,
        phi = w_0 s + acc s^2/2. The last velocity need not be 0. A run ends with a status where a
        length reaches 0.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            t: (n + 1,) times [s].
            q_K: (n_qK,) configuration at t[0], or (n, n_qK) at the start of every segment.
            v_K: (n_vK,) velocity at t[0], or (n, n_vK) at the start of every segment.
            acc_K: (n, n_vK) accelerations [m/s^2 or rad/s^2].

        Raises:
            InputError: an array has another shape, or segments with starts of their own do not
                join C^1.
        """
        table = reading.table_of(table)
        breaks_and_pieces = arrays.constant_acceleration(table, t, q_K, v_K, acc_K)
        motion = cls(table, *breaks_and_pieces, np.ones(table.n_vK, dtype=bool))
        # One piece cannot jump, and steppers make one for every step.
        return motion if len(motion.coef) == 1 else motion._without_jumps(Mistakes.of_inputs())

    @classmethod
    def load(cls, table: Table, path: str | Path) -> Input:
        """Reads an inputs file: YAML waypoints, CSV or npz samples, or a recording.

        A recording (:class:`fantoccini.theatre.Recording`) gives the motion of its hands;
        ``Recording.load(path)`` gives the winches and the start as well.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            path: the file; its ending (.yaml, .yml, .csv or .npz) gives the format.

        Raises:
            InputError: the file has mistakes; all are listed.
        """
        table = reading.table_of(table)
        contents = files.read_inputs(table, Path(path))
        if isinstance(contents, files.Segments):
            return cls.segments(table, contents.t, contents.q_K, contents.v_K, contents.acc_K)
        lengths = Mistakes.of_inputs()
        motion = cls.of_channels(table, contents.channels, lengths)
        contents.mistakes.findings += [
            ((*contents.place, *path_below), message) for path_below, message in lengths.findings
        ]
        contents.mistakes.raise_if_any()
        if contents.forces:
            motion = motion.with_force_points(contents.forces)
        if contents.duration is None:
            return motion
        # A file's clock starts at 0; the hand is at rest until the first waypoint.
        return (
            motion.with_rest_before(0.0).with_rest_until(contents.duration).with_name(contents.name)
        )

    # -- changing one ------------------------------------------------------------------------

    def with_forces(self, points: Mapping[str, Sequence[Any]]) -> Input:
        """The same motion with generalised forces u_D(t), piecewise linear in time, 0 outside.

        A time given twice is a step. The forces replace earlier ones.

        Args:
            points: name of a dynamic velocity -> list of (t [s], force [N or N m]).
        """
        mistakes = Mistakes.of_inputs()
        checked_points = reading.forces(self.coordinates, points, mistakes)
        mistakes.raise_if_any()
        return self.with_force_points(checked_points)

    def with_force_points(self, points: Mapping[str, channel.Points]) -> Input:
        """:meth:`with_forces` from arrays."""
        breaks = pieces.refined_breaks(self.breaks, [t for t, _ in points.values()])
        refined = self._on_breaks(breaks)
        force = np.zeros((len(breaks) - 1, self.coordinates.n_vD, polynomial.N_COEF))
        for name, (t, values) in points.items():
            column = self.coordinates.v_D.index(name)
            force[:, column] = channel.linear(pieces.snapped_to_breaks(t, breaks), values).on(
                breaks
            )[0][:, 0]
        return dataclasses.replace(refined, force=force)

    def shifted(self, dt: float) -> Input:
        """This input, ``dt`` seconds later."""
        return dataclasses.replace(self, breaks=self.breaks + float(floats(dt)))

    def with_name(self, name: str) -> Input:
        """This input with a name."""
        return dataclasses.replace(self, name=name)

    def with_rest_before(self, start: float) -> Input:
        """This input, preceded by rest from ``start`` [s] on."""
        start = float(floats(start))
        if start >= self.start - SAME_TIME:
            return self
        return self._on_breaks(np.concatenate([[start], self.breaks]))

    def with_rest_until(self, end: float) -> Input:
        """This input, followed by rest until ``end`` [s]."""
        end = float(floats(end))
        return self if end <= self.end + SAME_TIME else self._on_breaks(np.append(self.breaks, end))

    def then(self, *others: Input) -> Input:
        """This input, followed immediately by the others, whatever their times.

        A coordinate that only some of them name is at rest during the others.

        Raises:
            InputError: a position or velocity would jump where two of them meet.
            ValueError: they are of different puppets.
        """
        return Input.concatenate([self, *others])

    @staticmethod
    def concatenate(inputs: Sequence[Input]) -> Input:
        """The inputs one after another; the first keeps its times. See :meth:`then`."""
        for i, entry in enumerate(inputs):
            if not isinstance(entry, Input):
                raise TypeError(f"inputs[{i}] is a {type(entry).__name__}; it must be an Input")
        binding.check_same_puppet([entry.coordinates for entry in inputs])
        joined = inputs[0]
        for following in inputs[1:]:
            shifted = following.shifted(joined.end - following.start)
            before = joined._with_held(
                following.named & ~joined.named, following.evaluate(following.start)[0]
            )
            after = shifted._with_held(
                joined.named & ~following.named, joined.evaluate(joined.end)[0]
            )
            forces = [arrays.force_or_zero(x.coordinates, x._arrays) for x in (before, after)]
            has_force = before.force is not None or after.force is not None
            joined = Input(
                joined.coordinates,
                np.concatenate([before.breaks, after.breaks[1:]]),
                np.concatenate([before.coef, after.coef]),
                np.concatenate([before.base, after.base]),
                before.named | after.named,
                np.concatenate(forces) if has_force else None,
                joined.name,
            )
        return joined.checked()

    def bound(self, q_K: ConfigK, t: float | None = None, v_K: VecK | None = None) -> Input:
        """The input for a run from a start state: unnamed coordinates hold the state's values.

        Args:
            q_K: (n_qK,) driven configuration of the start state [m, rad or 1].
            t: time of the start state [s]; the first break when not given.
            v_K: (n_vK,) its driven velocity [m/s or rad/s]; the piece in which the run begins takes
                up small differences, see :mod:`fantoccini.motion.joints`.

        Raises:
            InputError: a named coordinate does not start where the state is.
        """
        t = self.start if t is None else float(t)
        q_inputs, v_inputs, _ = self.evaluate(t)
        coef, base = binding.bound(
            self.coordinates,
            self.breaks[None],
            self.coef[None],
            self.base[None],
            self.named[None],
            q_inputs[None],
            np.asarray(q_K, dtype=float)[None],
            t,
            None if v_K is None else (v_inputs[None], np.asarray(v_K, dtype=float)[None]),
        )
        return dataclasses.replace(self, coef=coef[0], base=base[0])

    # -- evaluation -------------------------------------------------------------------------

    def evaluate(self, t: float | Times) -> tuple[ConfigK, VecK, VecK]:
        """q_K, v_K, acc_K at given times; at a break, of the piece that begins there.

        Args:
            t: scalar or (...) times [s].

        Returns:
            q_K (..., n_qK), v_K (..., n_vK), acc_K (..., n_vK). Coordinates that the input does
            not name hold still where the run starts: q_K is NaN for them until
            ``inputs.bound(x0.q_K)`` sets it.
        """
        t = floats(t)
        i, s, outside = pieces.located(self.breaks, t.ravel())
        q, v, acc = pieces.evaluate(self.coordinates, self.coef[i], self.base[i], s)
        v[outside], acc[outside] = 0.0, 0.0
        q, v, acc = (x.reshape(*t.shape, x.shape[-1]) for x in (q, v, acc))
        return q, v, acc

    def evaluate_force(self, t: float | Times) -> VecD:
        """(..., n_vD) generalised forces u_D [N or N m] at given times [s]."""
        t = np.asarray(t, dtype=float)
        i, s, outside = pieces.located(self.breaks, t.ravel())
        force = arrays.force_or_zero(self.coordinates, self._arrays)
        u = polynomial.evaluate(force[i], s[:, None])[0]
        u[outside] = 0.0
        return u.reshape(*t.shape, u.shape[-1])

    def first_values(self) -> dict[str, float | list[float]]:
        """Values of the named coordinates at the first time, in the form of a state."""
        q_K, _, _ = self.evaluate(self.start)
        values = {}
        for name, (q, v) in pieces.channel_names(self.coordinates).items():
            if self.named[v.start]:
                rotation = name in self.coordinates.rotations
                values[name] = q_K[q].tolist() if rotation else float(q_K[q.start])
        return values

    def checked(self) -> Input:
        """This input, if it is C^1 and every named length stays positive.

        Small jumps are removed at the ends of pieces, see :mod:`fantoccini.motion.joints`.

        Raises:
            InputError: naming the coordinates and times where it jumps.
        """
        mistakes = Mistakes.of_inputs()
        binding.report_lengths(self.coordinates, self.breaks[None], self.coef[None], mistakes)
        return self._without_jumps(mistakes)

    def _without_jumps(self, mistakes: Mistakes) -> Input:
        """The same without small jumps; raises ``mistakes`` and larger jumps."""
        breaks, coef, base, named, _ = self._arrays
        coef = pieces.without_jumps(self.coordinates, breaks, coef, base, named, mistakes)
        mistakes.raise_if_any()
        return self if coef is self.coef else dataclasses.replace(self, coef=coef)

    def at_rest(self) -> Input:
        """This input with small velocities at both ends set to 0, by the tolerances of joints."""
        v = self.evaluate(np.array([self.start, self.end]))[1]
        coef = arrays.at_rest(self.coordinates, self.breaks, self.coef, v)
        return self if coef is self.coef else dataclasses.replace(self, coef=coef)

    # -- private -------------------------------------------------------------------------------

    @property
    def _arrays(self) -> InputArrays:
        return InputArrays(self.breaks, self.coef, self.base, self.named, self.force)

    def _on_breaks(self, breaks: Times) -> Input:
        """The same input on more breaks, which include its own."""
        end_configurations = self.evaluate(self.start)[0], self.evaluate(self.end)[0]
        refined = arrays.on_breaks(self.coordinates, self._arrays, end_configurations, breaks)
        return dataclasses.replace(self, **refined._asdict())

    def _with_held(self, mask: MaskRows, q_K: ConfigK) -> Input:
        """The same with the coordinates of ``mask`` (n_vK,) named and held at q_K."""
        filled = arrays.filled(self.coordinates, self._arrays, mask, q_K)
        return dataclasses.replace(self, **filled._asdict())
