"""Where cues of a play lead and point: places and headings of the stage at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.cast import Cast, Footing, Places
from fantoccini.theatre.gestures import CannotBe, Turn
from fantoccini.theatre.plays.on_stage import OnStage
from fantoccini.theatre.script import PlayCue, Spot, TurnsToCue, WalkCue, spelled

_EYES = 0.42
"""Height of a player's face [m]."""
_SAME = 1e-9
"""Distance of places that are one [m]."""


class Aims:
    """Meaning of the places and directions of cues, while they are placed.

    Args:
        cast, places: of the play.
    """

    def __init__(self, cast: Cast, places: Places):
        self._cast, self._places = cast, places

    def goals(self, stage: OnStage, turn: Turn[PlayCue], who: str) -> list[Footing]:
        """Where a walk leads: the last one is its own."""
        given, here = turn.given, stage.actors[who].last
        if isinstance(given, TurnsToCue):
            return [here.facing(self._heading(stage, given.turns_to, here, turn, "turns to"))]
        assert isinstance(given, WalkCue)
        last = given.verb_value
        spots: list[Spot] = [(*turn.spot, "past", i) for i in range(len(given.past))]
        spots.append((*turn.spot, spelled(given.verb)))
        places = [
            self.place_of(stage, where, spot, turn.wanted)
            for where, spot in zip((*given.past, last), spots, strict=True)
        ]
        z = [here.place, *(complex(place[0], place[1]) for place in places)]
        goals = []
        for before, there, after in zip(z[:-1], z[1:], [*z[2:], z[-1]], strict=True):
            way = after - there if after != there else there - before
            heading = float(np.angle(way)) if way else here.heading
            goals.append(Footing(there.real, there.imag, heading))
        mark = self._cast.file.stage.marks.get(last) if isinstance(last, str) else None
        facing = given.facing
        if facing is None and mark is not None:
            facing = mark.facing
        if facing is not None:
            heading = self._heading(stage, facing, goals[-1], turn, "facing")
            goals[-1] = goals[-1].facing(heading)
        return goals

    def _heading(
        self, stage: OnStage, given: float | str, there: Footing, turn: Turn[PlayCue], key: str
    ) -> float:
        direction = self._places.direction(given, (*turn.spot, key))
        if not isinstance(direction, str):
            return direction
        place = self.place_of(stage, direction, (*turn.spot, key), turn.wanted)
        z = complex(place[0], place[1])
        return there.towards(z) if abs(z - there.place) > _SAME else there.heading

    def place_of(self, stage: OnStage, where: object, spot: Spot, t: float) -> Array:
        """(3,) a place of the stage; of a player its head, at a time [s]."""
        if not isinstance(where, str):
            assert isinstance(where, Sequence)
            numbers = [float(x) for x in where]
            return np.array([*numbers, _EYES][:3])
        if where in stage.actors:
            other = stage.actors[where].stands(max(t, 0.0))
            return np.array([other.x, other.y, _EYES])
        marks = self._cast.file.stage.marks
        if where in marks:
            return np.array([*marks[where].at, 0.0], dtype=float)
        still = self._places.still(where)
        if still is None:
            raise CannotBe(f"nothing is called {where!r}")
        return still
