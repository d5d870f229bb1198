"""Cues with props: a player comes up to another or to a thing, handles it, and steps back.

Only here are two players nearer to each other than their radii: the last steps are straight, and
nobody else is in front of them or behind.
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
    hanging,
    prop_gestures,
    standing,
    top_of,
)
from fantoccini.theatre.gestures import CannotBe, Turn
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.approaching import CALM, Approaching, along
from fantoccini.theatre.plays.holdings import Hangs, Seated, Stands
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
_MIN_STEP_UP = 0.1
"""Least distance between the end of a walk to a table and the place of handling, for such legs
[m]."""
APPROACHES = ((0.04, 0.06), (0.06, 0.05), (0.08, 0.06))
"""Approaches to a seat, tried in turn: additional distance before it at which a player stops, since
shins swing on, and the longest step back; both for such legs [m]."""
_INSET, _EDGE = 0.03, 0.005
"""Least distance of a prop's axis from the border of its obstacle, and of its bottom's edge, if it
is large enough [m]."""


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
        self, stage: OnStage, turn: Turn[PlayCue], begin: float, wait: float
    ) -> tuple[OnStage, Moments]:
        """Stage after a cue with a prop, and the cue's moments.

        Args:
            stage: stage before the cue.
            turn: turn of the cue.
            begin: earliest time [s].
            wait: longest delay after it [s].

        Raises:
            CannotBe: the cue cannot be done.
        """
        match turn.given:
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
            moments.update({m: t for m, t in part.marks.items() if m in turn.cue.known})
        return stage, moments

    # -- one verb each -----------------------------------------------------------------------

    def _gives(
        self, stage: OnStage, turn: Turn[PlayCue], given: GivesCue, begin: float, wait: float
    ) -> OnStage:
        prop, (who, to) = given.gives, turn.who
        giver, receiver = stage.actors[who], stage.actors[to]
        held = stage.held(prop, who)
        other = OTHER_SIDE[held.side]
        if (taken := stage.on_forearm(to, other)) is not None:
            raise CannotBe(f"{given.to}'s {other} arm, which would take it, holds {taken}")
        stage.check_stands(who)
        stage.check_stands(to)
        handing = self._compute(
            lambda: prop_gestures.give(
                giver.player.alone,
                "",
                "",
                prop,
                side=held.side,
                along=self._along(turn),
                posed=True,
                receiver_stage=receiver.player.alone,
            ),
            giver,
        )
        here = giver.last
        there = Footing(*handing.place(here.x, here.y, here.heading))
        before = self._steps.apart(there, receiver, here, giver)
        stage = self._steps.come(
            stage, to, before, there, begin, wait, act_start=turn.start, beside=who
        )
        receiver = stage.actors[to].rested()
        soon = receiver.hands.end - prop_gestures.CARRY_TIME
        giver = carry_pose(giver.rested(), held.side, max(begin, soon), self._gestures)
        stage = stage.acting(receiver).acting(giver)
        posed = max(receiver.hands.end, giver.hands.lanes[0].end)
        stage, start = self._steps.calm(stage, turn, posed, who, to)
        stage, given_at = self._steps.do(stage, who, handing.giver, start)
        stage, taken_at = self._steps.do(stage, to, handing.receiver, start)
        end = max(given_at, taken_at)
        stage = stage.released(prop, held, start)
        pairs = standing(prop, FLOOR) | {
            hanging(stage.bodies(name), arm, prop) for name, arm in ((who, held.side), (to, other))
        }
        stage = stage.touching(turn, prop, pairs, start, end)
        stage = stage.placing(prop, Hangs(to, other, end, turn.spot))
        giver, receiver = stage.actors[who], stage.actors[to]
        retreat = self._steps.apart(here, giver, receiver.last, receiver)
        return self._steps.straight(stage, who, retreat, end, beside=to)

    def _sits(
        self, stage: OnStage, turn: Turn[PlayCue], given: SitsOnCue, begin: float, wait: float
    ) -> OnStage:
        seat, (who,) = given.sits_on, turn.who
        actor = stage.actors[who]
        stage.check_stands(who)
        for name, seated in stage.seated.items():
            if seated.seat == seat:
                raise CannotBe(f"{name} sits on {seat}")
        middle, heading, height = self._seat(stage, seat, actor, turn)
        alone, hangs = actor.player.alone, actor.player.hangs
        sits = self._compute(lambda: sit(alone, "", seat, height, start=hangs), actor)
        there = Footing(*along(Footing(middle.real, middle.imag, heading), sits.back), heading)
        clear = self._steps.clear_of(there, 1.0, actor)
        clearance, step = APPROACHES[self._corrections.approaches.get(turn.spot, 0)]
        away = abs(clear.place - there.place) + actor.player.leg_ratio * clearance
        before = self._steps.clear_of(there, 1.0, actor, away)
        stage = self._steps.come(
            stage, who, before, there, begin, wait, act_start=turn.start, step=step
        )
        since = stage.actors[who].ways[-1].begin
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.do(stage, who, sits.down, start)
        on_prop = seat in self._cast.props
        return stage.seating(who, Seated(seat, on_prop, since, end, turn.spot, sits.up, before))

    def _stands_up(
        self, stage: OnStage, turn: Turn[PlayCue], given: StandsUpFromCue, begin: float
    ) -> OnStage:
        (who,) = turn.who
        seated = stage.seated.get(who)
        if seated is None or seated.seat != given.stands_up_from:
            sits = f"sits on {seated.seat}" if seated else "stands"
            raise CannotBe(f"{who} does not sit on {given.stands_up_from}, but {sits}")
        actor = stage.actors[who].rested()
        start = max(begin, actor.hands.end)
        stage, up = self._steps.do(stage.acting(actor), who, seated.up, start)
        stage = self._steps.straight(stage, who, seated.ahead, up + CALM)
        stage, _ = self._calmed(stage, turn, who)
        away = stage.actors[who].ways[-1].end
        return stage.meeting(seated.meeting(stage.bodies(who), start, away)).seating(who, None)

    def _puts_down(
        self, stage: OnStage, turn: Turn[PlayCue], given: PutsDownCue, begin: float, wait: float
    ) -> OnStage:
        prop, onto, (who,) = given.puts_down, given.onto, turn.who
        actor = stage.actors[who]
        held = stage.held(prop, who)
        stage.check_stands(who)
        top = top_of(self._cast.file, onto)
        assert top is not None  # otherwise it is a mistake of the file
        hangs = self._hangs_at(turn, actor, prop, held)
        puts = self._putting(actor, prop, held.side, hangs, top, onto, along=self._along(turn))
        there = self._put_place(onto, prop, puts, actor)
        before = self._steps.clear_of(there, -1.0, actor, actor.player.leg_ratio * _MIN_STEP_UP)
        stage = self._steps.come(
            stage, who, before, there, begin, wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.do(stage, who, puts.gesture, start)
        pairs = standing(prop, onto) | {hanging(stage.bodies(who), held.side, prop)}
        stage = stage.released(prop, held, start).touching(turn, prop, pairs, start, end)
        z = there.place + np.exp(1j * there.heading) * complex(puts.forward, puts.left)
        stands = Stands(Footing(z.real, z.imag, there.heading), top, onto)
        return self._steps.straight(
            stage.placing(prop, stands), who, before, end, step=_MAX_TABLE_STEP
        )

    def _picks_up(
        self, stage: OnStage, turn: Turn[PlayCue], given: PicksUpCue, begin: float, wait: float
    ) -> OnStage:
        prop, (who,) = given.picks_up, turn.who
        actor, thing, side = stage.actors[who], stage.where[prop], "right"
        if isinstance(thing, Hangs):
            raise CannotBe(f"{thing.player} holds {prop}")
        if self._cast.props[prop].handle is None:
            raise CannotBe(f"{prop} has no handle")
        if stage.on_forearm(who, side) is not None:
            side = OTHER_SIDE[side]
        if (taken := stage.on_forearm(who, side)) is not None:
            raise CannotBe(f"{who}'s arms are not free: {taken} hangs there")
        stage.check_stands(who)
        hangs = self._would_hang(actor, prop, side)
        puts = self._putting(actor, prop, side, hangs, thing.height, thing.on, back=True)
        stands = self._corrections.stands.get(turn.spot, thing.place)
        z = stands.place - np.exp(1j * stands.heading) * complex(puts.forward, puts.left)
        there = Footing(z.real, z.imag, stands.heading)
        before = self._steps.clear_of(there, -1.0, actor, actor.player.leg_ratio * _MIN_STEP_UP)
        stage = self._steps.come(
            stage, who, before, there, begin, wait, act_start=turn.start, step=_MAX_TABLE_STEP
        )
        stage, start = self._calmed(stage, turn, who)
        stage, end = self._steps.do(stage, who, puts.gesture, start)
        pairs = standing(prop, thing.on) | {hanging(stage.bodies(who), side, prop)}
        stage = stage.touching(turn, prop, pairs, start, end)
        stage = stage.placing(prop, Hangs(who, side, end, turn.spot))
        return self._steps.straight(stage, who, before, end, step=_MAX_TABLE_STEP)

    # -- state -------------------------------------------------------------------------------

    def _calmed(self, stage: OnStage, turn: Turn[PlayCue], who: str) -> tuple[OnStage, float]:
        """Stage with a player's swing damped after its last motion, and the end of that [s]."""
        actor = stage.actors[who].rested()
        return self._steps.calm(stage.acting(actor), turn, actor.hands.end, who)

    def _compute(self, make: Callable[[], T], actor: Actor) -> T:
        try:
            return make()
        except (InputError, ValueError) as error:
            raise CannotBe(f"{actor.player.name} cannot do it: {error}") from None

    def _putting(
        self,
        actor: Actor,
        prop: str,
        side: str,
        hangs: float,
        top: float,
        on: str,
        *,
        along: float | None = None,
        back: bool = False,
    ) -> putting.Putting:
        """Gesture that puts a prop down on something, or picks it up from there."""
        physique = Physique.of(actor.player.alone)
        lowest, highest = (
            hangs - physique.arm_ratio(side) * drop for drop in reversed(putting.DROPS)
        )
        if not lowest <= top <= highest:
            off, near = ("low", lowest + 5e-4) if top < lowest else ("high", highest - 5e-4)
            raise CannotBe(
                f"{on} is {top:.3f} m high, which is too {off} for {actor.player.name}; needed: "
                f"{lowest:.3f} to {highest:.3f} m, {near:.3f} m is nearest"
            )
        return self._compute(
            lambda: putting.putting(
                actor.player.alone, "", prop, hangs - top, side=side, along=along, back=back
            ),
            actor,
        )

    def _would_hang(self, actor: Actor, prop: str, side: str) -> float:
        """Height of the bottom of a prop that a player carries on a forearm [m]."""
        handle = self._cast.props[prop].handle
        assert handle is not None
        alone = actor.player.alone
        rise = Physique.of(alone).arm_ratio(side) * putting.HIGHER
        return prop_gestures.handle_place(alone, side=side)[2] + rise - handle

    def _along(self, turn: Turn[PlayCue]) -> float | None:
        seen = self._corrections.hangs.get(turn.spot)
        return None if seen is None else seen[0]

    def _hangs_at(self, turn: Turn[PlayCue], actor: Actor, prop: str, held: Hangs) -> float:
        seen = self._corrections.hangs.get(turn.spot)
        handle = self._cast.props[prop].handle
        assert handle is not None
        return seen[1] - handle if seen else self._would_hang(actor, prop, held.side)

    def _seat(
        self, stage: OnStage, name: str, actor: Actor, turn: Turn[PlayCue]
    ) -> tuple[complex, float, float]:
        """Middle of a seat [m], heading of a sitter [rad], and height of the seat [m]."""
        if name in stage.where:
            thing, seat = stage.where[name], self._cast.props[name].seat
            if isinstance(thing, Hangs):
                raise CannotBe(f"{thing.player} holds {name}")
            if seat is None:
                raise CannotBe(f"{name} has no seat; needed: `seat:` of the prop")
            place = self._corrections.stands.get(turn.spot, thing.place)
            return place.place, place.heading, thing.height + seat
        top = top_of(self._cast.file, name)
        assert top is not None  # otherwise it is a mistake of the file
        known = self._walks.middle(name)
        if known is None:
            raise CannotBe(f"{name} is too high to sit on: its top is at {top:.3g} m")
        middle = known
        return middle, Footing(middle.real, middle.imag).towards(actor.last.place), top

    def _put_place(self, onto: str, prop: str, puts: putting.Putting, actor: Actor) -> Footing:
        """Footing for putting something on an obstacle, at the nearest side."""
        way, footings = complex(puts.forward, puts.left), []
        inset = max(_INSET, self._cast.props[prop].bottom_radius + _EDGE)
        for heading, inside in self._walks.sides(onto, actor.last.place, inset):
            z = inside - np.exp(1j * heading) * way
            footings.append(Footing(z.real, z.imag, heading))
        return min(footings, key=lambda footing: abs(footing.place - actor.last.place))
