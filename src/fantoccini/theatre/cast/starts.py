"""Places of players at the start, and names of places and directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array, did_you_mean
from fantoccini.theatre.cast.extents import extent
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
            obstacle.name: 0.5 * np.sum(extent(obstacle), axis=0)
            for obstacle in file.stage.obstacles
        }

    @property
    def names(self) -> list[str]:
        """Names of places, without those of players."""
        return [*self._file.stage.marks, *self._obstacles]

    def check(self, given: object, spot: Spot) -> None:
        """Records a mistake if a name is not a place."""
        known = [*self._file.cast, *self.names]
        if isinstance(given, str) and given not in known:
            text = f"found {given!r}; needed: a place [x, y], or a mark, player or obstacle"
            self._log.mistakes.add(spot, text + did_you_mean(given, known))

    def midpoint(self, name: str) -> Array | None:
        """Midpoint (3,) of an obstacle [m]; None for other names."""
        return self._obstacles.get(name)

    def fixed_place(self, where: object) -> complex | None:
        """x + i y of a mark, an obstacle or a point [m]; None for a player, which moves."""
        if not isinstance(where, str):
            assert isinstance(where, Sequence)
            return complex(where[0], where[1])
        if where in self._file.stage.marks:
            return complex(*self._file.stage.marks[where].at[:2])
        middle = self.midpoint(where)
        return None if middle is None else complex(middle[0], middle[1])

    def direction(self, given: float | str, spot: Spot) -> float | str:
        """Angle [rad], or name of a place to face; 0 after a mistake."""
        if not isinstance(given, str):
            return given
        if given in DIRECTIONS:
            return float(np.radians(DIRECTIONS[given]))
        known = [*self._file.cast, *self.names]
        if given not in known:
            text = f"found {given!r}; needed: an angle, a direction, or a mark, player or obstacle"
            self._log.mistakes.add(spot, text + did_you_mean(given, [*DIRECTIONS, *known]))
            return 0.0
        return given


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
        place = places.midpoint(heading)
        if place is None:
            other = file.cast.get(heading)
            at = other.at if other is not None else heading
            if isinstance(at, str):
                mark = file.stage.marks.get(at)
                at = (0.0, 0.0) if mark is None else mark.at
            place = np.array([at[0], at[1], 0.0])
        heading = footing.towards(complex(place[0], place[1]))
    return footing.facing(heading)
