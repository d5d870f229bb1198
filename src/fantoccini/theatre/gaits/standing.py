"""Lengths of strings at which a puppet's legs hang freely and its soles just reach the floor.

A sole is the lowest part of a foot. q_D are dynamic coordinates, q_K driven ones (ends and lengths
of strings); a slack string does not pull. A marionette is a puppet with its compiled equations;
`marionette.puppet` is the description in its file. The heading is the angle of the forward
direction, seen from above.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.model.tree import point_position, shape_box
from fantoccini.motion import State
from fantoccini.theatre.gestures import BodyParts, foot_links, leg_length, leg_strings, legs

_RAISED_HEIGHT_RATIO = 0.4
"""Height by which the puppet is raised to measure its hanging legs, relative to their length."""
_SLACK_RATIO = 0.5
"""Length let out of the legs' strings in that measurement, relative to the legs' length."""
_MIN_WHEELBASE_RATIO = 0.1
"""Distance between front and hind hips, relative to the legs' length, below which the trunk is
lowered without pitching."""


def standing_lengths(body_parts: BodyParts, start: State) -> dict[str, float]:
    """String -> length at which the soles just reach the floor [m].

    Strings of legs are then just taut. Where front and hind legs differ in height, the other
    strings pitch the trunk.

    Args:
        body_parts: parts of the puppet.
        start: rest on its strings.

    Raises:
        StateError: the puppet has no legs, a leg has no shapes, or it does not hang at rest with
            free legs.
    """
    L = leg_length(body_parts.body_map)
    if not L:
        raise StateError("it walks; the puppet has no legs")
    free_state = _with_free_legs(body_parts, start, L)
    poses = body_parts.marionette.poses(free_state.q_D[None], free_state.q_K[None])
    heading = _heading(body_parts, poses[0])
    drop, lengths = _drop_function(body_parts, poses[0], L, heading), {}
    marionette, prefix = body_parts.marionette, body_parts.prefix
    strings_of_legs = set(leg_strings(body_parts))
    for string in marionette.tree.strings:
        name, length = string.name.removeprefix(prefix), f"{string.name}.length"
        if not string.name.startswith(prefix) or length not in marionette.coordinates.q_K:
            continue
        positions = [point_position(poses, point, marionette.number)[0] for point in string.points]
        path = np.array(positions)
        old_length = _path_length(path)
        position = float(path[:, :2].mean(axis=0) @ heading)
        path[0 if path[0, 2] < path[-1, 2] else -1, 2] -= drop(position)
        new_length = _path_length(path)
        lengths[name] = (
            new_length
            if name in strings_of_legs
            else float(free_state[length]) + new_length - old_length
        )
    return lengths


def _with_free_legs(body_parts: BodyParts, start: State, leg_size: float) -> State:
    """Rest above the floor, with slack strings of the legs."""
    table, raised_height = body_parts.marionette.coordinates, _RAISED_HEIGHT_RATIO * leg_size
    strings_of_legs = set(leg_strings(body_parts))
    values = {name: float(start[name]) for name in table.q_K}
    for name in table.q_K:
        string, _, part = name.removeprefix(body_parts.prefix).rpartition(".")
        if name.startswith(body_parts.prefix) and part == "length":
            values[name] += (
                _SLACK_RATIO * leg_size if string in strings_of_legs else 0.0
            ) - raised_height
    for name in table.q_D:
        if name.startswith(body_parts.prefix) and name.endswith(".z"):
            values[name] = float(start[name]) + raised_height
    return body_parts.marionette.rest(values)


def _heading(body_parts: BodyParts, poses: Array) -> Array:
    """(2,) horizontal unit direction in which the puppet looks, for poses (n_links, 3, 4)."""
    trunk = poses[body_parts.marionette.link_index(body_parts.body_map.trunk[0])]
    forward: Array = (trunk[:, :3] @ np.array(body_parts.body_map.facing))[:2]
    return forward / np.linalg.norm(forward)


def _drop_function(
    body_parts: BodyParts, poses: Array, leg_size: float, heading: Array
) -> Callable[[float], float]:
    """Distance by which the trunk must be lowered until soles touch, by place along the heading.

    Args:
        body_parts: parts of the puppet.
        poses: (n_links, 3, 4) poses of its links.
        leg_size: length of the legs [m].
        heading: (2,) horizontal unit direction in which the puppet looks.

    Returns:
        Function: place along the heading [m] -> distance [m].
    """
    marionette = body_parts.marionette
    floor = marionette.number(marionette.puppet.floor or 0.0)
    hips, heights = [], []
    for name, foot in foot_links(body_parts).items():
        hip = marionette.link_index(legs(body_parts.body_map)[name].bodies[0])
        shapes = marionette.tree.links[foot].shapes
        hips.append(float(poses[hip, :2, 3] @ heading))
        heights.append(min(shape_box(shape, poses[foot])[0][2] for shape in shapes) - floor)
    if np.ptp(hips) < _MIN_WHEELBASE_RATIO * leg_size:
        return lambda position: float(np.mean(heights))
    slope, height = np.polyfit(hips, heights, 1)
    return lambda position: float(height + slope * position)


def _path_length(path: Array) -> float:
    """Length of a path (n, 3) [m]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
