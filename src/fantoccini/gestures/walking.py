"""Rigid motions of all ends of a puppet's strings: walks that turn, and turns on the spot.

    z(t) = c + exp(i theta) (z_0 - z_c + i w) + z_c,   theta = turn s(t),
    c = L (exp(i theta) - 1) / (i turn),   L = steps step

z = x + i y is an end's place, z_c the middle between the shoulders' ends, w the sway. s(t) goes
from 0 to 1, at constant speed but for the first step and the last.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import Polynomial

from fantoccini.arrays import Array, Times
from fantoccini.errors import UnknownNameError
from fantoccini.gestures.gesture import Gesture, numbered
from fantoccini.motion import State, pieces, polynomial
from fantoccini.motion.findings import Findings
from fantoccini.tree import CoordinateTable

STEPS, STEP = 4, 0.06
"""Steps of a walk, and the length of one [m], where they are not given."""
STEP_TIME = 0.6
"""Duration of a step [s]."""
_LIFT = 0.06
"""How far a knee's string is wound in [m]."""
_BOB, _SWAY = 0.004, 0.006
"""How far the body goes up in a step, and to the side of the foot that stands [m]."""
_PARTS = 8
"""Pieces of a step, even: knees are highest in its middle."""
_MOST_STEPS, _LONGEST, _MOST_TURN = 1000, 1.0, 0.5 * np.pi
"""Bounds of steps: how many, their length [m] and how far one turns [rad]."""
_SIDES = ("left", "right")
BODY = ("head", "shoulder_left", "shoulder_right")
"""The strings that carry the body."""
_MINIMUM_JERK = Polynomial([0, 0, 0, 10, -15, 6])
_RAMP = Polynomial([0, 0, 0, 1, -0.5])

Curve = tuple[Array, Array, Array]
"""Values and their first and second derivatives by time."""


@dataclass
class Ends:
    """Ends of a puppet's strings: their places, and how they move.

    Attributes:
        table: of the puppet or scene.
        of: what stands before the strings' names: ``pierrot.``, or nothing.
        places: string -> x + i y of its end at the start [m].
        middle: between those of the shoulders [m].
        curves: driven coordinate -> offsets.
        turns: whether they turn.

    Args:
        start: where the puppet hangs.

    Raises:
        UnknownNameError: a string of the bundled marionette is missing.
    """

    table: CoordinateTable
    start: State
    of: str = ""
    places: dict[str, complex] = field(default_factory=dict, init=False)
    middle: complex = field(default=0j, init=False)
    curves: dict[str, Curve] = field(default_factory=dict, init=False)
    turns: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        known = pieces.channel_names(self.table)
        own = [name[len(self.of) :] for name in known if name.startswith(self.of)]
        owners = {name.rsplit(".", 1)[0] for name in own}
        for owner in (*BODY, "knee_left", "knee_right"):
            for part in ("x", "y", "length"):
                if f"{owner}.{part}" not in own:
                    raise UnknownNameError("driven coordinate", f"{self.of}{owner}.{part}", known)
        for owner in sorted(owners):
            if f"{owner}.x" in own and f"{owner}.y" in own and "." not in owner:
                x, y = (float(self.start[f"{self.of}{owner}.{part}"]) for part in "xy")
                self.places[owner] = complex(x, y)
        self.middle = 0.5 * (self.places["shoulder_left"] + self.places["shoulder_right"])

    def carry(self, along: float, turn: float, s: Curve, sway: Curve | None = None) -> None:
        """Carries all ends along an arc, and turns them with it [m, rad]."""
        self.turns = self.turns or turn != 0.0
        s0, s1, s2 = s
        w0, w1, w2 = sway if sway is not None else (0.0 * s0,) * 3
        e, q1, q2 = np.exp(1j * turn * s0), 1j * turn * s1, 1j * turn * s2
        way = along * ((e - 1.0) / (1j * turn) if abs(turn) > 1e-9 else s0)
        for name, place in self.places.items():
            arm = place - self.middle + 1j * w0
            speed = along * s1 + q1 * arm + 1j * w1
            change = along * s2 + q2 * arm + 2j * q1 * w1 + q1 * (along * s1 + q1 * arm) + 1j * w2
            moved = way + e * arm - (place - self.middle)
            for part, of in (("x", np.real), ("y", np.imag)):
                self.add(f"{name}.{part}", (of(moved), of(e * speed), of(e * change)))

    def add(self, name: str, curve: Curve) -> None:
        """Moves a coordinate, beside what it does already."""
        before = self.curves.get(name)
        if before is not None:
            curve = (before[0] + curve[0], before[1] + curve[1], before[2] + curve[2])
        self.curves[name] = curve

    def gesture(self, t: Times, name: str, marks: dict[str, float], travels: bool) -> Gesture:
        """What moves, as a gesture that has its breaks at the curves' times."""
        h, n = np.diff(t), self.table.n_vK
        coef, named = np.zeros((len(h), n, polynomial.N_COEF)), np.zeros(n, dtype=bool)
        travel, known = np.zeros(n), pieces.channel_names(self.table)
        for channel, curve in self.curves.items():
            v = known[self.of + channel][1].start
            d, rate, change = curve
            first, last = (d[:-1], rate[:-1], change[:-1]), (d[1:], rate[1:], change[1:])
            coef[:, v] = polynomial.hermite(h, first, last)
            named[v], travel[v] = True, curve[0][-1] if travels else 0.0
        return Gesture(self.table, t, coef, named, travel, name, marks, self.turns)


def walk(
    ends: Ends, findings: Findings, steps: int | None, step: float | None, turn: float | None
) -> Gesture:
    """Steps forward, in all turned by an angle; the left foot goes first.

    Args:
        ends: of the puppet's strings.
        findings: take mistakes.
        steps: how many; 4 when not given.
        step: length of each; below 0 backward; 6 cm when not given [m].
        turn: to the left, in all [rad].

    Raises:
        InputError: with every mistake.
    """
    n, length = STEPS if steps is None else steps, STEP if step is None else float(step)
    angle = 0.0 if turn is None else float(turn)
    if not isinstance(n, int) or isinstance(n, bool) or not 1 <= n <= _MOST_STEPS:
        findings.add(("steps",), f"found {n!r}; needed: a whole number from 1 to {_MOST_STEPS}")
    elif not abs(angle) <= n * _MOST_TURN:
        text = f"found {np.degrees(angle):g} deg in {n} steps; needed: at most 90 deg in each"
        findings.add(("turn",), text)
    if not abs(length) <= _LONGEST:
        findings.add(("step",), f"found {length:g} m; needed: at most {_LONGEST:g} m")
    findings.raise_any()
    clock = np.arange(n * _PARTS + 1) / _PARTS
    ups: list[Curve] = [_bump(clock - k) for k in range(n)]
    sway: Curve = _sum([times(_SWAY * (-1.0) ** (k + 1), up) for k, up in enumerate(ups)])
    ends.carry(n * length, angle, _phase(clock, n), sway)
    for name in BODY:
        ends.add(f"{name}.length", times(-_BOB, _sum(ups)))
    marks: dict[str, float] = {}
    for k, side in enumerate(_SIDES[:n]):
        ends.add(f"knee_{side}.length", times(-_LIFT, _sum(ups[k::2])))
    for k in range(n):
        marks[numbered(_SIDES[k % 2], marks)] = (k + 0.5) * STEP_TIME
    return ends.gesture(clock * STEP_TIME, "walk", marks, travels=True)


def there_and_back(way: float, hold: float, parts: int = 12) -> tuple[Times, Curve]:
    """From 0 to 1 in ``way`` seconds, there for ``hold``, and back: times and the curve."""
    s = np.linspace(0.0, 1.0, parts + 1)
    up = tuple(
        (_MINIMUM_JERK.deriv(k) if k else _MINIMUM_JERK)(s) / way**k for k in range(3)
    )
    t = np.concatenate([way * s, way + hold + way * s])
    signs = (1.0, -1.0, 1.0)
    one, two, three = (
        np.concatenate([x, sign * x[::-1]]) for x, sign in zip(up, signs, strict=True)
    )
    return t, (one, two, three)


def _phase(clock: Array, n: int) -> Curve:
    """s over time: a ramp in the first step and the last, and constant speed between them."""
    if n == 1:
        return _in_seconds(_MINIMUM_JERK, clock)
    speed = 1.0 / (n - 1)
    first, last = clock < 1.0, clock > n - 1.0
    start, even = _in_seconds(_RAMP, clock), _in_seconds(Polynomial([-0.5, 1.0]), clock)
    end = _in_seconds(n - 1.0 - _RAMP(Polynomial([float(n), -1.0])), clock)
    a, b, c = (
        speed * np.where(first, x, np.where(last, z, y))
        for x, y, z in zip(start, even, end, strict=True)
    )
    return a, b, c


def _bump(s: Array) -> Curve:
    """From 0 to 1 and back while s goes from 0 to 1."""
    up = _in_seconds(_MINIMUM_JERK(Polynomial([0.0, 2.0])), s)
    down = _in_seconds(_MINIMUM_JERK(Polynomial([2.0, -2.0])), s)
    inside, rises = (s > 0.0) & (s < 1.0), s < 0.5
    a, b, c = (
        np.where(inside, np.where(rises, x, y), 0.0) for x, y in zip(up, down, strict=True)
    )
    return a, b, c


def _in_seconds(p: Polynomial, s: Array) -> Curve:
    """A polynomial of steps and its derivatives by time."""
    return p(s), p.deriv()(s) / STEP_TIME, p.deriv(2)(s) / STEP_TIME**2


def times(factor: float, curve: Curve) -> Curve:
    """A curve with all its values multiplied."""
    return factor * curve[0], factor * curve[1], factor * curve[2]


def _sum(curves: list[Curve]) -> Curve:
    a, b, c = (np.sum(x, axis=0) for x in zip(*curves, strict=True))
    return a, b, c
