"""Goals and targets of a play's cues: places and headings on the stage at a time.

A cue is a line of a play: a verb with its player and time. A footing is a place with a heading, a
mark a named place. A spot is the list of keys that leads to an entry of the file.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.base import Array
from fantoccini.theatre.cast import Cast, Footing, Places
from fantoccini.theatre.gestures import CueError, PendingCue
from fantoccini.theatre.plays.stage_state import StageState
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

    def goals(self, stage: StageState, turn: PendingCue[PlayCue], who: str) -> list[Footing]:
        """Goals of a walk in order: the places that it passes, and its own."""
        entry, footing = turn.entry, stage.actors[who].last_footing
        if isinstance(entry, TurnsToCue):
            return [footing.facing(self._heading(stage, entry.turns_to, footing, turn, "turns to"))]
        assert isinstance(entry, WalkCue)
        goal_value = entry.verb_value
        spots: list[Spot] = [(*turn.spot, "past", i) for i in range(len(entry.past))]
        spots.append((*turn.spot, file_key(entry.verb)))
        targets = [
            self.place_of(stage, where, spot, turn.wanted_time)
            for where, spot in zip((*entry.past, goal_value), spots, strict=True)
        ]
        z = [footing.place, *(complex(place[0], place[1]) for place in targets)]
        goals = []
        for previous, goal, following in zip(z[:-1], z[1:], [*z[2:], z[-1]], strict=True):
            direction = following - goal if following != goal else goal - previous
            heading = float(np.angle(direction)) if direction else footing.heading
            goals.append(Footing(goal.real, goal.imag, heading))
        mark = self._cast.file.stage.marks.get(goal_value) if isinstance(goal_value, str) else None
        facing = entry.facing
        if facing is None and mark is not None:
            facing = mark.facing
        if facing is not None:
            heading = self._heading(stage, facing, goals[-1], turn, "facing")
            goals[-1] = goals[-1].facing(heading)
        return goals

    def _heading(
        self,
        stage: StageState,
        direction_value: float | str,
        footing: Footing,
        turn: PendingCue[PlayCue],
        key: str,
    ) -> float:
        """Heading of a direction, or towards something, at a footing [rad]."""
        direction = self._places.direction(direction_value, (*turn.spot, key))
        if not isinstance(direction, str):
            return direction
        target = self.place_of(stage, direction, (*turn.spot, key), turn.wanted_time)
        z = complex(target[0], target[1])
        return footing.towards(z) if abs(z - footing.place) > _SAME_PLACE else footing.heading

    def place_of(self, stage: StageState, place: object, spot: Spot, t: float) -> Array:
        """(3,) place on the stage [m]; for a player, the place of its head at a time [s]."""
        if not isinstance(place, str):
            assert isinstance(place, Sequence)
            numbers = [float(x) for x in place]
            return np.array([*numbers, _EYE_HEIGHT][:3])
        if place in stage.actors:
            footing = stage.actors[place].footing_at(max(t, 0.0))
            return np.array([footing.x, footing.y, _EYE_HEIGHT])
        marks = self._cast.file.stage.marks
        if place in marks:
            return np.array([*marks[place].at, 0.0], dtype=float)
        midpoint = self._places.midpoint(place)
        if midpoint is None:
            raise CueError(f"nothing is called {place!r}")
        return midpoint
