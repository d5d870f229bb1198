"""One instant of a puppet, and what can happen at one."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows, VecD, VecK, frozen
from fantoccini.errors import StateError


@dataclass(frozen=True, eq=False)
class State:
    """Time, configuration, velocity and mode of a world. The arrays are read-only copies.

    Attributes:
        t: time [s].
        q_D: (n_qD,) dynamic configuration [rad, m or 1].
        v_D: (n_vD,) dynamic velocity [rad/s or m/s].
        q_K: (n_qK,) driven configuration [rad, m or 1].
        v_K: (n_vK,) driven velocity [rad/s or m/s].
        taut: (n_rows,) bool, rows that hold: strings, then limits.
        slip: (n_strings,) by how much slipping winches have let each string out, >= 0 [m]; empty
            for none.
    """

    t: float
    q_D: ConfigD
    v_D: VecD
    q_K: ConfigK
    v_K: VecK
    taut: MaskRows
    slip: Array = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", float(self.t))
        for name in ("q_D", "v_D", "q_K", "v_K", "slip"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "taut", frozen(self.taut, bool))

    def replace(self, **changes) -> State:
        """A copy with some fields changed: ``x.replace(t=0.0, v_D=v)``."""
        return dataclasses.replace(self, **changes)


@dataclass(frozen=True, eq=False)
class States:
    """States of one time side by side, n of them.

    Attributes:
        t: time [s].
        q_D, v_D, q_K, v_K: (n, ...) as of :class:`State`.
        slip: (n, n_strings) [m].
    """

    t: float
    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    slip: Array

    @classmethod
    def of(cls, states: Sequence[State], n_strings: int) -> States:
        """States with what winches have let out, for every string.

        Raises:
            ValueError: they are not of one time.
            StateError: a slip that is not a length >= 0 for each of the strings.
        """
        if any(x.t != states[0].t for x in states):
            raise ValueError("the states of a batch must be of one time: x.replace(t=...)")
        still, slips = np.zeros(n_strings), [x.slip for x in states]
        wrong = [x for x in slips if x.shape not in ((0,), (n_strings,))]
        slip = np.array([still if x.shape == (0,) else x for x in slips if not wrong])
        if wrong or not np.all(np.isfinite(slip) & (slip >= 0)):
            bad = wrong[0] if wrong else slip[~np.all(np.isfinite(slip) & (slip >= 0), axis=1)][0]
            raise StateError(
                f"slip: found {bad.tolist()}; it takes a length >= 0 for each of the {n_strings} "
                "strings, or nothing"
            )
        parts = (np.array([getattr(x, n) for x in states]) for n in ("q_D", "v_D", "q_K", "v_K"))
        return cls(states[0].t, *parts, slip.reshape(len(states), n_strings))

    def __len__(self) -> int:
        return len(self.q_D)

    def some(self, rows: slice) -> States:
        """Some of them."""
        parts = (getattr(self, name)[rows] for name in ("q_D", "v_D", "q_K", "v_K", "slip"))
        return States(self.t, *parts)


class EventKind(enum.StrEnum):
    """What happened at an event."""

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


@dataclass(frozen=True)
class Event:
    """A change of mode, or a point where the inputs may jump in acceleration.

    Attributes:
        t: time [s].
        kind: what happened. A winch that reaches its largest tension slips, and grips again. A
            stepper loses a step, a drive runs away.
        name: the string, limit or coordinate with a drive; empty for a breakpoint or an
            accumulation.
        impulse: of the catch, >= 0 [N s, or N m s for a limit of an angle].
        speed: hdot just before the catch, or with which a winch begins to slip [m/s or rad/s].
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
