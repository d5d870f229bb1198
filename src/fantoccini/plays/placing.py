"""Cues placed in time and on the stage, one after the other in the order in which they begin.

A walk is planned past those that are placed before it; they, later, past it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fantoccini.arrays import Array, MaskRows, Times
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.gestures import Gesture
from fantoccini.gestures.joining import Line
from fantoccini.gestures.notes import Notes
from fantoccini.gestures.timing import END, START, Spot
from fantoccini.gestures.transition import limits
from fantoccini.plays.acting import Repertory, Style
from fantoccini.plays.casting import Cast, Places, Player
from fantoccini.plays.cues import ARRIVES, Cue, Part, Timeline
from fantoccini.plays.footing import Footing, Way
from fantoccini.plays.play_file import said
from fantoccini.plays.walks import Walks

_STILL = 1e-9
"""Rate below which a lane is at rest [m/s or rad/s]."""
_SAME_HEADING = 1e-3
"""Change of a heading that a gesture does not notice [rad]."""


@dataclass
class Actor:
    """A player while its cues are placed.

    Attributes:
        player: who.
        lanes: motions that add up: the walks, and gestures beside one another.
        ways: the walks so far, in order.
        played: the gestures so far: lane, end [s] and what they move.
        done: end of the last cue [s].
        hidden: whether it has gone off.
    """

    player: Player
    lanes: list[Line]
    ways: list[Way] = field(default_factory=list)
    played: list[tuple[int, float, MaskRows]] = field(default_factory=list)
    done: float = 0.0
    hidden: bool = False

    def stands(self, t: float) -> Footing:
        """Where it stands at a time [s]."""
        way = next((one for one in reversed(self.ways) if one.begin <= t), None)
        if way is None:
            return self.player.start
        xy, heading = way.footing(np.array([t]))
        return Footing(float(xy[0, 0]), float(xy[0, 1]), float(heading[0]))

    def kept(self) -> Actor:
        """The actor as it is now: what is added to this one does not change it."""
        lanes = [line.kept() for line in self.lanes]
        return replace(self, lanes=lanes, ways=list(self.ways), played=list(self.played))

    @property
    def last(self) -> Footing:
        """Where it stands after all walks."""
        return self.stands(np.inf)

    def track(self) -> tuple[Times, Array]:
        """(T,) times and (T, 2) places, straight between them."""
        t, xy = [0.0], [[self.player.start.x, self.player.start.y]]
        for way in self.ways:
            if not way.steps:
                continue
            own = np.append(np.arange(way.begin, way.end, _TRACK), way.end)
            own = own[own > t[-1]]
            t += own.tolist()
            xy += way.footing(own)[0].tolist()
        return np.array(t), np.array(xy)


_TRACK = 0.05
"""Between samples of a walk, which is straight between them [s]."""


@dataclass
class Wishes:
    """What rounds of compiling have found out about cues.

    Attributes:
        earlier: (cue, player) -> by how much its hands begin earlier, as limbs lag [s].
        pauses: cue -> by how much later it begins, for swing [s].
        refused: cue -> why it cannot be done.
        smaller: cue -> factor of its size.
    """

    earlier: dict[tuple[Spot, str], float] = field(default_factory=dict)
    pauses: dict[Spot, float] = field(default_factory=dict)
    refused: dict[Spot, str] = field(default_factory=dict)
    smaller: dict[Spot, float] = field(default_factory=dict)


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
            label = name if i == 0 else f"{name} {i + 1}"
            lanes[label] = Gesture(actor.player.alone.coordinates, *line.motion, label)
        whole, *others = lanes.values()
        for other in others:
            whole += other
        return whole, lanes

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
        """When a cue is to begin, before what its gesture needs [s]."""
        spots = self.timeline.times_of(cue)
        beat = self._notes.beat
        if cue.given.go:
            earlier = [
                one.moments[END] for one in self.timeline.of_act(cue.act)
                if one.moments and one.index < cue.index
            ]  # fmt: skip
            floor = max([act_start, *earlier])
        else:
            floor = -np.inf
        if spots:
            t = max(self.timeline.time(spot, act_start) for spot, _ in spots)
        else:
            t = max(
                act_start if one is None or one.act != cue.act else one.moments[END]
                for one in cue.before.values()
            )
        return max(t + cue.given.after * beat, floor)

    # -- one cue -----------------------------------------------------------------------------

    def _place(self, cue: Cue, t: float) -> None:
        """Places a cue that begins, or whose mark of `on` is, at a time [s]."""
        cue.wanted = t
        why = self._wishes.refused.get(cue.spot, "")
        if not why:
            before = {name: self.actors[name].kept() for name in cue.who}
            try:
                for name in cue.who:
                    self._place_one(cue, self.actors[name], t)
            except _CannotBe as error:
                why = str(error)
                self.actors.update(before)
        if why:
            cue.refused = why
            cue.parts = []
            cue.moments = dict.fromkeys(cue.known, max(t, 0.0))
            return
        cue.moments = {
            moment: max(_moment(part, moment) for part in cue.parts) for moment in cue.known
        }

    def _place_one(self, cue: Cue, actor: Actor, t: float) -> None:
        given, name = cue.given, actor.player.name
        if actor.hidden and given.verb != "enters_to":
            raise _CannotBe(f"{name} is off the stage")
        early = self._wishes.earlier.get((cue.spot, name), 0.0)
        pause = self._wishes.pauses.get(cue.spot, 0.0)
        ahead = 0.0
        if given.on is not None and not cue.walks:
            (mark,) = given.on
            # The heading does not matter for times.
            ahead = self._gesture(cue, actor, actor.last).marks[mark]
        begin = t - ahead - early + pause
        if cue.walks:
            self._walk(cue, actor, begin)
            return
        self._act(cue, actor, max(begin, 0.0))

    def _act(self, cue: Cue, actor: Actor, begin: float) -> None:
        """Places a gesture, in the first lane that is free then."""
        stands = actor.stands(begin)
        gesture = self._gesture(cue, actor, stands)
        turned = abs(actor.stands(begin + gesture.duration).heading - stands.heading)
        if turned > _SAME_HEADING:
            raise _CannotBe(
                f"{actor.player.name} turns by {np.degrees(turned):.0f} deg meanwhile; it can "
                f"begin {self._notes.said(max(way.end for way in actor.ways))}"
            )
        lane = self._lane(actor, gesture, begin)
        start = self._add(actor.lanes[lane], gesture, begin)
        self._check_time(cue, actor, start - begin, start)
        actor.played.append((lane, start + gesture.duration, gesture.named))
        self._note(cue, actor, lane, gesture, start)

    def _walk(self, cue: Cue, actor: Actor, begin: float) -> None:
        given, player = cue.given, actor.player
        line = actor.lanes[0]
        if np.any(np.abs(line.rate) > _STILL):
            line.stop()
        asked, begin = begin, begin if given.on is not None else max(begin, line.end)
        others = [one for one in self.actors.values() if one is not actor and not one.hidden]
        goals = self._goals(cue, actor)
        wait = (given.may_wait or 0.0) * self._notes.beat
        way, why = self._walks.way(
            player, actor.last, goals, begin, wait, [(o.player, o.track()) for o in others],
            near=given.near, arrives=begin if given.on is not None else None, free_from=line.end,
        )  # fmt: skip
        if way is None:
            raise _CannotBe(why)
        if way.steps:
            try:
                made = self._repertory.walk(player, way.steps, way.step_time)
            except UnknownNameError as error:
                raise _CannotBe(f"{player.name} cannot walk: {error}") from None
            gesture = made.turned(way.start.heading)
            start = self._add(line, gesture, way.begin)
        else:
            gesture = Gesture.rest(player.alone, 1e-3, everything=False)
            start = way.begin
        if given.on is not None:
            self._check_time(cue, actor, way.end - cue.wanted, way.end)
        else:
            self._check_time(cue, actor, way.begin - asked, way.begin)
        actor.ways.append(way)
        actor.hidden = given.verb == "exits_to"
        marks = {**gesture.marks, ARRIVES: way.end - way.begin}
        self._note(cue, actor, 0, gesture, start, marks, way.end)

    def _check_time(self, cue: Cue, actor: Actor, late: float, then: float) -> None:
        """Refuses what cannot be in time."""
        if late <= cue.give(self._notes.beat) + IN_TIME:
            return
        what = "arrive" if cue.walks and cue.given.on is not None else "begin"
        beats = np.ceil(10.0 * late / self._notes.beat) / 10.0
        raise _CannotBe(
            f"{actor.player.name} cannot {what} before {self._notes.said(then)[3:]}; later by up "
            f"to {beats:g} beats it can (`may wait: {beats:g}`)"
        )

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

    def _gesture(self, cue: Cue, actor: Actor, stands: Footing) -> Gesture:
        given, player = cue.given, actor.player
        try:
            if given.does is not None:
                style = Style.of(given)
                smaller = self._wishes.smaller.get(cue.spot, 1.0)
                style = replace(style, larger=style.larger * smaller)
                return self._repertory.gesture(player, given, style, stands.heading)
            where = given.looks_at if given.looks_at is not None else given.points_at
            place = self._place_of(where, (*cue.spot, said(given.verb)), cue, actor)
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
            self._place_of(where, spot, cue, actor)
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
        place = self._place_of(direction, (*cue.spot, key), cue, actor)
        z = complex(place[0], place[1])
        return there.towards(z) if abs(z - there.place) > _STILL else there.heading

    def _place_of(self, where: object, spot: Spot, cue: Cue, actor: Actor) -> Array:
        """(3,) a place of the stage; of a player its head, at the time of the cue."""
        if not isinstance(where, str):
            assert isinstance(where, Sequence)
            numbers = [float(x) for x in where]
            return np.array([*numbers, _EYES][:3])
        if where in self.actors:
            other = self.actors[where].stands(max(cue.wanted, 0.0))
            return np.array([other.x, other.y, _EYES])
        marks = self._cast.file.stage.marks
        if where in marks:
            return np.array([*marks[where].at, 0.0], dtype=float)
        still = self._places.still(where)
        if still is None:
            raise _CannotBe(f"nothing is called {where!r}")
        return still

    # -- lanes -------------------------------------------------------------------------------

    def _lane(self, actor: Actor, gesture: Gesture, begin: float) -> int:
        """The lane of a gesture: the first that is free then, or a new one.

        Where another gesture moves the same then, it is that one's, and begins after it.
        """
        for lane, until, named in actor.played:
            if until > begin + _STILL and np.any(named & gesture.named):
                return lane
        for i, line in enumerate(actor.lanes[1:], 1):
            if line.end + line.lead_time(gesture.motion) <= begin + _STILL:
                return i
        if all(until <= begin for _, until, _ in actor.played) and len(actor.lanes) > 1:
            return 1
        actor.lanes.append(Line(actor.lanes[0].most))
        return len(actor.lanes) - 1

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


IN_TIME = 1.0 / 60.0
"""So near to its time a cue is in time [s]."""
_EYES = 0.42
"""Height of a player's face [m]."""


def _moment(part: Part, moment: str) -> float:
    if moment == START:
        return part.start
    if moment == END:
        return part.end
    return part.marks[moment]


def _most(player: Player, speed: float, acceleration: float) -> Array:
    return limits(player.alone.coordinates, speed, acceleration)
