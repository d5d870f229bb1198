"""Rounds of compiling a play: place all cues, simulate all players, correct what is wrong.

A rule takes the results so far and a round. It returns the new results, and whether any cue
must be placed again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from fantoccini.kernel.runtime import default_threads
from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import (
    ERRORS,
    CannotBegin,
    Footing,
    Kept,
    Part,
    Placed,
    Wishes,
    digest,
    lane_name,
    said_in_act,
)
from fantoccini.theatre.gestures import Gesture, Motion, Played, Score, lateness
from fantoccini.theatre.plays.calming import NONE, calm_gesture, calming
from fantoccini.theatre.plays.handled import failures, handle_seen, stands_seen
from fantoccini.theatre.plays.placing import IN_TIME, Placement, place_cues
from fantoccini.theatre.plays.reading import Script
from fantoccini.theatre.plays.runs import Runs, excerpt, runs_of
from fantoccini.theatre.plays.settling import PAUSE, pause
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import LATE, VERBS, PlayCue, Spot, walks

T = TypeVar("T")

_LOCATED = {verb.meets: verb.located for verb in VERBS.values()}
"""Kind of meeting -> what of a prop is measured before it."""

_ENOUGH = 0.25 * IN_TIME
"""Lateness that is not mended [s]."""
PEAKS = 2e-3
"""Share of a bound by which a peak may pass it: peaks of speeds are bounds themselves."""
_SLACK = 0.6
"""After a cue, in which what touches is still its own doing [s]."""
TRIES = 4
"""Largest number of times that a cue's hands are moved in time."""
_LOOKS = 3
"""Largest number of times that a handled prop is located again."""
_CALMS = 6
"""Largest number of times that swing before a cue is taken out anew."""
_SEEN = 1e-3
"""Error of a place above which cues are placed anew [m]."""
_JUST_BEFORE = 1e-6
"""Time by which a prop is located before it is handled [s]."""
_MOST_EARLY = 0.6
"""Longest time by which hands lead limbs [s]."""


@dataclass(frozen=True)
class Known:
    """Results of the rounds so far.

    Attributes:
        wishes: about cues.
        tried: (cue, player) -> number of times that its hands were moved in time.
        looked: cue -> number of times that its prop was located.
        calmed: (cue, player) -> number of times that swing before it was taken out.
        settled: number of a cue -> its pause, and the trunk's speeds after it without the pause
            and with it [s, m/s, m/s].
        touching: cues that are refused because something would touch.
    """

    wishes: Wishes = field(default_factory=Wishes)
    tried: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    looked: Mapping[Spot, int] = field(default_factory=dict)
    calmed: Mapping[tuple[Spot, str], int] = field(default_factory=dict)
    settled: Mapping[int, tuple[float, float, float]] = field(default_factory=dict)
    touching: tuple[Spot, ...] = ()

    def refusing(self, placed: Placed | None, why: str) -> Known | None:
        """The results with a cue refused and the retry counts reset.

        None if there is no such cue, or it is refused already.
        """
        if placed is None or placed.spot in self.wishes.refused:
            return None
        wishes = self.wishes.setting("refused", placed.spot, why).setting(
            "pauses", placed.spot, None
        )
        return replace(self, wishes=wishes, tried={}, looked={}, calmed={})

    def back(self, wishes: Wishes) -> Known:
        """The results with earlier wishes; props and swing are measured again."""
        return replace(self, wishes=wishes, looked={}, calmed={})


@dataclass(frozen=True, eq=False)
class Stage:
    """A play, and what all rounds of compiling it share.

    Attributes:
        script: the play; its cast is settled.
        walks: the stage from above.
        kept: results of earlier rounds.
    """

    script: Script
    walks: Walks
    kept: Kept

    @property
    def beat(self) -> float:
        """Duration of a beat [s]."""
        return self.script.notes.beat


@dataclass(frozen=True, eq=False)
class Round:
    """One placement of all cues, and its simulation.

    Attributes:
        known: results from which the cues were placed.
        placement: the placed cues.
        runs: of all players and props.
        beat: duration of a beat [s].
    """

    known: Known
    placement: Placement
    runs: Runs
    beat: float

    def said(self, t: float) -> str:
        """A time in words, in beats of its act."""
        return _said(self.placement, t, self.beat)

    def blamed(self, t: float, owners: set[str]) -> Placed | None:
        """The cue of some players that a time [s] belongs to."""
        return _blamed(self.placement.cues, t, owners)


Rule = tuple[Known, bool]
"""Results after a rule, and whether cues move by it."""


def make_round(stage: Stage, known: Known) -> Round:
    """Places all cues and simulates them.

    Raises:
        FileError: the run of a player cannot begin, whatever is refused.
    """
    script = stage.script
    while True:
        placement = place_cues(
            script.cast,
            script.timeline,
            script.repertory,
            script.places,
            stage.walks,
            known.wishes,
            script.notes,
        )
        try:
            runs = runs_of(
                script.cast, placement.motions, placement.starts, placement.meetings, stage.kept
            )
        except CannotBegin as error:
            first = _blamed(placement.cues, 0.0, {*error.stop.players})
            without = known.refusing(first, str(error))
            if without is None:
                script.notes.mistake(("cast", error.stop.players[0]), str(error))
                script.notes.refuse()
                raise
            known = without
        else:
            return Round(known, placement, runs, stage.beat)


def refuse_stopped(_: Stage, known: Known, made: Round) -> Rule:
    """Refuses the cues in which a run stops early."""
    before = known
    for stop in made.runs.stops:
        cue = made.blamed(stop.t, {*stop.players})
        known = known.refusing(cue, stop.told(made.said(stop.t))) or known
    return known, known is not before


def refuse_failures(stage: Stage, known: Known, made: Round) -> Rule:
    """Refuses the first cue that fails to bring a prop to its place."""
    of_spot = {placed.spot: placed for placed in made.placement.cues}
    for one in failures(stage.script.cast, made.placement.meetings, made.runs):
        cue = of_spot.get(one.cue) if one.cue else made.blamed(one.t, {*one.players})
        # Without it, later cues may succeed.
        after = known.refusing(cue, f"{one.text} {made.said(one.t)}")
        if after is not None:
            return after, True
    return known, False


def refuse_fast(stage: Stage, known: Known, made: Round) -> Rule:
    """Refuses the cues in which hands pass their bounds."""
    bounds, before = stage.script.cast.file.stage, known
    for name, motion in made.placement.motions.items():
        sizes = motion.peaks_of_pieces
        for row, bound, what, unit in (
            (0, bounds.speed, "moves at", "m/s"),
            (1, bounds.acceleration, "changes by", "m/s^2"),
        ):
            piece, v = np.unravel_index(int(np.argmax(sizes[:, row])), sizes[:, row].shape)
            most = float(sizes[piece, row, v])
            if most <= bound * (1.0 + PEAKS):
                continue
            t = 0.5 * float(motion.breaks[piece] + motion.breaks[piece + 1])
            slower = (most / bound) ** (1.0 / (row + 1))
            text = f"{motion.coordinates.v_K[v]} {what} {most:.3g} {unit}, and the bound is "
            text += f"{bound:g}; {1.02 * slower:.2g} times slower it can be done"
            known = known.refusing(made.blamed(t, {name}), text) or known
    return known, known is not before


def look(stage: Stage, known: Known, made: Round) -> Rule:
    """Locates the props that are handled, and computes motions that damp swing."""
    known, changed = _calm(stage, known, made)
    for meeting in made.placement.meetings:
        spot, located = meeting.cue, _LOCATED.get(meeting.kind)
        if spot is None or not located or not meeting.props:
            continue
        (prop,) = meeting.props
        if known.looked.get(spot, 0) >= _LOOKS:
            continue
        wishes, cast = known.wishes, stage.script.cast
        if located == "place":
            there = stands_seen(cast, made.runs, prop, meeting.begin)
            moved = _elsewhere(wishes.stands.get(spot), there)
            wishes = wishes.setting("stands", spot, there)
        else:
            seen = handle_seen(cast, made.runs, meeting, meeting.begin - _JUST_BEFORE)
            moved = _otherwise(wishes.hangs.get(spot), seen)
            wishes = wishes.setting("hangs", spot, seen)
        looked = {**known.looked, spot: known.looked.get(spot, 0) + moved}
        known, changed = replace(known, wishes=wishes, looked=looked), changed or moved
    return known, changed


def _elsewhere(before: Footing | None, there: Footing | None) -> bool:
    """True if a prop does not stand where the cue was placed for."""
    if before is None or there is None:
        return before is not there
    return abs(there.place - before.place) > _SEEN


def _otherwise(before: tuple[float, float] | None, seen: tuple[float, float] | None) -> bool:
    """True if a prop does not hang as the cue was placed for."""
    if before is None or seen is None:
        return before is not seen
    return not np.allclose(seen, before, rtol=0.0, atol=_SEEN)


def _calm(stage: Stage, known: Known, made: Round) -> Rule:
    """Finds motions that take out swing."""
    jobs: dict[str, Callable[[], tuple[float, ...]]] = {}
    keys: dict[str, tuple[Spot, str]] = {}
    for (spot, name), start in made.placement.calmed.items():
        run, player = made.runs.players[name], stage.script.cast.players[name]
        if start >= float(run.t[-1]) or known.calmed.get((spot, name), 0) >= _CALMS:
            continue
        x, label = run.at(start), f"calm {spot} {name}"
        key = digest(x, calm_gesture(player.alone, NONE), "calm", player.content)
        job = partial(_or, NONE, partial(calming, player.alone, x))
        jobs[label] = partial(stage.kept.get, key, job)
        keys[label] = spot, name
    changed = False
    for label, offsets in stage.kept.side_by_side(jobs, default_threads()).items():
        who = keys[label]
        before = known.wishes.calms.get(who, NONE)
        moved = not np.allclose(before, offsets, rtol=0.0, atol=_SEEN)
        calmed = {**known.calmed, who: known.calmed.get(who, 0) + moved}
        wishes = known.wishes.setting("calms", who, offsets)
        known, changed = replace(known, wishes=wishes, calmed=calmed), changed or moved
    return known, changed


def settle(stage: Stage, known: Known, made: Round) -> Rule:
    """Finds the pauses that let swing settle before cues that may be delayed."""
    jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
    cues: dict[str, tuple[int, Placed]] = {}
    for number, cue in enumerate(made.placement.cues, 1):
        most = most_pause(cue.given, stage.beat)
        if len(cue.parts) != 1 or most <= 0.0:
            continue
        (part,) = cue.parts
        motion = _alone(made.placement, part)
        if motion is None:
            continue
        begun, own = motion
        run, player = made.runs.players[part.who], stage.script.cast.players[part.who]
        x, alone = run.at(begun), player.alone
        key = digest(x, Gesture(alone.coordinates, *own), most, "pause", player.content)
        job = partial(_or, (0.0, 0.0, 0.0), partial(pause, alone, x, own, most))
        jobs[f"{number}"] = partial(stage.kept.get, key, job)
        cues[f"{number}"] = number, cue
    found = stage.kept.side_by_side(jobs, default_threads())
    for label, (number, cue) in cues.items():
        settled = {**known.settled, number: found[label]}
        wishes = known.wishes.setting("pauses", cue.spot, found[label][0])
        known = replace(known, wishes=wishes, settled=settled)
    return known, any(p > 0.0 for p, _, _ in found.values())


def most_pause(given: PlayCue, beat: float) -> float:
    """Longest delay of a cue that lets swing settle [s]."""
    if given.may_wait is not None:
        return given.may_wait * beat
    return PAUSE if given.is_free else 0.0


def _alone(placement: Placement, part: Part) -> tuple[float, Motion] | None:
    """Earliest start of a part [s], and its motion from then on; None where others go on."""
    mine = [
        one
        for cue in placement.cues
        for one in cue.parts
        if one.who == part.who and one is not part
    ]
    if any(one.end > part.start and one.start < part.end for one in mine):
        return None
    begun = max([0.0, *(one.end for one in mine if one.end <= part.start)])
    whole = placement.motions[part.who]
    if np.max(np.abs(whole.offsets(begun)[1])) > LATE or part.end - begun < LATE:
        return None
    return begun, excerpt(whole, begun, part.end)


def lates(stage: Stage, made: Round) -> dict[tuple[Spot, str], float]:
    """Cue and player -> lateness of its limb on the mark of `on` [s]."""
    return {
        (cue.spot, name): late
        for name, run in made.runs.players.items()
        for late, cue in _late(stage, name, run, made)
    }


def hurry(known: Known, late: Mapping[tuple[Spot, str], float]) -> Rule:
    """Lets hands begin earlier, where limbs are late on the marks that cues are timed by."""
    changed = False
    for key, seconds in late.items():
        tried = known.tried.get(key, 0)
        if abs(seconds) < _ENOUGH or tried >= TRIES:
            continue
        before = known.wishes.earlier.get(key, 0.0)
        after = float(np.clip(before + seconds, -_MOST_EARLY, _MOST_EARLY))
        wishes = known.wishes.setting("earlier", key, after)
        known = replace(known, wishes=wishes, tried={**known.tried, key: tried + 1})
        changed = changed or after != before
    return known, changed


def refuse_late(known: Known, made: Round, late: Mapping[tuple[Spot, str], float]) -> Rule:
    """Refuses cues whose limbs are not on their marks, however early the hands begin."""
    before, of_spot = known, {placed.spot: placed for placed in made.placement.cues}
    for (spot, name), seconds in late.items():
        if abs(seconds) > IN_TIME:
            side = "late" if seconds > 0.0 else "early"
            text = f"{name} would be {1e3 * abs(seconds):.0f} ms {side}, whenever its hands begin"
            known = known.refusing(of_spot[spot], text) or known
    return known, known is not before


def _late(stage: Stage, name: str, run: Trajectory, made: Round) -> list[tuple[float, Placed]]:
    """Lateness of a player's limbs on the marks of `on` [s], with the cues."""
    timed: dict[int, Placed] = {}
    played = []
    for cue in made.placement.cues:
        for part in cue.parts if cue.given.mark and not walks(cue.given) else ():
            if part.who == name:
                lane, called = lane_name(part.who, part.lane), cue.cue.name
                one = Played(lane, called, part.start, part.end, part.marks, called)
                played.append(one)
                timed[id(one)] = cue
    if not timed:
        return []
    score = Score(
        stage.script.cast.players[name].alone,
        made.placement.motions[name],
        tuple(played),
        {},
        (),
        stage.beat,
        lanes=made.placement.lanes[name],
    )
    found: dict[Spot, list[float]] = {}
    for late in lateness(score, run):
        cue = timed[id(late.cue)]
        if late.mark == cue.given.mark:
            found.setdefault(cue.spot, []).append(late.seconds)
    result = []
    for cue in timed.values():
        off = float(np.mean(found.get(cue.spot, [0.0]))) + _of_hands(cue, name)
        # Within what it may wait it is in time.
        result.append((off - min(max(off, 0.0), cue.given.patience * stage.beat), cue))
    return result


def _said(placement: Placement, t: float, beat: float) -> str:
    start = max(one for one in (0.0, *placement.act_starts) if one <= t + LATE)
    return said_in_act(t, start, beat)


def _blamed(cues: Sequence[Placed], t: float, owners: set[str]) -> Placed | None:
    """The cue that has begun last of those that go on at a time; a gesture before a walk."""
    now = [
        (not walks(cue.given), part.start, -i, cue)
        for i, cue in enumerate(cues)
        for part in cue.parts
        if part.who in owners and part.start - _SLACK <= t <= part.end + _SLACK
    ]
    if not now:
        now = [
            (True, part.start, -i, cue)
            for i, cue in enumerate(cues)
            for part in cue.parts
            if part.who in owners and part.start <= t
        ]
    return max(now, key=lambda one: one[:3])[3] if now else None


def _or(otherwise: T, job: Callable[[], T]) -> T:
    """The result of a search, or ``otherwise`` if its rollouts stop; the run gives the reason."""
    try:
        return job()
    except ERRORS:
        return otherwise


def _of_hands(cue: Placed, name: str) -> float:
    """Lateness of a player's hands on the mark of `on` [s]."""
    part = next(part for part in cue.parts if part.who == name)
    return part.marks[cue.given.mark] - cue.wanted
