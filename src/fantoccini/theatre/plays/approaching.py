"""How players come up to things and to each other, and step away.

Nearer to each other than their radii two are only here: the last steps are straight and slow, and
nobody else is there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from fantoccini.theatre.cast import Actor, CannotBe, Footing, Turn, Way, Wishes
from fantoccini.theatre.gestures import Gesture, Step
from fantoccini.theatre.plays.acting import Repertory
from fantoccini.theatre.plays.calming import NONE, calm_gesture
from fantoccini.theatre.plays.doing import carry_pose, note, walk_along
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import Spot

STEP, _STEP_TIME = 0.05, 1.0
"""Longest step of those that lead up to a thing or away from it [m], and its duration [s]."""
CALM = 0.3
"""Pause before something is handled [s]."""
_FARTHEST = 1.0
"""Farthest from a thing that a player steps up to it [m]."""
_APART = 0.02
"""By how much more than their radii two are apart before one comes up to the other [m]."""
_THERE = 1e-6
"""So near to a place a player is there [m]."""


class Approaching:
    """The steps of cues with props.

    Attributes:
        calmed: (cue, player) -> when it begins to take out its swing [s].

    Args:
        walks, repertory: of the play.
        actors: the players, as they are placed so far.
        wishes: of earlier rounds.
        carries: gives the forearm on which something hangs that a player carries, or "".
    """

    def __init__(
        self,
        walks: Walks,
        repertory: Repertory,
        actors: Mapping[str, Actor],
        wishes: Wishes,
        carries: Callable[[str], str],
    ):
        self._walks, self._repertory, self._actors = walks, repertory, actors
        self._wishes, self._carries = wishes, carries
        self.calmed: dict[tuple[Spot, str], float] = {}

    def come(
        self,
        turn: Turn,
        actor: Actor,
        before: Footing,
        there: Footing,
        begin: float,
        wait: float,
        *,
        beside: Actor | None = None,
        step: float = STEP,
    ) -> None:
        """A walk to a place before something, and the last straight steps."""
        actor.rests()
        carries = self._carries(actor.player.name)
        free = max(carry_pose(actor, carries, begin, self._repertory), begin)
        if abs(actor.last.place - before.place) > _THERE or actor.last.heading != before.heading:
            others = [
                (one.player, one.track()) for one in self._actors.values() if one is not actor
            ]
            way, why = self._walks.way(
                actor.player,
                actor.last,
                [before],
                free,
                wait,
                others,
                near=0.0,
                arrives=None,
                free_from=free,
                carries=bool(carries),
            )
            if way is None:
                raise CannotBe(why)
            self._walk(turn, actor, way)
            free = way.end
        self.straight(turn, actor, there, free, beside=beside, step=step)

    def straight(
        self,
        turn: Turn,
        actor: Actor,
        there: Footing,
        begin: float,
        beside: Actor | None = None,
        step: float = STEP,
    ) -> None:
        """Straight steps, forward or backward, past nobody."""
        here = actor.last
        way_there = here.seen(there.place).real
        n = max(1, int(np.ceil(abs(way_there) / step)))
        way = Way(here, begin, (Step(way_there / n),) * n, _STEP_TIME)
        others = [
            (one.player, one.track())
            for one in self._actors.values()
            if one is not actor and one is not beside
        ]
        who = self._walks.in_the_way(actor.player, way, others)
        if who is not None:
            raise CannotBe(f"{actor.player.name} has no room: {who} is in the way")
        if not self._walks.is_inside(actor.player, there):
            raise CannotBe(f"{actor.player.name}'s hands would leave their space")
        self._walk(turn, actor, way)

    def _walk(self, turn: Turn, actor: Actor, way: Way) -> None:
        carries = self._carries(actor.player.name)
        gesture, start = walk_along(actor, way, self._repertory, carries)
        note(turn, actor, 0, gesture, start, {}, way.end)

    def do(self, turn: Turn, actor: Actor, gesture: Gesture, start: float) -> float:
        """A gesture from a time on; its end [s]."""
        own = gesture.turned(actor.last.heading)
        begun = actor.add(0, own, start)
        actor.played.append((0, begun, begun + own.duration, own.named))
        note(turn, actor, 0, own, begun)
        return begun + own.duration

    def calm(self, turn: Turn, begin: float, *actors: Actor) -> float:
        """Takes out swing from a time on; when what is to be done can begin [s]."""
        for actor in actors:
            key = turn.spot, actor.player.name
            gesture = calm_gesture(actor.player.alone, self._wishes.calms.get(key, NONE))
            lane, start = actor.lane(gesture, begin)
            start = actor.add(lane, gesture, start)
            actor.played.append((lane, start, start + gesture.duration, gesture.named))
            self.calmed[key] = start
        return max(actor.rests() for actor in actors) + CALM

    def clear_of(self, there: Footing, side: float, actor: Actor, least: float = 0.02) -> Footing:
        """The nearest place ahead (1) or behind (-1) that is clear of what stands there."""
        for way in np.arange(least, _FARTHEST, 0.02):
            one = Footing(*along(there, side * float(way)), there.heading)
            if self._walks.is_clear(actor.player, one):
                return one
        raise CannotBe(f"{actor.player.name} has no room to step up to it")

    def apart(self, one: Footing, actor: Actor, other: Footing, beside: Actor) -> Footing:
        """The nearest place behind a footing that is as far from another as two must be."""
        away = self._walks.clear(actor.player) + self._walks.clear(beside.player) + _APART
        ways = 0.01 * np.arange(int(100 * 2.0 * away) + 1)
        behind = one.place - ways * np.exp(1j * one.heading)
        z = behind[int(np.argmax(np.abs(behind - other.place) >= away))]
        return Footing(float(z.real), float(z.imag), one.heading)


def along(one: Footing, forward: float) -> tuple[float, float]:
    """A place ahead of a footing [m]."""
    z = one.place + forward * np.exp(1j * one.heading)
    return float(z.real), float(z.imag)
