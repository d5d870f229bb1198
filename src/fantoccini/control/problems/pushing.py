"""Pushes: who pushes a prop from where to where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.control.tasks import Goal, StateArrays, Touches
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import POINT, POSE
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.motion import State


@dataclass(frozen=True)
class _Distances:
    """Where a pusher stops before and after a push."""

    before: float = 0.03
    """Gap between the pusher and the prop before the push [m]."""
    beyond: float = 0.005
    """How far the pusher goes on beyond where the prop is at its place [m]."""
    rounding: float = 1e-9
    """Way of a prop that is none [m]."""


_DISTANCES = _Distances()


@dataclass(frozen=True, eq=False)
class Push:
    """A prop that is to be pushed to a place.

    Attributes:
        prop: its name.
        pusher: name of the body that pushes; empty where none may touch the prop.
        first: (3,) where the prop is at the start [m].
        place: (3,) where it is to be [m].
        waypoints: of a point of the pusher: where the prop is at its place, and behind the prop.
        link: the prop's.
    """

    prop: str
    pusher: str
    first: Array
    place: Array
    waypoints: tuple[Goal, ...]
    link: int

    @property
    def reason(self) -> str:
        """Why the prop cannot be pushed; empty where it may."""
        if self.pusher:
            return ""
        return (
            f"nothing may touch {self.prop}; name what pushes it, "
            f"contact: {{touch: [[hand, {self.prop}]]}}"
        )

    def progress(self, marionette: Marionette, end: StateArrays) -> str:
        """How far the prop came towards its place, at the end of a plan."""
        there = marionette.poses(end.q_D, end.q_K)[self.link, :, 3]
        way = self.place - self.first
        length = float(np.linalg.norm(way))
        came = float((there - self.first) @ way) / max(length, _DISTANCES.rounding)
        left = float(np.linalg.norm(there - self.place))
        return f"{self.prop} came {came:.3g} m of {length:.3g} m, to {left:.3g} m from its place"


def push_of(goal: Goal, start: State, touches: Touches) -> Push | None:
    """The push that a goal asks for; None where it is no place of a prop.

    Args:
        goal: of the problem.
        start: where the plan begins.
        touches: of the problem.
    """
    marionette = goal.marionette
    link = _prop(goal)
    if link is None:
        return None
    prop = marionette.tree.links[link].name
    first = marionette.poses(start.q_D, start.q_K)[link, :, 3]
    place = _place(goal, start, link, first)
    found = [_knob(marionette, body, start, first) for body in touches.partners(prop)]
    knobs = [one for one in found if one is not None]
    way = place - first
    length = float(np.linalg.norm(way))
    if not knobs or length < _DISTANCES.rounding:
        return Push(prop, knobs[0][1] if knobs else "", first, place, (), link)
    _, pusher, at, radius = min(knobs, key=lambda one: one[0])
    u = way / length
    reach = _extent(marionette, link, start, u) + radius
    spots = (place - (reach - _DISTANCES.beyond) * u, first - (reach + _DISTANCES.before) * u)
    waypoints = tuple(Goal.point(marionette, pusher, spot.tolist(), at=at) for spot in spots)
    return Push(prop, pusher, first, place, waypoints, link)


def _prop(goal: Goal) -> int | None:
    """The link of the one prop whose place is the goal."""
    numbers, tree, props = goal.numbers, goal.marionette.tree, goal.marionette.puppet.props
    if numbers.kind == POINT:
        return numbers.link if tree.links[numbers.link].name in props else None
    if numbers.kind != POSE:
        return None
    named = {i for i, link in enumerate(tree.links) if np.any(numbers.weight[link.v] > 0.0)}
    found = {i for i in named if tree.links[i].name in props}
    return found.pop() if len(found) == 1 and named == found else None


def _place(goal: Goal, start: State, link: int, first: Array) -> Array:
    """(3,) where the prop is to be."""
    numbers = goal.numbers
    if numbers.kind == POINT:
        R = goal.marionette.poses(start.q_D, start.q_K)[link, :, :3]
        return np.clip(first + R @ numbers.at, numbers.place, numbers.place_high) - R @ numbers.at
    at = goal.marionette.tree.links[link]
    place = np.array(start.q_D[at.q][:3])
    wanted = numbers.weight[at.v][:3] > 0.0
    low, high = numbers.low[at.q][:3], numbers.high[at.q][:3]
    return np.where(wanted, np.clip(place, low, high), place) + (first - place)


def _knob(
    marionette: Marionette, body: str, start: State, place: Array
) -> tuple[float, str, list[float], float] | None:
    """The round end of a body that is nearest to a place: distance, body, point and radius."""
    link = marionette.link_index(body)
    pose = marionette.poses(start.q_D, start.q_K)[link]
    ends: list[tuple[tuple[float, ...], float]] = []
    for shape in marionette.tree.links[link].shapes:
        match shape:
            case Capsule():
                ends += [(shape.from_, shape.radius), (shape.to, shape.radius)]
            case Sphere():
                ends.append((shape.at, shape.radius))
            case Ellipsoid():
                ends.append((shape.at, min(shape.radii)))
            case Box():
                ends.append((shape.at, 0.5 * min(shape.size)))
    found = [
        (float(np.linalg.norm(pose[:, :3] @ at + pose[:, 3] - place)), body, list(at), radius)
        for at, radius in ends
    ]
    return min(found, default=None)


def _extent(marionette: Marionette, link: int, x: State, u: Array) -> float:
    """How far a link's shapes reach from its origin against a direction (3,) [m]."""
    R = marionette.poses(x.q_D, x.q_K)[link, :, :3]
    shapes = marionette.tree.links[link].shapes
    return max((_reach(shape, -(R.T @ u)) for shape in shapes), default=0.0)


def _reach(shape: Shape, u: Array) -> float:
    """The support function of a shape in its body's frame, max of p . u [m]."""
    match shape:
        case Capsule():
            return float(max(np.dot(shape.from_, u), np.dot(shape.to, u))) + shape.radius
        case Sphere():
            return float(np.dot(shape.at, u)) + shape.radius
        case Box():
            size = np.asarray(shape.size)
            turn = np.eye(3) if shape.orientation is None else shape.orientation.matrix
            return float(np.dot(shape.at, u) + 0.5 * np.abs(turn.T @ u) @ size)
        case Ellipsoid():
            return float(np.dot(shape.at, u)) + max(shape.radii)
        case _:
            return 0.0
