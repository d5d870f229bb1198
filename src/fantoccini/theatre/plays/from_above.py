"""Plan of a play's stage: marks, obstacles, and the players' ways seen from above."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.cast import Footing
from fantoccini.theatre.plays.play import Play
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import ScriptLog

_SAMPLE_INTERVAL = 0.1
"""Time between places of a way [s]."""


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
class Overhead:
    """Stage seen from above.

    Attributes:
        marks: name -> (x, y) [m].
        standing: name -> polygons (n, 2) of obstacles in the way [m].
        space: ((low, high) of x, (low, high) of y) of the hands [m]; None without bounds.
        starts: player -> footing at the start.
        ways: player -> its ways, in order.
    """

    marks: Mapping[str, tuple[float, float]]
    standing: Mapping[str, tuple[Array, ...]]
    space: tuple[tuple[float, float], tuple[float, float]] | None
    starts: Mapping[str, Footing]
    ways: Mapping[str, tuple[WalkPath, ...]]


def overhead(play: Play) -> Overhead:
    """Stage of a play seen from above."""
    stage = play.cast.file.stage
    standing: dict[str, list[Array]] = {}
    for region in Walks(play.cast, ScriptLog(play.located, play.cast.file.tempo)).blocked:
        corners = region.corners(0.0)
        standing.setdefault(region.name, []).append(np.stack([corners.real, corners.imag], -1))
    ways = {}
    for name, player_ways in play.ways.items():
        paths = []
        for way in player_ways:
            n = 2 + int((way.end - way.begin) / _SAMPLE_INTERVAL)
            places, headings = way.footing(np.linspace(way.begin, way.end, n))
            paths.append(WalkPath(way.begin, way.end, places, float(headings[-1])))
        ways[name] = tuple(paths)
    return Overhead(
        {name: mark.at for name, mark in stage.marks.items()},
        {name: tuple(polygons) for name, polygons in standing.items()},
        None if stage.space is None else (stage.space.x, stage.space.y),
        {name: player.start for name, player in play.cast.players.items()},
        ways,
    )
