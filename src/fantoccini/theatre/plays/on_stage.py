"""The stage while cues are placed: its players, its props and who may touch what, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fantoccini.base import UnknownNameError
from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import Actor, Cast, Meeting, Pair, Way
from fantoccini.theatre.gestures import CannotBe, Gesture, Part, Turn
from fantoccini.theatre.plays.holdings import Hangs, Seated, Stands
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.script import VERBS, PlayCue, Spot

IN_POSE = 1e-6
"""Distance from a pose below which a player is in it [m]."""


@dataclass(frozen=True, eq=False)
class OnStage:
    """Players and props as far as cues are placed.

    Attributes:
        actors: player -> as far as its cues are placed.
        where: prop -> on whose forearm it hangs, or where it stands.
        seated: player -> on what it sits.
        met: who may have touched what, and when.
        calmed: (cue, player) -> when it begins to take out its swing [s].
        parts: of the players in the cue that is being placed.
    """

    actors: Mapping[str, Actor]
    where: Mapping[str, Hangs | Stands]
    seated: Mapping[str, Seated] = field(default_factory=dict)
    met: tuple[Meeting, ...] = ()
    calmed: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    parts: tuple[Part, ...] = ()

    @classmethod
    def at_start(cls, cast: Cast, actors: Mapping[str, Actor]) -> OnStage:
        """The stage at the start of a play."""
        where: dict[str, Hangs | Stands] = {}
        for name, thing in cast.props.items():
            if thing.held_by:
                where[name] = Hangs(thing.held_by, thing.side, 0.0)
            else:
                on = cast.file.props[name].on or FLOOR
                where[name] = Stands(thing.stands, thing.height, on)
        return cls(actors, where)

    # -- what is so --------------------------------------------------------------------------

    def others(self, *names: str) -> list[Actor]:
        """All actors but these."""
        return [actor for name, actor in self.actors.items() if name not in names]

    def carries(self, who: str) -> str:
        """The forearm on which something hangs that a player carries; "" where nothing does."""
        sides = [
            thing.side
            for thing in self.where.values()
            if isinstance(thing, Hangs) and thing.player == who
        ]
        return sides[0] if sides else ""

    def on_forearm(self, who: str, side: str) -> str | None:
        """The prop that hangs on a forearm."""
        for prop, thing in self.where.items():
            if isinstance(thing, Hangs) and (thing.player, thing.side) == (who, side):
                return prop
        return None

    def held(self, prop: str, who: str) -> Hangs:
        """A prop on a player's forearm.

        Raises:
            CannotBe: it is elsewhere.
        """
        thing = self.where[prop]
        if isinstance(thing, Hangs) and thing.player == who:
            return thing
        there = (
            f"{thing.player} holds it" if isinstance(thing, Hangs) else f"it stands on {thing.on}"
        )
        raise CannotBe(f"{who} does not hold {prop}: {there}")

    def check_stands(self, who: str) -> None:
        """Refuses that one who sits walks."""
        if who in self.seated:
            seat = self.seated[who].seat
            raise CannotBe(f"{who} sits on {seat}; needed before: `stands up from`")

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Pairs that may touch until a time [s]."""
        hang = [
            thing.meeting(prop, until)
            for prop, thing in self.where.items()
            if isinstance(thing, Hangs)
        ]
        sit = [seated.meeting(who, until, until) for who, seated in self.seated.items()]
        return (*self.met, *hang, *sit)

    # -- what changes ------------------------------------------------------------------------

    def acting(self, actor: Actor) -> OnStage:
        """The stage with an actor after more of its cues."""
        return replace(self, actors={**self.actors, actor.player.name: actor})

    def part(
        self,
        actor: Actor,
        lane: int,
        gesture: Gesture,
        start: float,
        marks: Mapping[str, float] | None = None,
        end: float | None = None,
    ) -> OnStage:
        """The stage with an actor after its part in a cue; marks from the start on [s]."""
        end = start + gesture.duration if end is None else end
        own = gesture.marks if marks is None else marks
        placed = {mark: start + t for mark, t in own.items()}
        part = Part(actor.player.name, lane, gesture, start, end, placed)
        actor = replace(actor, done=max(actor.done, end))
        return replace(self.acting(actor), parts=(*self.parts, part))

    def placing(self, prop: str, where: Hangs | Stands) -> OnStage:
        """The stage with a prop elsewhere."""
        return replace(self, where={**self.where, prop: where})

    def seating(self, who: str, seated: Seated | None) -> OnStage:
        """The stage with a player that sits, or stands again."""
        others = {name: other for name, other in self.seated.items() if name != who}
        return replace(self, seated=others if seated is None else {**others, who: seated})

    def meeting(self, *meetings: Meeting) -> OnStage:
        """The stage with more meetings."""
        return replace(self, met=(*self.met, *meetings))

    def touching(
        self, turn: Turn[PlayCue], prop: str, pairs: frozenset[Pair], start: float, end: float
    ) -> OnStage:
        """The stage where the players of a cue and a prop may touch for a while [s]."""
        kind = VERBS[turn.given.verb].meets
        assert kind is not None
        return self.meeting(Meeting(start, end, turn.who, (prop,), pairs, kind, turn.spot))

    def released(self, prop: str, held: Hangs, until: float) -> OnStage:
        """The stage after a prop has hung on a forearm until a time [s]."""
        return self.meeting(held.meeting(prop, until)) if until > held.since else self


def carry_pose(actor: Actor, side: str, begin: float, gestures: PlayerGestures) -> Actor:
    """A player in the pose in which it carries something on a forearm, at the end of its walks.

    Args:
        actor: the player, whose strings are at rest.
        side: of the forearm; "" where nothing hangs, which needs no pose.
        begin: when the pose is taken up, if the player is not in it [s].
        gestures: have the pose.

    Raises:
        CannotBe: it has other strings than the bundled marionette.
    """
    line = actor.hands.lanes[0]
    if not side:
        return actor
    try:
        pose = gestures.pose(actor.player, side).turned(actor.last.heading)
    except UnknownNameError as error:
        raise CannotBe(f"{actor.player.name} cannot carry it: {error}") from None
    there, now = pose.ends[0][1][pose.named], (line.d - line.carried)[pose.named]
    if abs(there - now).max() <= IN_POSE:
        return actor
    hands, continued = actor.hands.add(0, pose, max(begin, line.end))
    lanes = (continued.line.stopped(), *hands.lanes[1:])
    return replace(actor, hands=replace(hands, lanes=lanes))


def walked(
    actor: Actor, way: Way, gestures: PlayerGestures, carries: str = ""
) -> tuple[Actor, Gesture]:
    """A player after a walk, and its gesture.

    Args:
        actor: the player.
        way: where it goes.
        gestures: have the steps.
        carries: the forearm on which something hangs.

    Raises:
        CannotBe: it has other strings than the bundled marionette.
    """
    if not way.steps:
        gesture = Gesture.rest(actor.player.alone, 1e-3, everything=False)
        return replace(actor, ways=(*actor.ways, way)), gesture
    try:
        steps = gestures.walk(actor.player, way.steps, way.step_time, carries)
    except UnknownNameError as error:
        raise CannotBe(f"{actor.player.name} cannot walk: {error}") from None
    gesture = steps.turned(way.start.heading)
    hands, _ = actor.hands.add(0, gesture, way.begin)
    return replace(actor, hands=hands, ways=(*actor.ways, way)), gesture
