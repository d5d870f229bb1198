"""Gestures with props: carrying and handing over.

    q_K(t) = q_K0 + d(t)

Offsets are relative to the puppet's rest, so that they hold for every place and heading. They are
written for an arm of 19 cm and multiplied by the ratio of lengths for others. A prop hangs by a
handle across a forearm, held by friction alone. A handle is a T: a bar with free ends on a stem.
The arm lies under one half of the bar. It moves there and away sideways, so the bar never meets a
string.

q_K are the driven coordinates, the ends and lengths of strings; q_K0 are their values at rest and
d(t) the offsets of the gesture. A member is a puppet of a scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State, pieces
from fantoccini.theatre.cast.contacts import OTHER_SIDE
from fantoccini.theatre.cast.physique import Physique
from fantoccini.theatre.gestures import STEP_TIME, BodyParts, Ends, Gesture, Step, step_gesture

Waypoints = list[tuple[float, float]]
"""Times [s] and offsets [m]."""

_HANDLE_ASIDE, _HANDLE_UP = 0.016, 0.004
"""Middle of the handle's bar on a forearm in the pose of the file, from the elbow: to the arm's
side, which is half the bar's length, and up [m]."""

_ELBOW_DISTANCE = 0.061
"""Distance of the handle from the elbow, along the forearm [m]."""
_OFFER = {"forward": 0.2, "in": 0.065, "up": 0.03}
_OFFER_ELBOW_SHIFT, _OFFER_FOREARM = (0.0431, 0.0), (0.986, 0.003)
"""Offset of the giver's hand string that holds the prop out [m]. In that pose: displacement of the
elbow from rest, forward and aside [m], and horizontal part of the unit vector along the forearm,
forward and aside."""
_TAKE_IN, _TAKE_MIDPOINT = 0.09, (0.083, -0.005)
"""Inward offset of the receiver's hand string while it takes the prop; midpoint of its forearm in
that pose, from the elbow at rest, forward and aside [m]."""
_UP_BELOW_PROP, _UP_WITH_PROP, _UP_EMPTY = -0.028, 0.036, -0.058
"""Upward offsets of hand strings: receiver below the prop and with it, giver without it [m]."""
_FOREARM_GAP, _SIDE_STEP = 0.051, 0.24
"""Distance between the two forearms, which the prop's bar determines, for any arm; length of the
receiver's step to the side, for arms of 19 cm or shorter ones [m]."""
_KNEE_CLEARANCE = 0.05
"""Distance by which the receiver's knee string moves back to make way for the prop, for legs of
26.4 cm [m]."""

CARRY_OFFSETS = {"out": 0.1, "up": 0.035}
"""Offsets of the hand's string that hold a prop away from the knees [m]."""
CARRY_TIME = 1.5
"""Duration of the gesture that takes up this pose [s]."""


@dataclass(frozen=True)
class Handover:
    """Gestures that pass a prop from one puppet's forearm to another's.

    Attributes:
        giver, receiver: gestures of the two, with a common start. The giver's has the marks
            ``offered`` and ``released``, the receiver's ``under`` and ``taken``.
        forward, left: position of the receiver relative to the giver [m].
        touching: pairs of bodies that may touch.
        turn: heading of the receiver minus that of the giver [rad].
    """

    giver: Gesture
    receiver: Gesture
    forward: float
    left: float
    touching: tuple[tuple[str, str], ...]
    turn: float

    def place(self, x: float, y: float, heading: float) -> tuple[float, float, float]:
        """Place [m] and heading [rad] of the receiver for those of the giver."""
        c, s = float(np.cos(heading)), float(np.sin(heading))
        return (
            x + c * self.forward - s * self.left,
            y + s * self.forward + c * self.left,
            heading + self.turn,
        )


def handle_place(
    stage: Marionette, who: str = "", *, side: str = "right"
) -> tuple[float, float, float]:
    """Middle of a handle that hangs on a forearm, from the puppet: forward, left, up [m].

    Args:
        stage: the scene, in whose pose the forearm is horizontal.
        who: member that holds the prop.
        side: side of the forearm.

    Raises:
        StateError: the puppet has no such arm.
        ValueError: the side is neither left nor right.
    """
    sign, physique = side_sign(side), Physique.of(stage, who)
    forward, left, up = physique.place(physique.forearm(side)).tolist()
    return (
        forward + physique.arm_ratio(side) * _ELBOW_DISTANCE,
        left + sign * _HANDLE_ASIDE,
        up + _HANDLE_UP,
    )


def _scaled(points: Waypoints, scale: float) -> Waypoints:
    """Waypoints with offsets multiplied by a ratio of sizes."""
    return [(t, scale * offset) for t, offset in points]


def carry_offsets(physique: Physique, side: str) -> dict[str, float]:
    """Offsets of the hand's string in the pose of :func:`carry`: out and up [m]."""
    return {way: physique.arm_ratio(side) * offset for way, offset in CARRY_OFFSETS.items()}


def give(
    stage: Marionette,
    giver: str,
    receiver: str,
    prop: str,
    *,
    side: str = "right",
    elbow_distance: float | None = None,
    in_pose: bool = False,
    receiver_stage: Marionette | None = None,
) -> Handover:
    """Gestures that pass a prop from one puppet's forearm to another's.

    They stand side by side and face the same way. The giver holds the prop out; the receiver steps
    aside to it with its forearm under the outer half of the bar, lifts it, and steps back with it
    when the giver's arm has sunk. No string passes the bar. It takes 13.8 s. Both end at rest; the
    stem is again on the outer side of the arm that holds it.

    Args:
        stage: the scene.
        giver, receiver: members of the scene.
        prop: prop that hangs by its handle on the giver's forearm, the stem on the outer side.
        side: side of the giver's forearm; the receiver uses the other.
        elbow_distance: distance of the handle from the elbow, see :func:`handle_distance` [m].
        in_pose: whether the giver is in the pose of :func:`carry`.
        receiver_stage: scene of the receiver, if it is another one.

    Raises:
        StateError: a member lacks an arm or a string that lifts a limb.
        ValueError: the side is neither left nor right.
    """
    receiver_side = OTHER_SIDE[side]
    giver_physique = Physique.of(stage, giver)
    receiver_physique = Physique.of(receiver_stage or stage, receiver)
    handle_places = (
        handle_place(stage, giver, side=side),
        handle_place(receiver_physique.stage, receiver, side=receiver_side),
    )
    giver_height = handle_places[0][2] - handle_places[1][2]
    arms = giver_physique.forearm(side), receiver_physique.forearm(receiver_side)
    # The longer of their arms keep clear of both bodies; the prop is as wide for shorter ones.
    max_arm_ratio = max(
        giver_physique.arm_ratio(side), receiver_physique.arm_ratio(receiver_side), 1.0
    )
    side_step = max_arm_ratio * _SIDE_STEP
    forward, left = _receiver_place(giver_physique, receiver_physique, side, elbow_distance)
    left += side_sign(side) * side_step
    return Handover(
        member_gesture(
            stage,
            giver,
            _giver_waypoints(giver_physique, side, in_pose=in_pose),
            "give",
            {"offered": 2.0, "released": 8.8},
        ),
        member_gesture(
            receiver_physique.stage,
            receiver,
            _receiver_waypoints(receiver_physique, receiver_side, giver_height, side_step),
            "take",
            {"under": 5.2, "taken": 7.2},
        ),
        forward,
        left,
        tuple((arm, prop) for arm in arms),
        0.0,
    )


def _giver_waypoints(physique: Physique, side: str, *, in_pose: bool) -> dict[str, Waypoints]:
    """Waypoints of a giver, whose arm is on this side.

    Args:
        physique: physique of the giver.
        side: side of its arm.
        in_pose: whether it begins in the pose of :func:`carry`.
    """
    offer, string = _OFFER, physique.hand_string(side)
    start_offsets = CARRY_OFFSETS if in_pose else {"up": 0.0, "out": 0.0}
    raised, lowered = offer["up"], _UP_EMPTY
    waypoints: dict[str, Waypoints] = {
        f"{string}.up": [
            (0, start_offsets["up"]),
            (2.0, raised),
            (7.4, raised),
            (8.8, lowered),
            (11.8, lowered),
        ],
        f"{string}.forward": [
            (0, 0),
            (2.0, offer["forward"]),
            (7.4, offer["forward"]),
            (8.8, 0.3),
            (11.8, 0.3),
        ],
        f"{string}.{OTHER_SIDE[side]}": [
            (0, -start_offsets["out"]),
            (2.0, offer["in"]),
            (11.8, offer["in"]),
        ],
    }
    scale = physique.arm_ratio(side)
    return {name: _scaled([*points, (13.8, 0)], scale) for name, points in waypoints.items()}


def _receiver_waypoints(
    physique: Physique, side: str, giver_height: float, step: float
) -> dict[str, Waypoints]:
    """Waypoints of a receiver that takes a prop with the arm on this side.

    Args:
        physique: physique of the receiver.
        side: side of its arm.
        giver_height: height of the giver's handle above that of the receiver, both at rest [m].
        step: length of its step to the side [m].
    """
    scale, hand_string, knee_string = (
        physique.arm_ratio(side),
        physique.hand_string(side),
        physique.knee_string(side),
    )
    lowered, lifted = (scale * offset + giver_height for offset in (_UP_BELOW_PROP, _UP_WITH_PROP))
    forward, inward, knee_offset = (
        scale * _OFFER["forward"],
        scale * _TAKE_IN,
        physique.leg_ratio * _KNEE_CLEARANCE,
    )
    step_shares: list[tuple[float, float]] = [
        (0, 0),
        (2.0, 0),
        (5.2, 1),
        (9.0, 1),
        (12.0, 0),
        (13.8, 0),
    ]
    waypoints = shifted(physique, side, step, step_shares)
    waypoints[f"{hand_string}.up"] = [
        (0, 0),
        (2.0, lowered),
        (5.6, lowered),
        (7.2, lifted),
        (12.0, lifted),
        (13.8, 0),
    ]
    waypoints[f"{hand_string}.forward"] = [(0, 0), (2.0, forward), (12.0, forward), (13.8, 0)]
    inward_waypoints = [(0, 0), (2.0, -inward), (12.0, -inward), (13.8, 0)]
    waypoints[f"{hand_string}.{side}"] = add_waypoints(
        waypoints[f"{hand_string}.{side}"], inward_waypoints
    )
    # The string of the receiver's knee makes way for the prop.
    waypoints[f"{knee_string}.back"] = [
        (0, 0),
        (2.0, 0),
        (4.0, knee_offset),
        (12.6, knee_offset),
        (13.8, 0),
    ]
    return waypoints


def _receiver_place(
    giver_physique: Physique, receiver_physique: Physique, side: str, elbow_distance: float | None
) -> tuple[float, float]:
    """Place of the receiver relative to the giver when it takes the prop: forward and left [m]."""
    sign, receiver_side = side_sign(side), OTHER_SIDE[side]
    giver_elbow, receiver_elbow = (
        giver_physique.place(giver_physique.forearm(side)),
        receiver_physique.place(receiver_physique.forearm(receiver_side)),
    )
    giver_scale, receiver_scale = (
        giver_physique.arm_ratio(side),
        receiver_physique.arm_ratio(receiver_side),
    )
    distance = giver_scale * _ELBOW_DISTANCE if elbow_distance is None else elbow_distance
    prop_place = giver_scale * np.array(_OFFER_ELBOW_SHIFT) + distance * np.array(_OFFER_FOREARM)
    prop_place += (giver_elbow[0], sign * giver_elbow[1])
    forward, aside = (
        receiver_scale * _TAKE_MIDPOINT[0] + receiver_elbow[0],
        _TAKE_MIDPOINT[1] * receiver_scale,
    )
    aside += -sign * receiver_elbow[1]
    return float(prop_place[0] - forward), sign * float(prop_place[1] + aside + _FOREARM_GAP)


def handle_distance(
    stage: Marionette, state: State, who: str, prop: str, height: float, *, side: str = "right"
) -> float:
    """Distance from the elbow at which a handle hangs on a forearm [m], for :func:`give`.

    Args:
        stage: the scene.
        state: state, for instance after a walk; the prop may swing.
        who: member that holds the prop.
        prop: prop on the forearm.
        height: height of its handle's bar above its origin [m].
        side: side of the forearm.
    """
    physique = Physique.of(stage, who)
    prop_pose, arm_pose = stage.pose(state, prop), stage.pose(state, physique.forearm(side))
    direction = arm_pose[:3, :3] @ physique.forearm_direction(side)
    return float(direction @ (prop_pose[:3, 3] + height * prop_pose[:3, 2] - arm_pose[:3, 3]))


def shifted(
    physique: Physique, direction: str, distance: float, shares: Waypoints
) -> dict[str, Waypoints]:
    """Waypoints of all strings, which shift the whole puppet.

    Args:
        physique: physique of the puppet.
        direction: direction of the shift, such as ``left``.
        distance: its length [m].
        shares: times [s], and shares of the distance there.
    """
    return {
        f"{string}.{direction}": [(t, distance * share) for t, share in shares]
        for string in physique.strings
    }


def add_waypoints(first: Waypoints, second: Waypoints) -> Waypoints:
    """Sum of two sets of waypoints at the times of both, interpolated linearly."""
    times = sorted({t for t, _ in (*first, *second)})
    values = np.array([np.interp(times, *np.transpose(x)) for x in (first, second)])
    return list(zip(times, values.sum(axis=0).tolist(), strict=True))


def carry(stage: Marionette, who: str, *, side: str = "right") -> Gesture:
    """Gesture that holds a prop on a forearm away from the knees, for a walk: 1.5 s.

    :func:`steps_carrying` walks in this pose.

    Args:
        stage: the scene.
        who: member that holds the prop.
        side: side of the forearm.

    Raises:
        StateError: the member lacks the arm, or a string that lifts it.
        ValueError: the side is neither left nor right.
    """
    sign = side_sign(side)
    physique = Physique.of(stage, who)
    directions = {"out": "left" if sign > 0.0 else "right"}
    waypoints = {
        f"{physique.hand_string(side)}.{directions.get(way, way)}": [
            (0.0, 0.0),
            (CARRY_TIME, offset),
        ]
        for way, offset in carry_offsets(physique, side).items()
    }
    return member_gesture(stage, who, waypoints, "carry", {"carried": CARRY_TIME})


def steps_carrying(
    stage: Marionette,
    pose: Gesture,
    start: State,
    who: str,
    walk_steps: Sequence[Step],
    step_time: float = STEP_TIME,
) -> Gesture:
    """Steps in the pose of :func:`carry`, which turns with the puppet.

    Args:
        stage: the scene.
        pose: gesture of :func:`carry`.
        start: rest of the puppet without the pose.
        who: member that walks.
        walk_steps, step_time: see :func:`fantoccini.theatre.gestures.walking.step_gesture`.
    """
    table, body_parts = pose.coordinates, BodyParts.for_puppet(stage, who)
    q_K, offsets = np.array(start.q_K), {}
    for name, (q, v) in pieces.channel_names(table).items():
        if pose.named[v.start]:
            offsets[name] = float(pose.ends[0][1, v.start])
            q_K[q] += offsets[name]
    walking = step_gesture(Ends(body_parts, start.replace(q_K=q_K)), walk_steps, step_time).moved(
        offsets
    )
    # Later gestures count from the strings' places without the pose.
    return replace(
        walking, travel=step_gesture(Ends(body_parts, start), walk_steps, step_time).travel
    )


def reverse_waypoints(
    waypoints: Mapping[str, Sequence[tuple[float, float]]], end: float
) -> dict[str, Waypoints]:
    """Waypoints reversed in time, on a clock that ends at a time [s]."""
    return {
        name: [(end - t, offset) for t, offset in reversed(points)]
        for name, points in waypoints.items()
    }


def member_gesture(
    stage: Marionette,
    who: str,
    moves: Mapping[str, Waypoints],
    name: str,
    marks: Mapping[str, float],
) -> Gesture:
    """Gesture of a member; further strings of its limbs follow those that are named."""
    physique = Physique.of(stage, who)
    whole = dict(moves)
    for follower, leader in physique.followers.items():
        for channel, offsets in moves.items():
            string, _, way = channel.partition(".")
            if string == leader:
                whole[f"{follower}.{way}"] = offsets
    points = {member_name(who, channel): offsets for channel, offsets in whole.items()}
    gesture = Gesture.from_points(stage, points, name=name, marks=marks)
    heading = physique.body_parts.heading
    return gesture.turned(heading) if heading else gesture


def member_name(who: str, name: str) -> str:
    """Name in the scene of a member's coordinate or body; unchanged without a member."""
    return f"{who}.{name}" if who else name


def side_sign(side: str) -> float:
    """1 for left, -1 for right.

    Raises:
        ValueError: the side is neither.
    """
    if side not in OTHER_SIDE:
        raise ValueError(f"side is {side!r}; it must be 'left' or 'right'")
    return 1.0 if side == "left" else -1.0
