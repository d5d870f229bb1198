"""Gestures: offsets d(t) of driven coordinates q_K, such as string ends and lengths, from rest.

    q_K(t) = q_K0 + d(t),   rotations: R(t) = R_0 exp([d(t)]x)

d(t) is a piecewise quintic, C^1 at its breaks. Coordinates that a gesture does not name stay free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import Array, MaskRows, StateError, Times, VecK, check_positive, frozen
from fantoccini.base.documents import Mistakes
from fantoccini.motion import SAME_TIME, Input, State, Table, binding, pieces, reading
from fantoccini.theatre.gestures import moves, piecewise
from fantoccini.theatre.gestures.joining import Motion, MotionSequence
from fantoccini.theatre.gestures.own_axes import OwnAxes
from fantoccini.theatre.gestures.transitions import (
    MAX_ACCELERATION,
    MAX_SPEED,
    OFFSET_TOLERANCE,
    MotionBound,
    motion_bounds,
)
from fantoccini.theatre.gestures.turns import (
    check_turns,
    end_shift,
    join_rotations,
    relative_to_start,
)

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.model.tree import CoordinateTable

_MAX_REST_SPEED = 1e-9
"""Speed below which a gesture is at rest [m/s or rad/s]."""
_REST_TIME = 0.02
"""Duration of rest before a gesture that begins in motion, and after one that ends so [s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Gesture:
    """Short motion of part of a puppet, relative to its rest.

    ::

        wave = fan.theatre.load_gesture(puppet, "wave")
        bow = fan.theatre.Gesture.from_points(puppet, {"head.down": [(0, 0), (0.8, 0.1), (1.6, 0)]})
        both = wave.mirrored().then(bow, bow.scaled(0.5).faster(1.5))
        run = fan.simulate(puppet, x0, both.inputs(x0))

    Attributes:
        coordinates: names and indices of the coordinates.
        breaks: (n + 1,) times, from 0 [s].
        coef: (n, n_vK, 6) offsets: ascending powers of the time since the piece began
            [m or rad, s].
        named: (n_vK,) bool, whether it moves a coordinate.
        travel: (n_vK,) part of its last offset that shifts the origin of later gestures, as after a
            walk [m or rad].
        name: name of the gesture.
        marks: name -> time within it [s], such as that at which a hand is up or a foot lands. In a
            row of gestures the second mark ``up`` is called ``up 2``, and so on.
        changes_heading: whether it turns the ends of all strings together; it is then neither
            scaled nor repeated, which would change the distances between the ends.
    """

    coordinates: CoordinateTable
    breaks: Times
    coef: Array
    named: MaskRows
    travel: VecK
    name: str = ""
    marks: Mapping[str, float] = field(default_factory=dict)
    changes_heading: bool = False

    def __post_init__(self) -> None:
        n, n_vK = len(self.breaks) - 1, self.coordinates.n_vK
        shapes = {"breaks": (n + 1,), "coef": (n, n_vK, 6), "named": (n_vK,), "travel": (n_vK,)}
        for name, shape in shapes.items():
            value = frozen(getattr(self, name), bool if name == "named" else float)
            if value.shape != shape:
                raise ValueError(f"{name} has the shape {value.shape}; it must be {shape}")
            object.__setattr__(self, name, value)
        if n < 1 or self.breaks[0] != 0.0 or not np.all(np.diff(self.breaks) > 0.0):
            raise ValueError("breaks must be two or more times that increase from 0")
        if not np.all(np.isfinite(self.coef)):
            raise ValueError("coef has a number that is not finite")
        check_turns(self.coordinates, self.breaks, self.coef)
        for name, t in self.marks.items():
            if not 0.0 <= t <= self.duration + SAME_TIME:
                raise ValueError(
                    f"the mark {name!r} is at {t:g} s; the gesture lasts {self.duration:g} s"
                )

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        return f"<Gesture{name}: {self.duration:g} s, moves {', '.join(self.uses) or 'nothing'}>"

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.breaks[-1])

    @cached_property
    def uses(self) -> tuple[str, ...]:
        """Strings and joints whose coordinates it moves."""
        channels = pieces.channel_names(self.coordinates)
        names = [name for name, (_, v) in channels.items() if self.named[v.start]]
        return tuple(dict.fromkeys(name.rsplit(".", 1)[0] for name in names))

    @property
    def motion(self) -> Motion:
        """Arrays of the gesture."""
        return Motion(self.breaks, self.coef, self.named, self.travel)

    @property
    def ends(self) -> tuple[Array, Array]:
        """(2, n_vK) offsets and (2, n_vK) rates at its beginning and end."""
        states = [self.offsets(t) for t in (0.0, self.duration)]
        return np.array([d for d, _ in states]), np.array([rate for _, rate in states])

    def offsets(self, t: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and (n_vK,) rates at a time [s], which is clipped to its duration."""
        return piecewise.evaluate(self.breaks, self.coef, float(np.clip(t, 0.0, self.duration)))

    @property
    def peaks(self) -> Array:
        """(2, n_vK) largest speeds, overestimated by at most about 1e-3, and accelerations."""
        return np.max(self.peaks_of_pieces, axis=0)

    @cached_property
    def peaks_of_pieces(self) -> Array:
        """(n, 2, n_vK) peaks of every piece."""
        return piecewise.peaks(self.breaks, self.coef)

    # -- constructors ------------------------------------------------------------------------

    @classmethod
    def from_points(
        cls,
        table: Table,
        points: Mapping[str, Sequence[Any]],
        *,
        travels: bool = False,
        name: str = "",
        marks: Mapping[str, float] | None = None,
    ) -> Gesture:
        """Gesture with smooth moves through offsets from time 0, at rest at both ends.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            points: moved name -> list of (t [s], offset [m, rad, or rotation vector]). A name is a
                driven coordinate (``hand_right.length``, ``bar.rotation``), or a string or driven
                body and a direction: ``.up`` and ``.down`` wind a string or lift a body,
                ``.forward``, ``.back``, ``.left`` and ``.right`` carry it along x and y, ``.out``
                and ``.in`` away from the middle and towards it, for names with left or right.
                ``.tip_forward``, ``.tip_back``, ``.roll_left``, ``.roll_right``, ``.turn_left`` and
                ``.turn_right`` are parts of a body's rotation vector.
            travels: whether the puppet is at its new place afterwards, as after a walk.
            name, marks: see the class.

        Raises:
            InputError: the points have mistakes; all of them are listed.
            StateError: see :meth:`from_offsets`.
            ValueError: nothing moves, or a mark is not within the gesture.
        """
        if not points:
            raise ValueError("points is empty; a gesture moves something")
        table, mistakes = reading.table_of(table), Mistakes.of_inputs()
        offsets = moves.read_offsets(table, points, mistakes)
        mistakes.raise_if_any()
        return cls.from_offsets(table, offsets, travels=travels, name=name, marks=marks)

    @classmethod
    def from_offsets(
        cls,
        table: CoordinateTable,
        offsets: Mapping[str, tuple[Times, Array]],
        *,
        travels: bool = False,
        name: str = "",
        marks: Mapping[str, float] | None = None,
    ) -> Gesture:
        """Gesture as in :meth:`from_points`, from arrays.

        Args:
            table: coordinate table.
            offsets: name as in :func:`moves.scalar_indices` -> times [s] and offsets.
            travels, name, marks: see :meth:`from_points`.

        Raises:
            TurnError: a driven body turns by nearly 180 degrees or more.
            StateError: it travels, and a driven body ends turned.
        """
        channels = join_rotations(table, pieces.through_waypoints(table, offsets))
        breaks, coef, _, named = pieces.on_common_breaks(table, channels, (0.0,))
        coef[:, ~named] = 0.0
        gesture = cls(table, breaks, coef, named, np.zeros(table.n_vK), name, dict(marks or {}))
        return replace(gesture, travel=end_shift(table, gesture.ends[0][1])) if travels else gesture

    @classmethod
    def from_input(cls, inputs: Input, *, travels: bool = False, name: str = "") -> Gesture:
        """Gesture that follows an input from its start: a recording, a plan or a search's result.

        Args:
            inputs: motion; ``recording.inputs`` of a live take, ``best.inputs`` of a search.
            travels, name: see :meth:`from_points`.

        Raises:
            StateError: a driven body turns by nearly 180 degrees, or the gesture travels and a
                driven body ends turned.
        """
        table, coef = inputs.coordinates, relative_to_start(inputs, np.diff(inputs.breaks))
        for _, v in table.scalars_K:
            coef[:, v, 0] -= coef[0, v, 0]
        coef[:, ~inputs.named] = 0.0
        breaks = inputs.breaks - inputs.breaks[0]
        gesture = cls(table, breaks, coef, inputs.named, np.zeros(table.n_vK), name or inputs.name)
        return replace(gesture, travel=end_shift(table, gesture.ends[0][1])) if travels else gesture

    @classmethod
    def rest(cls, table: Table, duration: float = 0.5, *, everything: bool = True) -> Gesture:
        """Gesture without motion; after other gestures it returns the puppet to rest.

        Args:
            table: a coordinate table, or anything with ``.coordinates``.
            duration: duration [s].
            everything: whether every coordinate returns to rest; otherwise all stay where they are.
        """
        check_positive(duration=duration)
        table = reading.table_of(table)
        coef = np.zeros((1, table.n_vK, 6))
        named = np.full(table.n_vK, everything)
        return cls(table, np.array([0.0, duration]), coef, named, coef[0, :, 0], "rest")

    # -- changed copies ----------------------------------------------------------------------

    def called(self, name: str) -> Gesture:
        """Copy with another name."""
        return replace(self, name=name)

    def scaled(self, factor: float) -> Gesture:
        """Copy with all offsets multiplied by a factor.

        Raises:
            StateError: it turns; for a larger turn give another ``turn`` or ``to``. Or a driven
                body would turn by nearly 180 degrees or more.
        """
        check_positive(factor=factor)
        if self.changes_heading and factor != 1.0:
            raise StateError(f"{self.name} turns, and cannot be scaled; give it another turn")
        return replace(self, coef=factor * self.coef, travel=factor * self.travel)

    def faster(self, factor: float) -> Gesture:
        """Copy that takes 1/factor of the time; below 1 it is slower."""
        check_positive(factor=factor)
        return replace(
            self,
            breaks=self.breaks / factor,
            coef=piecewise.faster(self.coef, factor),
            marks={name: t / factor for name, t in self.marks.items()},
        )

    def lasting(self, duration: float) -> Gesture:
        """Copy with another duration [s]."""
        check_positive(duration=duration)
        return self.faster(self.duration / duration)

    def delayed(self, pause: float) -> Gesture:
        """Copy that begins after a pause at its first offsets [s]."""
        check_positive(pause=pause)
        breaks = np.append(0.0, self.breaks + pause)
        return replace(
            self,
            breaks=breaks,
            coef=piecewise.refine(self.breaks + pause, self.coef, breaks),
            marks={name: t + pause for name, t in self.marks.items()},
        )

    def moved(self, shifts: Mapping[str, float]) -> Gesture:
        """Copy with constant offsets added [m or rad].

        Args:
            shifts: offsets, by names as in :meth:`from_points`.

        Raises:
            InputError: the names have mistakes; all of them are listed.
        """
        mistakes = Mistakes.of_inputs()
        points = {name: [(0.0, offset)] for name, offset in shifts.items()}
        waypoints = moves.read_offsets(self.coordinates, points, mistakes)
        mistakes.raise_if_any()
        coef, indices = np.array(self.coef), moves.scalar_indices(self.coordinates)
        for name, (_, offsets) in waypoints.items():
            coef[:, indices[name], 0] += offsets[0]
        named = self.named | Gesture.from_offsets(self.coordinates, waypoints).named
        return replace(self, coef=coef, named=named)

    def mirrored(self, puppet: Marionette | None = None) -> Gesture:
        """Reflection in the x-z plane: names with left and right are exchanged.

        Lengths, motions along x and z and joint angles keep their signs; motions along y and turns
        of bodies about x and z change theirs.

        Args:
            puppet: puppet or scene whose members' own axes x, y and z are: forward, to the left
                and up; those of the file by default.

        Raises:
            UnknownNameError: a coordinate has no twin.
            StateError: it moves a joint in the middle whose axis is neither along y nor across it,
                or its image would move an end along an axis that is not driven.
        """
        axes, gesture = None, self
        if puppet is not None:
            axes = OwnAxes.for_names(self.uses, puppet)
            motion = axes.to_own(self.motion)
            gesture = replace(self, coordinates=axes.own_table, **motion._asdict())
        coef, travel = np.zeros_like(gesture.coef), np.zeros_like(gesture.travel)
        named = np.zeros_like(gesture.named)
        for v, image_v, sign in moves.mirror_images(gesture.coordinates, gesture.named):
            coef[:, image_v] = sign[:, None] * gesture.coef[:, v]
            named[image_v], travel[image_v] = gesture.named[v], sign * gesture.travel[v]
        image = replace(gesture, coef=coef, named=named, travel=travel)
        return image if axes is None else image.in_driven_axes(axes)

    def in_driven_axes(self, axes: OwnAxes) -> Gesture:
        """Gesture of the puppet, from offsets along its own axes; see :meth:`OwnAxes.to_driven`."""
        return replace(self, coordinates=axes.coordinates, **axes.to_driven(self.motion)._asdict())

    def turned(self, angle: float) -> Gesture:
        """Copy turned about the vertical by an angle [rad], for a puppet that has turned.

        Driven bodies have turned with it, and all parts on them: their axes stay.

        Args:
            angle: angle to the left.

        Raises:
            StateError: it moves an end along x or y that is not driven along both.
        """
        coef, travel, named = np.array(self.coef), np.array(self.travel), np.array(self.named)
        c, s = np.cos(angle), np.sin(angle)
        for x, y in moves.xy_indices(self.coordinates, self.named):
            along_x, along_y = self.coef[:, x], self.coef[:, y]
            coef[:, x], coef[:, y] = c * along_x - s * along_y, s * along_x + c * along_y
            along_x, along_y = self.travel[x], self.travel[y]
            travel[x], travel[y] = c * along_x - s * along_y, s * along_x + c * along_y
            named[[x, y]] = True
        return replace(self, coef=coef, travel=travel, named=named)

    def repeated(self, count: int, **options: Any) -> Gesture:
        """Copy repeated several times in a row; options are those of :meth:`then`.

        Raises:
            StateError: it turns; each repetition would need another heading.
        """
        if not isinstance(count, int) or count < 1:
            raise ValueError(f"count is {count!r}; it must be a whole number of at least 1")
        if self.changes_heading and count > 1:
            raise StateError(f"{self.name} turns: each time it needs a heading of its own")
        return self.then(*[self] * (count - 1), **options) if count > 1 else self

    def then(
        self,
        *others: Gesture,
        speed: MotionBound = MAX_SPEED,
        acceleration: MotionBound = MAX_ACCELERATION,
    ) -> Gesture:
        """This gesture, then others, in one motion whose position and velocity are continuous.

        Where one ends at another place or speed than the next begins, a quintic joins them, as
        short as the bounds allow. Coordinates that the next one does not name stop, and stay where
        they are.

        Args:
            others: gestures of the same puppet.
            speed, acceleration: bounds of the transitions, for all [m/s, m/s^2; of turns 0.4 m from
                the axis], or by name [m/s, m/s^2, rad/s, rad/s^2]. They do not apply to the
                gestures: see :attr:`peaks`.

        Raises:
            ValueError: they are of different puppets, or a bound is not greater than 0.
        """
        binding.check_same_puppet([gesture.coordinates for gesture in (self, *others)])
        bounds = motion_bounds(self.coordinates, speed, acceleration)
        sequence = MotionSequence.empty(bounds, *(values[0] for values in self.ends))
        marks: dict[str, float] = {}
        for gesture in (self, *others):
            sequence, start, _ = sequence.add(gesture.motion)
            for name, t in gesture.marks.items():
                marks[numbered_mark(name, marks)] = start + t
        names = dict.fromkeys(gesture.name for gesture in (self, *others) if gesture.name)
        changes_heading = any(gesture.changes_heading for gesture in (self, *others))
        return Gesture(self.coordinates, *sequence.motion, ", ".join(names), marks, changes_heading)

    def __add__(self, other: Gesture) -> Gesture:
        """Sum of two gestures that begin together; the shorter one stays at its end.

        Turns of one body add as rotation vectors.

        Raises:
            ValueError: they are of different puppets.
            StateError: the shorter one ends in motion, or the sum turns a driven body by nearly
                180 degrees or more.
        """
        if not isinstance(other, Gesture):
            return NotImplemented
        binding.check_same_puppet([self.coordinates, other.coordinates])
        shorter = min(self, other, key=lambda gesture: gesture.duration)
        if self.duration != other.duration and np.max(np.abs(shorter.ends[1][1])) > _MAX_REST_SPEED:
            raise StateError(f"{shorter!r} ends in motion; what is added to it must end with it")
        marks = dict(self.marks)
        for name, t in other.marks.items():
            marks[numbered_mark(name, marks)] = t
        breaks, coef = piecewise.add((self.breaks, self.coef), (other.breaks, other.coef))
        return Gesture(
            self.coordinates,
            breaks,
            coef,
            self.named | other.named,
            self.travel + other.travel,
            " + ".join(gesture.name for gesture in (self, other) if gesture.name),
            marks,
        )

    # -- inputs ------------------------------------------------------------------------------

    def inputs(
        self,
        x0: State,
        *,
        speed: MotionBound = MAX_SPEED,
        acceleration: MotionBound = MAX_ACCELERATION,
    ) -> Input:
        """Input that begins at a state and is at rest at both ends.

        A gesture that begins away from rest is preceded by a transition, which delays all its
        times; one that ends in motion is followed by a stop.

        Args:
            x0: state at rest from which offsets count; the input begins at its time.
            speed, acceleration: see :meth:`then`.
        """
        rest = Gesture.rest(self.coordinates, _REST_TIME, everything=False)
        gesture, (offsets, rates) = self, self.ends
        if np.any(np.abs(offsets[0]) > OFFSET_TOLERANCE) or np.any(
            np.abs(rates[0]) > _MAX_REST_SPEED
        ):
            gesture = rest.then(gesture, speed=speed, acceleration=acceleration)
        if np.any(np.abs(rates[1]) > _MAX_REST_SPEED):
            gesture = gesture.then(rest, speed=speed, acceleration=acceleration)
        table, coef = self.coordinates, np.array(gesture.coef)
        base = np.tile(x0.q_K, (len(coef), 1))
        for q, v in table.scalars_K:
            coef[:, v, 0] += x0.q_K[q]
            base[:, q] = coef[:, v, 0]
        return Input(
            table, x0.t + gesture.breaks, coef, base, gesture.named, name=self.name
        ).checked()


def numbered_mark(name: str, taken: Mapping[str, float]) -> str:
    """The name, with the first free number if it is taken."""
    candidate, k = name, 2
    while candidate in taken:
        candidate, k = f"{name} {k}", k + 1
    return candidate
