"""Cues with props: a player comes up to another or to a thing, handles it, and steps back.

Nearer to each other than their radii two are only here: the last steps are straight, and in front
of them and behind there is nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np

from fantoccini.base import InputError
from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import (
    Actor,
    CannotBe,
    Cast,
    Footing,
    Meeting,
    Pair,
    Turn,
    Wishes,
    hanging,
    prop_gestures,
    standing,
    top_of,
)
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.acting import Repertory
from fantoccini.theatre.plays.approaching import CALM, Approaching, along
from fantoccini.theatre.plays.doing import carry_pose
from fantoccini.theatre.plays.holdings import Hangs, Seated, Stands
from fantoccini.theatre.plays.sitting import sit
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import (
    END,
    START,
    VERBS,
    GivesCue,
    Moments,
    PicksUpCue,
    PutsDownCue,
    SitsOnCue,
    Spot,
    StandsUpFromCue,
)

T = TypeVar("T")

Saved = tuple[
    list[Meeting], dict[str, Seated], dict[str, Hangs | Stands], dict[tuple[Spot, str], float]
]
"""Meetings, who sits, where props are, and when swing is taken out."""

_AT_TABLE = 0.025
"""Longest step at a table, which shins that swing must not touch [m]."""
_BACK = 0.1
"""A walk to a table ends at least so far from where one puts something down [m]."""
_BEFORE_SEAT = 0.135
"""A player sits down from so far before the middle of the seat [m]."""
APPROACHES = ((0.04, 0.06), (0.06, 0.05), (0.08, 0.06))
"""Who comes up to a seat stops so much farther before it, since shins swing on, and steps back by
so much at a time, at most [m]: the first, or if something touches then, the next."""
_INSET = 0.03
"""A prop is put so far from the border of what it is put on, where that is large enough [m]."""
_OTHER = {"left": "right", "right": "left"}


class Handling:
    """Props while cues are placed: who has them, and what players do with them.

    Attributes:
        where: prop -> on whose forearm it hangs, or where it stands.
        seated: player -> on what it sits.

    Args:
        cast, walks, repertory: of the play.
        actors: the players, as they are placed so far.
        wishes: of earlier rounds.
    """

    def __init__(
        self,
        cast: Cast,
        walks: Walks,
        repertory: Repertory,
        actors: Mapping[str, Actor],
        wishes: Wishes,
    ):
        self._cast, self._walks, self._repertory = cast, walks, repertory
        self._actors, self._wishes = actors, wishes
        self._met: list[Meeting] = []
        self.seated: dict[str, Seated] = {}
        self._steps = Approaching(walks, repertory, actors, wishes, self.carries)
        self.where: dict[str, Hangs | Stands] = {}
        for name, thing in cast.props.items():
            if thing.held_by:
                self.where[name] = Hangs(thing.held_by, thing.side, 0.0)
            else:
                on = cast.file.props[name].on or FLOOR
                self.where[name] = Stands(thing.stands, thing.height, on)

    @property
    def calmed(self) -> Mapping[tuple[Spot, str], float]:
        """(cue, player) -> when it begins to take out its swing [s]."""
        return self._steps.calmed

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Who may touch what until a time [s]."""
        found = list(self._met)
        found += [
            one.meeting(prop, until) for prop, one in self.where.items() if isinstance(one, Hangs)
        ]
        found += [one.meeting(who, until, until) for who, one in self.seated.items()]
        return tuple(found)

    def kept(self) -> Saved:
        """What is known now, to come back to with :meth:`back`."""
        return list(self._met), dict(self.seated), dict(self.where), dict(self._steps.calmed)

    def back(self, kept: Saved) -> None:
        """Forgets what was added since."""
        self._met, self.seated, self.where, self._steps.calmed = kept

    def place(self, turn: Turn, begin: float, wait: float) -> Moments:
        """Places a cue with a prop; its moments.

        Args:
            turn: the cue.
            begin: earliest time [s].
            wait: by how much later it may begin [s].

        Raises:
            CannotBe: it cannot be done.
        """
        given = turn.given
        match given:
            case GivesCue():
                self._gives(turn, given, begin, wait)
            case SitsOnCue():
                self._sits(turn, given, begin, wait)
            case StandsUpFromCue():
                self._stands_up(turn, given, begin)
            case PutsDownCue():
                self._puts_down(turn, given, begin, wait)
            case PicksUpCue():
                self._picks_up(turn, given, begin, wait)
        moments = {
            START: min(part.start for part in turn.parts),
            END: max(part.end for part in turn.parts),
        }
        for part in turn.parts:
            moments.update({m: t for m, t in part.marks.items() if m in turn.cue.known})
        return moments

    # -- one verb each -----------------------------------------------------------------------

    def _gives(self, turn: Turn, given: GivesCue, begin: float, wait: float) -> None:
        prop = given.gives
        giver, receiver = (self._actors[name] for name in turn.who)
        held = self._held(prop, giver)
        other = _OTHER[held.side]
        if (taken := self._on(receiver, other)) is not None:
            raise CannotBe(f"{given.to}'s {other} arm, which would take it, holds {taken}")
        self.check_stands(giver)
        self.check_stands(receiver)
        lift, lifts = (self._cast.file.cast[name].lift for name in turn.who)
        handing = self._made(
            lambda: prop_gestures.give(
                giver.player.alone,
                "",
                "",
                prop,
                side=held.side,
                along=self._along(turn),
                carried=True,
                higher=lift - lifts,
            ),
            giver,
        )
        here = giver.last
        x, y, heading = handing.place(here.x, here.y, here.heading)
        there = Footing(x, y, heading)
        before = self._steps.apart(there, receiver, here, giver)
        self._steps.come(turn, receiver, before, there, begin, wait, beside=giver)
        giver.rests()
        soon = receiver.rests() - prop_gestures.CARRY_TIME
        posed = carry_pose(giver, held.side, max(begin, soon), self._repertory)
        start = self._steps.calm(turn, max(receiver.rests(), posed), giver, receiver)
        ends = [
            self._steps.do(turn, actor, gesture, start)
            for actor, gesture in ((giver, handing.giver), (receiver, handing.receiver))
        ]
        end = max(ends)
        self._close(prop, held, start)
        pairs = {
            hanging(who, side, prop) for who, side in ((turn.who[0], held.side), (given.to, other))
        }
        pairs |= standing(prop, FLOOR)
        self._meet(turn, prop, frozenset(pairs), start, end)
        self.where[prop] = Hangs(given.to, other, end, turn.spot)
        retreat = self._steps.apart(here, giver, receiver.last, receiver)
        self._steps.straight(turn, giver, retreat, end, beside=receiver)

    def _sits(self, turn: Turn, given: SitsOnCue, begin: float, wait: float) -> None:
        seat, (actor,) = given.sits_on, (self._actors[name] for name in turn.who)
        self.check_stands(actor)
        who = turn.who[0]
        for name, one in self.seated.items():
            if one.seat == seat:
                raise CannotBe(f"{name} sits on {seat}")
        middle, heading, height = self._seat(seat, actor, turn)
        alone, hangs = actor.player.alone, actor.player.hangs
        sits = self._made(
            lambda: sit(alone, "", seat, height, distance=_BEFORE_SEAT, start=hangs), actor
        )
        there = Footing(*along(Footing(middle.real, middle.imag, heading), sits.back), heading)
        clear = self._steps.clear_of(there, 1.0, actor)
        room, step = APPROACHES[self._wishes.approaches.get(turn.spot, 0)]
        before = self._steps.clear_of(there, 1.0, actor, abs(clear.place - there.place) + room)
        self._steps.come(turn, actor, before, there, begin, wait, step=step)
        since = actor.ways[-1].begin
        end = self._steps.do(turn, actor, sits.down, self._steps.calm(turn, actor.rests(), actor))
        self.seated[who] = Seated(
            seat, seat in self._cast.props, since, end, turn.spot, sits.up, before
        )

    def _stands_up(self, turn: Turn, given: StandsUpFromCue, begin: float) -> None:
        (who,) = turn.who
        actor, one = self._actors[who], self.seated.get(who)
        if one is None or one.seat != given.stands_up_from:
            sits = f"sits on {one.seat}" if one else "stands"
            raise CannotBe(f"{who} does not sit on {given.stands_up_from}, but {sits}")
        start = max(begin, actor.rests())
        up = self._steps.do(turn, actor, one.up, start)
        self._steps.straight(turn, actor, one.ahead, up + CALM)
        self._steps.calm(turn, actor.rests(), actor)
        self._met.append(one.meeting(who, start, actor.ways[-1].end))
        del self.seated[who]

    def _puts_down(self, turn: Turn, given: PutsDownCue, begin: float, wait: float) -> None:
        prop, onto, (who,) = given.puts_down, given.onto, turn.who
        actor = self._actors[who]
        held = self._held(prop, actor)
        self.check_stands(actor)
        top = top_of(self._cast.file, onto)
        assert top is not None  # or it is a mistake
        hangs = self._hangs_at(turn, actor, prop, held)
        puts = self._putting(actor, prop, held.side, hangs, top, onto, along=self._along(turn))
        there = self._put_place(onto, puts, actor)
        before = self._steps.clear_of(there, -1.0, actor, _BACK)
        self._steps.come(turn, actor, before, there, begin, wait, step=_AT_TABLE)
        start = self._steps.calm(turn, actor.rests(), actor)
        end = self._steps.do(turn, actor, puts.gesture, start)
        self._close(prop, held, start)
        pairs = standing(prop, onto) | {hanging(who, held.side, prop)}
        self._meet(turn, prop, pairs, start, end)
        z = there.place + np.exp(1j * there.heading) * complex(puts.forward, puts.left)
        self.where[prop] = Stands(Footing(z.real, z.imag, there.heading), top, onto)
        self._steps.straight(turn, actor, before, end, step=_AT_TABLE)

    def _picks_up(self, turn: Turn, given: PicksUpCue, begin: float, wait: float) -> None:
        prop, (who,) = given.picks_up, turn.who
        actor, one, side = self._actors[who], self.where[prop], "right"
        if isinstance(one, Hangs):
            raise CannotBe(f"{one.player} holds {prop}")
        if self._cast.props[prop].handle is None:
            raise CannotBe(f"{prop} has no handle")
        if self._on(actor, side) is not None:
            side = _OTHER[side]
        if (taken := self._on(actor, side)) is not None:
            raise CannotBe(f"{who}'s arms are not free: {taken} hangs there")
        self.check_stands(actor)
        hangs = self._would_hang(actor, prop, side)
        puts = self._putting(actor, prop, side, hangs, one.height, one.on, back=True)
        stands = self._wishes.stands.get(turn.spot, one.place)
        z = stands.place - np.exp(1j * stands.heading) * complex(puts.forward, puts.left)
        there = Footing(z.real, z.imag, stands.heading)
        before = self._steps.clear_of(there, -1.0, actor, _BACK)
        self._steps.come(turn, actor, before, there, begin, wait, step=_AT_TABLE)
        start = self._steps.calm(turn, actor.rests(), actor)
        end = self._steps.do(turn, actor, puts.gesture, start)
        pairs = standing(prop, one.on) | {hanging(who, side, prop)}
        self._meet(turn, prop, pairs, start, end)
        self.where[prop] = Hangs(who, side, end, turn.spot)
        self._steps.straight(turn, actor, before, end, step=_AT_TABLE)

    # -- what is so --------------------------------------------------------------------------

    def _held(self, prop: str, actor: Actor) -> Hangs:
        one, who = self.where[prop], actor.player.name
        if isinstance(one, Hangs) and one.player == who:
            return one
        there = f"{one.player} holds it" if isinstance(one, Hangs) else f"it stands on {one.on}"
        raise CannotBe(f"{who} does not hold {prop}: {there}")

    def _on(self, actor: Actor, side: str) -> str | None:
        """What hangs on a forearm."""
        for prop, one in self.where.items():
            if isinstance(one, Hangs) and (one.player, one.side) == (actor.player.name, side):
                return prop
        return None

    def check_stands(self, actor: Actor) -> None:
        """Refuses that one who sits walks."""
        one = self.seated.get(actor.player.name)
        if one is not None:
            raise CannotBe(
                f"{actor.player.name} sits on {one.seat}; needed before: `stands up from`"
            )

    def _made(self, make: Callable[[], T], actor: Actor) -> T:
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
        """How a player puts a prop down on something, or picks it up from there."""
        least, most = (hangs - drop for drop in reversed(putting.DROPS))
        if not least <= top <= most:
            off, near = ("low", least + 5e-4) if top < least else ("high", most - 5e-4)
            raise CannotBe(
                f"{on} is {top:.3f} m high, which is too {off} for {actor.player.name}; needed: "
                f"{least:.3f} to {most:.3f} m, {near:.3f} m is nearest"
            )
        along = putting.ALONG if along is None else along
        return self._made(
            lambda: putting.putting(
                actor.player.alone, "", prop, hangs - top, side=side, along=along, back=back
            ),
            actor,
        )

    def _would_hang(self, actor: Actor, prop: str, side: str) -> float:
        """Height of a prop's bottom that a player carries on a forearm [m]."""
        handle = self._cast.props[prop].handle
        assert handle is not None
        lift = self._cast.file.cast[actor.player.name].lift
        return prop_gestures.handle_place(side, raised=lift)[2] + putting.HIGHER - handle

    def carries(self, who: str) -> str:
        """The forearm on which something hangs that a player carries; "" where nothing does."""
        sides = [
            one.side for one in self.where.values() if isinstance(one, Hangs) and one.player == who
        ]
        return sides[0] if sides else ""

    def _along(self, turn: Turn) -> float | None:
        seen = self._wishes.hangs.get(turn.spot)
        return None if seen is None else seen[0]

    def _hangs_at(self, turn: Turn, actor: Actor, prop: str, held: Hangs) -> float:
        seen = self._wishes.hangs.get(turn.spot)
        handle = self._cast.props[prop].handle
        assert handle is not None
        return seen[1] - handle if seen else self._would_hang(actor, prop, held.side)

    def _seat(self, name: str, actor: Actor, turn: Turn) -> tuple[complex, float, float]:
        """Middle of a seat [m], the direction in which one sits [rad], and its height [m]."""
        if name in self.where:
            one, seat = self.where[name], self._cast.props[name].seat
            if isinstance(one, Hangs):
                raise CannotBe(f"{one.player} holds {name}")
            if seat is None:
                raise CannotBe(f"{name} has no seat; needed: `seat:` of the prop")
            place = self._wishes.stands.get(turn.spot, one.place)
            return place.place, place.heading, one.height + seat
        top = top_of(self._cast.file, name)
        assert top is not None  # or it is a mistake
        known = self._walks.middle(name)
        if known is None:
            raise CannotBe(f"{name} is too high to sit on: its top is at {top:.3g} m")
        middle = known
        return middle, Footing(middle.real, middle.imag).towards(actor.last.place), top

    def _put_place(self, onto: str, puts: putting.Putting, actor: Actor) -> Footing:
        """From where a player puts something on an obstacle: the side that is nearest."""
        way, found = complex(puts.forward, puts.left), []
        for heading, inside in self._walks.sides(onto, actor.last.place, _INSET):
            z = inside - np.exp(1j * heading) * way
            found.append(Footing(z.real, z.imag, heading))
        return min(found, key=lambda one: abs(one.place - actor.last.place))

    # -- who meets ---------------------------------------------------------------------------

    def _meet(
        self, turn: Turn, prop: str, pairs: frozenset[Pair], start: float, end: float
    ) -> None:
        """Notes that the players of a cue and a prop may touch for a while [s]."""
        kind = VERBS[turn.given.verb].meets
        assert kind is not None
        self._met.append(Meeting(start, end, turn.who, (prop,), pairs, kind, turn.spot))

    def _close(self, prop: str, held: Hangs, until: float) -> None:
        if until > held.since:
            self._met.append(held.meeting(prop, until))
