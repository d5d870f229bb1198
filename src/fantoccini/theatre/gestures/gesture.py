"""Gestures: offsets of driven coordinates from the puppet's rest, over time.

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
from fantoccini.theatre.gestures.joining import Line, Motion
from fantoccini.theatre.gestures.own_axes import OwnAxes
from fantoccini.theatre.gestures.transitions import ACCELERATION, SAME, SPEED, Limit, limits
from fantoccini.theatre.gestures.turns import check_turns, end_shift, from_start, with_rotations

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
        bow = fan.theatre.Gesture.of(puppet, {"head.down": [(0, 0), (0.8, 0.1), (1.6, 0)]})
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
        turns: whether it turns the ends of all strings together; it is then neither scaled nor
            repeated, which would change the distances between the ends.
    """

    coordinates: CoordinateTable
    breaks: Times
    coef: Array
    named: MaskRows
    travel: VecK
    name: str = ""
    marks: Mapping[str, float] = field(default_factory=dict)
    turns: bool = False

    def __post_init__(self) -> None:
        n, k = len(self.breaks) - 1, self.coordinates.n_vK
        shapes = {"breaks": (n + 1,), "coef": (n, k, 6), "named": (k,), "travel": (k,)}
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
        called = f" {self.name!r}" if self.name else ""
        return f"<Gesture{called}: {self.duration:g} s, moves {', '.join(self.uses) or 'nothing'}>"

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.breaks[-1])

    @cached_property
    def uses(self) -> tuple[str, ...]:
        """Strings and joints whose coordinates it moves."""
        places = pieces.channel_names(self.coordinates)
        named = [name for name, (_, v) in places.items() if self.named[v.start]]
        return tuple(dict.fromkeys(name.rsplit(".", 1)[0] for name in named))

    @property
    def motion(self) -> Motion:
        """Arrays of the gesture."""
        return Motion(self.breaks, self.coef, self.named, self.travel)

    @property
    def ends(self) -> tuple[Array, Array]:
        """(2, n_vK) offsets and (2, n_vK) rates at its beginning and end."""
        both = [piecewise.at(self.breaks, self.coef, t) for t in (0.0, self.duration)]
        return np.array([d for d, _ in both]), np.array([rate for _, rate in both])

    def offsets(self, t: float) -> tuple[VecK, VecK]:
        """(n_vK,) offsets and (n_vK,) rates at a time [s], which is clipped to its duration."""
        return piecewise.at(self.breaks, self.coef, float(np.clip(t, 0.0, self.duration)))

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
    def of(
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
            StateError: see :meth:`of_offsets`.
            ValueError: nothing moves, or a mark is not within the gesture.
        """
        if not points:
            raise ValueError("points is empty; a gesture moves something")
        table, mistakes = reading.table_of(table), Mistakes.of_inputs()
        read = moves.read(table, points, mistakes)
        mistakes.raise_if_any()
        return cls.of_offsets(table, read, travels=travels, name=name, marks=marks)

    @classmethod
    def of_offsets(
        cls,
        table: CoordinateTable,
        offsets: Mapping[str, tuple[Times, Array]],
        *,
        travels: bool = False,
        name: str = "",
        marks: Mapping[str, float] | None = None,
    ) -> Gesture:
        """Gesture as in :meth:`of`, from arrays.

        Args:
            table: coordinate table.
            offsets: name as in :func:`moves.scalar_indices` -> times [s] and offsets.
            travels, name, marks: see :meth:`of`.

        Raises:
            TurnError: a driven body turns by nearly 180 degrees or more.
            StateError: it travels, and a driven body ends turned.
        """
        channels = with_rotations(table, pieces.through_waypoints(table, offsets))
        breaks, coef, _, named = pieces.on_common_breaks(table, channels, (0.0,))
        coef[:, ~named] = 0.0
        gesture = cls(table, breaks, coef, named, np.zeros(table.n_vK), name, dict(marks or {}))
        return replace(gesture, travel=end_shift(table, gesture.ends[0][1])) if travels else gesture

    @classmethod
    def of_input(cls, inputs: Input, *, travels: bool = False, name: str = "") -> Gesture:
        """Gesture that follows an input from its start: a recording, a plan or a search's result.

        Args:
            inputs: motion; ``recording.inputs`` of a live take, ``best.inputs`` of a search.
            travels, name: see :meth:`of`.

        Raises:
            StateError: a driven body turns by nearly 180 degrees, or the gesture travels and a
                driven body ends turned.
        """
        table, coef = inputs.coordinates, from_start(inputs, np.diff(inputs.breaks))
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
        if self.turns and factor != 1.0:
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

    def delayed(self, by: float) -> Gesture:
        """Copy that begins after a pause at its first offsets [s]."""
        check_positive(by=by)
        clock = np.append(0.0, self.breaks + by)
        return replace(
            self,
            breaks=clock,
            coef=piecewise.on(self.breaks + by, self.coef, clock),
            marks={name: t + by for name, t in self.marks.items()},
        )

    def moved(self, by: Mapping[str, float]) -> Gesture:
        """Copy with constant offsets added [m or rad].

        Args:
            by: offsets, by names as in :meth:`of`.

        Raises:
            InputError: the names have mistakes; all of them are listed.
        """
        mistakes = Mistakes.of_inputs()
        points = {name: [(0.0, offset)] for name, offset in by.items()}
        read = moves.read(self.coordinates, points, mistakes)
        mistakes.raise_if_any()
        coef, places = np.array(self.coef), moves.scalar_indices(self.coordinates)
        for name, (_, offsets) in read.items():
            coef[:, places[name], 0] += offsets[0]
        named = self.named | Gesture.of_offsets(self.coordinates, read).named
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
        axes, own = None, self
        if puppet is not None:
            axes = OwnAxes.moved_by(self.uses, puppet)
            own = replace(self, coordinates=axes.own, **axes.seen(self.motion)._asdict())
        coef, travel = np.zeros_like(own.coef), np.zeros_like(own.travel)
        named = np.zeros_like(own.named)
        for v, to, sign in moves.mirror_images(own.coordinates, own.named):
            coef[:, to] = sign[:, None] * own.coef[:, v]
            named[to], travel[to] = own.named[v], sign * own.travel[v]
        image = replace(own, coef=coef, named=named, travel=travel)
        return image if axes is None else image.placed(axes)

    def placed(self, axes: OwnAxes) -> Gesture:
        """Gesture of the puppet, from offsets along its own axes; see :meth:`OwnAxes.placed`."""
        return replace(self, coordinates=axes.coordinates, **axes.placed(self.motion)._asdict())

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
            a, b = self.coef[:, x], self.coef[:, y]
            coef[:, x], coef[:, y] = c * a - s * b, s * a + c * b
            a, b = self.travel[x], self.travel[y]
            travel[x], travel[y] = c * a - s * b, s * a + c * b
            named[[x, y]] = True
        return replace(self, coef=coef, travel=travel, named=named)

    def repeated(self, times: int, **options: Any) -> Gesture:
        """Copy repeated several times in a row; options are those of :meth:`then`.

        Raises:
            StateError: it turns; each repetition would need another heading.
        """
        if not isinstance(times, int) or times < 1:
            raise ValueError(f"times is {times!r}; it must be a whole number of at least 1")
        if self.turns and times > 1:
            raise StateError(f"{self.name} turns: each time it needs a heading of its own")
        return self.then(*[self] * (times - 1), **options) if times > 1 else self

    def then(
        self, *others: Gesture, speed: Limit = SPEED, acceleration: Limit = ACCELERATION
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
        line = Line.empty(limits(self.coordinates, speed, acceleration), *(x[0] for x in self.ends))
        marks: dict[str, float] = {}
        for gesture in (self, *others):
            line, start, _ = line.add(gesture.motion)
            for name, t in gesture.marks.items():
                marks[numbered(name, marks)] = start + t
        names = dict.fromkeys(gesture.name for gesture in (self, *others) if gesture.name)
        turns = any(gesture.turns for gesture in (self, *others))
        return Gesture(self.coordinates, *line.motion, ", ".join(names), marks, turns)

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
            marks[numbered(name, marks)] = t
        breaks, coef = piecewise.added((self.breaks, self.coef), (other.breaks, other.coef))
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
        self, x0: State, *, speed: Limit = SPEED, acceleration: Limit = ACCELERATION
    ) -> Input:
        """Input that begins at a state and is at rest at both ends.

        A gesture that begins away from rest is preceded by a transition, which delays all its
        times; one that ends in motion is followed by a stop.

        Args:
            x0: state at rest from which offsets count; the input begins at its time.
            speed, acceleration: see :meth:`then`.
        """
        still = Gesture.rest(self.coordinates, _REST_TIME, everything=False)
        whole, (offsets, rates) = self, self.ends
        if np.any(np.abs(offsets[0]) > SAME) or np.any(np.abs(rates[0]) > _MAX_REST_SPEED):
            whole = still.then(whole, speed=speed, acceleration=acceleration)
        if np.any(np.abs(rates[1]) > _MAX_REST_SPEED):
            whole = whole.then(still, speed=speed, acceleration=acceleration)
        table, coef = self.coordinates, np.array(whole.coef)
        base = np.tile(x0.q_K, (len(coef), 1))
        for q, v in table.scalars_K:
            coef[:, v, 0] += x0.q_K[q]
            base[:, q] = coef[:, v, 0]
        return Input(table, x0.t + whole.breaks, coef, base, whole.named, name=self.name).checked()


def numbered(name: str, taken: Mapping[str, float]) -> str:
    """The name, with the first free number if it is taken."""
    numbered_name, k = name, 2
    while numbered_name in taken:
        numbered_name, k = f"{name} {k}", k + 1
    return numbered_name
