"""Pushes of props: pusher, start, place and waypoints.

The pusher is a body that pushes the prop, a free body. q_D are dynamic coordinates, q_K driven
ones. A marionette is a puppet with its compiled equations; `marionette.puppet` is the description
in its file. A link is a body on its joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.control.tasks import Goal, StateArrays, TouchRules
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import POINT, POSE
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.motion import State


@dataclass(frozen=True)
class _Distances:
    """Distances between pusher and prop before and after a push."""

    start_gap: float = 0.03
    """Gap between the pusher and the prop before the push [m]."""
    overtravel: float = 0.005
    """Travel of the pusher beyond contact with the prop at its place [m]."""
    max_rest_displacement: float = 1e-9
    """Largest displacement of a prop that counts as none [m]."""


_DISTANCES = _Distances()


@dataclass(frozen=True, eq=False)
class Push:
    """A push of a prop to a place.

    Attributes:
        prop: name of the prop.
        pusher: name of the body that pushes; empty if none may touch the prop.
        start_position: (3,) position of the prop at the start [m].
        goal_position: (3,) position of the prop at the goal [m].
        waypoints: goals for a point of the pusher: in contact with the prop at its place, and
            behind the prop at the start.
        link: index of the prop's link.
    """

    prop: str
    pusher: str
    start_position: Array
    goal_position: Array
    waypoints: tuple[Goal, ...]
    link: int

    @property
    def reason(self) -> str:
        """The reason why the prop cannot be pushed; empty if it can."""
        if self.pusher:
            return ""
        return (
            f"nothing may touch {self.prop}; name what pushes it, "
            f"contact: {{touch: [[hand, {self.prop}]]}}"
        )

    def progress(self, marionette: Marionette, end: StateArrays) -> str:
        """Description of the prop's progress towards its place, at the end of a plan."""
        position = marionette.poses(end.q_D, end.q_K)[self.link, :, 3]
        displacement = self.goal_position - self.start_position
        length = float(np.linalg.norm(displacement))
        advance = float((position - self.start_position) @ displacement) / max(
            length, _DISTANCES.max_rest_displacement
        )
        dist = float(np.linalg.norm(position - self.goal_position))
        return f"{self.prop} came {advance:.3g} m of {length:.3g} m, to {dist:.3g} m from its place"


def find_push(goal: Goal, start: State, touches: TouchRules) -> Push | None:
    """The push for a goal; None unless the goal is a place of a prop.

    Args:
        goal: goal of the problem.
        start: start of the plan.
        touches: contact pairs of the problem.
    """
    marionette = goal.marionette
    link = _prop(goal)
    if link is None:
        return None
    prop = marionette.tree.links[link].name
    start_position = marionette.poses(start.q_D, start.q_K)[link, :, 3]
    place = _goal_position(goal, start, link, start_position)
    nearest_ends = [
        _nearest_round_end(marionette, body, start, start_position)
        for body in touches.partners(prop)
    ]
    ends = [end for end in nearest_ends if end is not None]
    displacement = place - start_position
    distance = float(np.linalg.norm(displacement))
    if not ends or distance < _DISTANCES.max_rest_displacement:
        return Push(prop, ends[0][1] if ends else "", start_position, place, (), link)
    _, pusher, point, radius = min(ends, key=lambda end: end[0])
    direction = displacement / distance
    contact_distance = _extent(marionette, link, start, direction) + radius
    targets = (
        place - (contact_distance - _DISTANCES.overtravel) * direction,
        start_position - (contact_distance + _DISTANCES.start_gap) * direction,
    )
    waypoints = tuple(
        Goal.point(marionette, pusher, target.tolist(), at=point) for target in targets
    )
    return Push(prop, pusher, start_position, place, waypoints, link)


def _prop(goal: Goal) -> int | None:
    """The link of the only prop in a goal; None if the goal is not the place of a single prop."""
    numbers, tree, props = goal.numbers, goal.marionette.tree, goal.marionette.puppet.props
    if numbers.kind == POINT:
        return numbers.link if tree.links[numbers.link].name in props else None
    if numbers.kind != POSE:
        return None
    weighted = {i for i, link in enumerate(tree.links) if np.any(numbers.weight[link.v] > 0.0)}
    props_in_goal = {i for i in weighted if tree.links[i].name in props}
    return props_in_goal.pop() if len(props_in_goal) == 1 and weighted == props_in_goal else None


def _goal_position(goal: Goal, start: State, link: int, start_position: Array) -> Array:
    """(3,) the position of the prop at the goal."""
    numbers = goal.numbers
    if numbers.kind == POINT:
        R = goal.marionette.poses(start.q_D, start.q_K)[link, :, :3]
        return (
            np.clip(start_position + R @ numbers.at, numbers.place, numbers.place_high)
            - R @ numbers.at
        )
    tree_link = goal.marionette.tree.links[link]
    place = np.array(start.q_D[tree_link.q][:3])
    has_target = numbers.weight[tree_link.v][:3] > 0.0
    low, high = numbers.low[tree_link.q][:3], numbers.high[tree_link.q][:3]
    return np.where(has_target, np.clip(place, low, high), place) + (start_position - place)


def _nearest_round_end(
    marionette: Marionette, body: str, start: State, place: Array
) -> tuple[float, str, list[float], float] | None:
    """The round end of a body nearest to a place: distance, body, point and radius."""
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
    distances = [
        (float(np.linalg.norm(pose[:, :3] @ at + pose[:, 3] - place)), body, list(at), radius)
        for at, radius in ends
    ]
    return min(distances, default=None)


def _extent(marionette: Marionette, link: int, x: State, direction: Array) -> float:
    """Largest distance of a link's shapes from its origin against a direction (3,) [m]."""
    R = marionette.poses(x.q_D, x.q_K)[link, :, :3]
    shapes = marionette.tree.links[link].shapes
    return max((_support(shape, -(R.T @ direction)) for shape in shapes), default=0.0)


def _support(shape: Shape, direction: Array) -> float:
    """The support function of a shape in its body's frame, max of p . u [m]."""
    match shape:
        case Capsule():
            return (
                float(max(np.dot(shape.from_, direction), np.dot(shape.to, direction)))
                + shape.radius
            )
        case Sphere():
            return float(np.dot(shape.at, direction)) + shape.radius
        case Box():
            size = np.asarray(shape.size)
            axes = np.eye(3) if shape.orientation is None else shape.orientation.matrix
            return float(np.dot(shape.at, direction) + 0.5 * np.abs(axes.T @ direction) @ size)
        case Ellipsoid():
            return float(np.dot(shape.at, direction)) + max(shape.radii)
        case _:
            return 0.0
