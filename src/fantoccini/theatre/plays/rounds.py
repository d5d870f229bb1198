"""Rounds of compiling: cues are placed, every player is simulated, and what is late is moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from fantoccini.kernel.runtime import default_threads
from fantoccini.motion import Trajectory
from fantoccini.theatre.cast import (
    ERRORS,
    CannotBegin,
    Cast,
    Cue,
    Footing,
    Kept,
    Meeting,
    Part,
    Places,
    Timeline,
    Wishes,
    digest,
    lane_name,
    said_in_act,
)
from fantoccini.theatre.gestures import Gesture, Motion, Played, Score, lateness
from fantoccini.theatre.plays.acting import Repertory
from fantoccini.theatre.plays.calming import NONE, calm_gesture, calming
from fantoccini.theatre.plays.handled import failures, handle_seen, stands_seen
from fantoccini.theatre.plays.placing import IN_TIME, Placing
from fantoccini.theatre.plays.runs import Runs, excerpt, runs_of
from fantoccini.theatre.plays.settling import PAUSE, pause
from fantoccini.theatre.plays.walks import Walks
from fantoccini.theatre.script import LATE, Notes, Spot

T = TypeVar("T")

_ENOUGH = 0.25 * IN_TIME
"""Lateness that is not mended [s]."""
PEAKS = 2e-3
"""Share of a bound by which a peak may pass it: peaks of speeds are bounds themselves."""
_RINGS = 1.0
"""After the last cue, in which the puppets still swing [s]."""
_SLACK = 0.6
"""After a cue, in which what touches is still its own doing [s]."""
TRIES = 4
"""How often a cue's hands are moved in time."""
_LOOKS = 3
"""How often it is seen where a prop is that is handled."""
_CALMS = 6
"""How often swing before a cue is taken out anew."""
_SEEN = 1e-3
"""By how much it is elsewhere than it was thought, for this to matter [m]."""
_JUST_BEFORE = 1e-6
"""Before a prop is handled, in which it is seen [s]."""
_MOST_EARLY = 0.6
"""By how much hands lead limbs at most [s]."""


@dataclass
class Round:
    """What a round has led to.

    Attributes:
        placing: the cues as they are placed.
        motions: player -> what its hands do.
        lanes: player -> lane -> its part of that.
        starts: player -> times at which its cues begin [s].
        meetings: who may touch what, and when.
        runs: of all.
    """

    placing: Placing
    motions: Mapping[str, Gesture]
    lanes: Mapping[str, Mapping[str, Gesture]]
    starts: Mapping[str, tuple[float, ...]]
    meetings: tuple[Meeting, ...]
    runs: Runs


class Rounds:
    """Rounds of one play.

    Attributes:
        timeline: the cues, as the last round has placed them.
        wishes: what rounds have found out.
        act_starts: of every act, in the last round [s].
        late: place of a cue and player -> by how much its limb is late in the last round [s].
        settled: number of a cue -> its pause, and the trunk's speeds after it without the pause
            and with it [s, m/s, m/s].

    Args:
        cast, timeline, repertory, places: of the play.
        notes: know the beat.
        kept: results of earlier rounds.
    """

    def __init__(
        self,
        cast: Cast,
        timeline: Timeline,
        repertory: Repertory,
        places: Places,
        notes: Notes,
        kept: Kept,
    ):
        self.timeline, self.wishes = timeline, Wishes()
        self.settled: dict[int, tuple[float, float, float]] = {}
        self._cast, self._repertory, self._places = cast, repertory, places
        self._notes, self._kept = notes, kept
        self._walks = Walks(cast, notes)
        self.act_starts: tuple[float, ...] = ()
        self.late: dict[tuple[Spot, str], float] = {}
        self._tried: dict[tuple[Spot, str], int] = {}
        self._looked: dict[Spot, int] = {}
        self._calmed: dict[tuple[Spot, str], int] = {}
        self._by_spot = {cue.spot: cue for cue in timeline.cues}

    def made(self) -> Round:
        """The next round."""
        placing = Placing(
            self._cast,
            self.timeline,
            self._repertory,
            self._places,
            self._walks,
            self.wishes,
            self._notes,
        )
        self.act_starts = tuple(placing.act_starts)
        end = max(placing.end, *(a.done for a in placing.actors.values())) + _RINGS
        both = {name: placing.motion(name, end) for name in self._cast.players}
        motions = {name: whole for name, (whole, _) in both.items()}
        lanes = {name: own for name, (_, own) in both.items()}
        starts = {
            name: tuple(
                part.start for cue in self.timeline.cues for part in cue.parts if part.who == name
            )
            for name in motions
        }
        meetings = placing.meetings(end)
        try:
            runs = runs_of(self._cast, motions, starts, meetings, self._kept)
        except CannotBegin as error:
            if not self.refuse(self.blamed(0.0, {*error.stop.players}), str(error)):
                self._notes.mistake(("cast", error.stop.players[0]), str(error))
                self._notes.refuse()
            return self.made()
        return Round(placing, motions, lanes, starts, meetings, runs)

    def refuse(self, cue: Cue | None, why: str) -> bool:
        """Refuses a cue, if it is one and is not refused yet; the others are moved anew."""
        if cue is None or cue.spot in self.wishes.refused:
            return False
        self.wishes.refused[cue.spot] = why
        self.wishes.pauses.pop(cue.spot, None)
        self._tried.clear()
        self._looked.clear()
        self._calmed.clear()
        return True

    def refuse_stopped(self, made: Round) -> bool:
        """Refuses cues in which a run stops early; returns whether there are any."""
        return any(
            [
                self.refuse(self.blamed(stop.t, {*stop.players}), stop.told(self.said(stop.t)))
                for stop in made.runs.stops
            ]
        )

    def refuse_failures(self, made: Round) -> bool:
        """Refuses the cues by which props do not come where they should; whether there are any."""
        found = False
        for one in failures(self._cast, made.meetings, made.runs):
            cue = self._by_spot.get(one.cue) if one.cue else self.blamed(one.t, {*one.players})
            # What comes later may be otherwise without it.
            if self.refuse(cue, f"{one.text} {self.said(one.t)}"):
                found = True
                break
        return found

    def back(self, wishes: Wishes) -> None:
        """Goes back to earlier wishes, from which all is seen anew."""
        self.wishes = wishes
        self._looked.clear()
        self._calmed.clear()

    def look(self, made: Round) -> bool:
        """Sees where props are that are handled; whether that changes what is done."""
        changed = self._calm(made)
        for meeting in made.meetings:
            spot = meeting.cue
            if spot is None or meeting.kind == "hangs" or not meeting.props:
                continue
            (prop,) = meeting.props
            if self._looked.get(spot, 0) >= _LOOKS:
                continue
            if meeting.kind in ("picked", "sits"):
                there = stands_seen(self._cast, made.runs, prop, meeting.begin)
                moved = self._look_where(spot, there)
            else:
                t = meeting.begin - _JUST_BEFORE
                moved = self._look_how(spot, handle_seen(self._cast, made.runs, meeting, t))
            self._looked[spot] = self._looked.get(spot, 0) + moved
            changed |= moved
        return changed

    def _look_where(self, spot: Spot, there: Footing | None) -> bool:
        """Keeps where a prop stands; whether that is elsewhere than was thought."""
        before = self.wishes.stands.pop(spot, None)
        if there is None:
            return before is not None
        self.wishes.stands[spot] = there
        return before is None or abs(there.place - before.place) > _SEEN

    def _look_how(self, spot: Spot, seen: tuple[float, float] | None) -> bool:
        """Keeps how a prop hangs; whether that is otherwise than was thought."""
        before = self.wishes.hangs.pop(spot, None)
        if seen is None:
            return before is not None
        self.wishes.hangs[spot] = seen
        return before is None or not np.allclose(seen, before, rtol=0.0, atol=_SEEN)

    def _calm(self, made: Round) -> bool:
        """Finds motions that take out swing; whether that changes what is done."""
        jobs: dict[str, Callable[[], tuple[float, ...]]] = {}
        keys: dict[str, tuple[Spot, str]] = {}
        for (spot, name), start in made.placing.calmed.items():
            run, alone = made.runs.players[name], self._cast.players[name].alone
            if start >= float(run.t[-1]):
                continue
            x = run.at(start)
            if self._calmed.get((spot, name), 0) >= _CALMS:
                continue
            label = f"calm {spot} {name}"
            content = self._cast.players[name].content
            key = digest(x, calm_gesture(alone, NONE), "calm", content)
            job = partial(_or, NONE, partial(calming, alone, x))
            jobs[label] = partial(self._kept.get, key, job)
            keys[label] = spot, name
        changed = False
        for label, offsets in self._kept.side_by_side(jobs, default_threads()).items():
            before = self.wishes.calms.get(keys[label], NONE)
            self.wishes.calms[keys[label]] = offsets
            moved = not np.allclose(before, offsets, rtol=0.0, atol=_SEEN)
            self._calmed[keys[label]] = self._calmed.get(keys[label], 0) + moved
            changed |= moved
        return changed

    def said(self, t: float) -> str:
        """A time in words, in beats of its act."""
        start = max(one for one in (0.0, *self.act_starts) if one <= t + LATE)
        return said_in_act(t, start, self._notes.beat)

    def refuse_fast(self, made: Round) -> bool:
        """Refuses the cues in which hands pass their bounds; whether there are any."""
        stage, found = self._cast.file.stage, []
        for name, motion in made.motions.items():
            sizes = motion.peaks_of_pieces
            for row, bound, what, unit in (
                (0, stage.speed, "moves at", "m/s"),
                (1, stage.acceleration, "changes by", "m/s^2"),
            ):
                piece, v = np.unravel_index(int(np.argmax(sizes[:, row])), sizes[:, row].shape)
                most = float(sizes[piece, row, v])
                if most <= bound * (1.0 + PEAKS):
                    continue
                t = 0.5 * float(motion.breaks[piece] + motion.breaks[piece + 1])
                slower = (most / bound) ** (1.0 / (row + 1))
                text = f"{motion.coordinates.v_K[v]} {what} {most:.3g} {unit}, and the bound is "
                text += f"{bound:g}; {1.02 * slower:.2g} times slower it can be done"
                found.append(self.refuse(self.blamed(t, {name}), text))
        return any(found)

    def settle(self, made: Round) -> bool:
        """Finds pauses of the cues that begin when they like."""
        jobs: dict[str, Callable[[], tuple[float, float, float]]] = {}
        cues: dict[str, tuple[int, Cue]] = {}
        for number, cue in enumerate(self.timeline.cues):
            if not _is_free(cue) or len(cue.parts) != 1:
                continue
            (part,) = cue.parts
            motion = self._alone(made, part)
            most = self.most_pause(cue)
            if motion is None or most <= 0.0:
                continue
            begun, own = motion
            run, alone = made.runs.players[part.who], self._cast.players[part.who].alone
            x = run.at(begun)
            content = self._cast.players[part.who].content
            key = digest(x, Gesture(alone.coordinates, *own), most, "pause", content)
            job = partial(_or, (0.0, 0.0, 0.0), partial(pause, alone, x, own, most))
            jobs[f"{number}"] = partial(self._kept.get, key, job)
            cues[f"{number}"] = number, cue
        found = self._kept.side_by_side(jobs, default_threads())
        for label, (number, cue) in cues.items():
            self.settled[number + 1] = found[label]
            self.wishes.pauses[cue.spot] = found[label][0]
        return any(p > 0.0 for p, _, _ in found.values())

    def most_pause(self, cue: Cue) -> float:
        """By how much later a cue may begin for swing's sake [s]."""
        if not _is_free(cue):
            return 0.0
        wait = cue.given.may_wait
        return PAUSE if wait is None else wait * self._notes.beat

    def _alone(self, made: Round, part: Part) -> tuple[float, Motion] | None:
        """When a part may begin, and its motion from then on; None where others go on meanwhile."""
        mine = [
            one
            for cue in self.timeline.cues
            for one in cue.parts
            if one.who == part.who and one is not part
        ]
        if any(one.end > part.start and one.start < part.end for one in mine):
            return None
        begun = max([0.0, *(one.end for one in mine if one.end <= part.start)])
        whole = made.motions[part.who]
        if np.max(np.abs(whole.offsets(begun)[1])) > LATE or part.end - begun < LATE:
            return None
        return begun, excerpt(whole, begun, part.end)

    def refuse_late(self) -> bool:
        """Refuses cues whose limbs are not on their marks, however early the hands begin."""
        found = []
        for (spot, name), late in self.late.items():
            if abs(late) > IN_TIME:
                side = "late" if late > 0.0 else "early"
                text = f"{name} would be {1e3 * abs(late):.0f} ms {side}, whenever its hands begin"
                found.append(self.refuse(self._by_spot[spot], text))
        return any(found)

    def hurry(self, made: Round) -> bool:
        """Lets hands begin earlier, where limbs are late on the marks that cues are timed by."""
        changed = False
        self.late.clear()
        for name, run in made.runs.players.items():
            for late, cue in self._late(name, run, made):
                key = cue.spot, name
                self.late[key] = late
                tried = self._tried.get(key, 0)
                if abs(late) < _ENOUGH or tried >= TRIES:
                    continue
                before = self.wishes.earlier.get(key, 0.0)
                after = float(np.clip(before + late, -_MOST_EARLY, _MOST_EARLY))
                self._tried[key] = tried + 1
                self.wishes.earlier[key] = after
                changed = changed or after != before
        return changed

    def _late(self, name: str, run: Trajectory, made: Round) -> list[tuple[float, Cue]]:
        """How late a player's limbs are on the marks of `on`."""
        timed: dict[int, Cue] = {}
        played = []
        for cue in self.timeline.cues:
            for part in cue.parts if cue.given.mark and not cue.walks else ():
                if part.who == name:
                    lane = lane_name(part.who, part.lane)
                    one = Played(lane, cue.name, part.start, part.end, part.marks, cue.name)
                    played.append(one)
                    timed[id(one)] = cue
        if not timed:
            return []
        alone = self._cast.players[name].alone
        score = Score(
            alone,
            made.motions[name],
            tuple(played),
            {},
            (),
            self._notes.beat,
            lanes=made.lanes[name],
        )
        found: dict[int, list[float]] = {}
        for late in lateness(score, run):
            one_cue = timed[id(late.cue)]
            if late.mark == one_cue.given.mark:
                found.setdefault(id(one_cue), []).append(late.seconds)
        lates = []
        for cue in timed.values():
            off = float(np.mean(found.get(id(cue), [0.0]))) + _of_hands(cue, name)
            # Within what it may wait it is in time.
            lates.append((off - min(max(off, 0.0), cue.give(self._notes.beat)), cue))
        return lates

    def blamed(self, t: float, owners: set[str]) -> Cue | None:
        """The cue that has begun last of those that go on at a time; a gesture before a walk."""
        now = [
            (not cue.walks, part.start, -i, cue)
            for i, cue in enumerate(self.timeline.cues)
            for part in cue.parts
            if part.who in owners and part.start - _SLACK <= t <= part.end + _SLACK
        ]
        if not now:
            now = [
                (True, part.start, -i, cue)
                for i, cue in enumerate(self.timeline.cues)
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


def _of_hands(cue: Cue, name: str) -> float:
    """How late a player's hands are on the mark of `on` [s]."""
    part = next(part for part in cue.parts if part.who == name)
    return part.marks[cue.given.mark] - cue.wanted


def _is_free(cue: Cue) -> bool:
    """Whether a cue may begin later than it is written."""
    given = cue.given
    if given.may_wait is not None:
        return given.may_wait > 0.0
    return given.is_free
