"""Placing of cues in time and on the stage, in the order in which they begin.

A walk is planned around all walks placed before it, and later walks are planned around it.

A cue is a line of the play: a verb with its player and time. A lane is a list of gestures in order,
and a footing a place with a heading. In names, K stands for driven coordinates: ends and lengths of
strings, driven joints. A spot is the list of keys that leads to an entry of the file. Mistakes of
the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.theatre.cast import (
    SIMULATION_ERRORS,
    Actor,
    Cast,
    Corrections,
    Meeting,
    Places,
    Player,
    Walk,
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
from fantoccini.theatre.plays.player_gestures import PlayerGestures
from fantoccini.theatre.plays.stage_state import StageState, after_walk, carry_pose
from fantoccini.theatre.plays.walk_planner import WalkPlanner
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
_LATENESS_POLICY = LatenessPolicy(IN_TIME, (CueError, UnknownNameError, *SIMULATION_ERRORS))
"""Policy of plays: cues that are late or cannot be done are refused."""
_MAX_TURN = 1e-3
"""Largest turn of a player during a gesture [rad]."""
_FINAL_SETTLING_TIME = 1.0
"""Time simulated after the last cue, in which the puppets stop swinging [s]."""


@dataclass(frozen=True, eq=False)
class Placement:
    """All cues of a play, placed once.

    Attributes:
        cues: cues in the file's order.
        act_starts: start of every act [s].
        motions: player -> motion of its hands.
        lane_motions: player -> lane -> motion of the lane.
        cue_starts: player -> times at which its cues begin [s].
        walks: player -> its walks.
        meetings: players and props that may touch, with times.
        pass_notes: cue -> cues of players that it passes, each with a note for the report.
        damping_times: (cue, player) -> time at which the hands begin to damp its swing [s].
        moments: keys of a cue or a time of the file -> its moments [s].
    """

    cues: tuple[PlacedCue[PlayCue], ...]
    act_starts: tuple[float, ...]
    motions: Mapping[str, Gesture]
    lane_motions: Mapping[str, Mapping[str, Gesture]]
    cue_starts: Mapping[str, tuple[float, ...]]
    walks: Mapping[str, tuple[Walk, ...]]
    meetings: tuple[Meeting, ...]
    pass_notes: Mapping[Spot, tuple[tuple[Spot, str], ...]]
    damping_times: Mapping[tuple[Spot, str], float]
    moments: Mapping[Spot, Moments]


def place_cues(
    cast: Cast,
    timeline: Timeline[PlayCue],
    gestures: PlayerGestures,
    places: Places,
    planner: WalkPlanner,
    corrections: Corrections,
    log: ScriptLog,
) -> Placement:
    """Placement of all cues of a play.

    Args:
        cast, timeline, gestures, places, planner: parts of the play.
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
    placer = _CuePlacer(cast, timeline, gestures, places, planner, corrections, log)
    performer = Performer(timeline, _LATENESS_POLICY, placer.do, refused=corrections.refusals)
    performed: PerformedScript[PlayCue, StageState] = PerformedScript(
        StageState.at_start(cast, actors)
    )
    act_starts, act_start = list[float](), 0.0
    for act_index, act_file in enumerate(cast.file.acts):
        act_start += act_file.after * log.beat
        act_starts.append(act_start)
        performed = performer.perform_act(performed, act_index, act_start)
        act_start = max(
            [
                act_start,
                *(performed.moments[cue.spot][END] for cue in timeline.cues_of_act(act_index)),
            ]
        )
    stage = performed.state
    actors = {name: actor.rested() for name, actor in stage.actors.items()}
    end = max(act_start, *(actor.busy_until for actor in actors.values())) + _FINAL_SETTLING_TIME
    cues = tuple(performed.placed[cue.spot] for cue in timeline.cues)
    motions_and_lanes = {name: actor.motion(end) for name, actor in actors.items()}
    return Placement(
        cues,
        tuple(act_starts),
        {name: motion for name, (motion, _) in motions_and_lanes.items()},
        {name: lane_motions for name, (_, lane_motions) in motions_and_lanes.items()},
        {
            name: tuple(part.start for cue in cues for part in cue.parts if part.who == name)
            for name in actors
        },
        {name: actor.walks for name, actor in actors.items()},
        stage.meetings(end),
        stage.pass_notes,
        stage.damping_times,
        performed.moments,
    )


class _CuePlacer:
    """Carries out the verbs of cues: each method maps a state of the stage to the next."""

    def __init__(
        self,
        cast: Cast,
        timeline: Timeline[PlayCue],
        gestures: PlayerGestures,
        places: Places,
        planner: WalkPlanner,
        corrections: Corrections,
        log: ScriptLog,
    ):
        self._timeline, self._gestures, self._planner = timeline, gestures, planner
        self._corrections, self._log = corrections, log
        self._aims = Aims(cast, places)
        self._handling = Handling(cast, planner, gestures, corrections)

    def do(
        self, stage: StageState, turn: PendingCue[PlayCue]
    ) -> tuple[StageState, tuple[CuePart, ...], Moments]:
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

    def _after(self, stage: StageState, turn: PendingCue[PlayCue]) -> tuple[StageState, Moments]:
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

    def _do_alone(self, stage: StageState, turn: PendingCue[PlayCue], name: str) -> StageState:
        """Stage after the part of one player in a cue without a prop."""
        entry, t = turn.entry, turn.wanted_time
        if stage.actors[name].is_off_stage and not isinstance(entry, EntersToCue):
            raise CueError(f"{name} is off the stage")
        if is_walk(entry):
            return self._walk_or_pass(stage, turn, name)
        mark_time = self._gesture(stage, turn, name, t).marks[entry.mark] if entry.mark else 0.0
        wanted, earliest = self._beginning(turn, name)
        return self._act(stage, turn, name, wanted - mark_time, earliest - mark_time)

    def _beginning(self, turn: PendingCue[PlayCue], name: str) -> tuple[float, float]:
        """Wanted beginning of a player's part, and the earliest one after its pause [s]."""
        wanted = turn.wanted_time - self._corrections.leads.get((turn.spot, name), 0.0)
        return wanted, wanted + self._corrections.pauses.get(turn.spot, 0.0)

    def _walk_or_pass(self, stage: StageState, turn: PendingCue[PlayCue], name: str) -> StageState:
        """Stage after a walk.

        If a player blocks it whose own next walk begins before this one ends, that player gives
        way: this walk is planned without it, and the other's walk, placed next, goes around. Until
        then the other stands, and must not be in the way.
        """
        try:
            return self._walk(stage, turn, name)
        except CueError as error:
            first_error = error
        for later in self._next_walks(turn):
            (other,) = later.who
            try:
                after = self._walk(stage, turn, name, absent=other)
                if later.wanted_time > after.actors[name].busy_until:
                    continue
                next_walk = self._walk(after, later, other).actors[other].walks[-1]
                leave_time = next_walk.begin if next_walk.steps else np.inf
            except CueError:
                continue
            actor, other_actor = after.actors[name], after.actors[other]
            track = other_actor.player, other_actor.track()
            if not self._planner.in_the_way(actor.player, actor.walks[-1], [track], leave_time):
                return after.with_pass(turn.spot, name, later.spot, other)
        raise first_error

    def _next_walks(self, turn: PendingCue[PlayCue]) -> Iterator[PendingCue[PlayCue]]:
        """Turns of the other players whose next cue in the act is a walk at a known time."""
        seen_players = {*turn.who}
        for cue in self._timeline.cues_of_act(turn.cue.act):
            if cue.spot in turn.moments or seen_players & {*cue.who}:
                continue
            seen_players |= {*cue.who}
            is_known = all(reference in turn.moments for reference in self._timeline.needs(cue))
            if is_known and len(cue.who) == 1 and is_walk(cue.entry):
                t = self._timeline.wanted_time(cue, turn.start, turn.moments)
                if cue.spot not in self._corrections.refusals:
                    yield replace(turn, cue=cue, wanted_time=t)

    def _do_with_prop(
        self, stage: StageState, turn: PendingCue[PlayCue]
    ) -> tuple[StageState, Moments]:
        """Stage after a cue with a prop, and its moments."""
        t = turn.wanted_time
        for name in turn.who:
            if stage.actors[name].is_off_stage:
                raise CueError(f"{name} is off the stage")
        begin = max(t + self._corrections.pauses.get(turn.spot, 0.0), turn.start)
        max_wait = max((turn.entry.may_wait or 0.0) * self._log.beat - (begin - t), 0.0)
        stage, moments = self._handling.do(stage, turn, begin, max_wait)
        start = moments[START]
        self._check_time(turn, turn.who[-1], start - t, start)
        return stage, moments

    def _check_begin(self, turn: PendingCue[PlayCue]) -> None:
        """Refuses a cue whose time is before its act, or before a GO that its act waits for."""
        t, start, go_cue = turn.wanted_time, turn.start, self._timeline.go_cues.get(turn.spot)
        if t < start - LATENESS_TOLERANCE:
            begins = self._in_words(turn, start)
            lead = self._log.duration_in_words(start - t)
            raise CueError(f"its time is {lead} before its act, which begins {begins}")
        if go_cue is not None and t < turn.moments[go_cue.spot][START] - LATENESS_TOLERANCE:
            line, go_time = self._log.located.line(go_cue.spot), turn.moments[go_cue.spot][START]
            raise CueError(
                f"its time is before the GO of line {line}, {self._in_words(turn, go_time)}"
            )

    def _act(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        name: str,
        wanted: float,
        earliest: float,
    ) -> StageState:
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
        turn_angle = abs(actor.footing_at(start + gesture.duration).heading - heading)
        if turn_angle > _MAX_TURN:
            last_walk_end = max(walk.end for walk in actor.walks)
            raise CueError(
                f"{name} turns by {np.degrees(turn_angle):.0f} deg meanwhile; the gesture "
                f"can begin {self._in_words(turn, last_walk_end)}"
            )
        hands, start = actor.hands.add_busy(lane, gesture, start)
        self._check_time(turn, name, start - wanted, start)
        return stage.with_part(replace(actor, hands=hands), lane, gesture, start)

    def _walk(
        self,
        stage: StageState,
        turn: PendingCue[PlayCue],
        name: str,
        *,
        absent: str = "",
        not_before: float = -np.inf,
    ) -> StageState:
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
        carrying_side = stage.carries(name)
        earliest = turn.start if arrival is not None else begin
        actor = carry_pose(actor, carrying_side, earliest, self._gestures)
        stage, free_time = stage.with_actor(actor), max(actor.hands.lanes[0].end, turn.start)
        begin = max(begin, free_time)
        max_wait = max((entry.may_wait or 0.0) * self._log.beat - (begin - wanted), 0.0)
        walk, reason = self._planner.plan(
            actor.player,
            actor.last_footing,
            self._aims.goals(stage, turn, name),
            begin,
            max_wait,
            [(other.player, other.track()) for other in stage.others(name, absent)],
            max_goal_distance=entry.near if isinstance(entry, WalkCue) else 0.0,
            arrival_time=arrival,
            free_time=free_time,
            is_carrying=bool(carrying_side),
            act_start=turn.start,
        )
        if walk is None:
            raise CueError(reason)
        move_time = walk.move_time
        if arrival is not None:
            self._check_time(turn, name, abs(walk.end - turn.wanted_time), walk.end)
        else:
            self._check_time(turn, name, move_time - wanted, move_time)
        gesture_end = self._end_of_gestures_in_turn(actor, walk)
        if gesture_end is not None:
            self._check_time(turn, name, gesture_end - wanted, gesture_end)
            if arrival is not None:
                raise CueError(f"{name} is busy until {self._in_words(turn, gesture_end)[3:]}")
            return self._walk(stage, turn, name, absent=absent, not_before=gesture_end)
        actor, gesture = after_walk(actor, walk, self._gestures, carrying_side)
        actor = replace(actor, is_off_stage=isinstance(entry, ExitsToCue))
        marks = {mark: t - (move_time - walk.begin) for mark, t in gesture.marks.items()}
        marks[ARRIVAL_MARK] = walk.end - move_time
        return stage.with_part(actor, 0, gesture, move_time, marks, walk.end)

    def _end_of_gestures_in_turn(self, actor: Actor, walk: Walk) -> float | None:
        """Latest end of the gestures during which the walk would turn the player [s], or None."""
        end_times = []
        for gesture in actor.hands.busy:
            begin, end = max(gesture.start, walk.begin), min(gesture.end, walk.end)
            if begin < end - LATENESS_TOLERANCE:
                _, heading = walk.footing(np.linspace(begin, end, 9))
                turn_angles = np.abs(heading - actor.footing_at(gesture.start).heading)
                if np.max(turn_angles) > _MAX_TURN:
                    end_times.append(gesture.end)
        return max(end_times, default=None)

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

        _LATENESS_POLICY.check(delay, turn.entry.patience * beat, reason)

    def _in_words(self, turn: PendingCue[PlayCue], t: float) -> str:
        """Time in words, in beats of the cue's act."""
        return act_time_in_words(t, turn.start, self._log.beat)

    # -- gestures ----------------------------------------------------------------------------

    def _gesture(
        self, stage: StageState, turn: PendingCue[PlayCue], name: str, t: float
    ) -> Gesture:
        """Gesture of a player that begins at a time [s]."""
        entry, actor = turn.entry, stage.actors[name]
        player, footing = actor.player, actor.footing_at(t)
        try:
            if isinstance(entry, DoesCue):
                style = self._gestures.style(entry)
                size_factor = self._corrections.size_factors.get(turn.spot, 1.0)
                style = replace(style, larger=style.larger * size_factor)
                return self._gestures.gesture(player, entry, style, footing.heading)
            cue_path, gesture_name = (
                (*turn.spot, file_key(entry.verb)),
                VERBS[entry.verb].default_name,
            )
            target = self._aims.place_of(stage, entry.verb_value, cue_path, t)
            gesture = self._gestures.aimed(player, gesture_name, target, footing)
            # Aim again from where player and target are when the gesture points.
            t_pointing = t + min(gesture.marks.values())
            target = self._aims.place_of(stage, entry.verb_value, cue_path, t_pointing)
            return self._gestures.aimed(player, gesture_name, target, actor.footing_at(t_pointing))
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
