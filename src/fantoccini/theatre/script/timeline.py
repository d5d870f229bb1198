"""Timeline of a script: dependencies between cues, and the order in which they are placed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

from fantoccini.base import did_you_mean
from fantoccini.theatre.script.cues import CueFile
from fantoccini.theatre.script.log import ScriptLog
from fantoccini.theatre.script.times import Ref, Reference, Times, circular_wait
from fantoccini.theatre.script.values import END, START, Spot, Time

CueT = TypeVar("CueT", bound=CueFile)
Moments = Mapping[str, float]
"""Mark, ``start`` or ``end`` -> time [s]; ``""`` is the only key for a mark of the file."""


@dataclass(frozen=True, eq=False)
class Cue(Generic[CueT]):
    """Cue of a file, with its references.

    Attributes:
        spot: keys of its place in the file.
        index: index in the file's order.
        act: number of its act; 0 in a score.
        given: entry of the file.
        who: players; in a score, the lane.
        name: name by which times refer to it; "" if none can.
        known: names of its moments.
        before: previous cues of its players.
    """

    spot: Spot
    index: int
    act: int
    given: CueT
    who: tuple[str, ...]
    name: str
    known: tuple[str, ...]
    before: tuple[Cue[CueT], ...] = ()

    @property
    def is_named(self) -> bool:
        """True if the file gives it a name of its own."""
        return self.given.name is not None

    @property
    def times(self) -> list[tuple[Spot, Time]]:
        """Times that its beginning refers to, with their keys."""
        return [((*self.spot, *keys), time) for keys, time in self.given.start_times]


@dataclass(frozen=True, eq=False)
class Timeline(Generic[CueT]):
    """Cues of a script, with their references in time.

    Attributes:
        cues: cues in the file's order.
        acts: (n,) indices of the first cues of the acts, and the number of cues.
        marks: keys of the file's own marks.
        names: reads times, which may contain names.
        refs: keys of a time -> a number of beats, or a reference.
        gos: keys of a cue -> the cue before it in its act that waits for GO.
        beat: duration of a beat [s].
    """

    cues: tuple[Cue[CueT], ...]
    acts: tuple[int, ...]
    marks: tuple[Spot, ...]
    names: Times
    refs: Mapping[Spot, Ref]
    gos: Mapping[Spot, Cue[CueT]]
    beat: float

    def of_act(self, act: int) -> tuple[Cue[CueT], ...]:
        """Cues of an act."""
        return self.cues[self.acts[act] : self.acts[act + 1]]

    def earlier(self, cue: Cue[CueT]) -> tuple[Cue[CueT], ...]:
        """Cues of its act that precede it in the file."""
        return self.cues[self.acts[cue.act] : cue.index]

    def needs(self, cue: Cue[CueT]) -> list[Spot]:
        """Keys of the cues and marks that must be placed before a cue."""
        needs = [before.spot for before in cue.before]
        if cue.given.waits_for_go:
            needs += [earlier.spot for earlier in self.earlier(cue)]
        elif cue.spot in self.gos:
            needs.append(self.gos[cue.spot].spot)
        refs = [self.refs[spot] for spot, _ in cue.times]
        return needs + [ref.spot for ref in refs if isinstance(ref, Reference)]

    def graph(self, act: int | None = None) -> dict[Spot, list[Spot]]:
        """Keys of a cue or a mark -> keys of those before it, in one act or in all."""
        cues = self.cues if act is None else self.of_act(act)
        marks = {
            spot: [ref.spot] if isinstance(ref := self.refs[spot], Reference) else []
            for spot in self.marks
        }
        return marks | {cue.spot: self.needs(cue) for cue in cues}

    def time(self, ref: Ref, start: float, placed: Mapping[Spot, Moments]) -> float:
        """Time of a reference whose cue or mark is placed [s].

        Args:
            ref: number of beats, or reference.
            start: start of the act from which beats count [s].
            placed: moments of placed cues and marks.
        """
        if not isinstance(ref, Reference):
            return start + ref * self.beat
        base = placed[ref.spot][ref.moment]
        return (max(base, start) if ref.in_act else base) + ref.offset * self.beat

    def wanted(self, cue: Cue[CueT], start: float, placed: Mapping[Spot, Moments]) -> float:
        """Wanted time of a cue or its mark in `on` [s]; the end of the cues before by default."""
        times = [self.time(self.refs[spot], start, placed) for spot, _ in cue.times]
        if not times:
            times = [placed[before.spot][END] for before in cue.before if before.act == cue.act]
            times += [start] if len(times) < len(cue.who) else []
        t = max(times) + cue.given.delay * self.beat
        if cue.given.waits_for_go:
            return max([t, start, *(placed[earlier.spot][END] for earlier in self.earlier(cue))])
        go = self.gos.get(cue.spot)
        return t if go is None or cue.times else max(t, placed[go.spot][START])

    def place(
        self,
        act: int,
        start: float,
        placed: dict[Spot, Moments],
        perform: Callable[[Cue[CueT], float], Moments],
        mark: Callable[[Spot, float], float] = lambda spot, t: t,
    ) -> None:
        """Places the cues of an act, in the order of their wanted times.

        Args:
            act: number of the act.
            start: start of the act [s].
            placed: moments of placed cues and marks; those of the act are added.
            perform: places a cue with its wanted time [s], and returns its moments.
            mark: returns the time of a mark of the file, from its written time [s].
        """
        graph, cue_at = self.graph(act), {cue.spot: cue for cue in self.of_act(act)}
        waiting = {
            spot: {need for need in needs if need not in placed}
            for spot, needs in graph.items()
            if spot not in placed
        }
        followers: dict[Spot, list[Spot]] = {}
        for spot, needs in waiting.items():
            for need in needs:
                followers.setdefault(need, []).append(spot)
        marks, cues = list[Spot](), list[tuple[float, int, Spot]]()
        free = [spot for spot, needs in waiting.items() if not needs]
        while free or marks or cues:
            for spot in free:
                if spot in cue_at:
                    cue = cue_at[spot]
                    heappush(cues, (self.wanted(cue, start, placed), cue.index, spot))
                else:
                    marks.append(spot)
            if marks:
                done = marks.pop()
                placed[done] = {"": mark(done, self.time(self.refs[done], 0.0, placed))}
            else:
                t, _, done = heappop(cues)
                placed[done] = perform(cue_at[done], t)
            free = []
            for follower in followers.get(done, ()):
                waiting[follower].discard(done)
                if not waiting[follower]:
                    free.append(follower)


def make_timeline(
    acts: Sequence[Iterable[Cue[CueT]]],
    marks: Mapping[Spot, Time],
    log: ScriptLog,
    special: Callable[[Cue[CueT], Spot, Time], Ref | None] = lambda cue, spot, time: None,
) -> Timeline[CueT]:
    """Timeline of acts of cues; records mistakes in its times.

    Args:
        acts: acts of the script, each with its cues in the file's order.
        marks: keys of a mark of the file -> its time.
        log: collects mistakes.
        special: reads times of cues that refer neither to marks nor to moments of cues by name;
            returns None for all others.
    """
    cues = tuple(cue for act in acts for cue in act)
    names = {str(spot[-1]): spot for spot in marks}
    times = Times(names, cues, log)
    refs: dict[Spot, Ref] = {spot: times.read(time, spot) for spot, time in marks.items()}
    gos, go = dict[Spot, Cue[CueT]](), None
    for cue in cues:
        if go is not None and go.act == cue.act:
            gos[cue.spot] = go
        go = cue if cue.given.waits_for_go else go
        for spot, time in cue.times:
            other = special(cue, spot, time)
            refs[spot] = times.read(time, spot) if other is None else other
        mark = cue.given.mark
        if mark and mark not in cue.known:
            text = f"{cue.name} has no mark {mark!r}{did_you_mean(mark, cue.known)}"
            log.mistakes.add((*cue.spot, "on"), text)
    firsts = [0]
    for act in acts:
        firsts.append(firsts[-1] + len([*act]))
    timeline = Timeline(cues, tuple(firsts), tuple(marks), times, refs, gos, log.beat)
    mistake = circular_wait(timeline.graph(), log.located)
    if mistake is not None:
        log.mistakes.add(*mistake)
    return timeline
