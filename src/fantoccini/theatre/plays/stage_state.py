"""The stage while cues are placed: players, props and meetings, as an immutable value.

A meeting is a time during which players and props may touch. A cue is a line of the play, and a
lane a list of gestures in order. A spot is the list of keys that leads to an entry of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fantoccini.base import StateError, UnknownNameError
from fantoccini.model.puppet import FLOOR
from fantoccini.theatre.cast import Actor, Cast, ContactBodies, Meeting, Pair, Walk
from fantoccini.theatre.gestures import CueError, CuePart, Gesture, PendingCue
from fantoccini.theatre.plays.floor_walks import floor_meetings
from fantoccini.theatre.plays.holdings import Hanging, Seated, Standing
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.script import VERBS, PlayCue, Spot

POSE_TOLERANCE = 1e-6
"""Distance from a pose below which a player counts as in it [m]."""


@dataclass(frozen=True, eq=False)
class StageState:
    """Players and props after the cues that have been placed.

    Attributes:
        actors: player -> its actor, after its last placed cue.
        prop_places: prop -> forearm on which it hangs, or place where it stands.
        seated: player -> seat on which it sits.
        past_meetings: meetings of the cues placed so far.
        damping_times: (cue, player) -> time at which it begins to damp its swing [s].
        pass_notes: cue -> cues of players that it passes, each with a note for the report.
        parts: parts of the players in the cue that is being placed.
    """

    actors: Mapping[str, Actor]
    prop_places: Mapping[str, Hanging | Standing]
    seated: Mapping[str, Seated] = field(default_factory=dict)
    past_meetings: tuple[Meeting, ...] = ()
    damping_times: Mapping[tuple[Spot, str], float] = field(default_factory=dict)
    pass_notes: Mapping[Spot, tuple[tuple[Spot, str], ...]] = field(default_factory=dict)
    parts: tuple[CuePart, ...] = ()

    @classmethod
    def at_start(cls, cast: Cast, actors: Mapping[str, Actor]) -> StageState:
        """Stage at the start of a play."""
        prop_places: dict[str, Hanging | Standing] = {}
        for name, prop in cast.props.items():
            if prop.held_by:
                prop_places[name] = Hanging(prop.held_by, prop.side, 0.0)
            else:
                support = cast.file.props[name].on or FLOOR
                prop_places[name] = Standing(prop.footing, prop.bottom_height, support)
        return cls(actors, prop_places)

    # -- state -------------------------------------------------------------------------------

    def others(self, *names: str) -> list[Actor]:
        """All actors except the named ones."""
        return [actor for name, actor in self.actors.items() if name not in names]

    def carries(self, who: str) -> str:
        """Side of the forearm on which a player carries something; "" if it carries nothing."""
        sides = [
            prop_place.side
            for prop_place in self.prop_places.values()
            if isinstance(prop_place, Hanging) and prop_place.player == who
        ]
        return sides[0] if sides else ""

    def on_forearm(self, who: str, side: str) -> str | None:
        """Prop that hangs on a forearm; None without one."""
        for prop, prop_place in self.prop_places.items():
            if isinstance(prop_place, Hanging) and (prop_place.player, prop_place.side) == (
                who,
                side,
            ):
                return prop
        return None

    def held(self, prop: str, who: str) -> Hanging:
        """A prop that hangs on a player's forearm.

        Raises:
            CueError: the prop is elsewhere.
        """
        place = self.prop_places[prop]
        if isinstance(place, Hanging) and place.player == who:
            return place
        actual_place = (
            f"{place.player} holds it" if isinstance(place, Hanging) else f"it stands on {place.on}"
        )
        raise CueError(f"{who} does not hold {prop}: {actual_place}")

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
        hanging = [
            prop_place.meeting(self.bodies(prop_place.player), prop, until)
            for prop, prop_place in self.prop_places.items()
            if isinstance(prop_place, Hanging)
        ]
        sitting = [
            seated.meeting(self.bodies(who), until, until) for who, seated in self.seated.items()
        ]
        walking = [meeting for actor in self.actors.values() for meeting in floor_meetings(actor)]
        return (*self.past_meetings, *hanging, *sitting, *walking)

    # -- changes -----------------------------------------------------------------------------

    def with_actor(self, actor: Actor) -> StageState:
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
    ) -> StageState:
        """Stage with an actor after its part in a cue; marks count from the start [s]."""
        end = start + gesture.duration if end is None else end
        relative_marks = gesture.marks if marks is None else marks
        mark_times = {mark: start + t for mark, t in relative_marks.items()}
        part = CuePart(actor.player.name, lane, gesture, start, end, mark_times)
        actor = replace(actor, busy_until=max(actor.busy_until, end))
        return replace(self.with_actor(actor), parts=(*self.parts, part))

    def with_pass(
        self, passing_cue: Spot, passing_player: str, yielding_cue: Spot, yielding_player: str
    ) -> StageState:
        """Stage on which a player gives way to another, in their cues.

        Args:
            passing_cue, passing_player: cue and player that walk as if the other were not there.
            yielding_cue, yielding_player: cue and player that give way.
        """
        notes = {
            passing_cue: (yielding_cue, f"{yielding_player} gives way"),
            yielding_cue: (passing_cue, f"gives way to {passing_player}"),
        }
        pass_notes = {spot: (*self.pass_notes.get(spot, ()), note) for spot, note in notes.items()}
        return replace(self, pass_notes={**self.pass_notes, **pass_notes})

    def with_prop(self, prop: str, place: Hanging | Standing) -> StageState:
        """Stage with a prop in another place."""
        return replace(self, prop_places={**self.prop_places, prop: place})

    def with_seated(self, who: str, seated: Seated | None) -> StageState:
        """Stage with a player that sits, or stands again."""
        others = {name: other for name, other in self.seated.items() if name != who}
        return replace(self, seated=others if seated is None else {**others, who: seated})

    def with_meetings(self, *meetings: Meeting) -> StageState:
        """Stage with additional meetings."""
        return replace(self, past_meetings=(*self.past_meetings, *meetings))

    def with_contact(
        self, turn: PendingCue[PlayCue], prop: str, pairs: frozenset[Pair], start: float, end: float
    ) -> StageState:
        """Stage with a meeting of the cue's players and a prop [s]."""
        kind = VERBS[turn.entry.verb].meeting
        assert kind is not None
        return self.with_meetings(Meeting(start, end, turn.who, (prop,), pairs, kind, turn.spot))

    def without_hold(self, prop: str, held: Hanging, until: float) -> StageState:
        """Stage with the meeting of a prop that has hung on a forearm until a time [s]."""
        if until <= held.begin:
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
        pose = actor.player.turned(gestures.pose(actor.player, side), actor.last_footing.heading)
    except (StateError, UnknownNameError) as error:
        raise CueError(f"{actor.player.name} cannot carry it: {error}") from None
    pose_offsets, present_offsets = pose.ends[0][1][pose.named], (line.d - line.origin)[pose.named]
    if abs(pose_offsets - present_offsets).max() <= POSE_TOLERANCE:
        return actor
    hands, continued = actor.hands.add(0, pose, max(begin, line.end))
    lanes = (continued.sequence.stopped(), *hands.lanes[1:])
    return replace(actor, hands=replace(hands, lanes=lanes))


def after_walk(
    actor: Actor, walk: Walk, gestures: PlayerGestures, carrying_side: str = ""
) -> tuple[Actor, Gesture]:
    """Player after a walk, and the gesture of the walk.

    Args:
        actor: player before the walk.
        walk: path and times of the walk.
        gestures: gestures with the steps.
        carrying_side: side of the forearm on which something hangs.

    Raises:
        CueError: it lacks a part of the body, or its strings are not driven.
    """
    if not walk.steps:
        gesture = Gesture.rest(actor.player.marionette, 1e-3, everything=False)
        return replace(actor, walks=(*actor.walks, walk)), gesture
    try:
        steps = gestures.walk(actor.player, walk, carrying_side)
    except (StateError, UnknownNameError) as error:
        raise CueError(f"{actor.player.name} cannot walk: {error}") from None
    gesture = actor.player.turned(steps, walk.start.heading)
    hands, _ = actor.hands.add(0, gesture, walk.begin)
    return replace(actor, hands=hands, walks=(*actor.walks, walk)), gesture
