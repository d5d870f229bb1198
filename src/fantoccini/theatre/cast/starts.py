"""Places of players at the start, and names of places and directions.

A mark is a named place on the stage, and a footing a place with a heading. A spot is the list of
keys that leads to an entry of the file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array, did_you_mean
from fantoccini.theatre.cast.extents import bounding_box
from fantoccini.theatre.cast.footing import Footing
from fantoccini.theatre.script import DIRECTIONS, PlayerFile, PlayFile, ScriptLog, Spot


class Places:
    """Places and directions by name.

    Args:
        file: the play.
        log: collects mistakes.
    """

    def __init__(self, file: PlayFile, log: ScriptLog):
        self._file, self._log = file, log
        self._obstacles = {
            obstacle.name: 0.5 * np.sum(bounding_box(obstacle), axis=0)
            for obstacle in file.stage.obstacles
        }

    @property
    def names(self) -> list[str]:
        """Names of places, without those of players."""
        return [*self._file.stage.marks, *self._obstacles]

    def check(self, name: object, spot: Spot) -> None:
        """Records a mistake if a name is not a place."""
        place_names = [*self._file.cast, *self.names]
        if isinstance(name, str) and name not in place_names:
            text = f"found {name!r}; needed: a place [x, y], or a mark, player or obstacle"
            self._log.mistakes.add(spot, text + did_you_mean(name, place_names))

    def midpoint(self, name: str) -> Array | None:
        """Midpoint (3,) of an obstacle [m]; None for other names."""
        return self._obstacles.get(name)

    def fixed_place(self, place: object) -> complex | None:
        """x + i y of a mark, an obstacle or a point [m]; None for a player, which moves."""
        if not isinstance(place, str):
            assert isinstance(place, Sequence)
            return complex(place[0], place[1])
        if place in self._file.stage.marks:
            return complex(*self._file.stage.marks[place].at[:2])
        midpoint = self.midpoint(place)
        return None if midpoint is None else complex(midpoint[0], midpoint[1])

    def direction(self, direction: float | str, spot: Spot) -> float | str:
        """Angle [rad], or name of a place to face; 0 after a mistake."""
        if not isinstance(direction, str):
            return direction
        if direction in DIRECTIONS:
            return float(np.radians(DIRECTIONS[direction]))
        place_names = [*self._file.cast, *self.names]
        if direction not in place_names:
            text = (
                f"found {direction!r}; needed: an angle, a direction, or a mark, player or obstacle"
            )
            self._log.mistakes.add(
                spot, text + did_you_mean(direction, [*DIRECTIONS, *place_names])
            )
            return 0.0
        return direction


def start_of(
    file: PlayFile, spec: PlayerFile, spot: Spot, places: Places, log: ScriptLog
) -> Footing:
    """Footing of a player at the start."""
    heading: float | str = 0.0
    if isinstance(spec.at, str):
        mark = file.stage.marks.get(spec.at)
        if mark is None:
            text = f"no mark is called {spec.at!r}{did_you_mean(spec.at, file.stage.marks)}"
            log.mistakes.add((*spot, "at"), text)
            return Footing(0.0, 0.0)
        x, y = mark.at
        heading = places.direction(mark.facing, ("stage", "marks", spec.at, "facing"))
    else:
        x, y = spec.at[:2]
    if spec.facing is not None:
        heading = places.direction(spec.facing, (*spot, "facing"))
    footing = Footing(x, y)
    if isinstance(heading, str):
        target = places.midpoint(heading)
        if target is None:
            other_player = file.cast.get(heading)
            other_place = other_player.at if other_player is not None else heading
            if isinstance(other_place, str):
                mark = file.stage.marks.get(other_place)
                other_place = (0.0, 0.0) if mark is None else mark.at
            target = np.array([other_place[0], other_place[1], 0.0])
        heading = footing.towards(complex(target[0], target[1]))
    return footing.facing(heading)
