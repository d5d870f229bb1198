"""Goals and targets of a play's cues: places and headings on the stage at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.cast import Cast, Footing, Places
from fantoccini.theatre.gestures import CueError, PendingCue
from fantoccini.theatre.plays.on_stage import OnStage
from fantoccini.theatre.script import PlayCue, Spot, TurnsToCue, WalkCue, file_key

_EYE_HEIGHT = 0.42
"""Height of a player's face above the floor [m]."""
_SAME_PLACE = 1e-9
"""Distance below which two places count as the same [m]."""


class Aims:
    """Places and directions in cues, resolved while the cues are placed.

    Args:
        cast, places: cast of the play, and its names of places.
    """

    def __init__(self, cast: Cast, places: Places):
        self._cast, self._places = cast, places

    def goals(self, stage: OnStage, turn: PendingCue[PlayCue], who: str) -> list[Footing]:
        """Goals of a walk in order: the places that it passes, and its own."""
        entry, here = turn.entry, stage.actors[who].last
        if isinstance(entry, TurnsToCue):
            return [here.facing(self._heading(stage, entry.turns_to, here, turn, "turns to"))]
        assert isinstance(entry, WalkCue)
        last = entry.verb_value
        spots: list[Spot] = [(*turn.spot, "past", i) for i in range(len(entry.past))]
        spots.append((*turn.spot, file_key(entry.verb)))
        places = [
            self.place_of(stage, where, spot, turn.wanted_time)
            for where, spot in zip((*entry.past, last), spots, strict=True)
        ]
        z = [here.place, *(complex(place[0], place[1]) for place in places)]
        goals = []
        for before, goal, after in zip(z[:-1], z[1:], [*z[2:], z[-1]], strict=True):
            direction = after - goal if after != goal else goal - before
            heading = float(np.angle(direction)) if direction else here.heading
            goals.append(Footing(goal.real, goal.imag, heading))
        mark = self._cast.file.stage.marks.get(last) if isinstance(last, str) else None
        facing = entry.facing
        if facing is None and mark is not None:
            facing = mark.facing
        if facing is not None:
            heading = self._heading(stage, facing, goals[-1], turn, "facing")
            goals[-1] = goals[-1].facing(heading)
        return goals

    def _heading(
        self,
        stage: OnStage,
        given: float | str,
        footing: Footing,
        turn: PendingCue[PlayCue],
        key: str,
    ) -> float:
        """Heading of a direction, or towards something, at a footing [rad]."""
        direction = self._places.direction(given, (*turn.spot, key))
        if not isinstance(direction, str):
            return direction
        place = self.place_of(stage, direction, (*turn.spot, key), turn.wanted_time)
        z = complex(place[0], place[1])
        return footing.towards(z) if abs(z - footing.place) > _SAME_PLACE else footing.heading

    def place_of(self, stage: OnStage, where: object, spot: Spot, t: float) -> Array:
        """(3,) place on the stage [m]; for a player, the place of its head at a time [s]."""
        if not isinstance(where, str):
            assert isinstance(where, Sequence)
            numbers = [float(x) for x in where]
            return np.array([*numbers, _EYE_HEIGHT][:3])
        if where in stage.actors:
            other = stage.actors[where].footing_at(max(t, 0.0))
            return np.array([other.x, other.y, _EYE_HEIGHT])
        marks = self._cast.file.stage.marks
        if where in marks:
            return np.array([*marks[where].at, 0.0], dtype=float)
        still = self._places.midpoint(where)
        if still is None:
            raise CueError(f"nothing is called {where!r}")
        return still
