"""Placing of cues in time and on the stage, in the order in which they begin.

A walk is planned around all walks placed before it, and later walks are planned around it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.theatre.cast import (
    ERRORS,
    Actor,
    Cast,
    Corrections,
    Meeting,
    Places,
    Player,
    Way,
    act_time_in_words,
)
from fantoccini.theatre.gestures import (
    CueError,
    CuePart,
    Gesture,
    Hands,
    LatenessPolicy,
    MotionSequence,
    PendingCue,
    PerformedScript,
    Performer,
    PlacedCue,
    motion_bounds,
)
from fantoccini.theatre.plays.aims import Aims
from fantoccini.theatre.plays.handling import Handling
from fantoccini.theatre.plays.on_stage import OnStage, carry_pose, walked
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import (
    ARRIVAL_MARK,
    END,
    LATENESS_TOLERANCE,
    START,
    VERBS,
    DoesCue,
    EntersToCue,
    ExitsToCue,
    Moments,
    PlayCue,
    PropCue,
    ScriptLog,
    Spot,
    Timeline,
    WalkCue,
    file_key,
    is_walk,
)

IN_TIME = 1.0 / 60.0
"""Lateness up to which a cue counts as on time [s]."""
_POLICY = LatenessPolicy(IN_TIME, (CueError, UnknownNameError, *ERRORS))
"""Policy of plays: cues that are late or cannot be done are refused."""
_MAX_TURN = 1e-3
"""Largest turn of a player during a gesture [rad]."""
_SETTLING_TIME = 1.0
"""Time simulated after the last cue, in which the puppets stop swinging [s]."""


@dataclass(frozen=True, eq=False)
class Placement:
    """All cues of a play, placed once.

    Attributes:
        cues: cues in the file's order.
        act_starts: start of every act [s].
        motions: player -> motion of its hands.
        lanes: player -> lane -> motion of the lane.
        starts: player -> times at which its cues begin [s].
        ways: player -> its walks.
        meetings: players and props that may touch, with times.
        passes: cue -> cues of players that it passes, each with a note for the report.
        calmed: (cue, player) -> time at which the hands begin to damp the player's swing [s].
        moments: keys of a cue or a time of the file -> its moments [s].
    """

    cues: tuple[PlacedCue[PlayCue], ...]
    act_starts: tuple[float, ...]
    motions: Mapping[str, Gesture]
    lanes: Mapping[str, Mapping[str, Gesture]]
    starts: Mapping[str, tuple[float, ...]]
    ways: Mapping[str, tuple[Way, ...]]
    meetings: tuple[Meeting, ...]
    passes: Mapping[Spot, tuple[tuple[Spot, str], ...]]
    calmed: Mapping[tuple[Spot, str], float]
    moments: Mapping[Spot, Moments]


def place_cues(
    cast: Cast,
    timeline: Timeline[PlayCue],
    gestures: PlayerGestures,
    places: Places,
    walks: Walks,
    corrections: Corrections,
    log: ScriptLog,
) -> Placement:
    """Placement of all cues of a play.

    Args:
        cast, timeline, gestures, places, walks: parts of the play.
        corrections: corrections from earlier rounds.
        log: collects mistakes; has the file and the length of a beat.
    """
    bounds = cast.file.stage
    actors = {
        name: Actor(
            player,
            Hands((MotionSequence.empty(_bounds_of(player, bounds.speed, bounds.acceleration)),)),
        )
        for name, player in cast.players.items()
    }
    verbs = _Verbs(cast, timeline, gestures, places, walks, corrections, log)
    performer = Performer(timeline, _POLICY, verbs.do, refused=corrections.refused)
    play: PerformedScript[PlayCue, OnStage] = PerformedScript(OnStage.at_start(cast, actors))
    starts, start = list[float](), 0.0
    for act, act_file in enumerate(cast.file.acts):
        start += act_file.after * log.beat
        starts.append(start)
        play = performer.perform_act(play, act, start)
        start = max([start, *(play.moments[cue.spot][END] for cue in timeline.cues_of_act(act))])
    stage = play.state
    actors = {name: actor.rested() for name, actor in stage.actors.items()}
    end = max(start, *(actor.done for actor in actors.values())) + _SETTLING_TIME
    cues = tuple(play.placed[cue.spot] for cue in timeline.cues)
    motions_and_lanes = {name: actor.motion(end) for name, actor in actors.items()}
    return Placement(
        cues,
        tuple(starts),
        {name: whole for name, (whole, _) in motions_and_lanes.items()},
        {name: lanes for name, (_, lanes) in motions_and_lanes.items()},
        {
            name: tuple(part.start for cue in cues for part in cue.parts if part.who == name)
            for name in actors
        },
        {name: actor.ways for name, actor in actors.items()},
        stage.meetings(end),
        stage.passes,
        stage.calmed,
        play.moments,
    )


class _Verbs:
    """Carries out the verbs of cues: each method maps a state of the stage to the next."""

    def __init__(
        self,
        cast: Cast,
        timeline: Timeline[PlayCue],
        gestures: PlayerGestures,
        places: Places,
        walks: Walks,
        corrections: Corrections,
        log: ScriptLog,
    ):
        self._timeline, self._gestures, self._walks = timeline, gestures, walks
        self._corrections, self._log = corrections, log
        self._aims = Aims(cast, places)
        self._handling = Handling(cast, walks, gestures, corrections)

    def do(
        self, stage: OnStage, turn: PendingCue[PlayCue]
    ) -> tuple[OnStage, tuple[CuePart, ...], Moments]:
        """Stage after a cue, the parts of its players, and its moments.

        Raises:
            CueError: the cue cannot be done.
        """
        self._check_begin(turn)
        after, moments = self._after(replace(stage, parts=()), turn)
        for name, actor in after.actors.items():
            table = actor.player.marionette.coordinates
            try:
                actor.hands.check_turns(table, stage.actors[name].hands)
            except StateError as error:
                raise CueError(str(error)) from None
        return after, after.parts, moments

    def _after(self, stage: OnStage, turn: PendingCue[PlayCue]) -> tuple[OnStage, Moments]:
        """Stage after a cue, and the cue's moments."""
        if isinstance(turn.entry, PropCue):
            return self._do_with_prop(stage, turn)
        for name in turn.who:
            stage = self._do_alone(stage, turn, name)
        moments = {
            moment: max(_moment(part, moment) for part in stage.parts)
            for moment in turn.cue.moment_names
        }
        return stage, moments

    def _do_alone(self, stage: OnStage, turn: PendingCue[PlayCue], name: str) -> OnStage:
        """Stage after the part of one player in a cue without a prop."""
        entry, t = turn.entry, turn.wanted_time
        if stage.actors[name].away and not isinstance(entry, EntersToCue):
            raise CueError(f"{name} is off the stage")
        if is_walk(entry):
            return self._walk_or_pass(stage, turn, name)
        mark_time = self._gesture(stage, turn, name, t).marks[entry.mark] if entry.mark else 0.0
        wanted, earliest = self._beginning(turn, name)
        return self._act(stage, turn, name, wanted - mark_time, earliest - mark_time)

    def _beginning(self, turn: PendingCue[PlayCue], name: str) -> tuple[float, float]:
        """Wanted beginning of a player's part, and the earliest one after its pause [s]."""
        wanted = turn.wanted_time - self._corrections.earlier.get((turn.spot, name), 0.0)
        return wanted, wanted + self._corrections.pauses.get(turn.spot, 0.0)

    def _walk_or_pass(self, stage: OnStage, turn: PendingCue[PlayCue], name: str) -> OnStage:
        """Stage after a walk.

        If a player blocks it whose own next walk begins before this one ends, that player gives
        way: this walk is planned without it, and the other's walk, placed next, goes around. Until
        then the other stands, and must not be in the way.
        """
        try:
            return self._walk(stage, turn, name)
        except CueError as error:
            reason = error
        for later in self._next_walks(turn):
            (other,) = later.who
            try:
                after = self._walk(stage, turn, name, absent=other)
                if later.wanted_time > after.actors[name].done:
                    continue
                way = self._walk(after, later, other).actors[other].ways[-1]
                leaves = way.begin if way.steps else np.inf
            except CueError:
                continue
            actor, stands = after.actors[name], after.actors[other]
            track = stands.player, stands.track()
            if not self._walks.in_the_way(actor.player, actor.ways[-1], [track], leaves):
                return after.with_pass(turn.spot, name, later.spot, other)
        raise reason

    def _next_walks(self, turn: PendingCue[PlayCue]) -> Iterator[PendingCue[PlayCue]]:
        """Turns of the other players whose next cue in the act is a walk at a known time."""
        seen = {*turn.who}
        for cue in self._timeline.cues_of_act(turn.cue.act):
            if cue.spot in turn.moments or seen & {*cue.who}:
                continue
            seen |= {*cue.who}
            is_known = all(need in turn.moments for need in self._timeline.needs(cue))
            if is_known and len(cue.who) == 1 and is_walk(cue.entry):
                t = self._timeline.wanted_time(cue, turn.start, turn.moments)
                if cue.spot not in self._corrections.refused:
                    yield replace(turn, cue=cue, wanted_time=t)

    def _do_with_prop(self, stage: OnStage, turn: PendingCue[PlayCue]) -> tuple[OnStage, Moments]:
        """Stage after a cue with a prop, and its moments."""
        t = turn.wanted_time
        for name in turn.who:
            if stage.actors[name].away:
                raise CueError(f"{name} is off the stage")
        begin = max(t + self._corrections.pauses.get(turn.spot, 0.0), turn.start)
        wait = max((turn.entry.may_wait or 0.0) * self._log.beat - (begin - t), 0.0)
        stage, moments = self._handling.do(stage, turn, begin, wait)
        start = moments[START]
        self._check_time(turn, turn.who[-1], start - t, start)
        return stage, moments

    def _check_begin(self, turn: PendingCue[PlayCue]) -> None:
        """Refuses a cue whose time is before its act, or before a GO that its act waits for."""
        t, start, go = turn.wanted_time, turn.start, self._timeline.go_cues.get(turn.spot)
        if t < start - LATENESS_TOLERANCE:
            begins = self._in_words(turn, start)
            early = self._log.duration_in_words(start - t)
            raise CueError(f"its time is {early} before its act, which begins {begins}")
        if go is not None and t < turn.moments[go.spot][START] - LATENESS_TOLERANCE:
            line, go_time = self._log.located.line(go.spot), turn.moments[go.spot][START]
            raise CueError(
                f"its time is before the GO of line {line}, {self._in_words(turn, go_time)}"
            )

    def _act(
        self, stage: OnStage, turn: PendingCue[PlayCue], name: str, wanted: float, earliest: float
    ) -> OnStage:
        """Stage after a gesture in a free lane, turned to the player's heading at that time.

        Args:
            stage, turn, name: stage before it, its cue and its player.
            wanted: wanted beginning [s].
            earliest: earliest beginning [s].

        Raises:
            CueError: the player turns during the gesture, or it would be late.
        """
        actor, earliest = stage.actors[name], max(earliest, turn.start)
        gesture = self._gesture(stage, turn, name, earliest)
        lane, start = actor.hands.free_lane(gesture, earliest)
        if start > earliest + LATENESS_TOLERANCE:
            gesture = self._gesture(stage, turn, name, start)
        heading = actor.footing_at(start).heading
        turned = abs(actor.footing_at(start + gesture.duration).heading - heading)
        if turned > _MAX_TURN:
            until = max(way.end for way in actor.ways)
            raise CueError(
                f"{name} turns by {np.degrees(turned):.0f} deg meanwhile; the gesture "
                f"can begin {self._in_words(turn, until)}"
            )
        hands, start = actor.hands.add_busy(lane, gesture, start)
        self._check_time(turn, name, start - wanted, start)
        return stage.with_part(replace(actor, hands=hands), lane, gesture, start)

    def _walk(
        self,
        stage: OnStage,
        turn: PendingCue[PlayCue],
        name: str,
        *,
        absent: str = "",
        not_before: float = -np.inf,
    ) -> OnStage:
        """Stage after a walk.

        Args:
            stage, turn, name: stage before it, its cue and its player.
            absent: another player, which the walk does not consider.
            not_before: earliest beginning [s].

        Raises:
            CueError: there is no way in time.
        """
        stage.check_stands(name)
        wanted, begin = self._beginning(turn, name)
        begin = max(begin, not_before)
        entry, actor = turn.entry, stage.actors[name]
        actor = replace(actor, hands=actor.hands.rested(0))
        arrival = begin if entry.mark else None
        carries = stage.carries(name)
        earliest = turn.start if arrival is not None else begin
        actor = carry_pose(actor, carries, earliest, self._gestures)
        stage, free = stage.with_actor(actor), max(actor.hands.lanes[0].end, turn.start)
        begin = max(begin, free)
        wait = max((entry.may_wait or 0.0) * self._log.beat - (begin - wanted), 0.0)
        way, reason = self._walks.way(
            actor.player,
            actor.last,
            self._aims.goals(stage, turn, name),
            begin,
            wait,
            [(other.player, other.track()) for other in stage.others(name, absent)],
            near=entry.near if isinstance(entry, WalkCue) else 0.0,
            arrives=arrival,
            free_from=free,
            carries=bool(carries),
            act_start=turn.start,
        )
        if way is None:
            raise CueError(reason)
        n_standing = len(list(takewhile(lambda step: step.stands, way.steps)))
        moves_off = way.begin + n_standing * way.step_time
        if arrival is not None:
            self._check_time(turn, name, abs(way.end - turn.wanted_time), way.end)
        else:
            self._check_time(turn, name, moves_off - wanted, moves_off)
        until = self._end_of_gestures_in_turn(actor, way)
        if until is not None:
            self._check_time(turn, name, until - wanted, until)
            if arrival is not None:
                raise CueError(f"{name} is busy until {self._in_words(turn, until)[3:]}")
            return self._walk(stage, turn, name, absent=absent, not_before=until)
        actor, gesture = walked(actor, way, self._gestures, carries)
        actor = replace(actor, away=isinstance(entry, ExitsToCue))
        marks = {mark: t - (moves_off - way.begin) for mark, t in gesture.marks.items()}
        marks[ARRIVAL_MARK] = way.end - moves_off
        return stage.with_part(actor, 0, gesture, moves_off, marks, way.end)

    def _end_of_gestures_in_turn(self, actor: Actor, way: Way) -> float | None:
        """Latest end of the gestures during which the walk would turn the player [s], or None."""
        ends = []
        for gesture in actor.hands.busy:
            since, until = max(gesture.start, way.begin), min(gesture.end, way.end)
            if since < until - LATENESS_TOLERANCE:
                _, heading = way.footing(np.linspace(since, until, 9))
                turned = np.abs(heading - actor.footing_at(gesture.start).heading)
                if np.max(turned) > _MAX_TURN:
                    ends.append(gesture.end)
        return max(ends, default=None)

    def _check_time(self, turn: PendingCue[PlayCue], name: str, delay: float, t: float) -> None:
        """Refuses a cue that would be late.

        Args:
            turn, name: its cue and its player.
            delay: its delay after the wanted time [s].
            t: time at which it would begin or arrive [s].
        """
        beat = self._log.beat

        def reason() -> str:
            verb = "arrive" if is_walk(turn.entry) and turn.entry.mark else "begin"
            beats = np.ceil(10.0 * delay / beat) / 10.0
            return (
                f"{name} cannot {verb} before {self._in_words(turn, t)[3:]}; `may wait: "
                f"{beats:g}` allows it to be {beats:g} beats late"
            )

        _POLICY.check(delay, turn.entry.patience * beat, reason)

    def _in_words(self, turn: PendingCue[PlayCue], t: float) -> str:
        """Time in words, in beats of the cue's act."""
        return act_time_in_words(t, turn.start, self._log.beat)

    # -- gestures ----------------------------------------------------------------------------

    def _gesture(self, stage: OnStage, turn: PendingCue[PlayCue], name: str, t: float) -> Gesture:
        """Gesture of a player that begins at a time [s]."""
        entry, actor = turn.entry, stage.actors[name]
        player, stands = actor.player, actor.footing_at(t)
        try:
            if isinstance(entry, DoesCue):
                style = self._gestures.style(entry)
                smaller = self._corrections.smaller.get(turn.spot, 1.0)
                style = replace(style, larger=style.larger * smaller)
                return self._gestures.gesture(player, entry, style, stands.heading)
            cue_path, called = (*turn.spot, file_key(entry.verb)), VERBS[entry.verb].default_name
            place = self._aims.place_of(stage, entry.verb_value, cue_path, t)
            gesture = self._gestures.aimed(player, called, place, stands)
            # Aim again from where player and target are when the gesture points.
            t_pointing = t + min(gesture.marks.values())
            place = self._aims.place_of(stage, entry.verb_value, cue_path, t_pointing)
            return self._gestures.aimed(player, called, place, actor.footing_at(t_pointing))
        except StateError as error:
            raise CueError(str(error)) from None


def _moment(part: CuePart, moment: str) -> float:
    """Time of a moment of a player's part [s]."""
    if moment == START:
        return part.start
    if moment == END:
        return part.end
    return part.marks[moment]


def _bounds_of(player: Player, speed: float, acceleration: float) -> Array:
    """(2, n_vK) bounds of speeds and accelerations of a player's hands."""
    return motion_bounds(player.marionette.coordinates, speed, acceleration)
