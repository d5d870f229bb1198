"""Walks of players over the stage of a play, past obstacles and each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.base import Array, Times
from fantoccini.base.documents import value_of
from fantoccini.model.puppet import Box as BoxShape, Shape
from fantoccini.theatre.cast import Cast, Footing, Player, PlayProp, Way, act_time_in_words, extent
from fantoccini.theatre.gestures import SWAY
from fantoccini.theatre.plays.player_gestures import step_time
from fantoccini.theatre.script import ScriptLog
from fantoccini.theatre.ways import Box, Disk, NoWay, Other, Rectangle, Region, find_way

_MAX_STEP = 0.1
"""Longest step, for legs of 26.4 cm [m]."""
_CARRYING_FACTOR = 2.0
"""Factor of a step's duration for a player that carries something."""
_SWING = 0.02
"""Swing of bodies beyond the disk of their strings' ends during a walk, for legs of 26.4 cm [m]."""
_MAX_TRIES = 4
"""Number of beginnings to try for a walk that must arrive in time."""
_CHECK_INTERVAL = 0.02
"""Time between checked places of a way [s]."""
_UPRIGHT_TOLERANCE = 1e-9
"""Tolerance of the vertical component of an upright box's axis."""
_DISTANCE_TOLERANCE = 1e-4
"""Tolerance of the distance between a path and standing obstacles [m]."""
_TIME_TOLERANCE = 1e-6
"""Tolerance for equal times [s]."""

Track = tuple[Player, tuple[Times, Array]]
"""A player, and its places over time."""


class Walks:
    """Planner of walks on the stage of a play.

    Args:
        cast: cast of the play.
        log: has the duration of a beat.
    """

    def __init__(self, cast: Cast, log: ScriptLog):
        stage = cast.file.stage
        self._log = log
        self.step_time = step_time(log.beat)
        self.blocked: list[Region] = []
        top = max(player.height for player in cast.players.values())
        for obstacle in stage.obstacles:
            self.blocked += _regions(obstacle.name, obstacle, top)
        for thing in cast.props.values():
            if not thing.held_by and cast.file.props[thing.name].on is None:
                self.blocked.append(_prop_region(thing))
        self._space = stage.space
        self._cache: dict[tuple[Any, ...], Way | NoWay] = {}

    def way(
        self,
        player: Player,
        start: Footing,
        goals: Sequence[Footing],
        begin: float,
        wait: float,
        others: Sequence[Track],
        *,
        near: float,
        arrives: float | None,
        free_from: float,
        act_start: float,
        carries: bool = False,
    ) -> tuple[Way | None, str]:
        """Way through several footings, clear of all other players.

        Args:
            player: player that walks.
            start, goals: footing at the beginning, and footings to pass, the goal last.
            begin: earliest time [s].
            wait: longest delay after it [s].
            others: other players with their places over time.
            near: largest distance from the last goal at which it may end [m].
            arrives: wanted time of arrival [s]; as soon as possible by default.
            free_from: time from which the player can begin [s].
            act_start: start of the act [s], for times in the reason.
            carries: whether something hangs on its forearm, so that it steps more slowly.

        Returns:
            The way, or None and the reason why there is none.
        """
        if arrives is not None:
            begin = free_from
        way = self._through_goals(player, start, goals, begin, wait, others, near, carries)
        if isinstance(way, NoWay):
            return None, self._reason(player, way, act_start)
        if arrives is None:
            return way, ""
        for _ in range(_MAX_TRIES):
            early = arrives - way.end
            later = way.begin + early
            if abs(early) < _TIME_TOLERANCE or later < free_from - _TIME_TOLERANCE:
                break
            shifted = self._through_goals(player, start, goals, later, 0.0, others, near, carries)
            if isinstance(shifted, NoWay):
                break
            way = shifted
        return way, ""

    @staticmethod
    def clearance(player: Player) -> float:
        """Distance of a player's middle from obstacles [m]."""
        return player.radius + player.leg_ratio * (SWAY + _SWING)

    def is_clear(self, player: Player, place: Footing) -> bool:
        """Whether a place is clear of all obstacles."""
        at = np.array(place.place)
        return all(float(region.distance(at)) >= self.clearance(player) for region in self.blocked)

    def is_inside(self, player: Player, place: Footing) -> bool:
        """Whether the hands of a player at a place are within their space."""
        bounds = self._middle_bounds(player)
        return bounds is None or bool(bounds.holds(np.array(place.place)))

    def obstruction(self, player: Player, place: complex) -> str:
        """Reason why a player can never stand at a place, even if others leave; "" if it can."""
        bounds, at = self._middle_bounds(player), np.array(place)
        if bounds is not None and not bounds.holds(at):
            outside = abs(bounds.nearest(place) - place)
            return f"the place is {outside:.2f} m outside of the hands' space"
        for region in self.blocked:
            if float(region.distance(at)) < self.clearance(player) - _DISTANCE_TOLERANCE:
                return f"{region.name} is there"
        return ""

    def in_the_way(
        self, player: Player, way: Way, others: Sequence[Track], until: float = np.inf
    ) -> str | None:
        """Name of a player that comes too near on a way until a time [s]; None if nobody does."""
        end = min(way.end, until)
        if end < way.begin:
            return None
        n = int(np.ceil((end - way.begin) / _CHECK_INTERVAL)) + 1
        t = np.linspace(way.begin, end, n)
        xy, _ = way.footing(t)
        for other, (clock, path) in others:
            other_xy = np.stack([np.interp(t, clock, path[:, i]) for i in (0, 1)], axis=1)
            min_distance = self.clearance(player) + self.clearance(other)
            if np.min(np.linalg.norm(xy - other_xy, axis=1)) < min_distance:
                return other.name
        return None

    def middle(self, name: str) -> complex | None:
        """Middle of an obstacle [m]; None if it is above the players."""
        centres = (complex(*region.centre) for region in self.blocked if region.name == name)
        return next(centres, None)

    def sides(self, name: str, seen: complex, inset: float) -> list[tuple[float, complex]]:
        """Places for a prop at the sides of an obstacle.

        Args:
            name: name of the obstacle.
            seen: place of the player [m].
            inset: distance from the border, if the obstacle is large enough [m].

        Returns:
            Heading of the player [rad] and place x + i y of the prop [m], for each side.
        """
        (region,) = [candidate for candidate in self.blocked if candidate.name == name]
        middle = complex(*region.centre)
        if not isinstance(region, Box):
            assert isinstance(region, Disk)
            heading = float(np.angle(middle - seen))
            return [(heading, middle - max(region.radius - inset, 0.0) * np.exp(1j * heading))]
        places = []
        for k, half in enumerate((*region.half, *region.half)):
            heading = region.yaw + 0.5 * np.pi * k
            places.append((heading, middle - max(half - inset, 0.0) * np.exp(1j * heading)))
        return places

    def _through_goals(
        self,
        player: Player,
        start: Footing,
        goals: Sequence[Footing],
        begin: float,
        wait: float,
        others: Sequence[Track],
        near: float,
        carries: bool,
    ) -> Way | NoWay:
        """Way from goal to goal, joined to a single one."""
        whole: Way | None = None
        for i, goal in enumerate(goals):
            part = self._cached_way(player, start, goal, begin, wait, others, carries)
            other = part.nearest if isinstance(part, NoWay) else None
            last = i == len(goals) - 1
            if last and other is not None and abs(other.place - goal.place) <= near:
                goal = other
                part = self._cached_way(player, start, goal, begin, wait, others, carries)
            if isinstance(part, NoWay):
                return part
            steps = part.steps if whole is None else (*whole.steps, *part.steps)
            whole = replace(part if whole is None else whole, steps=steps)
            # The player may only wait before the first part; later it stands in steps.
            start, begin, wait = goal, whole.end, 0.0
        assert whole is not None
        return whole

    def _cached_way(
        self,
        player: Player,
        start: Footing,
        goal: Footing,
        begin: float,
        wait: float,
        others: Sequence[Track],
        carries: bool,
    ) -> Way | NoWay:
        around = tuple((other.name, t.tobytes(), xy.tobytes()) for other, (t, xy) in others)
        key = (player.name, start, goal, round(begin, 9), wait, carries, around)
        if key not in self._cache:
            self._cache[key] = find_way(
                start,
                goal,
                begin=begin,
                longest_step=_MAX_STEP * player.leg_ratio,
                step_time=self.step_time * (_CARRYING_FACTOR if carries else 1.0),
                radius=self.clearance(player),
                blocked=self.blocked,
                space=self._middle_bounds(player),
                latest_begin=begin + wait,
                others=[
                    Other(other.name, t, xy, self.clearance(other)) for other, (t, xy) in others
                ],
            )
        return self._cache[key]

    def _middle_bounds(self, player: Player) -> Rectangle | None:
        """Bounds of the middle of a player, so that its hands stay in their space; or None."""
        if self._space is None:
            return None
        (a, b), (c, d) = self._space.x, self._space.y
        r = player.radius + player.leg_ratio * SWAY
        return Rectangle((a + r, c + r), (b - r, d - r))

    def _reason(self, player: Player, failure: NoWay, act_start: float) -> str:
        """Reason why there is no way, in words, with the nearest possible time and place."""
        text = f"{player.name} cannot get there: {failure.reason}"
        if failure.earliest is not None:
            when = act_time_in_words(failure.earliest, act_start, self._log.beat)
            text += f"; it could be there {when}"
        if failure.nearest is not None:
            x, y = failure.nearest.x, failure.nearest.y
            text += f"; the nearest place that can be reached is [{x:.2f}, {y:.2f}]"
        return text


def _regions(name: str, shape: Shape, top: float) -> list[Region]:
    """Region of the stage under a shape; empty if it is above the top of all players [m]."""
    low, high = extent(shape)
    if low[2] > top:
        return []
    box = _turned_box(name, shape)
    if box is not None:
        return [box]
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    centre = float(middle[0]), float(middle[1])
    if isinstance(shape, BoxShape) and shape.orientation is None:
        return [Box(name, centre, (float(half[0]), float(half[1])))]
    return [Disk(name, centre, float(np.hypot(half[0], half[1])))]


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


def _prop_region(thing: PlayProp) -> Region:
    """Region of the stage under a prop on the floor."""
    ends = np.array([extent(shape) for shape in thing.prop.shapes])
    low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    footing = thing.stands
    centre = footing.place + np.exp(1j * footing.heading) * complex(middle[0], middle[1])
    return Box(
        thing.name, (centre.real, centre.imag), (float(half[0]), float(half[1])), footing.heading
    )
