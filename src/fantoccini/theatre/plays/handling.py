"""Cues with props: a player steps up to another or to a thing, handles it, and steps back.

A prop is a body that players handle; it hangs on a forearm by its handle, or stands at a footing, a
place with a heading. A cue is a line of the play. A spot is the list of keys that leads to an entry
of the file. The stage is the scene with all players, props and obstacles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from fantoccini.base import InputError
from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import (
    OTHER_SIDE,
    Actor,
    Cast,
    Corrections,
    Footing,
    Physique,
    hanging_pair,
    obstacle_top,
    prop_gestures,
    standing_pairs,
)
from fantoccini.theatre.gestures import CueError, PendingCue
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.approaching import CALM_TIME, Approaching, place_ahead
from fantoccini.theatre.plays.holdings import Hanging, Seated, Standing
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.sitting import sit
from fantoccini.theatre.plays.stage_state import StageState, carry_pose
from fantoccini.theatre.plays.walk_planner import WalkPlanner
from fantoccini.theatre.script import (
    END,
    START,
    GivesCue,
    Moments,
    PicksUpCue,
    PlayCue,
    PutsDownCue,
    SitsOnCue,
    StandsUpFromCue,
)

T = TypeVar("T")

_MAX_TABLE_STEP = 0.025
"""Longest step at a table, which swinging shins must not touch, for legs of 26.4 cm [m]."""
_TABLE_STOP_DISTANCE = 0.1
"""Least distance between the end of a walk to a table and the place of handling, for legs of
26.4 cm [m]."""
APPROACHES = ((0.04, 0.06), (0.06, 0.05), (0.08, 0.06))
"""Approaches to a seat, tried in turn: additional distance before it at which a player stops, since
shins swing on, and the longest step back; both for legs of 26.4 cm [m]."""
_AXIS_INSET, _EDGE_INSET = 0.03, 0.005
"""Least distance of a prop's axis, and of the edge of its bottom, from the border of the obstacle
on which it is put, if that is large enough [m]."""


class Handling:
    """Verbs of cues with props, each from one state of the stage to the next.

    Args:
        cast, planner, gestures: cast, planner of walks, and gestures of the play.
        corrections: corrections from earlier rounds.
    """

    def __init__(
        self, cast: Cast, planner: WalkPlanner, gestures: PlayerGestures, corrections: Corrections
    ):
        self._cast, self._planner, self._gestures = cast, planner, gestures
        self._corrections = corrections
        self._approaching = Approaching(planner, gestures, corrections)

    def do(
        self, stage: StageState, turn: PendingCue[PlayCue], begin: float, max_wait: float
    ) -> tuple[StageState, Moments]:
        """Stage after a cue with a prop, and the cue's moments.

        Args:
            stage: stage before the cue.
            turn: turn of the cue.
            begin: earliest time [s].
            max_wait: longest delay after it [s].

        Raises:
            CueError: the cue cannot be done.
        """
        match turn.entry:
            case GivesCue() as given:
                stage = self._gives(stage, turn, given, begin, max_wait)
            case SitsOnCue() as given:
                stage = self._sits(stage, turn, given, begin, max_wait)
            case StandsUpFromCue() as given:
                stage = self._stands_up(stage, turn, given, begin)
            case PutsDownCue() as given:
                stage = self._puts_down(stage, turn, given, begin, max_wait)
            case PicksUpCue() as given:
                stage = self._picks_up(stage, turn, given, begin, max_wait)
        moments = {
            START: min(part.start for part in stage.parts),
            END: max(part.end for part in stage.parts),
        }
        for part in stage.parts:
            moments.update({m: t for m, t in part.marks.items() if m in turn.cue.moment_names})
        return stage, moments

    # -- one verb each -----------------------------------------------------------------------

    def _gives(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        given: GivesCue,
        begin: float,
        max_wait: float,
    ) -> StageState:
        prop, (giver_name, receiver_name) = given.gives, turn.who
        giver, receiver = stage.actors[giver_name], stage.actors[receiver_name]
        held = stage.held(prop, giver_name)
        receiver_side = OTHER_SIDE[held.side]
        if (held_prop := stage.on_forearm(receiver_name, receiver_side)) is not None:
            raise CueError(
                f"{given.to}'s {receiver_side} arm, which would take it, holds {held_prop}"
            )
        stage.check_stands(giver_name)
        stage.check_stands(receiver_name)
        handover = self._compute(
            lambda: prop_gestures.give(
                giver.player.marionette,
                "",
                "",
                prop,
                side=held.side,
                elbow_distance=self._elbow_distance(turn),
                in_pose=True,
                receiver_stage=receiver.player.marionette,
            ),
            giver,
        )
        giver_footing = giver.last_footing
        goal = Footing(*handover.place(giver_footing.x, giver_footing.y, giver_footing.heading))
        stop = self._approaching.behind(goal, receiver, giver_footing, giver)
        stage = self._approaching.approach(
            stage,
            receiver_name,
            stop,
            goal,
            begin,
            max_wait,
            act_start=turn.start,
            ignored=giver_name,
        )
        receiver = stage.actors[receiver_name].rested()
        pose_start = max(begin, receiver.hands.end - prop_gestures.CARRY_TIME)
        giver = carry_pose(giver.rested(), held.side, pose_start, self._gestures)
        stage = stage.with_actor(receiver).with_actor(giver)
        pose_end = max(receiver.hands.end, giver.hands.lanes[0].end)
        stage, start = self._approaching.calm(stage, turn, pose_end, giver_name, receiver_name)
        stage, giver_end = self._approaching.perform(stage, giver_name, handover.giver, start)
        stage, receiver_end = self._approaching.perform(
            stage, receiver_name, handover.receiver, start
        )
        end = max(giver_end, receiver_end)
        stage = stage.without_hold(prop, held, start)
        pairs = standing_pairs(prop, FLOOR) | {
            hanging_pair(stage.bodies(name), arm, prop)
            for name, arm in ((giver_name, held.side), (receiver_name, receiver_side))
        }
        stage = stage.with_contact(turn, prop, pairs, start, end)
        stage = stage.with_prop(prop, Hanging(receiver_name, receiver_side, end, turn.spot))
        giver, receiver = stage.actors[giver_name], stage.actors[receiver_name]
        retreat = self._approaching.behind(giver_footing, giver, receiver.last_footing, receiver)
        return self._approaching.step_straight(
            stage, giver_name, retreat, end, ignored=receiver_name
        )

    def _sits(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        given: SitsOnCue,
        begin: float,
        max_wait: float,
    ) -> StageState:
        seat, (who,) = given.sits_on, turn.who
        actor = stage.actors[who]
        stage.check_stands(who)
        for name, seated in stage.seated.items():
            if seated.seat == seat:
                raise CueError(f"{name} sits on {seat}")
        middle, heading, height = self._seat(stage, seat, actor, turn)
        marionette, rest = actor.player.marionette, actor.player.rest_state
        sitting = self._compute(lambda: sit(marionette, "", seat, height, start=rest), actor)
        front_place = place_ahead(Footing(middle.real, middle.imag, heading), sitting.back)
        goal = Footing(*front_place, heading)
        clear_footing = self._approaching.nearest_clear(goal, 1.0, actor)
        clearance, step = APPROACHES[self._corrections.approach_indices.get(turn.spot, 0)]
        distance = abs(clear_footing.place - goal.place) + actor.player.leg_ratio * clearance
        stop = self._approaching.nearest_clear(goal, 1.0, actor, distance)
        stage = self._approaching.approach(
            stage, who, stop, goal, begin, max_wait, act_start=turn.start, step=step
        )
        approach_start = stage.actors[who].walks[-1].begin
        stage, start = self._damp_swing(stage, turn, who)
        stage, end = self._approaching.perform(stage, who, sitting.down, start)
        is_on_prop = seat in self._cast.props
        return stage.with_seated(
            who, Seated(seat, is_on_prop, approach_start, end, turn.spot, sitting.up, stop)
        )

    def _stands_up(
        self, stage: StageState, turn: PendingCue[PlayCue], given: StandsUpFromCue, begin: float
    ) -> StageState:
        (who,) = turn.who
        seated = stage.seated.get(who)
        if seated is None or seated.seat != given.stands_up_from:
            posture = f"sits on {seated.seat}" if seated else "stands"
            raise CueError(f"{who} does not sit on {given.stands_up_from}, but {posture}")
        actor = stage.actors[who].rested()
        start = max(begin, actor.hands.end)
        stage, end = self._approaching.perform(
            stage.with_actor(actor), who, seated.rise_gesture, start
        )
        stage = self._approaching.step_straight(stage, who, seated.stand_footing, end + CALM_TIME)
        stage, _ = self._damp_swing(stage, turn, who)
        meeting = seated.meeting(stage.bodies(who), start, stage.actors[who].walks[-1].end)
        return stage.with_meetings(meeting).with_seated(who, None)

    def _puts_down(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        given: PutsDownCue,
        begin: float,
        max_wait: float,
    ) -> StageState:
        prop, onto, (who,) = given.puts_down, given.onto, turn.who
        actor = stage.actors[who]
        held = stage.held(prop, who)
        stage.check_stands(who)
        top = obstacle_top(self._cast.file, onto)
        assert top is not None  # otherwise it is a mistake of the file
        bottom = self._bottom_height(turn, actor, prop, held)
        putting_gesture = self._putting_gesture(
            actor, prop, held.side, bottom, top, onto, elbow_distance=self._elbow_distance(turn)
        )
        goal = self._put_place(onto, prop, putting_gesture, actor)
        stop = self._table_stop(goal, actor)
        stage = self._approaching.approach(
            stage, who, stop, goal, begin, max_wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._damp_swing(stage, turn, who)
        stage, end = self._approaching.perform(stage, who, putting_gesture.gesture, start)
        pairs = standing_pairs(prop, onto) | {hanging_pair(stage.bodies(who), held.side, prop)}
        stage = stage.without_hold(prop, held, start).with_contact(turn, prop, pairs, start, end)
        prop_place = goal.place + np.exp(1j * goal.heading) * complex(
            putting_gesture.forward, putting_gesture.left
        )
        standing = Standing(Footing(prop_place.real, prop_place.imag, goal.heading), top, onto)
        return self._approaching.step_straight(
            stage.with_prop(prop, standing), who, stop, end, step=_MAX_TABLE_STEP
        )

    def _picks_up(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        given: PicksUpCue,
        begin: float,
        max_wait: float,
    ) -> StageState:
        prop, (who,) = given.picks_up, turn.who
        actor, prop_place, side = stage.actors[who], stage.prop_places[prop], "right"
        if isinstance(prop_place, Hanging):
            raise CueError(f"{prop_place.player} holds {prop}")
        if self._cast.props[prop].handle_height is None:
            raise CueError(f"{prop} has no handle")
        if stage.on_forearm(who, side) is not None:
            side = OTHER_SIDE[side]
        if (held_prop := stage.on_forearm(who, side)) is not None:
            raise CueError(f"{who}'s arms are not free: {held_prop} hangs there")
        stage.check_stands(who)
        bottom = self._carried_bottom_height(actor, prop, side)
        putting_gesture = self._putting_gesture(
            actor, prop, side, bottom, prop_place.bottom_height, prop_place.on, pick_up=True
        )
        prop_footing = self._corrections.prop_footings.get(turn.spot, prop_place.footing)
        place = prop_footing.place - np.exp(1j * prop_footing.heading) * complex(
            putting_gesture.forward, putting_gesture.left
        )
        goal = Footing(place.real, place.imag, prop_footing.heading)
        stop = self._table_stop(goal, actor)
        stage = self._approaching.approach(
            stage, who, stop, goal, begin, max_wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._damp_swing(stage, turn, who)
        stage, end = self._approaching.perform(stage, who, putting_gesture.gesture, start)
        pairs = standing_pairs(prop, prop_place.on) | {hanging_pair(stage.bodies(who), side, prop)}
        stage = stage.with_contact(turn, prop, pairs, start, end)
        stage = stage.with_prop(prop, Hanging(who, side, end, turn.spot))
        return self._approaching.step_straight(stage, who, stop, end, step=_MAX_TABLE_STEP)

    # -- state -------------------------------------------------------------------------------

    def _damp_swing(
        self, stage: StageState, turn: PendingCue[PlayCue], who: str
    ) -> tuple[StageState, float]:
        """Stage with a player's swing damped after its last motion, and the end of that [s]."""
        actor = stage.actors[who].rested()
        return self._approaching.calm(stage.with_actor(actor), turn, actor.hands.end, who)

    def _compute(self, compute: Callable[[], T], actor: Actor) -> T:
        """Result of ``compute``.

        Raises:
            CueError: the actor cannot do it.
        """
        try:
            return compute()
        except (InputError, ValueError) as error:
            raise CueError(f"{actor.player.name} cannot do it: {error}") from None

    def _table_stop(self, goal: Footing, actor: Actor) -> Footing:
        """Footing behind the place of handling at which the walk to a table ends."""
        distance = actor.player.leg_ratio * _TABLE_STOP_DISTANCE
        return self._approaching.nearest_clear(goal, -1.0, actor, distance)

    def _putting_gesture(
        self,
        actor: Actor,
        prop: str,
        side: str,
        bottom: float,
        top: float,
        on: str,
        *,
        elbow_distance: float | None = None,
        pick_up: bool = False,
    ) -> putting.Putting:
        """Gesture that puts a prop down on something, or picks it up from there.

        Args:
            actor: player that does it.
            prop: the prop.
            side: side of the forearm on which it hangs.
            bottom: height of its bottom while it hangs [m].
            top: height on which it stands [m].
            on: obstacle on which it stands.
            elbow_distance: distance of its handle from the elbow [m].
            pick_up: whether to pick it up.

        Raises:
            CueError: the obstacle is too low or too high, or the player cannot do it.
        """
        physique = Physique.of(actor.player.marionette)
        lowest, highest = (
            bottom - physique.arm_ratio(side) * drop for drop in reversed(putting.DROP_RANGE)
        )
        if not lowest <= top <= highest:
            fault, nearest_height = (
                ("low", lowest + 5e-4) if top < lowest else ("high", highest - 5e-4)
            )
            raise CueError(
                f"{on} is {top:.3f} m high, which is too {fault} for {actor.player.name}; needed: "
                f"{lowest:.3f} to {highest:.3f} m, {nearest_height:.3f} m is nearest"
            )
        return self._compute(
            lambda: putting.putting(
                actor.player.marionette,
                "",
                prop,
                bottom - top,
                side=side,
                elbow_distance=elbow_distance,
                pick_up=pick_up,
            ),
            actor,
        )

    def _carried_bottom_height(self, actor: Actor, prop: str, side: str) -> float:
        """Height of the bottom of a prop that a player carries on a forearm [m]."""
        handle = self._cast.props[prop].handle_height
        assert handle is not None
        marionette = actor.player.marionette
        rise = Physique.of(marionette).arm_ratio(side) * putting.CARRY_RISE
        return prop_gestures.handle_place(marionette, side=side)[2] + rise - handle

    def _elbow_distance(self, turn: PendingCue[PlayCue]) -> float | None:
        """Distance of the handle from the elbow, measured in an earlier round [m]."""
        measured = self._corrections.handle_positions.get(turn.spot)
        return None if measured is None else measured[0]

    def _bottom_height(
        self, turn: PendingCue[PlayCue], actor: Actor, prop: str, held: Hanging
    ) -> float:
        """Height of the bottom of a held prop, as measured in an earlier round if it was [m]."""
        measured = self._corrections.handle_positions.get(turn.spot)
        handle = self._cast.props[prop].handle_height
        assert handle is not None
        if measured is None:
            return self._carried_bottom_height(actor, prop, held.side)
        return measured[1] - handle

    def _seat(
        self, stage: StageState, name: str, actor: Actor, turn: PendingCue[PlayCue]
    ) -> tuple[complex, float, float]:
        """Middle of a seat [m], heading of a sitter [rad], and height of the seat [m]."""
        if name in stage.prop_places:
            prop_place, seat_height = stage.prop_places[name], self._cast.props[name].seat_height
            if isinstance(prop_place, Hanging):
                raise CueError(f"{prop_place.player} holds {name}")
            if seat_height is None:
                raise CueError(f"{name} has no seat; needed: `seat:` of the prop")
            footing = self._corrections.prop_footings.get(turn.spot, prop_place.footing)
            return footing.place, footing.heading, prop_place.bottom_height + seat_height
        top_height = obstacle_top(self._cast.file, name)
        assert top_height is not None  # otherwise it is a mistake of the file
        middle = self._planner.middle(name)
        if middle is None:
            raise CueError(f"{name} is too high to sit on: its top is at {top_height:.3g} m")
        return (
            middle,
            Footing(middle.real, middle.imag).towards(actor.last_footing.place),
            top_height,
        )

    def _put_place(
        self, onto: str, prop: str, putting_gesture: putting.Putting, actor: Actor
    ) -> Footing:
        """Footing for putting something on an obstacle, at the nearest side."""
        offset, footings = complex(putting_gesture.forward, putting_gesture.left), []
        inset = max(_AXIS_INSET, self._cast.props[prop].bottom_radius + _EDGE_INSET)
        for heading, prop_place in self._planner.sides(onto, actor.last_footing.place, inset):
            place = prop_place - np.exp(1j * heading) * offset
            footings.append(Footing(place.real, place.imag, heading))
        return min(footings, key=lambda footing: abs(footing.place - actor.last_footing.place))
