"""Steps of players up to things and to each other, and away again.

Only here are two players nearer to each other than their radii: the last steps are straight and
slow, and nobody else is near.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.theatre.cast import Actor, Corrections, Footing, Way
from fantoccini.theatre.gestures import CannotBe, Gesture, Step, Turn
from fantoccini.theatre.plays.calming import NONE, calm_gesture
from fantoccini.theatre.plays.on_stage import OnStage, carry_pose, walked
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import PlayCue

STEP, _STEP_TIME = 0.05, 1.0
"""Longest step up to a thing or away from it, for legs of 26.4 cm [m], and its duration [s]."""
CALM = 0.3
"""Pause before a thing is handled [s]."""
_MAX_DISTANCE = 1.0
"""Largest distance from a thing from which a player steps up to it [m]."""
_GAP = 0.02
"""Gap between two players, in addition to their radii, before one comes up to the other, for such
legs [m]."""
_SAME_PLACE = 1e-6
"""Distance below which a player is at a place [m]."""


class Approaching:
    """Steps of cues with props.

    Args:
        walks, gestures: walks and gestures of the play.
        corrections: corrections from earlier rounds.
    """

    def __init__(self, walks: Walks, gestures: PlayerGestures, corrections: Corrections):
        self._walks, self._gestures, self._corrections = walks, gestures, corrections

    def come(
        self,
        stage: OnStage,
        who: str,
        before: Footing,
        there: Footing,
        begin: float,
        wait: float,
        *,
        act_start: float,
        beside: str = "",
        step: float = STEP,
    ) -> OnStage:
        """Stage after a walk to a place before something, and the last straight steps."""
        carries = stage.carries(who)
        actor = carry_pose(stage.actors[who].rested(), carries, begin, self._gestures)
        stage, free = stage.acting(actor), max(actor.hands.lanes[0].end, begin)
        if (
            abs(actor.last.place - before.place) > _SAME_PLACE
            or actor.last.heading != before.heading
        ):
            way, why = self._walks.way(
                actor.player,
                actor.last,
                [before],
                free,
                wait,
                [(other.player, other.track()) for other in stage.others(who)],
                near=0.0,
                arrives=None,
                free_from=free,
                carries=bool(carries),
                act_start=act_start,
            )
            if way is None:
                raise CannotBe(why)
            stage, free = self._walk(stage, actor, way), way.end
        return self.straight(stage, who, there, free, beside=beside, step=step)

    def straight(
        self,
        stage: OnStage,
        who: str,
        there: Footing,
        begin: float,
        *,
        beside: str = "",
        step: float = STEP,
    ) -> OnStage:
        """Stage after straight steps, forward or backward, in which nobody is passed.

        The longest step is that for legs of 26.4 cm [m].
        """
        actor = stage.actors[who]
        way_there = actor.last.seen(there.place).real
        n = max(1, int(np.ceil(abs(way_there) / (step * actor.player.leg_ratio))))
        way = Way(actor.last, begin, (Step(way_there / n),) * n, _STEP_TIME)
        others = [(other.player, other.track()) for other in stage.others(who, beside)]
        blocking = self._walks.in_the_way(actor.player, way, others)
        if blocking is not None:
            raise CannotBe(f"{who} has no room: {blocking} is in the way")
        if not self._walks.is_inside(actor.player, there):
            raise CannotBe(f"{who}'s hands would leave their space")
        return self._walk(stage, actor, way)

    def _walk(self, stage: OnStage, actor: Actor, way: Way) -> OnStage:
        carries = stage.carries(actor.player.name)
        actor, gesture = walked(actor, way, self._gestures, carries)
        return stage.part(actor, 0, gesture, way.begin, {}, way.end)

    def do(self, stage: OnStage, who: str, gesture: Gesture, start: float) -> tuple[OnStage, float]:
        """Stage after a gesture that begins at a time or later, and its end [s]."""
        actor = stage.actors[who]
        own = actor.player.turned(gesture, actor.last.heading)
        hands, begun = actor.hands.add_busy(0, own, start)
        stage = stage.part(replace(actor, hands=hands), 0, own, begun)
        return stage, begun + own.duration

    def calm(
        self, stage: OnStage, turn: Turn[PlayCue], begin: float, *names: str
    ) -> tuple[OnStage, float]:
        """Stage after motions that damp swing, and the time at which the action can begin [s]."""
        for name in names:
            actor, key = stage.actors[name], (turn.spot, name)
            gesture = calm_gesture(actor.player.alone, self._corrections.calms.get(key, NONE))
            lane, start = actor.hands.free_lane(gesture, begin)
            hands, start = actor.hands.add_busy(lane, gesture, start)
            actor = replace(actor, hands=hands)
            stage = replace(stage.acting(actor), calmed={**stage.calmed, key: start})
        for name in names:
            stage = stage.acting(stage.actors[name].rested())
        return stage, max(stage.actors[name].hands.end for name in names) + CALM

    def clear_of(self, there: Footing, side: float, actor: Actor, least: float = 0.02) -> Footing:
        """Nearest place ahead (1) or behind (-1) that is clear of everything on the stage."""
        for way in np.arange(least, _MAX_DISTANCE, 0.02):
            candidate = Footing(*along(there, side * float(way)), there.heading)
            if self._walks.is_clear(actor.player, candidate):
                return candidate
        raise CannotBe(f"{actor.player.name} has no room to step up to it")

    def apart(self, one: Footing, actor: Actor, other: Footing, beside: Actor) -> Footing:
        """Nearest place behind a footing that keeps the distance of two players from another."""
        distance = self._walks.clear(actor.player) + self._walks.clear(beside.player)
        distance += _GAP * max(actor.player.leg_ratio, beside.player.leg_ratio)
        ways = 0.01 * np.arange(int(100 * 2.0 * distance) + 1)
        behind = one.place - ways * np.exp(1j * one.heading)
        z = behind[int(np.argmax(np.abs(behind - other.place) >= distance))]
        return Footing(float(z.real), float(z.imag), one.heading)


def along(one: Footing, forward: float) -> tuple[float, float]:
    """Place ahead of a footing [m]."""
    z = one.place + forward * np.exp(1j * one.heading)
    return float(z.real), float(z.imag)
