"""One instant of a puppet, and what can happen at one."""

from __future__ import annotations

import dataclasses
import enum
from dataclasses import dataclass

from fantoccini.arrays import Array, ConfigD, ConfigK, MaskRows, VecD, VecK, frozen


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


@dataclass(frozen=True)
class Event:
    """A change of mode, or a point where the inputs may jump in acceleration.

    Attributes:
        t: time [s].
        kind: what happened. A winch that reaches its largest tension slips, and grips again.
        name: the string or limit; empty for a breakpoint or an accumulation.
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
