"""The stage while cues are placed: players, props and meetings, as an immutable value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fantoccini.base import StateError, UnknownNameError
from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import Actor, Cast, ContactBodies, Meeting, Pair, Way
from fantoccini.theatre.gestures import CueError, CuePart, Gesture, PendingCue
from fantoccini.theatre.plays.holdings import Hanging, Seated, Standing
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.script import VERBS, PlayCue, Spot

IN_POSE = 1e-6
"""Distance from a pose below which a player counts as in it [m]."""


@dataclass(frozen=True, eq=False)
class OnStage:
    """Players and props after the cues that have been placed.

    Attributes:
        actors: player -> its actor, after its last placed cue.
        where: prop -> forearm on which it hangs, or place where it stands.
        seated: player -> seat on which it sits.
        met: meetings of the cues placed so far.
        calmed: (cue, player) -> time at which it begins to damp its swing [s].
        passes: cue -> cues of players that it passes, each with a note for the report.
        parts: parts of the players in the cue that is being placed.
    """

    actors: Mapping[str, Actor]
    where: Mapping[str, Hanging | Standing]
    seated: Mapping[str, Seated] = field(default_factory=dict)
    met: tuple[Meeting, ...] = ()
    calmed: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    passes: Mapping[Spot, tuple[tuple[Spot, str], ...]] = field(default_factory=dict)
    parts: tuple[CuePart, ...] = ()

    @classmethod
    def at_start(cls, cast: Cast, actors: Mapping[str, Actor]) -> OnStage:
        """Stage at the start of a play."""
        where: dict[str, Hanging | Standing] = {}
        for name, thing in cast.props.items():
            if thing.held_by:
                where[name] = Hanging(thing.held_by, thing.side, 0.0)
            else:
                on = cast.file.props[name].on or FLOOR
                where[name] = Standing(thing.stands, thing.height, on)
        return cls(actors, where)

    # -- state -------------------------------------------------------------------------------

    def others(self, *names: str) -> list[Actor]:
        """All actors except the named ones."""
        return [actor for name, actor in self.actors.items() if name not in names]

    def carries(self, who: str) -> str:
        """Side of the forearm on which a player carries something; "" if it carries nothing."""
        sides = [
            thing.side
            for thing in self.where.values()
            if isinstance(thing, Hanging) and thing.player == who
        ]
        return sides[0] if sides else ""

    def on_forearm(self, who: str, side: str) -> str | None:
        """Prop that hangs on a forearm; None without one."""
        for prop, thing in self.where.items():
            if isinstance(thing, Hanging) and (thing.player, thing.side) == (who, side):
                return prop
        return None

    def held(self, prop: str, who: str) -> Hanging:
        """A prop that hangs on a player's forearm.

        Raises:
            CueError: the prop is elsewhere.
        """
        thing = self.where[prop]
        if isinstance(thing, Hanging) and thing.player == who:
            return thing
        there = (
            f"{thing.player} holds it" if isinstance(thing, Hanging) else f"it stands on {thing.on}"
        )
        raise CueError(f"{who} does not hold {prop}: {there}")

    def check_stands(self, who: str) -> None:
        """Raises CueError if a player sits, so that it cannot walk."""
        if who in self.seated:
            seat = self.seated[who].seat
            raise CueError(f"{who} sits on {seat}; needed before: `stands up from`")

    def bodies(self, who: str) -> ContactBodies:
        """Bodies of a player that touch props and seats."""
        return self.actors[who].player.bodies

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Meetings until a time [s]."""
        hang = [
            thing.meeting(self.bodies(thing.player), prop, until)
            for prop, thing in self.where.items()
            if isinstance(thing, Hanging)
        ]
        sit = [
            seated.meeting(self.bodies(who), until, until) for who, seated in self.seated.items()
        ]
        return (*self.met, *hang, *sit)

    # -- changes -----------------------------------------------------------------------------

    def with_actor(self, actor: Actor) -> OnStage:
        """Stage with an actor after more of its cues."""
        return replace(self, actors={**self.actors, actor.player.name: actor})

    def with_part(
        self,
        actor: Actor,
        lane: int,
        gesture: Gesture,
        start: float,
        marks: Mapping[str, float] | None = None,
        end: float | None = None,
    ) -> OnStage:
        """Stage with an actor after its part in a cue; marks count from the start [s]."""
        end = start + gesture.duration if end is None else end
        own = gesture.marks if marks is None else marks
        placed = {mark: start + t for mark, t in own.items()}
        part = CuePart(actor.player.name, lane, gesture, start, end, placed)
        actor = replace(actor, done=max(actor.done, end))
        return replace(self.with_actor(actor), parts=(*self.parts, part))

    def with_pass(self, first: Spot, who: str, second: Spot, other: str) -> OnStage:
        """Stage on which a player gives way to another, in their cues.

        Args:
            first, who: cue and player that walk as if the other were not there.
            second, other: cue and player that give way.
        """
        notes = {first: (second, f"{other} gives way"), second: (first, f"gives way to {who}")}
        passes = {spot: (*self.passes.get(spot, ()), note) for spot, note in notes.items()}
        return replace(self, passes={**self.passes, **passes})

    def with_prop(self, prop: str, where: Hanging | Standing) -> OnStage:
        """Stage with a prop in another place."""
        return replace(self, where={**self.where, prop: where})

    def with_seated(self, who: str, seated: Seated | None) -> OnStage:
        """Stage with a player that sits, or stands again."""
        others = {name: other for name, other in self.seated.items() if name != who}
        return replace(self, seated=others if seated is None else {**others, who: seated})

    def with_meetings(self, *meetings: Meeting) -> OnStage:
        """Stage with additional meetings."""
        return replace(self, met=(*self.met, *meetings))

    def with_contact(
        self, turn: PendingCue[PlayCue], prop: str, pairs: frozenset[Pair], start: float, end: float
    ) -> OnStage:
        """Stage with a meeting of the cue's players and a prop [s]."""
        kind = VERBS[turn.entry.verb].meeting
        assert kind is not None
        return self.with_meetings(Meeting(start, end, turn.who, (prop,), pairs, kind, turn.spot))

    def without_hold(self, prop: str, held: Hanging, until: float) -> OnStage:
        """Stage with the meeting of a prop that has hung on a forearm until a time [s]."""
        if until <= held.since:
            return self
        return self.with_meetings(held.meeting(self.bodies(held.player), prop, until))


def carry_pose(actor: Actor, side: str, begin: float, gestures: PlayerGestures) -> Actor:
    """Player in the pose for carrying something on a forearm, at the end of its walks.

    Args:
        actor: player, whose strings are at rest.
        side: side of the forearm; "" if it carries nothing and needs no pose.
        begin: time at which it takes up the pose, if it is not in it [s].
        gestures: gestures with the pose.

    Raises:
        CueError: it lacks a part of the body, or its strings are not driven.
    """
    line = actor.hands.lanes[0]
    if not side:
        return actor
    try:
        pose = actor.player.turned(gestures.pose(actor.player, side), actor.last.heading)
    except (StateError, UnknownNameError) as error:
        raise CueError(f"{actor.player.name} cannot carry it: {error}") from None
    there, now = pose.ends[0][1][pose.named], (line.d - line.origin)[pose.named]
    if abs(there - now).max() <= IN_POSE:
        return actor
    hands, continued = actor.hands.add(0, pose, max(begin, line.end))
    lanes = (continued.sequence.stopped(), *hands.lanes[1:])
    return replace(actor, hands=replace(hands, lanes=lanes))


def walked(
    actor: Actor, way: Way, gestures: PlayerGestures, carries: str = ""
) -> tuple[Actor, Gesture]:
    """Player after a walk, and the gesture of the walk.

    Args:
        actor: player before the walk.
        way: way of the walk.
        gestures: gestures with the steps.
        carries: side of the forearm on which something hangs.

    Raises:
        CueError: it lacks a part of the body, or its strings are not driven.
    """
    if not way.steps:
        gesture = Gesture.rest(actor.player.marionette, 1e-3, everything=False)
        return replace(actor, ways=(*actor.ways, way)), gesture
    try:
        steps = gestures.walk(actor.player, way.steps, way.step_time, carries)
    except (StateError, UnknownNameError) as error:
        raise CueError(f"{actor.player.name} cannot walk: {error}") from None
    gesture = actor.player.turned(steps, way.start.heading)
    hands, _ = actor.hands.add(0, gesture, way.begin)
    return replace(actor, hands=hands, ways=(*actor.ways, way)), gesture
