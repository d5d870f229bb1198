"""Recognition of unreachable goals before the search.

A goal is out of reach if no pose of the bodies, on their joints, has it. A marionette is a puppet
with its compiled equations; `marionette.puppet` is the description in its file. A link is a body on
its joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.control.tasks import Goal
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.runtime import POINT, POSE
from fantoccini.model.puppet import FLOOR, Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.model.tree import WORLD

_TRANSLATING = ("prismatic", "translation", "free")
"""Kinds of joints that change the distance of a body from its parent."""


def out_of_reach(goal: Goal, tolerance: float) -> str:
    """Reason why a goal is out of reach; may be empty.

    Either a pose is beyond a joint's limits, or a point is farther from the root of its chain of
    bodies than the chain is long. Effects of strings and obstacles are not considered.

    Args:
        goal: goal of the plan.
        tolerance: tolerance of the goal's distance.
    """
    if goal.numbers.kind == POSE:
        return _beyond_limits(goal, tolerance)
    return _too_far(goal, tolerance) if goal.numbers.kind == POINT else ""


def _beyond_limits(goal: Goal, tolerance: float) -> str:
    numbers, tree = goal.numbers, goal.marionette.tree
    for limit in tree.limits:
        link = tree.links[limit.link]
        if limit.side not in ("lower", "upper") or link.kind not in ("revolute", "prismatic"):
            continue
        weight = numbers.weight[link.v.start]
        if not weight:
            continue
        low, high = numbers.low[link.q.start], numbers.high[link.q.start]
        excess = low - limit.bound if limit.side == "upper" else limit.bound - high
        if weight * excess > tolerance:
            interval = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            return (
                f"{link.joint} is required at {interval}, beyond its {limit.side} limit "
                f"{limit.bound:g} by more than the tolerance"
            )
    return ""


def too_far_to_touch(goal: Goal) -> str:
    """Reason why a required touch is out of reach; may be empty.

    An obstacle or the floor is out of reach if the body's chain of bodies is too short.
    """
    marionette, puppet = goal.marionette, goal.marionette.puppet
    obstacles = {o.name: o for o in puppet.obstacles}
    bodies = {link.name: i for i, link in enumerate(marionette.tree.links)}
    for pair in goal.touches:
        for body, counterpart in (pair, pair[::-1]):
            if body not in bodies or not (counterpart in obstacles or counterpart == FLOOR):
                continue
            chain = _chain(marionette, bodies[body], 0.0)
            if chain is None:
                continue
            reach = chain.reach + max(
                map(_bounding_radius, marionette.tree.links[bodies[body]].shapes)
            )
            if counterpart == FLOOR:
                distance = float(chain.root[2]) - (puppet.floor or 0.0)
            else:
                centre, radius = _bounding_sphere(obstacles[counterpart])
                distance = float(np.linalg.norm(chain.root - centre)) - radius
            if distance > reach:
                return (
                    f"{counterpart} is at least {distance:.3g} m from {chain.joint}, and {body} "
                    f"reaches at most {reach:.3g} m"
                )
    return ""


@dataclass(frozen=True)
class _Chain:
    """A chain of bodies from the world: first joint, its position and the chain's length."""

    joint: str
    root: Array
    reach: float


def _chain(marionette: Marionette, link: int, reach: float) -> _Chain | None:
    """The chain that ends at a link; None if one of its joints translates.

    Args:
        marionette: the puppet.
        link: index of the last link.
        reach: reach beyond the origin of that link [m].
    """
    links = marionette.tree.links
    while True:
        body = links[link]
        if body.kind in _TRANSLATING:
            return None
        offset = np.array([marionette.number(x) for x in body.offset])
        if body.parent == WORLD:
            return _Chain(body.joint, offset, reach)
        reach += float(np.linalg.norm(offset))
        link = body.parent


def _bounding_sphere(shape: Shape) -> tuple[Array, float]:
    """Centre and radius of a ball around a shape; infinite radius for a mesh [m]."""
    match shape:
        case Capsule():
            start, end = np.array(shape.from_), np.array(shape.to)
            return 0.5 * (start + end), 0.5 * float(np.linalg.norm(end - start)) + shape.radius
        case Sphere():
            return np.array(shape.at), shape.radius
        case Ellipsoid():
            return np.array(shape.at), max(shape.radii)
        case Box():
            return np.array(shape.at), 0.5 * float(np.linalg.norm(shape.size))
        case _:
            return np.zeros(3), np.inf


def _bounding_radius(shape: Shape) -> float:
    """Largest distance of a shape from its body's origin [m]."""
    centre, radius = _bounding_sphere(shape)
    return float(np.linalg.norm(centre)) + radius


def _too_far(goal: Goal, tolerance: float) -> str:
    numbers, marionette = goal.numbers, goal.marionette
    chain = _chain(marionette, numbers.link, float(np.linalg.norm(numbers.at)))
    if chain is None:
        return ""
    nearest = np.clip(chain.root, numbers.place, numbers.place_high)
    distance = float(np.linalg.norm(chain.root - nearest))
    if distance <= chain.reach + tolerance:
        return ""
    return (
        f"the place is {distance:.3g} m from {chain.joint}, and "
        f"{marionette.tree.links[numbers.link].name} reaches at most {chain.reach:.3g} m"
    )
