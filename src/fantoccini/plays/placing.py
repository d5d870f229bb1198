"""Cues placed in time and on the stage, one after the other in the order in which they begin.

A walk is planned past those that are placed before it; they, later, past it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.gestures import Gesture
from fantoccini.gestures.joining import Line
from fantoccini.gestures.notes import LATE, Notes
from fantoccini.gestures.timing import END, START, Spot
from fantoccini.gestures.transition import limits
from fantoccini.plays.acting import Repertory, Style
from fantoccini.plays.actors import Actor, Wishes
from fantoccini.plays.casting import Cast, Player
from fantoccini.plays.companies import Meeting
from fantoccini.plays.cue_file import said
from fantoccini.plays.cues import ARRIVES, Cue, Part, Timeline, lane_name, said_in_act
from fantoccini.plays.footing import Footing, Way
from fantoccini.plays.starts import Places
from fantoccini.plays.walks import Walks

IN_TIME = 1.0 / 60.0
"""So near to its time a cue is in time [s]."""
_EYES = 0.42
"""Height of a player's face [m]."""
_STILL = 1e-9
"""Rate below which a lane is at rest [m/s or rad/s]."""
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
        self, cast: Cast, timeline: Timeline, repertory: Repertory, places: Places, walks: Walks,
        wishes: Wishes, notes: Notes,
    ):  # fmt: skip
        self._cast, self.timeline, self._repertory = cast, timeline, repertory
        self._places, self._walks, self._wishes, self._notes = places, walks, wishes, notes
        bounds = cast.file.stage
        self.actors = {
            name: Actor(player, [Line(_most(player, bounds.speed, bounds.acceleration))])
            for name, player in cast.players.items()
        }
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
                if np.any(np.abs(line.rate) > _STILL):
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

    def meetings(self, until: float) -> tuple[Meeting, ...]:
        """Who may touch what until a time [s]."""
        return ()

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
            try:
                self._check_begin(cue, t)
                for name in cue.who:
                    self._place_one(cue, self.actors[name], t)
            except _CannotBe as error:
                why = str(error)
                self.actors.update(before)
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
        if actor.away and given.verb != "enters_to":
            raise _CannotBe(f"{name} is off the stage")
        early = self._wishes.earlier.get((cue.spot, name), 0.0)
        pause = self._wishes.pauses.get(cue.spot, 0.0)
        ahead = 0.0
        if given.on is not None and not cue.walks:
            (mark,) = given.on
            ahead = self._gesture(cue, actor, t).marks[mark]
        asked = t - ahead - early
        if cue.walks:
            self._walk(cue, actor, asked, asked + pause)
        else:
            self._act(cue, actor, asked, asked + pause)

    def _check_begin(self, cue: Cue, t: float) -> None:
        """Refuses what would be before its act, or before a GO for which its act waits."""
        start, go = self.act_starts[cue.act], self.timeline.last_go(cue)
        if t < start - LATE:
            said = self._said(start, cue)
            raise _CannotBe(f"its time is {start - t:.2f} s before its act, which begins {said}")
        if go is not None and t < go.moments[START] - LATE:
            line = self._notes.located.line(go.spot)
            raise _CannotBe(
                f"its time is before the GO of line {line}, {self._said(go.moments[START], cue)}"
            )

    def _act(self, cue: Cue, actor: Actor, asked: float, begin: float) -> None:
        """Places a gesture in a lane, from the heading that the player then has.

        It is to begin at one time, and begins at another or later [s].
        """
        earliest = max(begin, self.act_starts[cue.act])
        gesture = self._gesture(cue, actor, earliest)
        lane, start = self._lane(actor, gesture, earliest)
        if start > earliest + LATE:
            gesture = self._gesture(cue, actor, start)
        heading = actor.stands(start).heading
        turned = abs(actor.stands(start + gesture.duration).heading - heading)
        if turned > _SAME_HEADING:
            until = max(way.end for way in actor.ways)
            raise _CannotBe(
                f"{actor.player.name} turns by {np.degrees(turned):.0f} deg meanwhile; it can "
                f"begin {self._said(until, cue)}"
            )
        start = self._add(actor.lanes[lane], gesture, start)
        self._check_time(cue, actor, start - asked, start)
        actor.played.append((lane, start, start + gesture.duration, gesture.named))
        self._note(cue, actor, lane, gesture, start)

    def _walk(self, cue: Cue, actor: Actor, asked: float, begin: float) -> None:
        """Places a walk that is to begin at a time, at another or later [s]."""
        given, player, line = cue.given, actor.player, actor.lanes[0]
        if np.any(np.abs(line.rate) > _STILL):
            line.stop()
        by = begin if given.on is not None else None
        free = max(line.end, self.act_starts[cue.act])
        begin = max(begin, free)
        others = [one for one in self.actors.values() if one is not actor]
        wait = max((given.may_wait or 0.0) * self._notes.beat - (begin - asked), 0.0)
        way, why = self._walks.way(
            player, actor.last, self._goals(cue, actor), begin, wait,
            [(one.player, one.track()) for one in others],
            near=given.near, arrives=by, free_from=free,
        )  # fmt: skip
        if way is None:
            raise _CannotBe(why)
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
                raise _CannotBe(f"{player.name} is busy until {self._said(until, cue)[3:]}")
            self._walk(cue, actor, asked, until)
            return
        if way.steps:
            try:
                made = self._repertory.walk(player, way.steps, way.step_time)
            except UnknownNameError as error:
                raise _CannotBe(f"{player.name} cannot walk: {error}") from None
            gesture = made.turned(way.start.heading)
            self._add(line, gesture, way.begin)
        else:
            gesture = Gesture.rest(player.alone, 1e-3, everything=False)
        actor.ways.append(way)
        actor.away = given.verb == "exits_to"
        marks = {mark: t - (starts - way.begin) for mark, t in gesture.marks.items()}
        marks[ARRIVES] = way.end - starts
        self._note(cue, actor, 0, gesture, starts, marks, way.end)

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
        what = "arrive" if cue.walks and cue.given.on is not None else "begin"
        beats = np.ceil(10.0 * late / self._notes.beat) / 10.0
        raise _CannotBe(
            f"{actor.player.name} cannot {what} before {self._said(then, cue)[3:]}; later by up "
            f"to {beats:g} beats it can (`may wait: {beats:g}`)"
        )

    def _said(self, t: float, cue: Cue) -> str:
        """A time in words, in beats of the cue's act."""
        return said_in_act(t, self.act_starts[cue.act], self._notes.beat)

    def _note(
        self, cue: Cue, actor: Actor, lane: int, gesture: Gesture, start: float,
        marks: Mapping[str, float] | None = None, end: float | None = None,
    ) -> None:  # fmt: skip
        end = start + gesture.duration if end is None else end
        own = gesture.marks if marks is None else marks
        placed = {mark: start + t for mark, t in own.items()}
        cue.parts.append(Part(actor.player.name, lane, gesture, start, end, placed))
        actor.done = max(actor.done, end)

    # -- what is done ------------------------------------------------------------------------

    def _gesture(self, cue: Cue, actor: Actor, t: float) -> Gesture:
        """What a player does that begins at a time [s]."""
        given, player, stands = cue.given, actor.player, actor.stands(t)
        try:
            if given.does is not None:
                style = Style.of(given)
                smaller = self._wishes.smaller.get(cue.spot, 1.0)
                style = replace(style, larger=style.larger * smaller)
                return self._repertory.gesture(player, given, style, stands.heading)
            where = given.looks_at if given.looks_at is not None else given.points_at
            spot = (*cue.spot, said(given.verb))
            place = self._place_of(where, spot, t)
            made = self._repertory.aimed(player, given.verb, place, stands)
            # Both may have gone on until then.
            then = t + min(made.marks.values())
            place, stands = self._place_of(where, spot, then), actor.stands(then)
            return self._repertory.aimed(player, given.verb, place, stands)
        except StateError as error:
            raise _CannotBe(str(error)) from None

    def _goals(self, cue: Cue, actor: Actor) -> list[Footing]:
        """Where a walk leads: the last one is its own."""
        given, here = cue.given, actor.last
        if given.turns_to is not None:
            return [here.facing(self._heading(given.turns_to, here, cue, actor, "turns to"))]
        last = getattr(given, given.verb)
        spots: list[Spot] = [(*cue.spot, "past", i) for i in range(len(given.past))]
        spots.append((*cue.spot, said(given.verb)))
        places = [
            self._place_of(where, spot, cue.wanted)
            for where, spot in zip((*given.past, last), spots, strict=True)
        ]
        z = [here.place, *(complex(place[0], place[1]) for place in places)]
        goals = []
        for before, there, after in zip(z[:-1], z[1:], [*z[2:], z[-1]], strict=True):
            way = after - there if after != there else there - before
            heading = float(np.angle(way)) if way else here.heading
            goals.append(Footing(there.real, there.imag, heading))
        mark = self._cast.file.stage.marks.get(last) if isinstance(last, str) else None
        facing = given.facing
        if facing is None and mark is not None:
            facing = mark.facing
        if facing is not None:
            heading = self._heading(facing, goals[-1], cue, actor, "facing")
            goals[-1] = goals[-1].facing(heading)
        return goals

    def _heading(
        self, given: float | str, there: Footing, cue: Cue, actor: Actor, key: str
    ) -> float:
        direction = self._places.direction(given, (*cue.spot, key))
        if not isinstance(direction, str):
            return direction
        place = self._place_of(direction, (*cue.spot, key), cue.wanted)
        z = complex(place[0], place[1])
        return there.towards(z) if abs(z - there.place) > _STILL else there.heading

    def _place_of(self, where: object, spot: Spot, t: float) -> Array:
        """(3,) a place of the stage; of a player its head, at a time [s]."""
        if not isinstance(where, str):
            assert isinstance(where, Sequence)
            numbers = [float(x) for x in where]
            return np.array([*numbers, _EYES][:3])
        if where in self.actors:
            other = self.actors[where].stands(max(t, 0.0))
            return np.array([other.x, other.y, _EYES])
        marks = self._cast.file.stage.marks
        if where in marks:
            return np.array([*marks[where].at, 0.0], dtype=float)
        still = self._places.still(where)
        if still is None:
            raise _CannotBe(f"nothing is called {where!r}")
        return still

    # -- lanes -------------------------------------------------------------------------------

    def _lane(self, actor: Actor, gesture: Gesture, begin: float) -> tuple[int, float]:
        """The lane of a gesture, and when it can begin there [s].

        It is the first lane that is free then, or a new one. Where other gestures move the same
        strings then, it begins after them, in the lane of the last.
        """
        busy = [
            (until, lane) for lane, _, until, named in actor.played
            if until > begin + _STILL and np.any(named & gesture.named)
        ]  # fmt: skip
        if busy:
            until, lane = max(busy)
            return lane, max(until, begin)
        for i, line in enumerate(actor.lanes[1:], 1):
            if line.end + line.lead_time(gesture.motion) <= begin + _STILL:
                return i, begin
        if len(actor.lanes) > 1 and all(until <= begin for _, _, until, _ in actor.played):
            return 1, begin
        actor.lanes.append(Line(actor.lanes[0].most))
        return len(actor.lanes) - 1, begin

    def _add(self, line: Line, gesture: Gesture, begin: float) -> float:
        lead = line.lead_time(gesture.motion)
        if begin - lead > line.end:
            if np.any(np.abs(line.rate) > _STILL):
                line.stop()
                lead = line.lead_time(gesture.motion)
            line.hold(begin - lead)
        return line.add(gesture.motion)


class _CannotBe(Exception):
    """A cue cannot be done; the text says why, and what can."""




def _moment(part: Part, moment: str) -> float:
    if moment == START:
        return part.start
    if moment == END:
        return part.end
    return part.marks[moment]


def _most(player: Player, speed: float, acceleration: float) -> Array:
    return limits(player.alone.coordinates, speed, acceleration)
