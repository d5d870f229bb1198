"""Plays verified: the whole simulated event-driven, and everything that is promised measured."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import FileError
from fantoccini.dynamics.clearance import StringsApart, Winding
from fantoccini.motion import EventKind, Trajectory
from fantoccini.theatre.cast import CannotBegin, OutOfTime, Stop
from fantoccini.theatre.gestures import lateness, limits
from fantoccini.theatre.plays.handled import failures
from fantoccini.theatre.plays.placing import IN_TIME
from fantoccini.theatre.plays.play import CueOfPlay, Play
from fantoccini.theatre.plays.rounds import PEAKS
from fantoccini.theatre.plays.stage_run import together
from fantoccini.theatre.plays.touching import EVERY, Touch, touches
from fantoccini.theatre.script import LATE, START

_AT_REST = 1e-6
"""Rate of hands that are at rest [m/s or rad/s]."""
_WOUND = 0.75
"""Winding of two strings that have passed through one another [turns]."""


@dataclass(frozen=True)
class CueTime:
    """When a cue is seen.

    Attributes:
        cue: of the play.
        who: the player.
        wanted, seen: when it is to be, and when it is, in the event-driven run [s].
        limb: whether a limb's turn at the mark was seen; otherwise the time is the hands'.
    """

    cue: CueOfPlay
    who: str
    wanted: float
    seen: float
    limb: bool

    @property
    def late(self) -> float:
        """[s]"""
        return self.seen - self.wanted


@dataclass(frozen=True, eq=False)
class Verification:
    """A play's event-driven run, and what was measured in it; true where all holds.

    Attributes:
        play: what was simulated.
        run: of the whole stage.
        faults: what does not hold, in words.
        cues: when every cue that is done is seen.
        touches: what comes too near, or crosses.
        peaks: coordinate -> (largest speed, its bound, largest acceleration, its bound).
        tension: string -> largest tension [N].
        catches: string -> how often it snapped taut.
        space: farthest places of the hands: ((low, high) of x, (low, high) of y) [m].
        windings: pairs of strings that are wound around each other.
        stepped: why parts in which something touches were simulated in time steps, as their
            event-driven run stops.
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
    stepped: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return not self.faults

    def __repr__(self) -> str:
        what = "holds" if self else f"{len(self.faults)} faults"
        return f"<Verification of {self.play.name!r}: {what}>"

    @property
    def worst(self) -> float:
        """Largest lateness of a cue, late or early [s]."""
        return max((abs(cue.late) for cue in self.cues), default=0.0)


def verify_play(play: Play, *, within: float | None = None) -> Verification:
    """Simulates a play event-driven, and measures whether it is as it was compiled.

    Checked are: the run reaches its end; every cue that is done is seen within 1/60 s of its time;
    players, obstacles and strings keep the stage's distance; strings never cross; the floor is not
    touched but by who sits; what is held, put down or sat on is so; the hands keep their bounds and
    their space, and rest where a show waits. The bodies of one player are not checked against each
    other, nor against its own strings.

    Args:
        play: compiled.
        within: time after which simulating stops [s]. The run from compiling is then measured,
            with time steps where something touches, and this counts as a fault. No limit by
            default.

    Raises:
        FileError: a player's run cannot begin.
    """
    faults = []
    try:
        with play.kept.limited(math.inf if within is None else time.monotonic() + within):
            runs = play.runs(exact=True)
    except OutOfTime:
        faults.append(
            "not simulated event-driven: the time was over "
            + (f"after {within:.3g} s" if within else "before it began")
            + "; measured is the run of compiling, in time steps of 1 ms where something touches"
        )
        runs = play.runs()
    except CannotBegin as error:
        text = _stops(play, error.stop)
        raise play.located.error([(("cast", error.stop.players[0]), text)], FileError) from None
    run = together(play.cast, runs)
    faults += [
        f"{failure.text}, in {play.when(failure.t)}"
        for failure in failures(play.cast, play.meetings, runs)
    ]
    faults += [_stops(play, stop) for stop in runs.stops]
    found = tuple(touches(play.cast, run, play.meetings))
    faults += [f"{one}, in {play.when(one.t)}" for one in found]
    cues = cue_times(play, run)
    for one in cues:
        if abs(one.late) > IN_TIME + 1e-9:
            side = "late" if one.late > 0.0 else "early"
            faults.append(
                f"line {one.cue.line}: {one.cue.what}: {one.who} is {1e3 * abs(one.late):.0f} ms "
                f"{side}, in {play.when(one.wanted)}"
            )
    faults += [
        f"hands move by {rate:.2g} m/s where a show waits, in {play.when(wait.t)}"
        for wait in play.score.waits
        if (rate := float(np.max(np.abs(play.score.offsets(wait.t)[1])))) > _AT_REST
    ]
    peaks, over = _peaks(play)
    space, outside = _space(play, run.q_K)
    strings = StringsApart(play.marionette).over(*(x[::EVERY] for x in (run.q_D, run.q_K, run.t)))
    wound = tuple(
        winding
        for winding in strings.windings()
        if np.max(np.abs(winding.turns - winding.turns[0])) > _WOUND
    )
    faults += [
        f"strings {winding.what} and {winding.other} are wound around each other by "
        f"{np.max(np.abs(winding.turns - winding.turns[0])):.1f} turns"
        for winding in wound
    ]
    faults += [*over, *outside]
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
        found,
        peaks,
        tension,
        catches,
        space,
        wound,
        tuple(why for company in runs.companies for why in company.stepped),
    )


def _stops(play: Play, stop: Stop) -> str:
    """A sentence on the stop of a run, with its last cue begun, else the first, and the line."""
    starts = [
        (marks[START], cue)
        for cue in play.cues
        for who, marks in cue.marks.items()
        if who in stop.players
    ]
    told = stop.told(f"in {play.when(stop.t)}")
    if not starts:
        return told
    starts.sort(key=lambda one: one[0])
    begun = [cue for t, cue in starts if t <= stop.t + LATE]
    cue = begun[-1] if begun else starts[0][1]
    return f"line {cue.line}: {cue.what}: {told}"


def cue_times(play: Play, run: Trajectory) -> tuple[CueTime, ...]:
    """When every cue that is done is seen in a run of the play."""
    seen: dict[tuple[int, str], list[float]] = {}
    parts = {id(one): part for one, part in zip(play.score.cues, play.parts, strict=True)}
    for late in lateness(play.score, run):
        number, who = parts[id(late.cue)]
        if late.mark == play.cues[number - 1].mark:
            seen.setdefault((number, who), []).append(late.seconds)
    found = []
    for cue in play.cues:
        if cue.refused or cue.start > run.t[-1]:
            continue
        if cue.with_prop:
            # Who takes part begins one after the other: the cue begins with the first.
            wanted = float(np.clip(cue.start, cue.wanted, cue.wanted + cue.give))
            found.append(CueTime(cue, cue.who[0], wanted, cue.start, limb=False))
            continue
        for who, marks in cue.marks.items():
            own, hands = seen.get((cue.number, who)), marks[cue.mark or START]
            at = hands if own is None else hands + float(np.mean(own))
            # What may begin later is in time until then.
            wanted = float(np.clip(at, cue.wanted, cue.wanted + cue.give))
            found.append(CueTime(cue, who, wanted, at, own is not None))
    return tuple(found)


def _peaks(play: Play) -> tuple[dict[str, tuple[float, float, float, float]], list[str]]:
    """Largest speeds and accelerations of the hands, and where they pass their bounds."""
    score, table = play.score, play.marionette.coordinates
    most = limits(table, score.speed, score.acceleration)
    peaks = score.gesture.peaks
    found, over = {}, []
    for v in np.flatnonzero(score.gesture.named):
        name = table.v_K[v]
        found[name] = (float(peaks[0, v]), float(most[0, v]), float(peaks[1, v]), float(most[1, v]))
        for row, what, unit in ((0, "moves at", "m/s"), (1, "changes by", "m/s^2")):
            if peaks[row, v] > most[row, v] * (1.0 + PEAKS):
                piece = int(np.argmax(score.gesture.peaks_of_pieces[:, row, v]))
                when = play.when(score.gesture.breaks[piece])
                over.append(
                    f"{name} {what} {peaks[row, v]:.3g} {unit} in {when}; "
                    f"the bound is {most[row, v]:.3g}"
                )
    return found, over


def _space(
    play: Play, q_K: np.ndarray
) -> tuple[tuple[tuple[float, float], tuple[float, float]], list[str]]:
    """Reach of the hands, and where they leave their space."""
    names = play.marionette.coordinates.q_K
    found, outside = [], []
    space = play.cast.file.stage.space
    for part, bounds in (("x", space and space.x), ("y", space and space.y)):
        own = q_K[:, [i for i, name in enumerate(names) if name.endswith(f".{part}")]]
        low, high = (float(own.min()), float(own.max())) if own.size else (0.0, 0.0)
        found.append((low, high))
        if bounds and not (bounds[0] - 1e-9 <= low and high <= bounds[1] + 1e-9):
            outside.append(
                f"hands go from {part} = {low:.3f} to {high:.3f} m; "
                f"their space is {bounds[0]:g} to {bounds[1]:g} m"
            )
    return (found[0], found[1]), outside
