"""Walks of players over the stage of a play: what is in their way, and how they step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.gestures.notes import Notes
from fantoccini.gestures.walking import SWAY
from fantoccini.plays.acting import step_time
from fantoccini.plays.casting import Cast, Player
from fantoccini.plays.extents import extent
from fantoccini.plays.footing import Footing, Way
from fantoccini.plays.regions import Box, Disk, Rectangle, Region
from fantoccini.plays.ways import NoWay, Other, find_way
from fantoccini.puppet.shapes import Box as BoxShape, Shape

_LONGEST_STEP = 0.1
"""[m]"""
_SWING = 0.02
"""How far bodies swing beyond the disk of their strings' ends in a walk [m]."""
_REACH = 0.6
"""Height below which what stands on the stage is in the way [m]."""
_TRIES = 4
"""Of beginnings with which a walk is to arrive in time."""
_IN_TIME = 1e-6
"""Difference of times that counts as none [s]."""

Track = tuple[Player, tuple[Times, Array]]
"""A player, and where it is over time."""


class Walks:
    """The stage from above.

    Args:
        cast: of the play.
        notes: know the beat.
    """

    def __init__(self, cast: Cast, notes: Notes):
        stage = cast.file.stage
        self._notes = notes
        self.step_time = step_time(notes.beat)
        self.blocked: list[Region] = []
        for one in stage.obstacles:
            self.blocked += _regions(one.name, one)
        self._space = stage.space
        self._kept: dict[tuple[Any, ...], Way | NoWay] = {}

    def way(
        self, player: Player, start: Footing, goals: Sequence[Footing], begin: float, wait: float,
        others: Sequence[Track], *, near: float, arrives: float | None, free_from: float,
    ) -> tuple[Way | None, str]:  # fmt: skip
        """A way by several footings past all others.

        Args:
            player: who walks.
            start, goals: from where, and by what places to where.
            begin: earliest time [s].
            wait: by how much later it may begin [s].
            others: where they are over time.
            near: how far from the last goal it may end [m].
            arrives: when it is to arrive [s]; as soon as it can when not given.
            free_from: when the player can begin at the earliest [s].

        Returns:
            The way, or None and why there is none.
        """
        if arrives is not None:
            begin = free_from
        found = self._by_goals(player, start, goals, begin, wait, others, near)
        if isinstance(found, NoWay):
            return None, self._why(player, found)
        if arrives is None:
            return found, ""
        for _ in range(_TRIES):
            early = arrives - found.end
            if abs(early) < _IN_TIME or found.begin + early < free_from - _IN_TIME:
                break
            later = found.begin + early
            again = self._by_goals(player, start, goals, later, 0.0, others, near)
            if isinstance(again, NoWay):
                break
            found = again
        return found, ""

    def _by_goals(
        self, player: Player, start: Footing, goals: Sequence[Footing], begin: float, wait: float,
        others: Sequence[Track], near: float,
    ) -> Way | NoWay:  # fmt: skip
        """Ways from goal to goal as one."""
        whole: Way | None = None
        for i, goal in enumerate(goals):
            found = self._found(player, start, goal, begin, wait, others)
            other = found.nearest if isinstance(found, NoWay) else None
            last = i == len(goals) - 1
            if last and other is not None and abs(other.place - goal.place) <= near:
                goal = other
                found = self._found(player, start, goal, begin, wait, others)
            if isinstance(found, NoWay):
                return found
            steps = found.steps if whole is None else (*whole.steps, *found.steps)
            whole = replace(found if whole is None else whole, steps=steps)
            # Later it only stands, which is a step that does not move.
            start, begin, wait = goal, whole.end, 0.0
        assert whole is not None
        return whole

    def _found(
        self, player: Player, start: Footing, goal: Footing, begin: float, wait: float,
        others: Sequence[Track],
    ) -> Way | NoWay:  # fmt: skip
        around = tuple((other.name, t.tobytes(), xy.tobytes())
                       for other, (t, xy) in others)  # fmt: skip
        key = (player.name, start, goal, round(begin, 9), wait, around)
        if key not in self._kept:
            clear = player.radius + SWAY + _SWING
            space = None
            if self._space is not None:
                (a, b), (c, d) = self._space.x, self._space.y
                r = player.radius + SWAY
                space = Rectangle((a + r, c + r), (b - r, d - r))
            self._kept[key] = find_way(
                start, goal, begin=begin, step_time=self.step_time, longest_step=_LONGEST_STEP,
                radius=clear, blocked=self.blocked, space=space, latest_begin=begin + wait,
                others=[
                    Other(other.name, t, xy, other.radius + SWAY + _SWING)
                    for other, (t, xy) in others
                ],
            )  # fmt: skip
        return self._kept[key]

    def _why(self, player: Player, found: NoWay) -> str:
        text = f"{player.name} cannot get there: {found.reason}"
        if found.nearest is not None:
            x, y = found.nearest.x, found.nearest.y
            text += f"; the nearest place that can be reached is [{x:.2f}, {y:.2f}]"
        return text


def _regions(name: str, shape: Shape) -> list[Region]:
    """What a shape takes of the stage, if it is not above the players."""
    low, high = extent(shape)
    if low[2] > _REACH:
        return []
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    centre = float(middle[0]), float(middle[1])
    if isinstance(shape, BoxShape) and shape.orientation is None:
        return [Box(name, centre, (float(half[0]), float(half[1])))]
    return [Disk(name, centre, float(np.hypot(half[0], half[1])))]
