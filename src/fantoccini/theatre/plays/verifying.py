"""Verification of plays: event-driven simulation, and a check of every requirement.

A cue is a line of the play: a verb with its player and time. q_D are dynamic coordinates, q_K
driven ones (ends and lengths of strings), which the hands move.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import FileError
from fantoccini.dynamics.clearance import StringDistances, Winding
from fantoccini.motion import EventKind, Trajectory
from fantoccini.theatre.cast import CannotBegin, OutOfTime, Stop
from fantoccini.theatre.gestures import measure_lateness, motion_bounds, names_and_units
from fantoccini.theatre.plays.failures import find_failures
from fantoccini.theatre.plays.floor_walks import FloorFeet, feet_on_floor
from fantoccini.theatre.plays.leashes import find_stretches
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.rounds import PEAK_TOLERANCE
from fantoccini.theatre.plays.stage_run import combine_runs
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE, Touch, find_touches
from fantoccini.theatre.script import LATENESS_TOLERANCE, START

_MAX_REST_RATE = 1e-6
"""Rate below which hands count as at rest [m/s or rad/s]."""
_MIN_WINDING = 0.75
"""Change of winding above which two strings count as wound around each other [turns]."""


@dataclass(frozen=True)
class CueTime:
    """Time of a cue in a run.

    Attributes:
        cue: cue of the play.
        who: player of the cue.
        wanted, observed: wanted time, and time in the event-driven run [s].
        is_limb_time: whether it is the time of a limb's turn at the mark; otherwise that of the
            hands.
    """

    cue: CueOfPlay
    who: str
    wanted: float
    observed: float
    is_limb_time: bool

    @property
    def lateness(self) -> float:
        """Lateness [s]."""
        return self.observed - self.wanted


@dataclass(frozen=True, eq=False)
class Verification:
    """Event-driven run of a play, and its measurements; true if there are no faults.

    Attributes:
        play: simulated play.
        run: run of the whole stage.
        faults: violated requirements, in words.
        cues: times of all cues that are done.
        touches: touches and crossings.
        peaks: coordinate -> (largest speed, its bound, largest acceleration, its bound).
        tension: string -> largest tension [N].
        catches: string -> number of its catches.
        space: extent of the hands' motion: ((low, high) of x, (low, high) of y) [m].
        windings: pairs of strings that are wound around each other.
        stepping_reasons: reasons why parts with touches were simulated in time steps: stops of
            their event-driven run.
        feet: feet in the straight parts of walks on the floor.
    """

    play: Play
    run: Trajectory
    faults: tuple[str, ...]
    cues: tuple[CueTime, ...]
    touches: tuple[Touch, ...]
    peaks: Mapping[str, tuple[float, float, float, float]]
    tension: Mapping[str, float]
    catches: Mapping[str, int]
    space: tuple[tuple[float, float], tuple[float, float]]
    windings: tuple[Winding, ...] = field(default=(), repr=False)
    stepping_reasons: tuple[str, ...] = ()
    feet: tuple[FloorFeet, ...] = field(default=(), repr=False)

    def __bool__(self) -> bool:
        return not self.faults

    def __repr__(self) -> str:
        verdict = "holds" if self else f"{len(self.faults)} faults"
        return f"<Verification of {self.play.name!r}: {verdict}>"

    @property
    def max_lateness(self) -> float:
        """Largest lateness of a cue, late or early [s]."""
        return max((abs(cue.lateness) for cue in self.cues), default=0.0)


def verify_play(play: Play, *, within: float | None = None) -> Verification:
    """Verification of a play by an event-driven simulation.

    The requirements are: the run reaches its end; every cue that is done is observed within 1/60 s
    of its time; players, obstacles and strings keep the stage's distance; strings never cross;
    leashes stay slack; only sitters and walkers touch the floor; feet stand on it and hardly slide
    in walks on the floor; props are held, put down and sat on as in the cues; the hands keep their
    bounds and their space, and rest while a show waits. The bodies of one player are not checked
    against each other, nor against its own strings.

    Args:
        play: compiled play.
        within: time limit of the simulation [s]. If it passes, the run from compiling is measured,
            with time steps where something touches, and this counts as a fault. No limit by
            default.

    Raises:
        FileError: a player's run cannot begin.
    """
    faults = []
    try:
        with play.cache.time_limit(math.inf if within is None else time.monotonic() + within):
            runs = play.runs(exact=True)
    except OutOfTime:
        faults.append(
            "not simulated event-driven: the time limit passed "
            + (f"after {within:.3g} s" if within else "at once")
            + "; the run of compiling is measured, in time steps of 1 ms where something touches"
        )
        runs = play.runs()
    except CannotBegin as error:
        text = _stop_in_words(play, error.stop)
        raise play.located.error([(("cast", error.stop.players[0]), text)], FileError) from None
    run = combine_runs(play.cast, runs)
    faults += [
        f"{failure.text}, in {play.when(failure.t)}"
        for failure in find_failures(play.cast, play.meetings, runs)
    ]
    faults += [_stop_in_words(play, stop) for stop in runs.stops]
    all_touches = tuple(find_touches(play.cast, run, play.meetings))
    faults += [f"{touch}, in {play.when(touch.t)}" for touch in all_touches]
    faults += [
        f"{stretch}, in {play.when(stretch.t)}" for stretch in find_stretches(play.cast, run)
    ]
    feet = tuple(feet_on_floor(play.cast, play.walks, runs))
    faults += [f"{text}, in {play.when(t)}" for walk in feet for t, text in walk.faults()]
    cues = cue_times(play, run)
    for timing in cues:
        if abs(timing.lateness) > IN_TIME + 1e-9:
            side = "late" if timing.lateness > 0.0 else "early"
            faults.append(
                f"line {timing.cue.line}: {timing.cue.description}: "
                f"{timing.who} is {1e3 * abs(timing.lateness):.0f} ms "
                f"{side}, in {play.when(timing.wanted)}"
            )
    faults += [
        f"hands move by {rate:.2g} m/s where a show waits, in {play.when(wait.t)}"
        for wait in play.score.waits
        if (rate := float(np.max(np.abs(play.score.offsets(wait.t)[1])))) > _MAX_REST_RATE
    ]
    peaks, bound_faults = _hand_peaks(play)
    space, space_faults = _hand_extent(play, run.q_K)
    strings = StringDistances(play.marionette).motion(
        *(x[::SAMPLE_STRIDE] for x in (run.q_D, run.q_K, run.t))
    )
    wound_pairs = tuple(
        winding
        for winding in strings.windings()
        if not {winding.first, winding.second} & {*play.cast.file.leashes}
        and np.max(np.abs(winding.turns - winding.turns[0])) > _MIN_WINDING
    )
    faults += [
        f"strings {winding.first} and {winding.second} are wound around each other by "
        f"{np.max(np.abs(winding.turns - winding.turns[0])):.1f} turns"
        for winding in wound_pairs
    ]
    faults += [*bound_faults, *space_faults]
    catches = {
        name: sum(e.kind is EventKind.CATCH and e.name == name for e in run.events)
        for name in run.tension
    }
    tension = {name: float(np.max(run.tension[name])) for name in run.tension}
    return Verification(
        play,
        run,
        tuple(faults),
        cues,
        all_touches,
        peaks,
        tension,
        catches,
        space,
        wound_pairs,
        tuple(reason for company in runs.companies for reason in company.stepping_reasons),
        feet,
    )


def _stop_in_words(play: Play, stop: Stop) -> str:
    """Sentence about the stop of a run, with the cue in which it stops."""
    starts = [
        (marks[START], cue)
        for cue in play.cues
        for who, marks in cue.marks.items()
        if who in stop.players
    ]
    sentence = stop.sentence(f"in {play.when(stop.t)}")
    if not starts:
        return sentence
    starts.sort(key=lambda start: start[0])
    begun = [cue for t, cue in starts if t <= stop.t + LATENESS_TOLERANCE]
    cue = begun[-1] if begun else starts[0][1]
    return f"line {cue.line}: {cue.description}: {sentence}"


def cue_times(play: Play, run: Trajectory) -> tuple[CueTime, ...]:
    """Times of all cues that are done, in a run of the play."""
    limb_lateness: dict[tuple[int, str], list[float]] = {}
    cue_and_player = {id(cue): part for cue, part in zip(play.score.cues, play.parts, strict=True)}
    for limb_lateness_of_cue in measure_lateness(play.score, run):
        cue_number, who = cue_and_player[id(limb_lateness_of_cue.cue)]
        if limb_lateness_of_cue.mark == play.cues[cue_number - 1].mark:
            limb_lateness.setdefault((cue_number, who), []).append(limb_lateness_of_cue.seconds)
    times = []
    for cue in play.cues:
        if cue.refused or cue.start > run.t[-1]:
            continue
        if cue.with_prop:
            # Its players begin one after the other: the cue begins with the first.
            wanted = float(np.clip(cue.start, cue.wanted, cue.wanted + cue.max_delay))
            times.append(CueTime(cue, cue.who[0], wanted, cue.start, is_limb_time=False))
            continue
        for who, marks in cue.marks.items():
            limb_times, hand_time = limb_lateness.get((cue.number, who)), marks[cue.mark or START]
            if limb_times is not None:
                hand_time += float(np.mean(limb_times))
            # A cue that may be delayed is in time until its largest delay.
            wanted = float(np.clip(hand_time, cue.wanted, cue.wanted + cue.max_delay))
            times.append(CueTime(cue, who, wanted, hand_time, limb_times is not None))
    return tuple(times)


def _hand_peaks(play: Play) -> tuple[dict[str, tuple[float, float, float, float]], list[str]]:
    """Largest speeds and accelerations of the hands, and violations of their bounds."""
    score, table = play.score, play.marionette.coordinates
    bounds = motion_bounds(table, score.speed, score.acceleration)
    peaks = score.gesture.peaks
    peaks_and_bounds, faults = {}, []
    for v in np.flatnonzero(score.gesture.named):
        name = table.v_K[v]
        peaks_and_bounds[name] = (
            float(peaks[0, v]),
            float(bounds[0, v]),
            float(peaks[1, v]),
            float(bounds[1, v]),
        )
        unit = names_and_units(table)[v][1]
        for order, verb, time_unit in ((0, "moves at", "s"), (1, "changes by", "s^2")):
            if peaks[order, v] > bounds[order, v] * (1.0 + PEAK_TOLERANCE):
                piece = int(np.argmax(score.gesture.peaks_of_pieces[:, order, v]))
                when = play.when(score.gesture.breaks[piece])
                faults.append(
                    f"{name} {verb} {peaks[order, v]:.3g} {unit}/{time_unit} in {when}; "
                    f"the bound is {bounds[order, v]:.3g}"
                )
    return peaks_and_bounds, faults


def _hand_extent(
    play: Play, q_K: np.ndarray
) -> tuple[tuple[tuple[float, float], tuple[float, float]], list[str]]:
    """Extent of the hands' motion, and violations of their space."""
    names = play.marionette.coordinates.q_K
    extents, faults = [], []
    space = play.cast.file.stage.space
    for axis, bounds in (("x", space and space.x), ("y", space and space.y)):
        values = q_K[:, [i for i, name in enumerate(names) if name.endswith(f".{axis}")]]
        lower, upper = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
        extents.append((lower, upper))
        if bounds and not (bounds[0] - 1e-9 <= lower and upper <= bounds[1] + 1e-9):
            faults.append(
                f"hands move from {axis} = {lower:.3f} to {upper:.3f} m; "
                f"their space is {bounds[0]:g} to {bounds[1]:g} m"
            )
    return (extents[0], extents[1]), faults
