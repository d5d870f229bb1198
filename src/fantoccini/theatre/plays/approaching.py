"""Steps of players up to things and to each other, and away again.

Two players come nearer to each other than their radii only here: the last steps are straight and
slow, and nobody else is near.

A footing is a place with a heading, the angle of the forward direction. A lane is a list of
gestures in order; the offsets of all lanes add up. The stage is the scene with all players, props
and obstacles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.theatre.cast import Actor, Corrections, Footing, Walk
from fantoccini.theatre.gestures import CueError, Gesture, PendingCue, Step
from fantoccini.theatre.plays.calming import NO_OFFSETS, calm_gesture
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.stage_state import StageState, after_walk, carry_pose
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import PlayCue

MAX_STEP, _STEP_TIME = 0.05, 1.0
"""Longest step up to a thing or away from it, for legs of 26.4 cm [m], and its duration [s]."""
CALM_TIME = 0.3
"""Pause before a thing is handled [s]."""
_MAX_DISTANCE = 1.0
"""Largest distance from a thing from which a player steps up to it [m]."""
_GAP = 0.02
"""Gap between two players, in addition to their radii, before one steps up to the other, for legs
of 26.4 cm [m]."""
_PLACE_TOLERANCE = 1e-6
"""Distance below which a player is at a place [m]."""


class Approaching:
    """Steps towards props, seats and players, and away from them.

    Args:
        planner, gestures: planner of walks, and gestures of the play.
        corrections: corrections from earlier rounds.
    """

    def __init__(self, planner: WalkPlanner, gestures: PlayerGestures, corrections: Corrections):
        self._planner, self._gestures, self._corrections = planner, gestures, corrections

    def approach(
        self,
        stage: StageState,
        who: str,
        stop: Footing,
        goal: Footing,
        begin: float,
        max_wait: float,
        *,
        act_start: float,
        ignored: str = "",
        step: float = MAX_STEP,
    ) -> StageState:
        """Stage after a walk to a stop, and straight steps from there to a goal.

        Args:
            stage: stage before.
            who: player that walks.
            stop: footing at which the walk ends.
            goal: footing after the last steps.
            begin: earliest time [s].
            max_wait: longest delay after it [s].
            act_start: start of the act [s].
            ignored: player that may be near at the last steps.
            step: longest of the last steps, for legs of 26.4 cm [m].

        Raises:
            CueError: the player has no way, or no room.
        """
        carrying_side = stage.carries(who)
        actor = carry_pose(stage.actors[who].rested(), carrying_side, begin, self._gestures)
        stage, free_time = stage.with_actor(actor), max(actor.hands.lanes[0].end, begin)
        if (
            abs(actor.last_footing.place - stop.place) > _PLACE_TOLERANCE
            or actor.last_footing.heading != stop.heading
        ):
            walk, reason = self._planner.plan(
                actor.player,
                actor.last_footing,
                [stop],
                free_time,
                max_wait,
                [(other.player, other.track()) for other in stage.others(who)],
                max_goal_distance=0.0,
                arrival_time=None,
                free_time=free_time,
                is_carrying=bool(carrying_side),
                act_start=act_start,
            )
            if walk is None:
                raise CueError(reason)
            stage, free_time = self._walk(stage, actor, walk), walk.end
        return self.step_straight(stage, who, goal, free_time, ignored=ignored, step=step)

    def step_straight(
        self,
        stage: StageState,
        who: str,
        goal: Footing,
        begin: float,
        *,
        ignored: str = "",
        step: float = MAX_STEP,
    ) -> StageState:
        """Stage after straight steps, forward or backward, that pass no other player.

        Args:
            stage, who, goal, ignored, step: see :meth:`approach`.
            begin: time of the first step [s].

        Raises:
            CueError: somebody is in the way, or the player's hands would leave their space.
        """
        actor = stage.actors[who]
        distance = actor.last_footing.seen(goal.place).real
        n = max(1, int(np.ceil(abs(distance) / (step * actor.player.leg_ratio))))
        walk = Walk(actor.last_footing, begin, (Step(distance / n),) * n, _STEP_TIME)
        tracks = [(other.player, other.track()) for other in stage.others(who, ignored)]
        blocking_player = self._planner.in_the_way(actor.player, walk, tracks)
        if blocking_player is not None:
            raise CueError(f"{who} has no room: {blocking_player} is in the way")
        if not self._planner.is_inside(actor.player, goal):
            raise CueError(f"{who}'s hands would leave their space")
        return self._walk(stage, actor, walk)

    def _walk(self, stage: StageState, actor: Actor, walk: Walk) -> StageState:
        carrying_side = stage.carries(actor.player.name)
        actor, gesture = after_walk(actor, walk, self._gestures, carrying_side)
        return stage.with_part(actor, 0, gesture, walk.begin, {}, walk.end)

    def perform(
        self, stage: StageState, who: str, gesture: Gesture, earliest: float
    ) -> tuple[StageState, float]:
        """Stage after a gesture that begins at a time or later, and its end [s]."""
        actor = stage.actors[who]
        turned_gesture = actor.player.turned(gesture, actor.last_footing.heading)
        hands, start = actor.hands.add_busy(0, turned_gesture, earliest)
        stage = stage.with_part(replace(actor, hands=hands), 0, turned_gesture, start)
        return stage, start + turned_gesture.duration

    def calm(
        self, stage: StageState, turn: PendingCue[PlayCue], begin: float, *names: str
    ) -> tuple[StageState, float]:
        """Stage after motions that damp swing, and the time at which the action can begin [s]."""
        for name in names:
            actor, key = stage.actors[name], (turn.spot, name)
            gesture = calm_gesture(
                actor.player.marionette, self._corrections.damping_offsets.get(key, NO_OFFSETS)
            )
            lane, start = actor.hands.free_lane(gesture, begin)
            hands, start = actor.hands.add_busy(lane, gesture, start)
            actor = replace(actor, hands=hands)
            stage = replace(
                stage.with_actor(actor), damping_times={**stage.damping_times, key: start}
            )
        for name in names:
            stage = stage.with_actor(stage.actors[name].rested())
        return stage, max(stage.actors[name].hands.end for name in names) + CALM_TIME

    def nearest_clear(
        self, footing: Footing, side: float, actor: Actor, min_distance: float = 0.02
    ) -> Footing:
        """Nearest footing ahead (side 1) or behind (-1) that is clear of everything on the stage.

        Raises:
            CueError: there is none up to 1 m away.
        """
        for distance in np.arange(min_distance, _MAX_DISTANCE, 0.02):
            candidate = Footing(*place_ahead(footing, side * float(distance)), footing.heading)
            if self._planner.is_clear(actor.player, candidate):
                return candidate
        raise CueError(f"{actor.player.name} has no room to step up to it")

    def behind(
        self, footing: Footing, actor: Actor, other_footing: Footing, other: Actor
    ) -> Footing:
        """Nearest footing behind an actor's one at which two actors are clear of each other."""
        distance = self._planner.clearance(actor.player) + self._planner.clearance(other.player)
        distance += _GAP * max(actor.player.leg_ratio, other.player.leg_ratio)
        steps_back = 0.01 * np.arange(int(100 * 2.0 * distance) + 1)
        places = footing.place - steps_back * np.exp(1j * footing.heading)
        place = places[int(np.argmax(np.abs(places - other_footing.place) >= distance))]
        return Footing(float(place.real), float(place.imag), footing.heading)


def place_ahead(footing: Footing, distance: float) -> tuple[float, float]:
    """(x, y) of the place at a distance ahead of a footing [m]."""
    place = footing.place + distance * np.exp(1j * footing.heading)
    return float(place.real), float(place.imag)
