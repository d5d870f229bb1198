"""What players do, put into their lanes and noted in their cues."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.base import UnknownNameError
from fantoccini.theatre.cast import Actor, CannotBe, Part, Turn, Way
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.plays.acting import Repertory

_IN_POSE = 1e-6
"""So near to a pose a player is in it [m]."""


def carry_pose(actor: Actor, side: str, begin: float, repertory: Repertory) -> float:
    """A player is in the pose in which it carries something on a forearm; from when on [s].

    Args:
        actor: the player, whose strings are at rest.
        side: of the forearm; "" where nothing hangs, which needs no pose.
        begin: when the pose is taken up, if the player is not in it [s].
        repertory: has the pose.

    Raises:
        CannotBe: it has other strings than the bundled marionette.
    """
    line = actor.lanes[0]
    if not side:
        return line.end
    try:
        pose = repertory.pose(actor.player, side).turned(actor.last.heading)
    except UnknownNameError as error:
        raise CannotBe(f"{actor.player.name} cannot carry it: {error}") from None
    there, now = pose.ends[0][1][pose.named], (line.d - line.carried)[pose.named]
    if np.max(np.abs(there - now)) > _IN_POSE:
        actor.add(0, pose, max(begin, line.end))
        line.stop()
    return line.end


def walk_along(
    actor: Actor, way: Way, repertory: Repertory, carries: str = ""
) -> tuple[Gesture, float]:
    """A player walks; the gesture, and when it begins [s].

    Args:
        actor: the player.
        way: where it goes.
        repertory: has the steps.
        carries: the forearm on which something hangs.

    Raises:
        CannotBe: it has other strings than the bundled marionette.
    """
    if way.steps:
        try:
            made = repertory.walk(actor.player, way.steps, way.step_time, carries)
        except UnknownNameError as error:
            raise CannotBe(f"{actor.player.name} cannot walk: {error}") from None
        gesture = made.turned(way.start.heading)
        actor.add(0, gesture, way.begin)
    else:
        gesture = Gesture.rest(actor.player.alone, 1e-3, everything=False)
    actor.ways.append(way)
    return gesture, way.begin


def note(
    turn: Turn,
    actor: Actor,
    lane: int,
    gesture: Gesture,
    start: float,
    marks: Mapping[str, float] | None = None,
    end: float | None = None,
) -> None:
    """Notes what a player does in a cue; marks from the start on [s]."""
    end = start + gesture.duration if end is None else end
    own = gesture.marks if marks is None else marks
    placed = {mark: start + t for mark, t in own.items()}
    turn.parts.append(Part(actor.player.name, lane, gesture, start, end, placed))
    actor.done = max(actor.done, end)
