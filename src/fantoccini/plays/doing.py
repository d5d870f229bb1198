"""What players do, put into their lanes and noted in their cues."""

from __future__ import annotations

from collections.abc import Mapping

from fantoccini.errors import UnknownNameError
from fantoccini.gestures import Gesture
from fantoccini.plays.acting import Repertory
from fantoccini.plays.actors import Actor, CannotBe
from fantoccini.plays.cues import Cue, Part
from fantoccini.plays.footing import Way


def walk_along(actor: Actor, way: Way, repertory: Repertory) -> tuple[Gesture, float]:
    """A player walks; the gesture, and when it begins [s].

    Raises:
        CannotBe: it has other strings than the bundled marionette.
    """
    if way.steps:
        try:
            made = repertory.walk(actor.player, way.steps, way.step_time)
        except UnknownNameError as error:
            raise CannotBe(f"{actor.player.name} cannot walk: {error}") from None
        gesture = made.turned(way.start.heading)
        actor.add(0, gesture, way.begin)
    else:
        gesture = Gesture.rest(actor.player.alone, 1e-3, everything=False)
    actor.ways.append(way)
    return gesture, way.begin


def note(
    cue: Cue, actor: Actor, lane: int, gesture: Gesture, start: float,
    marks: Mapping[str, float] | None = None, end: float | None = None,
) -> None:  # fmt: skip
    """Notes what a player does in a cue; marks from the start on [s]."""
    end = start + gesture.duration if end is None else end
    own = gesture.marks if marks is None else marks
    placed = {mark: start + t for mark, t in own.items()}
    cue.parts.append(Part(actor.player.name, lane, gesture, start, end, placed))
    actor.done = max(actor.done, end)
