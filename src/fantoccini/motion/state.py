"""States of a puppet, and events of a run.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings, driven
joints), v_D and v_K their velocities. The active set consists of the taut strings and closed
limits; slip is the length that a winch has let out.
"""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import (
    Array,
    ConfigD,
    ConfigK,
    MaskRows,
    ShortRepr,
    StateError,
    UnknownNameError,
    VecD,
    VecK,
    floats,
    frozen,
)

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

_MOTION_FIELDS = ("q_D", "v_D", "q_K", "v_K")
_MAX_NAMES = 8
"""Largest number of names in a message."""


@dataclass(frozen=True, eq=False)
class State:
    """Time, configuration, velocity and active set of a world. The arrays are read-only copies.

    ``x["elbow"]`` is a coordinate, ``x["v:elbow"]`` its velocity, ``x["bar.rotation"]`` a
    quaternion (w, x, y, z). States are equal if all their numbers and flags are.

    Attributes:
        t: time [s].
        q_D: (n_qD,) dynamic configuration [rad, m or 1].
        v_D: (n_vD,) dynamic velocity [rad/s or m/s].
        q_K: (n_qK,) driven configuration [rad, m or 1].
        v_K: (n_vK,) driven velocity [rad/s or m/s].
        taut: (n_rows,) bool, active set, strings before limits; all False if unknown.
        slip: (n_strings,) slip of each string's winch, >= 0 [m]; empty for no slip.
        coordinates: names and indices of the coordinates; None if unknown.

    Raises:
        StateError: a number is not finite.
    """

    t: float
    q_D: ConfigD
    v_D: VecD
    q_K: ConfigK
    v_K: VecK
    taut: MaskRows
    slip: Array = field(default_factory=lambda: np.zeros(0))
    coordinates: CoordinateTable | None = field(default=None, repr=False, compare=False)

    # Without this, Python would iterate over states by number.
    __iter__ = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", _finite_time(self.t))
        for name in (*_MOTION_FIELDS, "slip"):
            try:
                value = frozen(getattr(self, name))
            except (TypeError, ValueError) as error:
                raise StateError(f"{name}: {error}") from None
            if not np.isfinite(value).all():
                raise self._not_finite(name, value)
            object.__setattr__(self, name, value)
        object.__setattr__(self, "taut", frozen(self.taut, bool))

    @classmethod
    def of_sample(
        cls, sample: Array, indices: Mapping[str, slice | int], coordinates: CoordinateTable
    ) -> State:
        """The state in a sample of compiled code, at a fifth of the constructor's cost.

        Args:
            sample: (width,) numbers, which are copied.
            indices: indices of ``t``, ``q_D``, ``v_D``, ``q_K``, ``v_K``, ``taut`` and ``slip``.
            coordinates: names and indices of the coordinates.

        Raises:
            StateError: a number of the state is not finite.
        """
        values = frozen(sample)
        parts: dict[str, Any] = {name: values[indices[name]] for name in (*_MOTION_FIELDS, "slip")}
        t, taut = float(values[indices["t"]]), values[indices["taut"]] > 0
        if not np.isfinite(values).all():  # possibly a number outside of the state
            return cls(t, **parts, taut=taut, coordinates=coordinates)
        taut.setflags(write=False)
        state = object.__new__(cls)
        state.__dict__.update(parts, t=t, taut=taut, coordinates=coordinates)
        return state

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, State):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def __getitem__(self, name: str) -> float | Array:
        table = self.coordinates
        if table is None:
            raise StateError(
                f"this state has no names of coordinates; "
                f"write x.replace(coordinates=marionette.coordinates)[{name!r}]"
            )
        for names, values in ((table.q_D, self.q_D), (table.q_K, self.q_K)):
            if name in names:
                return float(values[names.index(name)])
            first_column = f"{str(name).removesuffix('rotation')}qw"
            if str(name).endswith(".rotation") and first_column in names:
                index = names.index(first_column)
                return values[index : index + 4]
        for names, values in ((table.v_D, self.v_D), (table.v_K, self.v_K)):
            if str(name).startswith("v:") and name[2:] in names:
                return float(values[names.index(name[2:])])
        raise UnknownNameError(
            "coordinate",
            str(name),
            (*table.q_D, *table.q_K, *(f"v:{n}" for n in (*table.v_D, *table.v_K))),
        )

    def replace(self, **changes: Any) -> State:
        """A copy with other fields: ``x.replace(t=0.0, v_D=v)``.

        The active set depends on the motion: if a configuration, velocity or slip changes, it is
        unknown in the copy, unless ``taut`` is given.
        """
        if changes.keys() == {"t"}:  # read-only arrays are shared
            copy = object.__new__(type(self))
            copy.__dict__.update(self.__dict__, t=_finite_time(changes["t"]))
            return copy
        motion_changed = any(
            name in changes and not np.array_equal(changes[name], getattr(self, name))
            for name in (*_MOTION_FIELDS, "slip")
        )
        if motion_changed:
            changes.setdefault("taut", np.zeros_like(self.taut))
        return dataclasses.replace(self, **changes)

    def _values(self) -> tuple[object, ...]:
        """The values that are compared; no slip equals a slip of 0."""
        slip = self.slip.tolist() if np.any(self.slip) else ()
        motion = (tuple(getattr(self, name).tolist()) for name in _MOTION_FIELDS)
        return self.t, *motion, tuple(self.taut.tolist()), tuple(slip)

    def _not_finite(self, name: str, value: Array) -> StateError:
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(value))[0])
        location = f"{name}[{', '.join(map(str, index))}]"
        names = None if self.coordinates is None else getattr(self.coordinates, name, None)
        if names is not None and len(names) == value.size:
            location += f" ({names[index[0]]})"
        return StateError(f"{location} is {value[index]}; a state holds finite numbers")


def _finite_time(t: float) -> float:
    try:
        time = t if type(t) is float else float(floats(t))  # arrays would slow down runs
    except (TypeError, ValueError):
        raise StateError(f"t is {t!r}; it must be a number of seconds") from None
    if not math.isfinite(time):
        raise StateError(f"t is {time}; a state holds finite numbers")
    return time


@dataclass(frozen=True, eq=False, repr=False)
class States(ShortRepr):
    """n states at one time, as arrays with a leading axis.

    Attributes:
        t: time [s].
        q_D, v_D, q_K, v_K: (n, ...) configurations and velocities, as in :class:`State`.
        taut: (n, n_rows) bool, active sets.
        slip: (n, n_strings) slips [m].
    """

    t: float
    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    taut: MaskRows
    slip: Array

    @classmethod
    def stack(
        cls, states: Sequence[State], table: CoordinateTable, n_strings: int, n_rows: int
    ) -> States:
        """Several states of one puppet; those without an active set or slip get zeros.

        Args:
            states: one or more states.
            table: coordinates of the puppet.
            n_strings, n_rows: number of its strings, and of its strings and limits.

        Raises:
            ValueError: the states have different times.
            StateError: a state is of another puppet, or its slip is not a length >= 0 for each
                string.
        """
        for state in states:
            check_size(state, table, n_rows)
        if any(state.t != states[0].t for state in states):
            raise ValueError("the states of a batch must have one time: x.replace(t=...)")
        no_slip, slips = np.zeros(n_strings), [state.slip for state in states]
        wrong_slips = [state for state in slips if state.shape not in ((0,), (n_strings,))]
        slip = np.array(
            [no_slip if state.shape == (0,) else state for state in slips if not wrong_slips]
        )
        if wrong_slips or not np.all(np.isfinite(slip) & (slip >= 0)):
            wrong_slip = (
                wrong_slips[0]
                if wrong_slips
                else slip[~np.all(np.isfinite(slip) & (slip >= 0), axis=1)][0]
            )
            raise StateError(
                f"slip: found {wrong_slip.tolist()}; needed: a length >= 0 for each of the "
                f"{n_strings} strings, or nothing"
            )
        q_D, v_D, q_K, v_K = (
            np.array([getattr(state, n) for state in states]) for n in _MOTION_FIELDS
        )
        unknown = np.zeros(n_rows, dtype=bool)
        taut = np.array([state.taut if len(state.taut) else unknown for state in states])
        return cls(states[0].t, q_D, v_D, q_K, v_K, taut, slip.reshape(len(states), n_strings))

    def __len__(self) -> int:
        return len(self.q_D)

    def repeated(self, n: int) -> States:
        """A single state, repeated n times."""
        parts = {name: getattr(self, name) for name in (*_MOTION_FIELDS, "taut", "slip")}
        return States(self.t, **{k: np.repeat(x, n, axis=0) for k, x in parts.items()})

    def subset(self, lanes: slice) -> States:
        """The states of a slice."""
        parts = {name: getattr(self, name)[lanes] for name in (*_MOTION_FIELDS, "taut", "slip")}
        return States(self.t, **parts)


def check_size(x: State, table: CoordinateTable, n_rows: int) -> None:
    """Raises StateError unless a state fits a puppet with these coordinates and rows."""
    if not isinstance(x, State):
        raise StateError(f"found {x!r}; needed: a state, such as marionette.rest()")
    if x.coordinates is not None and x.coordinates is not table:
        state_names, puppet_names = ((*t.q_D, *t.q_K) for t in (x.coordinates, table))
        if (x.coordinates.q_D, x.coordinates.q_K) != (table.q_D, table.q_K):
            raise StateError(
                f"the state is of another puppet: its coordinates are {_listed(state_names)}, "
                f"this puppet's {_listed(puppet_names)}"
            )
    lengths = tuple(len(getattr(x, name)) for name in _MOTION_FIELDS)
    sizes = table.n_qD, table.n_vD, table.n_qK, table.n_vK
    for name, n, n_needed in zip(_MOTION_FIELDS, lengths, sizes, strict=True):
        if n != n_needed:
            raise StateError(
                f"the state is of another puppet: its {name} has {n} numbers, this puppet's "
                f"{n_needed}"
            )
    if len(x.taut) not in (0, n_rows):
        raise StateError(
            f"the state's taut has {len(x.taut)} flags; this puppet has {n_rows} strings and limits"
        )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:_MAX_NAMES]) + (", ..." if len(names) > _MAX_NAMES else "")


class EventKind(enum.StrEnum):
    """Kind of an event.

    A winch that reaches its largest tension slips, and grips again. A stepper motor loses a step,
    a drive runs away.
    """

    CATCH = "catch"
    RELEASE = "release"
    LIMIT_ON = "limit_on"
    LIMIT_OFF = "limit_off"
    ACCUMULATION = "accumulation"
    BREAKPOINT = "breakpoint"
    SLIP = "slip"
    GRIP = "grip"
    LOST_STEP = "lost_step"
    RUNAWAY = "runaway"
    TOUCH = "touch"
    LIFT = "lift"
    STICK = "stick"
    SLIDE = "slide"


@dataclass(frozen=True)
class EventRecord:
    """An event of a run: a discrete change, or a point where the inputs' acceleration may jump.

    Attributes:
        t: time [s].
        kind: kind of the event.
        name: name of the string, limit or coordinate with a drive; for contact, of both parts
            (``foot|floor``); empty for a breakpoint or an accumulation.
        impulse: impulse of the catch, >= 0 [N s, or N m s for a limit of an angle].
        speed: hdot just before a catch, a touch or the slip of a winch [m/s or rad/s].
    """

    t: float
    kind: EventKind
    name: str = ""
    impulse: float = 0.0
    speed: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "kind", EventKind(self.kind))
        for name in ("t", "impulse", "speed"):
            object.__setattr__(self, name, float(getattr(self, name)))
