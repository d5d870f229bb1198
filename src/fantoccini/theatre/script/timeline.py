"""Timeline of a script: dependencies between cues, and the order in which they are placed.

A cue is a line of a score or play: a verb with its player and time. A moment is its start or end,
or a mark: a named time of its gesture. `Spot` is the list of keys that leads to an entry of the
file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

from fantoccini.base import did_you_mean
from fantoccini.theatre.script.cues import CueFile
from fantoccini.theatre.script.log import ScriptLog
from fantoccini.theatre.script.times import ResolvedTime, TimeReference, TimeResolver, circular_wait
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
        entry: entry of the file.
        who: players; in a score, the lane.
        name: name by which times refer to it; "" if none can.
        moment_names: names of its moments.
        previous: previous cues of its players.
    """

    spot: Spot
    index: int
    act: int
    entry: CueT
    who: tuple[str, ...]
    name: str
    moment_names: tuple[str, ...]
    previous: tuple[Cue[CueT], ...] = ()

    @property
    def is_named(self) -> bool:
        """True if the file gives it a name of its own."""
        return self.entry.name is not None

    @property
    def times(self) -> list[tuple[Spot, Time]]:
        """Times that its beginning refers to, with their keys."""
        return [((*self.spot, *keys), time) for keys, time in self.entry.start_times]


@dataclass(frozen=True, eq=False)
class Timeline(Generic[CueT]):
    """Cues of a script, with their references in time.

    Attributes:
        cues: cues in the file's order.
        act_bounds: (n,) indices of the first cues of the acts, and the number of cues.
        marks: keys of the file's own marks.
        time_resolver: reads times, which may contain names.
        refs: keys of a time -> a number of beats, or a reference.
        go_cues: keys of a cue -> the cue before it in its act that waits for GO.
        beat: duration of a beat [s].
    """

    cues: tuple[Cue[CueT], ...]
    act_bounds: tuple[int, ...]
    marks: tuple[Spot, ...]
    time_resolver: TimeResolver
    refs: Mapping[Spot, ResolvedTime]
    go_cues: Mapping[Spot, Cue[CueT]]
    beat: float

    def cues_of_act(self, act: int) -> tuple[Cue[CueT], ...]:
        """Cues of an act."""
        return self.cues[self.act_bounds[act] : self.act_bounds[act + 1]]

    def earlier_in_act(self, cue: Cue[CueT]) -> tuple[Cue[CueT], ...]:
        """Cues of its act that precede it in the file."""
        return self.cues[self.act_bounds[cue.act] : cue.index]

    def needs(self, cue: Cue[CueT]) -> list[Spot]:
        """Keys of the cues and marks that must be placed before a cue."""
        needs = [previous.spot for previous in cue.previous]
        if cue.entry.waits_for_go:
            needs += [earlier.spot for earlier in self.earlier_in_act(cue)]
        elif cue.spot in self.go_cues:
            needs.append(self.go_cues[cue.spot].spot)
        refs = [self.refs[spot] for spot, _ in cue.times]
        return needs + [ref.spot for ref in refs if isinstance(ref, TimeReference)]

    def graph(self, act: int | None = None) -> dict[Spot, list[Spot]]:
        """Keys of a cue or a mark -> keys of those before it, in one act or in all."""
        cues = self.cues if act is None else self.cues_of_act(act)
        needs_of_marks = {
            spot: [ref.spot] if isinstance(ref := self.refs[spot], TimeReference) else []
            for spot in self.marks
        }
        return needs_of_marks | {cue.spot: self.needs(cue) for cue in cues}

    def time(self, ref: ResolvedTime, start: float, placed: Mapping[Spot, Moments]) -> float:
        """Time of a reference whose cue or mark is placed [s].

        Args:
            ref: number of beats, or reference.
            start: start of the act from which beats count [s].
            placed: moments of placed cues and marks.
        """
        if not isinstance(ref, TimeReference):
            return start + ref * self.beat
        base = placed[ref.spot][ref.moment]
        return (max(base, start) if ref.in_act else base) + ref.offset * self.beat

    def wanted_time(self, cue: Cue[CueT], start: float, placed: Mapping[Spot, Moments]) -> float:
        """Wanted time of a cue or its mark in `on` [s]; the end of the cues before by default."""
        times = [self.time(self.refs[spot], start, placed) for spot, _ in cue.times]
        if not times:
            times = [
                placed[previous.spot][END] for previous in cue.previous if previous.act == cue.act
            ]
            times += [start] if len(times) < len(cue.who) else []
        t = max(times) + cue.entry.delay * self.beat
        if cue.entry.waits_for_go:
            return max(
                [t, start, *(placed[earlier.spot][END] for earlier in self.earlier_in_act(cue))]
            )
        go_cue = self.go_cues.get(cue.spot)
        return t if go_cue is None or cue.times else max(t, placed[go_cue.spot][START])

    def place(
        self,
        act: int,
        start: float,
        placed: dict[Spot, Moments],
        place_cue: Callable[[Cue[CueT], float], Moments],
        time_of_mark: Callable[[Spot, float], float] = lambda spot, t: t,
    ) -> None:
        """Places the cues of an act, in the order of their wanted times.

        Args:
            act: number of the act.
            start: start of the act [s].
            placed: moments of placed cues and marks; those of the act are added.
            place_cue: places a cue with its wanted time [s], and returns its moments.
            time_of_mark: returns the time of a mark of the file, from its written time [s].
        """
        graph, cue_at = self.graph(act), {cue.spot: cue for cue in self.cues_of_act(act)}
        unplaced_needs = {
            spot: {need for need in needs if need not in placed}
            for spot, needs in graph.items()
            if spot not in placed
        }
        followers: dict[Spot, list[Spot]] = {}
        for spot, needs in unplaced_needs.items():
            for need in needs:
                followers.setdefault(need, []).append(spot)
        marks, cues = list[Spot](), list[tuple[float, int, Spot]]()
        ready = [spot for spot, needs in unplaced_needs.items() if not needs]
        while ready or marks or cues:
            for spot in ready:
                if spot in cue_at:
                    cue = cue_at[spot]
                    heappush(cues, (self.wanted_time(cue, start, placed), cue.index, spot))
                else:
                    marks.append(spot)
            if marks:
                placed_spot = marks.pop()
                placed[placed_spot] = {
                    "": time_of_mark(placed_spot, self.time(self.refs[placed_spot], 0.0, placed))
                }
            else:
                t, _, placed_spot = heappop(cues)
                placed[placed_spot] = place_cue(cue_at[placed_spot], t)
            ready = []
            for follower in followers.get(placed_spot, ()):
                unplaced_needs[follower].discard(placed_spot)
                if not unplaced_needs[follower]:
                    ready.append(follower)


def make_timeline(
    acts: Sequence[Iterable[Cue[CueT]]],
    marks: Mapping[Spot, Time],
    log: ScriptLog,
    read_special: Callable[[Cue[CueT], Spot, Time], ResolvedTime | None] = lambda cue, spot, time: (
        None
    ),
) -> Timeline[CueT]:
    """Timeline of acts of cues; records mistakes in its times.

    Args:
        acts: acts of the script, each with its cues in the file's order.
        marks: keys of a mark of the file -> its time.
        log: collects mistakes.
        read_special: reads times that refer neither to marks nor to moments of cues by name;
            returns None for all others.
    """
    cues = tuple(cue for act in acts for cue in act)
    mark_spots = {str(spot[-1]): spot for spot in marks}
    resolver = TimeResolver(mark_spots, cues, log)
    refs: dict[Spot, ResolvedTime] = {
        spot: resolver.read(time, spot) for spot, time in marks.items()
    }
    go_before, last_go = dict[Spot, Cue[CueT]](), None
    for cue in cues:
        if last_go is not None and last_go.act == cue.act:
            go_before[cue.spot] = last_go
        last_go = cue if cue.entry.waits_for_go else last_go
        for spot, time in cue.times:
            special_ref = read_special(cue, spot, time)
            refs[spot] = resolver.read(time, spot) if special_ref is None else special_ref
        mark = cue.entry.mark
        if mark and mark not in cue.moment_names:
            text = f"{cue.name} has no mark {mark!r}{did_you_mean(mark, cue.moment_names)}"
            log.mistakes.add((*cue.spot, "on"), text)
    first_indices = [0]
    for act in acts:
        first_indices.append(first_indices[-1] + len([*act]))
    timeline = Timeline(
        cues, tuple(first_indices), tuple(marks), resolver, refs, go_before, log.beat
    )
    mistake = circular_wait(timeline.graph(), log.located)
    if mistake is not None:
        log.mistakes.add(*mistake)
    return timeline
