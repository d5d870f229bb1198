"""Cues placed in time and on the stage, one after the other in the order in which they begin.

A walk is planned past those that are placed before it; they, later, past it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.theatre.cast import (
    ERRORS,
    Actor,
    CannotBe,
    Cast,
    Meeting,
    Part,
    Placed,
    Places,
    Player,
    Turn,
    Way,
    Wishes,
    said_in_act,
)
from fantoccini.theatre.gestures import Gesture, Line, limits
from fantoccini.theatre.plays.acting import Repertory, Style
from fantoccini.theatre.plays.aims import Aims
from fantoccini.theatre.plays.doing import carry_pose, note, walk_along
from fantoccini.theatre.plays.handling import Handling
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import (
    ARRIVES,
    END,
    LATE,
    START,
    VERBS,
    Cue,
    DoesCue,
    EntersToCue,
    ExitsToCue,
    Moments,
    Notes,
    PlayCue,
    PropCue,
    Spot,
    Timeline,
    WalkCue,
    said,
    walks,
)

_REFUSED: tuple[type[Exception], ...] = (CannotBe, UnknownNameError, *ERRORS)
"""Errors that refuse a cue as it is placed."""
IN_TIME = 1.0 / 60.0
"""So near to its time a cue is in time [s]."""
_SAME_HEADING = 1e-3
"""Change of a heading that a gesture does not notice [rad]."""
_RINGS = 1.0
"""Time simulated after the last cue, in which the puppets swing out [s]."""


@dataclass(frozen=True, eq=False)
class Placement:
    """All cues of a play, placed once.

    Attributes:
        cues: in the file's order.
        act_starts: of every act [s].
        motions: player -> what its hands do.
        lanes: player -> lane -> its part of that.
        starts: player -> times at which its cues begin [s].
        ways: player -> its walks.
        meetings: who may touch what, and when.
        calmed: (cue, player) -> when it begins to take out its swing [s].
    """

    cues: tuple[Placed, ...]
    act_starts: tuple[float, ...]
    motions: Mapping[str, Gesture]
    lanes: Mapping[str, Mapping[str, Gesture]]
    starts: Mapping[str, tuple[float, ...]]
    ways: Mapping[str, tuple[Way, ...]]
    meetings: tuple[Meeting, ...]
    calmed: Mapping[tuple[Spot, str], float]


def place_cues(
    cast: Cast,
    timeline: Timeline[PlayCue],
    repertory: Repertory,
    places: Places,
    walks: Walks,
    wishes: Wishes,
    notes: Notes,
) -> Placement:
    """Places all cues of a play.

    Args:
        cast, timeline, repertory, places, walks: of the play.
        wishes: of earlier rounds.
        notes: know the file and the beat.
    """
    bounds = cast.file.stage
    actors = {
        name: Actor(player, [Line(_most(player, bounds.speed, bounds.acceleration))])
        for name, player in cast.players.items()
    }
    placing = _Placing(cast, timeline, repertory, places, walks, wishes, notes, actors)
    starts, start = list[float](), 0.0
    for act, given in enumerate(cast.file.acts):
        start += given.after * notes.beat
        starts.append(start)
        placing.place_act(act, start)
        start = max([start, *(placing.moments[cue.spot][END] for cue in timeline.of_act(act))])
    for actor in actors.values():
        for line in actor.lanes:
            line.rest()
    end = max(start, *(actor.done for actor in actors.values())) + _RINGS
    cues = tuple(placing.placed[cue.spot] for cue in timeline.cues)
    both = {name: actor.motion(end) for name, actor in actors.items()}
    return Placement(
        cues,
        tuple(starts),
        {name: whole for name, (whole, _) in both.items()},
        {name: own for name, (_, own) in both.items()},
        {
            name: tuple(part.start for cue in cues for part in cue.parts if part.who == name)
            for name in actors
        },
        {name: tuple(actor.ways) for name, actor in actors.items()},
        placing.handling.meetings(end),
        dict(placing.handling.calmed),
    )


class _Placing:
    """The stage while cues are placed, one after the other.

    Attributes:
        handling: props, and what is done with them.
        moments: place of a cue or a time of the play -> its moments.
        placed: place of a cue -> the cue as it is placed.
    """

    def __init__(
        self,
        cast: Cast,
        timeline: Timeline[PlayCue],
        repertory: Repertory,
        places: Places,
        walks: Walks,
        wishes: Wishes,
        notes: Notes,
        actors: dict[str, Actor],
    ):
        self._timeline, self._repertory, self._walks = timeline, repertory, walks
        self._wishes, self._notes, self._actors = wishes, notes, actors
        self._aims = Aims(cast, places, actors)
        self._start = 0.0
        self.handling = Handling(cast, walks, repertory, actors, wishes)
        self.moments: dict[Spot, Moments] = {}
        self.placed: dict[Spot, Placed] = {}

    def place_act(self, act: int, start: float) -> None:
        """Places the cues of an act that begins at a time [s]."""
        self._start = start
        self._timeline.place(act, start, self.moments, self._place)

    # -- one cue -----------------------------------------------------------------------------

    def _place(self, cue: Cue[PlayCue], t: float) -> Moments:
        """Places a cue that begins, or whose mark of `on` is, at a time [s]; its moments."""
        turn, why = Turn(cue, t), self._wishes.refused.get(cue.spot, "")
        moments: Moments = {}
        if not why:
            before = {name: self._actors[name].kept() for name in cue.who}
            things = self.handling.kept()
            try:
                moments = self._placed(turn)
            except _REFUSED as error:
                why = str(error)
                self._actors.update(before)
                self.handling.back(things)
        if why:
            turn.parts.clear()
            # What follows begins when it would have, but not while the player is busy.
            busy = [self.moments[one.spot][END] for one in cue.before]
            moments = dict.fromkeys(cue.known, max(t, 0.0)) | {END: max([t, 0.0, *busy])}
        self.placed[cue.spot] = Placed(cue, t, tuple(turn.parts), moments, why)
        return moments

    def _placed(self, turn: Turn) -> Moments:
        """Places a cue; its moments.

        Raises:
            CannotBe: it cannot be done.
        """
        self._check_begin(turn)
        if isinstance(turn.given, PropCue):
            return self._handle(turn)
        for name in turn.who:
            self._place_one(turn, self._actors[name], turn.wanted)
        return {
            moment: max(_moment(part, moment) for part in turn.parts) for moment in turn.cue.known
        }

    def _place_one(self, turn: Turn, actor: Actor, t: float) -> None:
        given, name = turn.given, actor.player.name
        if actor.away and not isinstance(given, EntersToCue):
            raise CannotBe(f"{name} is off the stage")
        if walks(given):
            self.handling.check_stands(actor)
        early = self._wishes.earlier.get((turn.spot, name), 0.0)
        pause = self._wishes.pauses.get(turn.spot, 0.0)
        ahead = 0.0
        if given.mark and not walks(given):
            ahead = self._gesture(turn, actor, t).marks[given.mark]
        asked = t - ahead - early
        if walks(given):
            self._walk(turn, actor, asked, asked + pause)
        else:
            self._act(turn, actor, asked, asked + pause)

    def _handle(self, turn: Turn) -> Moments:
        """Places a cue with a prop; its moments."""
        t = turn.wanted
        for name in turn.who:
            if self._actors[name].away:
                raise CannotBe(f"{name} is off the stage")
        begin = max(t + self._wishes.pauses.get(turn.spot, 0.0), self._start)
        wait = max((turn.given.may_wait or 0.0) * self._notes.beat - (begin - t), 0.0)
        moments = self.handling.place(turn, begin, wait)
        begun = moments[START]
        self._check_time(turn, self._actors[turn.who[-1]], begun - t, begun)
        return moments

    def _check_begin(self, turn: Turn) -> None:
        """Refuses what would be before its act, or before a GO for which its act waits."""
        t, start, go = turn.wanted, self._start, self._timeline.gos.get(turn.spot)
        if t < start - LATE:
            begins = self._said(start)
            raise CannotBe(f"its time is {start - t:.2f} s before its act, which begins {begins}")
        if go is not None and t < self.moments[go.spot][START] - LATE:
            line, then = self._notes.located.line(go.spot), self.moments[go.spot][START]
            raise CannotBe(f"its time is before the GO of line {line}, {self._said(then)}")

    def _act(self, turn: Turn, actor: Actor, asked: float, begin: float) -> None:
        """Places a gesture in a lane, from the heading that the player then has.

        It is to begin at one time, and begins at another or later [s].
        """
        earliest = max(begin, self._start)
        gesture = self._gesture(turn, actor, earliest)
        lane, start = actor.lane(gesture, earliest)
        if start > earliest + LATE:
            gesture = self._gesture(turn, actor, start)
        heading = actor.stands(start).heading
        turned = abs(actor.stands(start + gesture.duration).heading - heading)
        if turned > _SAME_HEADING:
            until = max(way.end for way in actor.ways)
            raise CannotBe(
                f"{actor.player.name} turns by {np.degrees(turned):.0f} deg meanwhile; it can "
                f"begin {self._said(until)}"
            )
        start = actor.add(lane, gesture, start)
        self._check_time(turn, actor, start - asked, start)
        actor.played.append((lane, start, start + gesture.duration, gesture.named))
        note(turn, actor, lane, gesture, start)

    def _walk(self, turn: Turn, actor: Actor, asked: float, begin: float) -> None:
        """Places a walk that is to begin at a time, at another or later [s]."""
        given, player = turn.given, actor.player
        actor.lanes[0].rest()
        by = begin if given.mark else None
        carries = self.handling.carries(player.name)
        earliest = self._start if by is not None else begin
        free = max(carry_pose(actor, carries, earliest, self._repertory), self._start)
        begin = max(begin, free)
        others = [one for one in self._actors.values() if one is not actor]
        wait = max((given.may_wait or 0.0) * self._notes.beat - (begin - asked), 0.0)
        way, why = self._walks.way(
            player,
            actor.last,
            self._aims.goals(turn, actor),
            begin,
            wait,
            [(one.player, one.track()) for one in others],
            near=given.near if isinstance(given, WalkCue) else 0.0,
            arrives=by,
            free_from=free,
            carries=bool(carries),
        )
        if way is None:
            raise CannotBe(why)
        stands = len(list(takewhile(lambda step: step.stands, way.steps)))
        starts = way.begin + stands * way.step_time
        if by is not None:
            self._check_time(turn, actor, abs(way.end - turn.wanted), way.end)
        else:
            self._check_time(turn, actor, starts - asked, starts)
        until = self._turns_under(actor, way)
        if until is not None:
            self._check_time(turn, actor, until - asked, until)
            if by is not None:
                raise CannotBe(f"{player.name} is busy until {self._said(until)[3:]}")
            self._walk(turn, actor, asked, until)
            return
        gesture, _ = walk_along(actor, way, self._repertory, carries)
        actor.away = isinstance(given, ExitsToCue)
        marks = {mark: t - (starts - way.begin) for mark, t in gesture.marks.items()}
        marks[ARRIVES] = way.end - starts
        note(turn, actor, 0, gesture, starts, marks, way.end)

    def _turns_under(self, actor: Actor, way: Way) -> float | None:
        """Latest end of the gestures during which a walk would turn [s]; None without any."""
        ends = []
        for _, start, end, _ in actor.played:
            since, until = max(start, way.begin), min(end, way.end)
            if since < until - LATE:
                _, heading = way.footing(np.linspace(since, until, 9))
                if np.max(np.abs(heading - actor.stands(start).heading)) > _SAME_HEADING:
                    ends.append(end)
        return max(ends, default=None)

    def _check_time(self, turn: Turn, actor: Actor, late: float, then: float) -> None:
        """Refuses what cannot be in time."""
        if late <= turn.given.patience * self._notes.beat + IN_TIME:
            return
        what = "arrive" if walks(turn.given) and turn.given.mark else "begin"
        beats = np.ceil(10.0 * late / self._notes.beat) / 10.0
        raise CannotBe(
            f"{actor.player.name} cannot {what} before {self._said(then)[3:]}; later by up "
            f"to {beats:g} beats it can (`may wait: {beats:g}`)"
        )

    def _said(self, t: float) -> str:
        """A time in words, in beats of the cue's act."""
        return said_in_act(t, self._start, self._notes.beat)

    # -- what is done ------------------------------------------------------------------------

    def _gesture(self, turn: Turn, actor: Actor, t: float) -> Gesture:
        """Gesture of a player from a time on [s]."""
        given, player, stands = turn.given, actor.player, actor.stands(t)
        try:
            if isinstance(given, DoesCue):
                style = Style.of(given)
                smaller = self._wishes.smaller.get(turn.spot, 1.0)
                style = replace(style, larger=style.larger * smaller)
                return self._repertory.gesture(player, given, style, stands.heading)
            where, spot, name = given.what, (*turn.spot, said(given.verb)), VERBS[given.verb].called
            place = self._aims.place_of(where, spot, t)
            made = self._repertory.aimed(player, name, place, stands)
            # Both may have gone on until then.
            then = t + min(made.marks.values())
            place, stands = self._aims.place_of(where, spot, then), actor.stands(then)
            return self._repertory.aimed(player, name, place, stands)
        except StateError as error:
            raise CannotBe(str(error)) from None


def _moment(part: Part, moment: str) -> float:
    if moment == START:
        return part.start
    if moment == END:
        return part.end
    return part.marks[moment]


def _most(player: Player, speed: float, acceleration: float) -> Array:
    return limits(player.alone.coordinates, speed, acceleration)
