"""Plan of a play's stage: marks, obstacles, and the players' ways seen from above.

A mark is a named place on the stage. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.cast import Footing
from fantoccini.theatre.plays.play import Play
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import ScriptLog

_SAMPLE_INTERVAL = 0.1
"""Time between places of a walk [s]."""


@dataclass(frozen=True)
class WalkPath:
    """Path of a walk, seen from above.

    Attributes:
        begin, end: beginning and end [s].
        places: (n, 2) places [m].
        heading: heading at its end [rad].
    """

    begin: float
    end: float
    places: Array
    heading: float


@dataclass(frozen=True)
class StagePlan:
    """Stage seen from above.

    Attributes:
        marks: name -> (x, y) [m].
        obstacles: name -> polygons (n, 2) of obstacles in the way [m].
        hand_space: ((low, high) of x, (low, high) of y) of the hands [m]; None without bounds.
        starts: player -> footing at the start.
        walks: player -> its ways, in order.
    """

    marks: Mapping[str, tuple[float, float]]
    obstacles: Mapping[str, tuple[Array, ...]]
    hand_space: tuple[tuple[float, float], tuple[float, float]] | None
    starts: Mapping[str, Footing]
    walks: Mapping[str, tuple[WalkPath, ...]]


def make_stage_plan(play: Play) -> StagePlan:
    """Stage of a play seen from above."""
    stage = play.cast.file.stage
    obstacles: dict[str, list[Array]] = {}
    for region in WalkPlanner(play.cast, ScriptLog(play.located, play.cast.file.tempo)).obstacles:
        corners = region.corners(0.0)
        obstacles.setdefault(region.name, []).append(np.stack([corners.real, corners.imag], -1))
    walks = {}
    for name, player_walks in play.walks.items():
        paths = []
        for walk in player_walks:
            n = 2 + int((walk.end - walk.begin) / _SAMPLE_INTERVAL)
            places, headings = walk.footing(np.linspace(walk.begin, walk.end, n))
            paths.append(WalkPath(walk.begin, walk.end, places, float(headings[-1])))
        walks[name] = tuple(paths)
    return StagePlan(
        {name: mark.at for name, mark in stage.marks.items()},
        {name: tuple(polygons) for name, polygons in obstacles.items()},
        None if stage.space is None else (stage.space.x, stage.space.y),
        {name: player.start for name, player in play.cast.players.items()},
        walks,
    )
