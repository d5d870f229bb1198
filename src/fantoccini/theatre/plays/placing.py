"""Cues placed in time and on the stage, one after the other in the order in which they begin.

A walk is planned past those that are placed before it; they, later, past it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import takewhile

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.theatre.cast import (
    ERRORS,
    STILL,
    Actor,
    CannotBe,
    Cast,
    Cue,
    Meeting,
    Part,
    Places,
    Player,
    Timeline,
    Way,
    Wishes,
    lane_name,
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
    DoesCue,
    EntersToCue,
    ExitsToCue,
    Notes,
    PropCue,
    Spot,
    WalkCue,
    said,
)

_REFUSED: tuple[type[Exception], ...] = (CannotBe, UnknownNameError, *ERRORS)
"""Errors that refuse a cue as it is placed."""
IN_TIME = 1.0 / 60.0
"""So near to its time a cue is in time [s]."""
_SAME_HEADING = 1e-3
"""Change of a heading that a gesture does not notice [rad]."""


class Placing:
    """All cues of a play, placed once.

    Attributes:
        actors: by player.
        timeline: the cues.
        act_starts: of every act [s].

    Args:
        cast, timeline, repertory, places, walks: of the play.
        wishes: of earlier rounds.
        notes: take changes.
    """

    def __init__(
        self,
        cast: Cast,
        timeline: Timeline,
        repertory: Repertory,
        places: Places,
        walks: Walks,
        wishes: Wishes,
        notes: Notes,
    ):
        self._cast, self.timeline, self._repertory = cast, timeline, repertory
        self._places, self._walks, self._wishes, self._notes = places, walks, wishes, notes
        bounds = cast.file.stage
        self.actors = {
            name: Actor(player, [Line(_most(player, bounds.speed, bounds.acceleration))])
            for name, player in cast.players.items()
        }
        self._aims = Aims(cast, places, self.actors)
        self._handling = Handling(cast, walks, repertory, self.actors, wishes)
        self.act_starts: list[float] = []
        start = 0.0
        for act, given in enumerate(cast.file.acts):
            start += given.after * notes.beat
            self.act_starts.append(start)
            self._place_act(act, start)
            start = max([start, *(cue.moments[END] for cue in timeline.of_act(act))])
        self.end = start
        for actor in self.actors.values():
            for line in actor.lanes:
                if np.any(np.abs(line.rate) > STILL):
                    line.stop()

    def motion(self, name: str, until: float) -> tuple[Gesture, dict[str, Gesture]]:
        """All that a player does until a time [s], and its lanes."""
        actor = self.actors[name]
        lanes = {}
        for i, line in enumerate(actor.lanes):
            line.hold(until)
            label = lane_name(name, i)
            lanes[label] = Gesture(actor.player.alone.coordinates, *line.motion, label)
        whole, *others = lanes.values()
        for other in others:
            whole += other
        return whole, lanes

    @property
    def calmed(self) -> Mapping[tuple[Spot, str], float]:
        """(cue, player) -> when it begins to take out its swing [s]."""
        return self._handling.calmed

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Who may touch what until a time [s]."""
        return self._handling.meetings(until)

    # -- time --------------------------------------------------------------------------------

    def _place_act(self, act: int, start: float) -> None:
        left = self.timeline.of_act(act)
        for cue in left:
            cue.parts, cue.refused, cue.moments = [], "", {}
        while left:
            ready = [
                (self._wanted(cue, start), i)
                for i, cue in enumerate(left)
                if all(one.moments for one in self.timeline.needs(cue))
            ]
            t, i = min(ready)
            self._place(left.pop(i), t)

    def _wanted(self, cue: Cue, act_start: float) -> float:
        """When a cue, or its mark of `on`, is to be [s]."""
        spots = self.timeline.times_of(cue)
        if spots:
            t = max(self.timeline.time(spot, act_start) for spot, _ in spots)
        else:
            t = max(
                act_start if one is None or one.act != cue.act else one.moments[END]
                for one in cue.before.values()
            )
        t += cue.given.after * self._notes.beat
        go = self.timeline.last_go(cue)
        if cue.given.go:
            earlier = self.timeline.cues[self.timeline.acts[cue.act] : cue.index]
            return max([t, act_start, *(one.moments[END] for one in earlier)])
        return t if go is None or spots else max(t, go.moments[START])

    # -- one cue -----------------------------------------------------------------------------

    def _place(self, cue: Cue, t: float) -> None:
        """Places a cue that begins, or whose mark of `on` is, at a time [s]."""
        cue.wanted = t
        why = self._wishes.refused.get(cue.spot, "")
        if not why:
            before = {name: self.actors[name].kept() for name in cue.who}
            things = self._handling.kept()
            try:
                self._check_begin(cue, t)
                if isinstance(cue.given, PropCue):
                    self._handle(cue, t)
                    return
                for name in cue.who:
                    self._place_one(cue, self.actors[name], t)
            except _REFUSED as error:
                why = str(error)
                self.actors.update(before)
                self._handling.back(things)
        if why:
            cue.refused = why
            cue.parts = []
            # What follows begins when it would have, but not while the player is busy.
            busy = [one.moments[END] for one in cue.before.values() if one is not None]
            cue.moments = dict.fromkeys(cue.known, max(t, 0.0))
            cue.moments[END] = max([t, 0.0, *busy])
            return
        cue.moments = {
            moment: max(_moment(part, moment) for part in cue.parts) for moment in cue.known
        }

    def _place_one(self, cue: Cue, actor: Actor, t: float) -> None:
        given, name = cue.given, actor.player.name
        if actor.away and not isinstance(given, EntersToCue):
            raise CannotBe(f"{name} is off the stage")
        if cue.walks:
            self._handling.check_stands(actor)
        early = self._wishes.earlier.get((cue.spot, name), 0.0)
        pause = self._wishes.pauses.get(cue.spot, 0.0)
        ahead = 0.0
        if given.mark and not cue.walks:
            ahead = self._gesture(cue, actor, t).marks[given.mark]
        asked = t - ahead - early
        if cue.walks:
            self._walk(cue, actor, asked, asked + pause)
        else:
            self._act(cue, actor, asked, asked + pause)

    def _handle(self, cue: Cue, t: float) -> None:
        """Places a cue with a prop that begins at a time [s]."""
        for name in cue.who:
            if self.actors[name].away:
                raise CannotBe(f"{name} is off the stage")
        begin = max(t + self._wishes.pauses.get(cue.spot, 0.0), self.act_starts[cue.act])
        wait = max((cue.given.may_wait or 0.0) * self._notes.beat - (begin - t), 0.0)
        begun = self._handling.place(cue, begin, wait)
        self._check_time(cue, self.actors[cue.who[-1]], begun - t, begun)

    def _check_begin(self, cue: Cue, t: float) -> None:
        """Refuses what would be before its act, or before a GO for which its act waits."""
        start, go = self.act_starts[cue.act], self.timeline.last_go(cue)
        if t < start - LATE:
            said = self._said(start, cue)
            raise CannotBe(f"its time is {start - t:.2f} s before its act, which begins {said}")
        if go is not None and t < go.moments[START] - LATE:
            line = self._notes.located.line(go.spot)
            raise CannotBe(
                f"its time is before the GO of line {line}, {self._said(go.moments[START], cue)}"
            )

    def _act(self, cue: Cue, actor: Actor, asked: float, begin: float) -> None:
        """Places a gesture in a lane, from the heading that the player then has.

        It is to begin at one time, and begins at another or later [s].
        """
        earliest = max(begin, self.act_starts[cue.act])
        gesture = self._gesture(cue, actor, earliest)
        lane, start = actor.lane(gesture, earliest)
        if start > earliest + LATE:
            gesture = self._gesture(cue, actor, start)
        heading = actor.stands(start).heading
        turned = abs(actor.stands(start + gesture.duration).heading - heading)
        if turned > _SAME_HEADING:
            until = max(way.end for way in actor.ways)
            raise CannotBe(
                f"{actor.player.name} turns by {np.degrees(turned):.0f} deg meanwhile; it can "
                f"begin {self._said(until, cue)}"
            )
        start = actor.add(lane, gesture, start)
        self._check_time(cue, actor, start - asked, start)
        actor.played.append((lane, start, start + gesture.duration, gesture.named))
        note(cue, actor, lane, gesture, start)

    def _walk(self, cue: Cue, actor: Actor, asked: float, begin: float) -> None:
        """Places a walk that is to begin at a time, at another or later [s]."""
        given, player, line = cue.given, actor.player, actor.lanes[0]
        if np.any(np.abs(line.rate) > STILL):
            line.stop()
        by = begin if given.mark else None
        carries = self._handling.carries(player.name)
        earliest = self.act_starts[cue.act] if by is not None else begin
        free = max(carry_pose(actor, carries, earliest, self._repertory), self.act_starts[cue.act])
        begin = max(begin, free)
        others = [one for one in self.actors.values() if one is not actor]
        wait = max((given.may_wait or 0.0) * self._notes.beat - (begin - asked), 0.0)
        way, why = self._walks.way(
            player,
            actor.last,
            self._aims.goals(cue, actor),
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
            self._check_time(cue, actor, abs(way.end - cue.wanted), way.end)
        else:
            self._check_time(cue, actor, starts - asked, starts)
        until = self._turns_under(actor, way)
        if until is not None:
            self._check_time(cue, actor, until - asked, until)
            if by is not None:
                raise CannotBe(f"{player.name} is busy until {self._said(until, cue)[3:]}")
            self._walk(cue, actor, asked, until)
            return
        gesture, _ = walk_along(actor, way, self._repertory, carries)
        actor.away = isinstance(given, ExitsToCue)
        marks = {mark: t - (starts - way.begin) for mark, t in gesture.marks.items()}
        marks[ARRIVES] = way.end - starts
        note(cue, actor, 0, gesture, starts, marks, way.end)

    def _turns_under(self, actor: Actor, way: Way) -> float | None:
        """When the gestures end that go on while a way turns; None where there are none [s]."""
        ends = []
        for _, start, end, _ in actor.played:
            since, until = max(start, way.begin), min(end, way.end)
            if since < until - LATE:
                _, heading = way.footing(np.linspace(since, until, 9))
                if np.max(np.abs(heading - actor.stands(start).heading)) > _SAME_HEADING:
                    ends.append(end)
        return max(ends, default=None)

    def _check_time(self, cue: Cue, actor: Actor, late: float, then: float) -> None:
        """Refuses what cannot be in time."""
        if late <= cue.give(self._notes.beat) + IN_TIME:
            return
        what = "arrive" if cue.walks and cue.given.mark else "begin"
        beats = np.ceil(10.0 * late / self._notes.beat) / 10.0
        raise CannotBe(
            f"{actor.player.name} cannot {what} before {self._said(then, cue)[3:]}; later by up "
            f"to {beats:g} beats it can (`may wait: {beats:g}`)"
        )

    def _said(self, t: float, cue: Cue) -> str:
        """A time in words, in beats of the cue's act."""
        return said_in_act(t, self.act_starts[cue.act], self._notes.beat)

    # -- what is done ------------------------------------------------------------------------

    def _gesture(self, cue: Cue, actor: Actor, t: float) -> Gesture:
        """What a player does that begins at a time [s]."""
        given, player, stands = cue.given, actor.player, actor.stands(t)
        try:
            if isinstance(given, DoesCue):
                style = Style.of(given)
                smaller = self._wishes.smaller.get(cue.spot, 1.0)
                style = replace(style, larger=style.larger * smaller)
                return self._repertory.gesture(player, given, style, stands.heading)
            where, spot, name = given.what, (*cue.spot, said(given.verb)), VERBS[given.verb].called
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
