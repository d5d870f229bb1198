"""Gestures with props: handing over, putting down and picking up.

    q_K(t) = q_K0 + d(t)

Offsets are those of the bundled marionette, relative to where it hangs, so that they hold wherever
it stands and whichever way it faces. A prop hangs by a handle across a forearm; nothing ties it
there but friction. A handle is a stem and on it a bar whose ends are free: the arm lies under one
half, beside the stem, and comes and goes sideways, so that strings never pass the bar.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.gestures import Gesture
from fantoccini.gestures.ends import Ends
from fantoccini.gestures.stepping import STEP_TIME, Step
from fantoccini.gestures.walking import steps
from fantoccini.marionette import Marionette
from fantoccini.motion import State, pieces

Waypoints = list[tuple[float, float]]

_SIDES = {"right": "left", "left": "right"}
_BODY = ("head", "shoulder_left", "shoulder_right")
_HANDLE = (0.061, 0.089, 0.324)
"""Middle of the handle's bar on a forearm in the bundled pose: forward, to the arm's side, and
above the floor [m]."""

_ALONG = 0.061
"""The handle hangs so far from the elbow along the forearm [m]."""
_HELD = {"forward": 0.2, "in": 0.065, "up": 0.03}
_HELD_ELBOW, _HELD_FOREARM = (0.0431, 0.073), (0.986, 0.003)
"""What moves the hand's string to hold something out; elbow and direction of the forearm then."""
_TAKES, _TAKEN = 0.09, (0.083, 0.068)
"""Inward, the string of the receiver's hand; middle of the forearm then: forward, aside [m]."""
_LOW, _LIFTED, _SUNK = -0.028, 0.036, -0.058
"""Up: the receiver's hand before it takes, when it has taken; the giver's when it gives [m]."""
_BESIDE, _STEP = 0.051, 0.24
"""Distance of the two forearms, and the receiver's step to the side [m]."""

_CARRIED = {"out": 0.1, "up": 0.035}
"""What moves the hand's string to hold a prop away from the knees [m]."""
CARRY_TIME = 1.5
"""Duration of what takes up that pose [s]."""

_LOWEST = 0.075
"""Farthest way of a prop down: below that the thighs would push it [m]."""
_STANDS = (0.173, 0.061)
"""Where a prop stands that was put down: forward, and to the arm's side [m]."""
_LEAVES = 0.125
"""Way to the side on which the arm comes out from under the bar [m]."""
_OVERTRAVEL = 0.024
"""Way down beyond the surface: the arm that reaches forward lifts the prop by so much [m]."""


@dataclass(frozen=True)
class Handing:
    """A prop goes from one puppet's forearm to another's.

    Attributes:
        giver, receiver: their gestures, from a common start. The giver's has the marks ``offered``
            and ``released``, the receiver's ``under`` and ``taken``.
        forward, left: where the receiver stands, seen from the giver [m].
        touching: pairs of bodies that may touch.
        turned: how far the receiver's heading is from the giver's [rad].
    """

    giver: Gesture
    receiver: Gesture
    forward: float
    left: float
    touching: tuple[tuple[str, str], ...]
    turned: float

    def place(self, x: float, y: float, heading: float) -> tuple[float, float, float]:
        """Place [m] and heading [rad] of the receiver for those of the giver."""
        c, s = float(np.cos(heading)), float(np.sin(heading))
        return (
            x + c * self.forward - s * self.left,
            y + s * self.forward + c * self.left,
            heading + self.turned,
        )


@dataclass(frozen=True)
class Putting:
    """A prop comes to stand on something, or is taken from it.

    Attributes:
        gesture: marks ``down`` and ``free``, or ``under`` and ``up``.
        forward, left: where the prop stands, seen from the puppet [m].
        touching: pairs of bodies that may touch.
    """

    gesture: Gesture
    forward: float
    left: float
    touching: tuple[tuple[str, str], ...]


def handle_place(side: str = "right", *, raised: float = 0.0) -> tuple[float, float, float]:
    """Where a handle's middle hangs on a forearm: forward, left and up from the puppet's place [m].

    Args:
        side: of the forearm.
        raised: height of the puppet above its bundled pose [m].

    Raises:
        ValueError: the side is neither left nor right.
    """
    forward, aside, up = _HANDLE
    return forward, _sign(side) * aside, up + raised


def give(
    stage: Marionette, giver: str, receiver: str, prop: str, *, side: str = "right",
    along: float | None = None, carried: bool = False,
) -> Handing:  # fmt: skip
    """The gestures by which a prop changes from one puppet's forearm to another's.

    They stand side by side and face the same way. The giver holds it out; the receiver steps aside
    to it with its forearm under the outer half of the bar, lifts it, and steps back with it when
    the giver's arm has sunk. No string passes the bar. It takes 13.8 s. Both hang as before
    afterwards; the stem is again on the outer side of the arm that holds it.

    Args:
        stage: the scene.
        giver, receiver: its members.
        prop: which hangs by its handle on the giver's forearm, the stem on its outer side.
        side: of the giver's forearm; the receiver takes with the other.
        along: how far from the elbow it hangs there: :func:`along_forearm` [m].
        carried: whether the giver is in the pose of :func:`carry`.

    Raises:
        InputError: the members have other strings than the bundled marionette.
        ValueError: the side is neither left nor right.
    """
    other, held = _SIDES[side], _HELD
    begins = _CARRIED if carried else {"up": 0.0, "out": 0.0}
    gives: dict[str, Waypoints] = {
        f"hand_{side}.up": [
            (0, begins["up"]), (2.0, held["up"]), (7.4, held["up"]), (8.8, _SUNK), (11.8, _SUNK),
            (13.8, 0),
        ],
        f"hand_{side}.forward": [
            (0, 0), (2.0, held["forward"]), (7.4, held["forward"]), (8.8, 0.3), (11.8, 0.3),
            (13.8, 0),
        ],
        f"hand_{side}.in": [(0, -begins["out"]), (2.0, held["in"]), (11.8, held["in"]), (13.8, 0)],
    }  # fmt: skip
    gets = _aside(other, _STEP, [(0, 0), (2.0, 0), (5.2, 1), (9.0, 1), (12.0, 0), (13.8, 0)])
    gets[f"hand_{other}.up"] = [
        (0, 0), (2.0, _LOW), (5.6, _LOW), (7.2, _LIFTED), (12.0, _LIFTED), (13.8, 0),
    ]  # fmt: skip
    forward, inward = _HELD["forward"], _TAKES
    gets[f"hand_{other}.forward"] = [(0, 0), (2.0, forward), (12.0, forward), (13.8, 0)]
    gets[f"hand_{other}.{other}"] = _sum(
        gets[f"hand_{other}.{other}"], [(0, 0), (2.0, -inward), (12.0, -inward), (13.8, 0)]
    )
    arms = _body(giver, f"forearm_{side}"), _body(receiver, f"forearm_{other}")
    forward, left = _beside(side, _ALONG if along is None else along)
    return Handing(
        _of(stage, giver, gives, "give", {"offered": 2.0, "released": 8.8}),
        _of(stage, receiver, gets, "take", {"under": 5.2, "taken": 7.2}),
        forward, left, tuple((arm, prop) for arm in arms), 0.0,
    )  # fmt: skip


def _beside(side: str, along: float) -> tuple[float, float]:
    """Where the receiver stands before it steps aside to the giver: forward and left [m]."""
    held = np.array(_HELD_ELBOW) + along * np.array(_HELD_FOREARM)
    forward, aside = _TAKEN
    return float(held[0]) - forward, _sign(side) * (float(held[1]) + aside + _BESIDE + _STEP)


def along_forearm(
    stage: Marionette, state: State, who: str, prop: str, height: float, *, side: str = "right"
) -> float:
    """How far from the elbow a handle hangs on a forearm [m], for :func:`give`.

    Args:
        stage: the scene.
        state: after a walk, say; it may swing.
        who: a member.
        prop: what hangs.
        height: of its handle's bar above its origin [m].
        side: of the forearm.
    """
    thing, arm = stage.pose(state, prop), stage.pose(state, _body(who, f"forearm_{side}"))
    return float(-arm[:3, 2] @ (thing[:3, 3] + height * thing[:3, 2] - arm[:3, 3]))


def _aside(side: str, way: float, share: Waypoints) -> dict[str, Waypoints]:
    """A whole puppet carried a step to a side [m]."""
    strings = (*_BODY, *(f"{limb}_{end}" for limb in ("hand", "knee") for end in _SIDES))
    return {f"{string}.{side}": [(t, way * x) for t, x in share] for string in strings}


def _sum(one: Waypoints, other: Waypoints) -> Waypoints:
    """Of two, at the times of both; straight between waypoints."""
    times = sorted({t for t, _ in (*one, *other)})
    values = np.array([np.interp(times, *np.transpose(x)) for x in (one, other)])
    return list(zip(times, values.sum(axis=0).tolist(), strict=True))


def carry(stage: Marionette, who: str, *, side: str = "right") -> Gesture:
    """Holds what hangs on a forearm away from the knees, for a walk: 1.5 s.

    Then :func:`steps_carrying` walks, and :func:`lower` takes it back.

    Args:
        stage: the scene.
        who: a member.
        side: of the forearm.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the side is neither left nor right.
    """
    _sign(side)
    moves = {way: [(0, 0), (CARRY_TIME, offset)] for way, offset in _CARRIED.items()}
    return _of_string(stage, who, f"hand_{side}", moves, "carry", {"carried": CARRY_TIME})


def lower(stage: Marionette, who: str, *, side: str = "right") -> Gesture:
    """From the pose of :func:`carry` back to where the forearm hangs: 1.5 s; the same arguments."""
    _sign(side)
    moves = {way: [(0, offset), (CARRY_TIME, 0)] for way, offset in _CARRIED.items()}
    return _of_string(stage, who, f"hand_{side}", moves, "lower", {"lowered": CARRY_TIME})


def steps_carrying(
    pose: Gesture, start: State, who: str, given: Sequence[Step], step_time: float = STEP_TIME
) -> Gesture:
    """Steps in the pose of :func:`carry`, which turns along; turned :func:`lower` leads out of it.

    Args:
        pose: made by :func:`carry`.
        start: where the puppet hangs when it does not carry.
        who: a member.
        given, step_time: see :func:`fantoccini.gestures.walking.steps`.
    """
    table, of = pose.coordinates, f"{who}." if who else ""
    q_K, by = np.array(start.q_K), {}
    for name, (q, v) in pieces.channel_names(table).items():
        if pose.named[v.start]:
            by[name] = float(pose.ends[0][1, v.start])
            q_K[q] += by[name]
    walk = steps(Ends(table, start.replace(q_K=q_K), of), given, step_time).moved(by)
    # What follows counts from where the strings would be without the pose.
    return replace(walk, travel=steps(Ends(table, start, of), given, step_time).travel)


def put_down(
    stage: Marionette, who: str, prop: str, height: float, *, side: str = "right",
    start: State | None = None,
) -> Putting:  # fmt: skip
    """The gesture by which a puppet stands a prop on something and takes its forearm away.

    Args:
        stage: the scene.
        who: a member.
        prop: which hangs by its handle on the forearm; the origin of its frame is in its bottom.
        height: of what it will stand on [m].
        side: of the forearm.
        start: where the puppet and the prop hang; ``stage.rest()`` when not given.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the prop hangs too low or too high above it.
    """
    start = stage.rest() if start is None else start
    return putting(stage, who, prop, float(stage.pose(start, prop)[2, 3]) - height, side=side)


def pick_up(
    stage: Marionette, who: str, prop: str, drop: float, *, side: str = "right"
) -> Putting:
    """:meth:`put_down` backwards: the forearm goes under the handle and lifts the prop.

    Args:
        stage: the scene.
        who: a member.
        prop: which stands at the place that is returned.
        drop: how much lower its bottom is than where it will hang [m].
        side: of the forearm.

    Raises:
        InputError: the member has other strings than the bundled marionette.
        ValueError: the prop stands too low or too high.
    """
    return putting(stage, who, prop, drop, side=side, back=True)


def putting(
    stage: Marionette, who: str, prop: str, drop: float, *, side: str = "right", back: bool = False
) -> Putting:
    sign, other = _sign(side), _SIDES[side]
    if not 0.0 < drop <= _LOWEST:
        text = f"{prop} would go down by {drop:.3f} m; needed: above 0, at most {_LOWEST} m"
        raise ValueError(text)
    low = drop + _OVERTRAVEL
    moves = _aside(other, _LEAVES, [(0, 0), (5.4, 0), (7.8, 1), (9.6, 1), (12.0, 0)])
    sink: Waypoints = [(0, 0), (2.0, 0), (4.0, low), (7.8, low), (9.8, 0), (12.0, 0)]
    for string in (*_BODY, f"hand_{other}"):
        moves[f"{string}.down"] = sink
    for knee in ("knee_left", "knee_right"):
        moves[f"{knee}.down"] = [(t, 0.016 * x / low) for t, x in sink]
        moves[f"{knee}.forward"] = [(t, 0.3 * x) for t, x in sink]
    moves[f"hand_{side}.down"] = [
        (0, 0), (2.0, 0.02), (4.0, low + 0.02), (5.0, low + 0.06), (7.8, low + 0.06), (9.8, 0),
    ]  # fmt: skip
    moves[f"hand_{side}.forward"] = [(0, 0), (2.0, 0.36), (7.8, 0.36), (9.8, 0)]
    moves[f"hand_{side}.{other}"] = _sum(
        moves[f"hand_{side}.{other}"], [(0, 0), (2.0, 0.08), (7.8, 0.08), (9.8, 0)]
    )
    end, name, marks = 12.0, "put down", {"down": 4.4, "free": 7.8}
    if back:
        moves = _reversed(moves, end)
        name, marks = "pick up", {"under": 6.8, "up": 10.0}
    forward, aside = _STANDS
    touching = ((_body(who, f"forearm_{side}"), prop),)
    return Putting(_of(stage, who, moves, name, marks), forward, sign * aside, touching)


def _reversed(moves: Mapping[str, Sequence[tuple[float, float]]], end: float) -> dict[
    str, Waypoints
]:
    """Waypoints backwards in time, on a clock that ends at a time [s]."""
    return {
        name: [(end - t, offset) for t, offset in reversed(points)]
        for name, points in moves.items()
    }


def _of_string(
    stage: Marionette, who: str, string: str, moves: Mapping[str, Waypoints], name: str,
    marks: Mapping[str, float],
) -> Gesture:  # fmt: skip
    return _of(stage, who, {f"{string}.{way}": x for way, x in moves.items()}, name, marks)


def _of(
    stage: Marionette, who: str, moves: Mapping[str, Waypoints], name: str,
    marks: Mapping[str, float],
) -> Gesture:  # fmt: skip
    points = {_body(who, channel): offsets for channel, offsets in moves.items()}
    return Gesture.of(stage, points, name=name, marks=marks)


def _body(who: str, name: str) -> str:
    """A name in the scene; in a scene of one puppet names have no member before them."""
    return f"{who}.{name}" if who else name


def _sign(side: str) -> float:
    """1 for left, -1 for right."""
    if side not in _SIDES:
        raise ValueError(f"side is {side!r}; it must be 'left' or 'right'")
    return 1.0 if side == "left" else -1.0
