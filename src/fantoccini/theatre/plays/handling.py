"""Cues with props: a player steps up to another or to a thing, handles it, and steps back."""

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
from fantoccini.theatre.plays.on_stage import OnStage, carry_pose
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.sitting import sit
from fantoccini.theatre.plays.walks import Walks
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
_MIN_STOP_DISTANCE = 0.1
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
        cast, walks, gestures: cast, walks and gestures of the play.
        corrections: corrections from earlier rounds.
    """

    def __init__(
        self, cast: Cast, walks: Walks, gestures: PlayerGestures, corrections: Corrections
    ):
        self._cast, self._walks, self._gestures = cast, walks, gestures
        self._corrections = corrections
        self._steps = Approaching(walks, gestures, corrections)

    def do(
        self, stage: OnStage, turn: PendingCue[PlayCue], begin: float, wait: float
    ) -> tuple[OnStage, Moments]:
        """Stage after a cue with a prop, and the cue's moments.

        Args:
            stage: stage before the cue.
            turn: turn of the cue.
            begin: earliest time [s].
            wait: longest delay after it [s].

        Raises:
            CueError: the cue cannot be done.
        """
        match turn.entry:
            case GivesCue() as given:
                stage = self._gives(stage, turn, given, begin, wait)
            case SitsOnCue() as given:
                stage = self._sits(stage, turn, given, begin, wait)
            case StandsUpFromCue() as given:
                stage = self._stands_up(stage, turn, given, begin)
            case PutsDownCue() as given:
                stage = self._puts_down(stage, turn, given, begin, wait)
            case PicksUpCue() as given:
                stage = self._picks_up(stage, turn, given, begin, wait)
        moments = {
            START: min(part.start for part in stage.parts),
            END: max(part.end for part in stage.parts),
        }
        for part in stage.parts:
            moments.update({m: t for m, t in part.marks.items() if m in turn.cue.moment_names})
        return stage, moments

    # -- one verb each -----------------------------------------------------------------------

    def _gives(
        self, stage: OnStage, turn: PendingCue[PlayCue], given: GivesCue, begin: float, wait: float
    ) -> OnStage:
        prop, (who, to) = given.gives, turn.who
        giver, receiver = stage.actors[who], stage.actors[to]
        held = stage.held(prop, who)
        other = OTHER_SIDE[held.side]
        if (taken := stage.on_forearm(to, other)) is not None:
            raise CueError(f"{given.to}'s {other} arm, which would take it, holds {taken}")
        stage.check_stands(who)
        stage.check_stands(to)
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
        here = giver.last
        goal = Footing(*handover.place(here.x, here.y, here.heading))
        stop = self._steps.behind(goal, receiver, here, giver)
        stage = self._steps.approach(
            stage, to, stop, goal, begin, wait, act_start=turn.start, ignored=who
        )
        receiver = stage.actors[to].rested()
        pose_start = max(begin, receiver.hands.end - prop_gestures.CARRY_TIME)
        giver = carry_pose(giver.rested(), held.side, pose_start, self._gestures)
        stage = stage.with_actor(receiver).with_actor(giver)
        pose_end = max(receiver.hands.end, giver.hands.lanes[0].end)
        stage, start = self._steps.calm(stage, turn, pose_end, who, to)
        stage, given_at = self._steps.perform(stage, who, handover.giver, start)
        stage, taken_at = self._steps.perform(stage, to, handover.receiver, start)
        end = max(given_at, taken_at)
        stage = stage.without_hold(prop, held, start)
        pairs = standing_pairs(prop, FLOOR) | {
            hanging_pair(stage.bodies(name), arm, prop)
            for name, arm in ((who, held.side), (to, other))
        }
        stage = stage.with_contact(turn, prop, pairs, start, end)
        stage = stage.with_prop(prop, Hanging(to, other, end, turn.spot))
        giver, receiver = stage.actors[who], stage.actors[to]
        retreat = self._steps.behind(here, giver, receiver.last, receiver)
        return self._steps.step_straight(stage, who, retreat, end, ignored=to)

    def _sits(
        self, stage: OnStage, turn: PendingCue[PlayCue], given: SitsOnCue, begin: float, wait: float
    ) -> OnStage:
        seat, (who,) = given.sits_on, turn.who
        actor = stage.actors[who]
        stage.check_stands(who)
        for name, seated in stage.seated.items():
            if seated.seat == seat:
                raise CueError(f"{name} sits on {seat}")
        middle, heading, height = self._seat(stage, seat, actor, turn)
        marionette, rest = actor.player.marionette, actor.player.rest_state
        sits = self._compute(lambda: sit(marionette, "", seat, height, start=rest), actor)
        place = place_ahead(Footing(middle.real, middle.imag, heading), sits.back)
        goal = Footing(*place, heading)
        clear = self._steps.nearest_clear(goal, 1.0, actor)
        clearance, step = APPROACHES[self._corrections.approaches.get(turn.spot, 0)]
        distance = abs(clear.place - goal.place) + actor.player.leg_ratio * clearance
        stop = self._steps.nearest_clear(goal, 1.0, actor, distance)
        stage = self._steps.approach(
            stage, who, stop, goal, begin, wait, act_start=turn.start, step=step
        )
        since = stage.actors[who].ways[-1].begin
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.perform(stage, who, sits.down, start)
        on_prop = seat in self._cast.props
        return stage.with_seated(who, Seated(seat, on_prop, since, end, turn.spot, sits.up, stop))

    def _stands_up(
        self, stage: OnStage, turn: PendingCue[PlayCue], given: StandsUpFromCue, begin: float
    ) -> OnStage:
        (who,) = turn.who
        seated = stage.seated.get(who)
        if seated is None or seated.seat != given.stands_up_from:
            posture = f"sits on {seated.seat}" if seated else "stands"
            raise CueError(f"{who} does not sit on {given.stands_up_from}, but {posture}")
        actor = stage.actors[who].rested()
        start = max(begin, actor.hands.end)
        stage, end = self._steps.perform(stage.with_actor(actor), who, seated.up, start)
        stage = self._steps.step_straight(stage, who, seated.ahead, end + CALM_TIME)
        stage, _ = self._calmed(stage, turn, who)
        meeting = seated.meeting(stage.bodies(who), start, stage.actors[who].ways[-1].end)
        return stage.with_meetings(meeting).with_seated(who, None)

    def _puts_down(
        self,
        stage: OnStage,
        turn: PendingCue[PlayCue],
        given: PutsDownCue,
        begin: float,
        wait: float,
    ) -> OnStage:
        prop, onto, (who,) = given.puts_down, given.onto, turn.who
        actor = stage.actors[who]
        held = stage.held(prop, who)
        stage.check_stands(who)
        top = obstacle_top(self._cast.file, onto)
        assert top is not None  # otherwise it is a mistake of the file
        bottom = self._bottom_height(turn, actor, prop, held)
        puts = self._putting(
            actor, prop, held.side, bottom, top, onto, elbow_distance=self._elbow_distance(turn)
        )
        goal = self._put_place(onto, prop, puts, actor)
        stop = self._table_stop(goal, actor)
        stage = self._steps.approach(
            stage, who, stop, goal, begin, wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.perform(stage, who, puts.gesture, start)
        pairs = standing_pairs(prop, onto) | {hanging_pair(stage.bodies(who), held.side, prop)}
        stage = stage.without_hold(prop, held, start).with_contact(turn, prop, pairs, start, end)
        z = goal.place + np.exp(1j * goal.heading) * complex(puts.forward, puts.left)
        stands = Standing(Footing(z.real, z.imag, goal.heading), top, onto)
        return self._steps.step_straight(
            stage.with_prop(prop, stands), who, stop, end, step=_MAX_TABLE_STEP
        )

    def _picks_up(
        self,
        stage: OnStage,
        turn: PendingCue[PlayCue],
        given: PicksUpCue,
        begin: float,
        wait: float,
    ) -> OnStage:
        prop, (who,) = given.picks_up, turn.who
        actor, thing, side = stage.actors[who], stage.where[prop], "right"
        if isinstance(thing, Hanging):
            raise CueError(f"{thing.player} holds {prop}")
        if self._cast.props[prop].handle is None:
            raise CueError(f"{prop} has no handle")
        if stage.on_forearm(who, side) is not None:
            side = OTHER_SIDE[side]
        if (taken := stage.on_forearm(who, side)) is not None:
            raise CueError(f"{who}'s arms are not free: {taken} hangs there")
        stage.check_stands(who)
        bottom = self._carried_bottom_height(actor, prop, side)
        puts = self._putting(actor, prop, side, bottom, thing.height, thing.on, pick_up=True)
        stands = self._corrections.stands.get(turn.spot, thing.place)
        z = stands.place - np.exp(1j * stands.heading) * complex(puts.forward, puts.left)
        goal = Footing(z.real, z.imag, stands.heading)
        stop = self._table_stop(goal, actor)
        stage = self._steps.approach(
            stage, who, stop, goal, begin, wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.perform(stage, who, puts.gesture, start)
        pairs = standing_pairs(prop, thing.on) | {hanging_pair(stage.bodies(who), side, prop)}
        stage = stage.with_contact(turn, prop, pairs, start, end)
        stage = stage.with_prop(prop, Hanging(who, side, end, turn.spot))
        return self._steps.step_straight(stage, who, stop, end, step=_MAX_TABLE_STEP)

    # -- state -------------------------------------------------------------------------------

    def _calmed(self, stage: OnStage, turn: PendingCue[PlayCue], who: str) -> tuple[OnStage, float]:
        """Stage with a player's swing damped after its last motion, and the end of that [s]."""
        actor = stage.actors[who].rested()
        return self._steps.calm(stage.with_actor(actor), turn, actor.hands.end, who)

    def _compute(self, make: Callable[[], T], actor: Actor) -> T:
        """Result of ``make``.

        Raises:
            CueError: the actor cannot do it.
        """
        try:
            return make()
        except (InputError, ValueError) as error:
            raise CueError(f"{actor.player.name} cannot do it: {error}") from None

    def _table_stop(self, goal: Footing, actor: Actor) -> Footing:
        """Footing behind the place of handling at which the walk to a table ends."""
        distance = actor.player.leg_ratio * _MIN_STOP_DISTANCE
        return self._steps.nearest_clear(goal, -1.0, actor, distance)

    def _putting(
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
            bottom - physique.arm_ratio(side) * drop for drop in reversed(putting.DROPS)
        )
        if not lowest <= top <= highest:
            off, near = ("low", lowest + 5e-4) if top < lowest else ("high", highest - 5e-4)
            raise CueError(
                f"{on} is {top:.3f} m high, which is too {off} for {actor.player.name}; needed: "
                f"{lowest:.3f} to {highest:.3f} m, {near:.3f} m is nearest"
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
        handle = self._cast.props[prop].handle
        assert handle is not None
        marionette = actor.player.marionette
        rise = Physique.of(marionette).arm_ratio(side) * putting.CARRY_RISE
        return prop_gestures.handle_place(marionette, side=side)[2] + rise - handle

    def _elbow_distance(self, turn: PendingCue[PlayCue]) -> float | None:
        """Distance of the handle from the elbow, measured in an earlier round [m]."""
        measured = self._corrections.handles.get(turn.spot)
        return None if measured is None else measured[0]

    def _bottom_height(
        self, turn: PendingCue[PlayCue], actor: Actor, prop: str, held: Hanging
    ) -> float:
        """Height of the bottom of a held prop, as measured in an earlier round if it was [m]."""
        measured = self._corrections.handles.get(turn.spot)
        handle = self._cast.props[prop].handle
        assert handle is not None
        if measured is None:
            return self._carried_bottom_height(actor, prop, held.side)
        return measured[1] - handle

    def _seat(
        self, stage: OnStage, name: str, actor: Actor, turn: PendingCue[PlayCue]
    ) -> tuple[complex, float, float]:
        """Middle of a seat [m], heading of a sitter [rad], and height of the seat [m]."""
        if name in stage.where:
            thing, seat = stage.where[name], self._cast.props[name].seat
            if isinstance(thing, Hanging):
                raise CueError(f"{thing.player} holds {name}")
            if seat is None:
                raise CueError(f"{name} has no seat; needed: `seat:` of the prop")
            place = self._corrections.stands.get(turn.spot, thing.place)
            return place.place, place.heading, thing.height + seat
        top = obstacle_top(self._cast.file, name)
        assert top is not None  # otherwise it is a mistake of the file
        middle = self._walks.middle(name)
        if middle is None:
            raise CueError(f"{name} is too high to sit on: its top is at {top:.3g} m")
        return middle, Footing(middle.real, middle.imag).towards(actor.last.place), top

    def _put_place(self, onto: str, prop: str, puts: putting.Putting, actor: Actor) -> Footing:
        """Footing for putting something on an obstacle, at the nearest side."""
        offset, footings = complex(puts.forward, puts.left), []
        inset = max(_AXIS_INSET, self._cast.props[prop].bottom_radius + _EDGE_INSET)
        for heading, inside in self._walks.sides(onto, actor.last.place, inset):
            z = inside - np.exp(1j * heading) * offset
            footings.append(Footing(z.real, z.imag, heading))
        return min(footings, key=lambda footing: abs(footing.place - actor.last.place))
