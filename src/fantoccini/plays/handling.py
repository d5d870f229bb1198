"""Cues with props: a player comes up to another or to a thing, handles it, and steps back.

Nearer to each other than their radii two are only here: the last steps are straight, and in front
of them and behind there is nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np

from fantoccini.errors import InputError
from fantoccini.gestures import Gesture
from fantoccini.gestures.stepping import Step
from fantoccini.gestures.timing import END, START, Spot
from fantoccini.plays import props, putting
from fantoccini.plays.acting import Repertory
from fantoccini.plays.actors import Actor, CannotBe, Wishes
from fantoccini.plays.calming import NONE, calm_gesture
from fantoccini.plays.casting import Cast
from fantoccini.plays.companies import Meeting
from fantoccini.plays.contacts import hanging, standing
from fantoccini.plays.cues import Cue
from fantoccini.plays.doing import carry_pose, note, walk_along
from fantoccini.plays.footing import Footing, Way
from fantoccini.plays.holdings import Hangs, Seated, Stands
from fantoccini.plays.sitting import sit
from fantoccini.plays.things import top_of
from fantoccini.plays.walks import Walks
from fantoccini.puppet.contact import FLOOR

T = TypeVar("T")

_STEP, _STEP_TIME = 0.05, 1.0
"""Longest step of those that lead up to a thing or away from it [m], and its duration [s]."""
_AT_TABLE = 0.025
"""The same at a table, which shins that swing must not touch [m]."""
_BACK = 0.1
"""A walk to a table ends at least so far from where one puts something down [m]."""
_BEFORE_SEAT = 0.135
"""A player sits down from so far before the middle of the seat [m]."""
_CALM = 0.3
"""Pause before something is handled [s]."""
_FARTHEST = 1.0
"""Farthest from a thing that a player steps up to it [m]."""
_APART = 0.02
"""By how much more than their radii two are apart before one comes up to the other [m]."""
_INSET = 0.03
"""A prop is put so far from the border of what it is put on, where that is large enough [m]."""
_OTHER = {"left": "right", "right": "left"}


class Handling:
    """Props while cues are placed: who has them, and what players do with them.

    Attributes:
        where: prop -> on whose forearm it hangs, or where it stands.
        seated: player -> on what it sits.
        calmed: (cue, player) -> when it begins to take out its swing [s].

    Args:
        cast, walks, repertory: of the play.
        actors: the players, as they are placed so far.
        wishes: of earlier rounds.
    """

    def __init__(
        self, cast: Cast, walks: Walks, repertory: Repertory, actors: Mapping[str, Actor],
        wishes: Wishes,
    ):  # fmt: skip
        self._cast, self._walks, self._repertory = cast, walks, repertory
        self._actors, self._wishes = actors, wishes
        self._met: list[Meeting] = []
        self.seated: dict[str, Seated] = {}
        self.calmed: dict[tuple[Spot, str], float] = {}
        self.where: dict[str, Hangs | Stands] = {}
        for name, thing in cast.things.items():
            if thing.held_by:
                self.where[name] = Hangs(thing.held_by, thing.side, 0.0)
            else:
                on = cast.file.props[name].on or FLOOR
                self.where[name] = Stands(thing.stands, thing.height, on)

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Who may touch what until a time [s]."""
        found = list(self._met)
        found += [
            one.meeting(prop, until)
            for prop, one in self.where.items() if isinstance(one, Hangs)
        ]
        found += [one.meeting(who, until, until) for who, one in self.seated.items()]
        return tuple(found)

    def kept(self) -> tuple[object, ...]:
        """What is known now, to come back to with :meth:`back`."""
        return list(self._met), dict(self.seated), dict(self.where), dict(self.calmed)

    def back(self, kept: tuple[object, ...]) -> None:
        """Forgets what was added since."""
        self._met, self.seated, self.where, self.calmed = kept  # type: ignore[assignment]

    def place(self, cue: Cue, begin: float, wait: float) -> float:
        """Places a cue with a prop; when its first step or gesture begins [s].

        Args:
            cue: which.
            begin: earliest time [s].
            wait: by how much later it may begin [s].

        Raises:
            CannotBe: it cannot be done.
        """
        does: dict[str, Callable[[Cue, float, float], None]] = {
            "gives": self._gives, "sits_on": self._sits, "stands_up_from": self._stands_up,
            "puts_down": self._puts_down, "picks_up": self._picks_up,
        }  # fmt: skip
        does[cue.given.verb](cue, begin, wait)
        cue.moments = {START: min(part.start for part in cue.parts),
                       END: max(part.end for part in cue.parts)}  # fmt: skip
        for part in cue.parts:
            cue.moments.update({m: t for m, t in part.marks.items() if m in cue.known})
        return cue.moments[START]

    # -- one verb each -----------------------------------------------------------------------

    def _gives(self, cue: Cue, begin: float, wait: float) -> None:
        prop, given = str(cue.given.gives), cue.given
        giver, receiver = (self._actors[name] for name in cue.who)
        held = self._held(prop, giver)
        other = _OTHER[held.side]
        if (taken := self._on(receiver, other)) is not None:
            raise CannotBe(f"{given.to}'s {other} arm, which would take it, holds {taken}")
        self.check_stands(giver)
        self.check_stands(receiver)
        handing = self._made(
            lambda: props.give(
                giver.player.alone, "", "", prop, side=held.side, along=self._along(cue),
                carried=True,
            ),
            giver,
        )
        here = giver.last
        x, y, heading = handing.place(here.x, here.y, here.heading)
        there = Footing(x, y, heading)
        before = self._apart(there, receiver, here, giver)
        self._come(cue, receiver, before, there, begin, wait, beside=giver)
        giver.rests()
        soon = receiver.rests() - props.CARRY_TIME
        posed = carry_pose(giver, held.side, max(begin, soon), self._repertory)
        start = self._calm(cue, max(receiver.rests(), posed), giver, receiver)
        ends = [
            self._do(cue, actor, gesture, start)
            for actor, gesture in ((giver, handing.giver), (receiver, handing.receiver))
        ]
        end = max(ends)
        self._close(prop, held, start)
        pairs = {hanging(str(who), side, prop)
                 for who, side in ((cue.who[0], held.side), (given.to, other))}  # fmt: skip
        pairs |= standing(prop, FLOOR)
        self._met.append(
            Meeting(start, end, cue.who, (prop,), frozenset(pairs), "given", cue.spot)
        )
        self.where[prop] = Hangs(str(given.to), other, end, cue.spot)
        retreat = self._apart(here, giver, receiver.last, receiver)
        self._straight(cue, giver, retreat, end, beside=receiver)

    def _sits(self, cue: Cue, begin: float, wait: float) -> None:
        seat, (actor,) = str(cue.given.sits_on), (self._actors[name] for name in cue.who)
        self.check_stands(actor)
        who = cue.who[0]
        for name, one in self.seated.items():
            if one.seat == seat:
                raise CannotBe(f"{name} sits on {seat}")
        middle, heading, height = self._seat(seat, actor)
        alone, hangs = actor.player.alone, actor.player.hangs
        sits = self._made(
            lambda: sit(alone, "", seat, height, distance=_BEFORE_SEAT, start=hangs), actor
        )
        there = Footing(*_along(Footing(middle.real, middle.imag, heading), sits.back), heading)
        before = self._clear_of(there, 1.0, actor)
        self._come(cue, actor, before, there, begin, wait)
        since = actor.ways[-1].begin
        end = self._do(cue, actor, sits.down, self._calm(cue, actor.rests(), actor))
        self.seated[who] = Seated(
            seat, seat in self._cast.things, since, end, cue.spot, sits.up, before
        )

    def _stands_up(self, cue: Cue, begin: float, wait: float) -> None:
        (who,) = cue.who
        actor, one = self._actors[who], self.seated.get(who)
        if one is None or one.seat != cue.given.stands_up_from:
            sits = f"sits on {one.seat}" if one else "stands"
            raise CannotBe(f"{who} does not sit on {cue.given.stands_up_from}, but {sits}")
        start = max(begin, actor.rests())
        up = self._do(cue, actor, one.up, start)
        self._straight(cue, actor, one.ahead, up + _CALM)
        self._calm(cue, actor.rests(), actor)
        self._met.append(one.meeting(who, start, actor.ways[-1].end))
        del self.seated[who]

    def _puts_down(self, cue: Cue, begin: float, wait: float) -> None:
        prop, onto, (who,) = str(cue.given.puts_down), str(cue.given.onto), cue.who
        actor = self._actors[who]
        held = self._held(prop, actor)
        self.check_stands(actor)
        top = top_of(self._cast.file, onto)
        assert top is not None  # or it is a mistake
        hangs = self._hangs_at(cue, actor, prop, held)
        puts = self._putting(actor, prop, held.side, hangs, top, onto, along=self._along(cue))
        there = self._put_place(onto, puts, actor)
        before = self._clear_of(there, -1.0, actor, _BACK)
        self._come(cue, actor, before, there, begin, wait, step=_AT_TABLE)
        start = self._calm(cue, actor.rests(), actor)
        end = self._do(cue, actor, puts.gesture, start)
        self._close(prop, held, start)
        pairs = standing(prop, onto) | {hanging(who, held.side, prop)}
        self._met.append(Meeting(start, end, (who,), (prop,), pairs, "put", cue.spot))
        z = there.place + np.exp(1j * there.heading) * complex(puts.forward, puts.left)
        self.where[prop] = Stands(Footing(z.real, z.imag, there.heading), top, onto)
        self._straight(cue, actor, before, end, step=_AT_TABLE)

    def _picks_up(self, cue: Cue, begin: float, wait: float) -> None:
        prop, (who,) = str(cue.given.picks_up), cue.who
        actor, one, side = self._actors[who], self.where[prop], "right"
        if isinstance(one, Hangs):
            raise CannotBe(f"{one.player} holds {prop}")
        if self._cast.things[prop].handle is None:
            raise CannotBe(f"{prop} has no handle")
        if self._on(actor, side) is not None:
            side = _OTHER[side]
        if (taken := self._on(actor, side)) is not None:
            raise CannotBe(f"{who}'s arms are not free: {taken} hangs there")
        self.check_stands(actor)
        hangs = self._would_hang(actor, prop, side)
        puts = self._putting(actor, prop, side, hangs, one.height, one.on, back=True)
        stands = self._wishes.stands.get(cue.spot, one.place)
        z = stands.place - np.exp(1j * stands.heading) * complex(puts.forward, puts.left)
        there = Footing(z.real, z.imag, stands.heading)
        before = self._clear_of(there, -1.0, actor, _BACK)
        self._come(cue, actor, before, there, begin, wait, step=_AT_TABLE)
        start = self._calm(cue, actor.rests(), actor)
        end = self._do(cue, actor, puts.gesture, start)
        pairs = standing(prop, one.on) | {hanging(who, side, prop)}
        self._met.append(Meeting(start, end, (who,), (prop,), pairs, "picked", cue.spot))
        self.where[prop] = Hangs(who, side, end, cue.spot)
        self._straight(cue, actor, before, end, step=_AT_TABLE)

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
        self, actor: Actor, prop: str, side: str, hangs: float, top: float, on: str, *,
        along: float | None = None, back: bool = False,
    ) -> putting.Putting:  # fmt: skip
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
        handle = self._cast.things[prop].handle
        assert handle is not None
        lift = self._cast.file.cast[actor.player.name].lift
        return props.handle_place(side, raised=lift)[2] + putting.HIGHER - handle

    def carries(self, who: str) -> str:
        """The forearm on which something hangs that a player carries; "" where nothing does."""
        sides = [one.side for one in self.where.values()
                 if isinstance(one, Hangs) and one.player == who]  # fmt: skip
        return sides[0] if sides else ""

    def _along(self, cue: Cue) -> float | None:
        seen = self._wishes.hangs.get(cue.spot)
        return None if seen is None else seen[0]

    def _hangs_at(self, cue: Cue, actor: Actor, prop: str, held: Hangs) -> float:
        seen = self._wishes.hangs.get(cue.spot)
        handle = self._cast.things[prop].handle
        assert handle is not None
        return seen[1] - handle if seen else self._would_hang(actor, prop, held.side)

    def _seat(self, name: str, actor: Actor) -> tuple[complex, float, float]:
        """Middle of a seat [m], the direction in which one sits [rad], and its height [m]."""
        if name in self.where:
            one, seat = self.where[name], self._cast.things[name].seat
            if isinstance(one, Hangs):
                raise CannotBe(f"{one.player} holds {name}")
            if seat is None:
                raise CannotBe(f"{name} has no seat; needed: `seat:` of the prop")
            return one.place.place, one.place.heading, one.height + seat
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

    # -- what is done ------------------------------------------------------------------------

    def _come(
        self, cue: Cue, actor: Actor, before: Footing, there: Footing, begin: float, wait: float,
        *, beside: Actor | None = None, step: float = _STEP,
    ) -> None:  # fmt: skip
        """A walk to a place before something, and the last straight steps."""
        actor.rests()
        carries = self.carries(actor.player.name)
        free = max(carry_pose(actor, carries, begin, self._repertory), begin)
        if abs(actor.last.place - before.place) > 1e-6 or actor.last.heading != before.heading:
            others = [
                (one.player, one.track()) for one in self._actors.values() if one is not actor
            ]
            way, why = self._walks.way(
                actor.player, actor.last, [before], free, wait, others, near=0.0, arrives=None,
                free_from=free, carries=bool(carries),
            )  # fmt: skip
            if way is None:
                raise CannotBe(why)
            self._walk(cue, actor, way)
            free = way.end
        self._straight(cue, actor, there, free, beside=beside, step=step)

    def _straight(
        self, cue: Cue, actor: Actor, there: Footing, begin: float,
        beside: Actor | None = None, step: float = _STEP,
    ) -> None:  # fmt: skip
        """Straight steps, forward or backward, past nobody."""
        here = actor.last
        along = here.seen(there.place).real
        n = max(1, int(np.ceil(abs(along) / step)))
        way = Way(here, begin, (Step(along / n),) * n, _STEP_TIME)
        others = [
            (one.player, one.track()) for one in self._actors.values()
            if one is not actor and one is not beside
        ]  # fmt: skip
        who = self._walks.in_the_way(actor.player, way, others)
        if who is not None:
            raise CannotBe(f"{actor.player.name} has no room: {who} is in the way")
        self._walk(cue, actor, way)

    def _walk(self, cue: Cue, actor: Actor, way: Way) -> None:
        carries = self.carries(actor.player.name)
        gesture, start = walk_along(actor, way, self._repertory, carries)
        note(cue, actor, 0, gesture, start, {}, way.end)

    def _do(self, cue: Cue, actor: Actor, gesture: Gesture, start: float) -> float:
        """A gesture from a time on; its end [s]."""
        own = gesture.turned(actor.last.heading)
        begun = actor.add(0, own, start)
        actor.played.append((0, begun, begun + own.duration, own.named))
        note(cue, actor, 0, own, begun)
        return begun + own.duration

    def _calm(self, cue: Cue, begin: float, *actors: Actor) -> float:
        """Takes out swing from a time on; when what is to be done can begin [s]."""
        for actor in actors:
            key = cue.spot, actor.player.name
            gesture = calm_gesture(actor.player.alone, self._wishes.calms.get(key, NONE))
            lane, start = actor.lane(gesture, begin)
            start = actor.add(lane, gesture, start)
            actor.played.append((lane, start, start + gesture.duration, gesture.named))
            self.calmed[key] = start
        return max(actor.rests() for actor in actors) + _CALM

    def _clear_of(
        self, there: Footing, side: float, actor: Actor, least: float = 0.02
    ) -> Footing:
        """The nearest place ahead (1) or behind (-1) that is clear of what stands there."""
        for way in np.arange(least, _FARTHEST, 0.02):
            one = Footing(*_along(there, side * float(way)), there.heading)
            if self._walks.is_clear(actor.player, one):
                return one
        raise CannotBe(f"{actor.player.name} has no room to step up to it")

    def _apart(self, one: Footing, actor: Actor, other: Footing, beside: Actor) -> Footing:
        """The nearest place behind a footing that is as far from another as two must be."""
        away = self._walks.clear(actor.player) + self._walks.clear(beside.player) + _APART
        ways = 0.01 * np.arange(int(100 * 2.0 * away) + 1)
        behind = one.place - ways * np.exp(1j * one.heading)
        z = behind[int(np.argmax(np.abs(behind - other.place) >= away))]
        return Footing(float(z.real), float(z.imag), one.heading)

    # -- who meets ---------------------------------------------------------------------------

    def _close(self, prop: str, held: Hangs, until: float) -> None:
        if until > held.since:
            self._met.append(held.meeting(prop, until))


def _along(one: Footing, forward: float) -> tuple[float, float]:
    z = one.place + forward * np.exp(1j * one.heading)
    return float(z.real), float(z.imag)
