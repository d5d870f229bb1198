"""Planner of walks of players over the stage of a play, past obstacles and each other.

A footing is a place on the stage with a heading. A track is the path of a player over time, and a
region a part of the stage from which puppets keep clear. Mistakes of the file are recorded in a
log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.base.documents import value_of
from fantoccini.model.puppet import Box as BoxShape, Shape
from fantoccini.theatre.cast import (
    Cast,
    Footing,
    Player,
    PlayProp,
    Walk,
    act_time_in_words,
    bounding_box,
)
from fantoccini.theatre.gestures import SWAY
from fantoccini.theatre.pathfinding import (
    Box,
    Disk,
    NoPath,
    OtherPlayer,
    Rectangle,
    Region,
    plan_walk,
)
from fantoccini.theatre.plays.floor_walks import FLOOR_PAUSES
from fantoccini.theatre.plays.player_gestures import step_time
from fantoccini.theatre.script import ScriptLog

_MAX_STEP = 0.1
"""Longest step, for legs of 26.4 cm [m]."""
_CARRYING_FACTOR = 2.0
"""Factor of a step's duration for a player that carries something."""
_BODY_SWING = 0.02
"""Swing of bodies beyond the disk of their strings' ends during a walk, for legs of 26.4 cm [m]."""
_MAX_SHIFTS = 4
"""Number of beginnings to try for a walk that must arrive in time."""
_CHECK_INTERVAL = 0.02
"""Time between checked places of a walk [s]."""
_UPRIGHT_TOLERANCE = 1e-9
"""Tolerance of the vertical component of an upright box's axis."""
_DISTANCE_TOLERANCE = 1e-4
"""Tolerance of the distance between a path and standing obstacles [m]."""
_TIME_TOLERANCE = 1e-6
"""Tolerance for equal times [s]."""

PlayerTrack = tuple[Player, tuple[Times, Array]]
"""A player, and its places over time."""


class WalkPlanner:
    """Planner of walks on the stage of a play.

    Args:
        cast: cast of the play.
        log: has the duration of a beat.
    """

    def __init__(self, cast: Cast, log: ScriptLog):
        stage = cast.file.stage
        self._log = log
        self.step_time = step_time(log.beat)
        self.obstacles: list[Region] = []
        max_height = max(player.height for player in cast.players.values())
        for obstacle in stage.obstacles:
            self.obstacles += _regions_under(obstacle.name, obstacle, max_height)
        for prop in cast.props.values():
            if not prop.held_by and cast.file.props[prop.name].on is None:
                self.obstacles.append(_prop_region(prop))
        self._space = stage.space
        self._walks: dict[tuple[Any, ...], Walk | NoPath] = {}

    def plan(
        self,
        player: Player,
        start: Footing,
        goals: Sequence[Footing],
        begin: float,
        max_wait: float,
        tracks: Sequence[PlayerTrack],
        *,
        max_goal_distance: float,
        arrival_time: float | None,
        free_time: float,
        act_start: float,
        is_carrying: bool = False,
    ) -> tuple[Walk | None, str]:
        """Walk through several footings, clear of all other players.

        Args:
            player: player that walks.
            start, goals: footing at the beginning, and footings to pass, the goal last.
            begin: earliest time [s].
            max_wait: longest delay after it [s].
            tracks: other players with their places over time.
            max_goal_distance: largest distance from the last goal at which it may end [m].
            arrival_time: wanted time of arrival [s]; as soon as possible by default.
            free_time: time from which the player can begin [s].
            act_start: start of the act [s], for times in the reason.
            is_carrying: whether something hangs on its forearm, so that it steps more slowly.

        Returns:
            The walk, or None and the reason why there is none.
        """
        if arrival_time is not None:
            begin = free_time
        walk = self._through_goals(
            player, start, goals, begin, max_wait, tracks, max_goal_distance, is_carrying
        )
        if isinstance(walk, NoPath):
            return None, self._reason(player, walk, act_start)
        if arrival_time is None:
            return walk, ""
        for _ in range(_MAX_SHIFTS):
            lead = arrival_time - walk.end
            shifted_begin = walk.begin + lead
            if abs(lead) < _TIME_TOLERANCE or shifted_begin < free_time - _TIME_TOLERANCE:
                break
            shifted_walk = self._through_goals(
                player, start, goals, shifted_begin, 0.0, tracks, max_goal_distance, is_carrying
            )
            if isinstance(shifted_walk, NoPath):
                break
            walk = shifted_walk
        return walk, ""

    @staticmethod
    def clearance(player: Player) -> float:
        """Distance of a player's middle from obstacles [m]."""
        return player.radius + player.leg_ratio * (SWAY + _BODY_SWING) + _gait_reach(player)

    def is_clear(self, player: Player, footing: Footing) -> bool:
        """Whether a place is clear of all obstacles."""
        point = np.array(footing.place)
        return all(
            float(region.distance(point)) >= self.clearance(player) for region in self.obstacles
        )

    def is_inside(self, player: Player, footing: Footing) -> bool:
        """Whether the hands of a player at a place are within their space."""
        bounds = self._middle_bounds(player)
        return bounds is None or bool(bounds.holds(np.array(footing.place)))

    def obstruction(self, player: Player, place: complex) -> str:
        """Reason why a player can never stand at a place, even if others leave; "" if it can."""
        bounds, point = self._middle_bounds(player), np.array(place)
        if bounds is not None and not bounds.holds(point):
            distance = abs(bounds.nearest(place) - place)
            return f"the place is {distance:.2f} m outside of the hands' space"
        for region in self.obstacles:
            if float(region.distance(point)) < self.clearance(player) - _DISTANCE_TOLERANCE:
                return f"{region.name} is there"
        return ""

    def in_the_way(
        self, player: Player, walk: Walk, tracks: Sequence[PlayerTrack], end_time: float = np.inf
    ) -> str | None:
        """Name of a player that comes too near on a walk before a time [s]; None if nobody does."""
        end = min(walk.end, end_time)
        if end < walk.begin:
            return None
        n = int(np.ceil((end - walk.begin) / _CHECK_INTERVAL)) + 1
        t = np.linspace(walk.begin, end, n)
        xy, _ = walk.footing(t)
        for other, (times, places) in tracks:
            other_xy = np.stack([np.interp(t, times, places[:, i]) for i in (0, 1)], axis=1)
            min_distance = self.clearance(player) + self.clearance(other)
            if np.min(np.linalg.norm(xy - other_xy, axis=1)) < min_distance:
                return other.name
        return None

    def middle(self, name: str) -> complex | None:
        """Middle of an obstacle [m]; None if it is above the players."""
        centres = (complex(*region.centre) for region in self.obstacles if region.name == name)
        return next(centres, None)

    def sides(self, name: str, player_place: complex, inset: float) -> list[tuple[float, complex]]:
        """Places for a prop at the sides of an obstacle.

        Args:
            name: name of the obstacle.
            player_place: place of the player [m].
            inset: distance from the border, if the obstacle is large enough [m].

        Returns:
            Heading of the player [rad] and place x + i y of the prop [m], for each side.
        """
        (region,) = [candidate for candidate in self.obstacles if candidate.name == name]
        middle = complex(*region.centre)
        if not isinstance(region, Box):
            assert isinstance(region, Disk)
            heading = float(np.angle(middle - player_place))
            return [(heading, middle - max(region.radius - inset, 0.0) * np.exp(1j * heading))]
        places = []
        for k, half_size in enumerate((*region.half_sizes, *region.half_sizes)):
            heading = region.yaw + 0.5 * np.pi * k
            places.append((heading, middle - max(half_size - inset, 0.0) * np.exp(1j * heading)))
        return places

    def _through_goals(
        self,
        player: Player,
        start: Footing,
        goals: Sequence[Footing],
        begin: float,
        max_wait: float,
        tracks: Sequence[PlayerTrack],
        max_goal_distance: float,
        is_carrying: bool,
    ) -> Walk | NoPath:
        """Walk from goal to goal, joined to a single one."""
        walk: Walk | None = None
        for i, goal in enumerate(goals):
            part = self._cached_walk(player, start, goal, begin, max_wait, tracks, is_carrying)
            alternative = part.nearest if isinstance(part, NoPath) else None
            is_last = i == len(goals) - 1
            if (
                is_last
                and alternative is not None
                and abs(alternative.place - goal.place) <= max_goal_distance
            ):
                goal = alternative
                part = self._cached_walk(player, start, goal, begin, max_wait, tracks, is_carrying)
            if isinstance(part, NoPath):
                return part
            steps = part.steps if walk is None else (*walk.steps, *part.steps)
            walk = replace(part if walk is None else walk, steps=steps)
            # The player may only wait before the first part; later it stands in steps.
            start, begin, max_wait = goal, walk.end, 0.0
        assert walk is not None
        return walk

    def _cached_walk(
        self,
        player: Player,
        start: Footing,
        goal: Footing,
        begin: float,
        max_wait: float,
        tracks: Sequence[PlayerTrack],
        is_carrying: bool,
    ) -> Walk | NoPath:
        track_keys = tuple((other.name, t.tobytes(), xy.tobytes()) for other, (t, xy) in tracks)
        key = (player.name, start, goal, round(begin, 9), max_wait, is_carrying, track_keys)
        if key not in self._walks:
            longest_step, pauses = _MAX_STEP * player.leg_ratio, (0, 0)
            duration = self.step_time * (_CARRYING_FACTOR if is_carrying else 1.0)
            if player.gait is not None and not is_carrying:
                longest_step = player.gait.stride * player.leg_length
                duration, pauses = player.gait.step_time, FLOOR_PAUSES
            self._walks[key] = plan_walk(
                start,
                goal,
                begin=begin,
                longest_step=longest_step,
                step_time=duration,
                radius=self.clearance(player),
                blocked=self.obstacles,
                space=self._middle_bounds(player),
                latest_begin=begin + max_wait,
                pauses=pauses,
                others=[
                    OtherPlayer(other.name, t, xy, self.clearance(other))
                    for other, (t, xy) in tracks
                ],
            )
        return self._walks[key]

    def _middle_bounds(self, player: Player) -> Rectangle | None:
        """Bounds of the middle of a player, so that its hands stay in their space; or None."""
        if self._space is None:
            return None
        (x_min, x_max), (y_min, y_max) = self._space.x, self._space.y
        radius = player.radius + player.leg_ratio * SWAY + _gait_reach(player)
        return Rectangle((x_min + radius, y_min + radius), (x_max - radius, y_max - radius))

    def _reason(self, player: Player, failure: NoPath, act_start: float) -> str:
        """Reason why no walk exists, in words, with the nearest possible time and place."""
        text = f"{player.name} cannot get there: {failure.reason}"
        if failure.earliest is not None:
            when = act_time_in_words(failure.earliest, act_start, self._log.beat)
            text += f"; it could be there {when}"
        if failure.nearest is not None:
            x, y = failure.nearest.x, failure.nearest.y
            text += f"; the nearest place that can be reached is [{x:.2f}, {y:.2f}]"
        return text


def _gait_reach(player: Player) -> float:
    """Distance by which a gait on the floor carries ends of strings beyond the radius [m]."""
    return 0.0 if player.gait is None else player.gait.reach * player.leg_length


def _regions_under(name: str, shape: Shape, max_height: float) -> list[Region]:
    """Region of the stage under a shape; empty if it is above the top of all players [m]."""
    lower, upper = bounding_box(shape)
    if lower[2] > max_height:
        return []
    turned_box = _turned_box(name, shape)
    if turned_box is not None:
        return [turned_box]
    middle, half_sizes = 0.5 * (lower + upper), 0.5 * (upper - lower)
    centre = float(middle[0]), float(middle[1])
    if isinstance(shape, BoxShape) and shape.orientation is None:
        return [Box(name, centre, (float(half_sizes[0]), float(half_sizes[1])))]
    return [Disk(name, centre, float(np.hypot(half_sizes[0], half_sizes[1])))]


def _turned_box(name: str, shape: Shape) -> Region | None:
    """Region of a box that is turned only about the vertical; None for other shapes."""
    if not isinstance(shape, BoxShape) or shape.orientation is None:
        return None
    R = shape.orientation.matrix
    if R[2, 2] < 1.0 - _UPRIGHT_TOLERANCE:
        return None
    width, depth, _ = (0.5 * value_of(size) for size in shape.size)
    yaw = float(np.arctan2(R[1, 0], R[0, 0]))
    return Box(name, (float(shape.at[0]), float(shape.at[1])), (width, depth), yaw)


def _prop_region(prop: PlayProp) -> Region:
    """Region of the stage under a prop on the floor."""
    boxes = np.array([bounding_box(shape) for shape in prop.prop.shapes])
    lower, upper = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
    middle, half_sizes = 0.5 * (lower + upper), 0.5 * (upper - lower)
    footing = prop.footing
    centre = footing.place + np.exp(1j * footing.heading) * complex(middle[0], middle[1])
    return Box(
        prop.name,
        (centre.real, centre.imag),
        (float(half_sizes[0]), float(half_sizes[1])),
        footing.heading,
    )
