"""Times in scores and plays: a number, or the name of a mark or of a cue's moment, and an offset.

t = (mark or moment) + offset * beat

A mark is a named time of a gesture or score, and a moment the start, the end or a mark of a cue. A
spot is the list of keys that leads to an entry of the file. Mistakes of the file are recorded in a
log.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Protocol

from fantoccini.base import did_you_mean
from fantoccini.base.documents import NAME, Located, shown
from fantoccini.theatre.script.log import ScriptLog
from fantoccini.theatre.script.values import Spot, Time

_OFFSET = r"(?: *([-+]) *(\d+\.?\d*|\.\d+))?"
_NON_GREEDY_NAME = NAME.replace("{0,63}", "{0,63}?")
# A dash may belong to a name or begin an offset: the longest known name has precedence.
_PATTERNS = [
    re.compile(rf"({name})(?:\.({name}(?: \d+)?))?{_OFFSET}", re.ASCII)
    for name in (NAME, _NON_GREEDY_NAME)
]


class CueWithMoments(Protocol):
    """A cue to which times may refer."""

    @property
    def spot(self) -> Spot:
        """Path of the cue's keys in the file."""

    @property
    def name(self) -> str:
        """Name of the cue in times; "" if it has none."""

    @property
    def is_named(self) -> bool:
        """Whether the file names the cue with the key `name`."""

    @property
    def moment_names(self) -> tuple[str, ...]:
        """Names of the cue's moments, such as ``start``."""


@dataclass(frozen=True)
class TimeReference:
    """A time by name.

    Attributes:
        spot: keys of the mark or the cue.
        moment: moment of the cue; "" for a mark.
        offset: offset [beats].
        in_act: whether to use the start of the present act if the time is in an earlier one.
    """

    spot: Spot
    moment: str
    offset: float
    in_act: bool = False


ResolvedTime = float | TimeReference
"""A number of beats, or a time by name."""


class TimeResolver:
    """Resolver of the names in the times of a script, or of one of its phrases.

    Args:
        marks: mark of the file -> its keys.
        cues: cues of the script or the phrase.
        log: collects mistakes.
    """

    def __init__(self, marks: Mapping[str, Spot], cues: Iterable[CueWithMoments], log: ScriptLog):
        self._marks, self._log = marks, log
        self._cues: dict[str, list[CueWithMoments]] = {}
        self._named_cues: dict[str, CueWithMoments] = {}
        for cue in cues:
            if not cue.is_named:
                if cue.name:
                    self._cues.setdefault(cue.name, []).append(cue)
            elif cue.name in self._named_cues or cue.name in marks:
                text = f"another cue or mark is called {cue.name!r}; needed: a name of its own"
                log.mistakes.add((*cue.spot, "name"), text)
            else:
                self._named_cues[cue.name] = cue

    def read(self, time: Time, spot: Spot) -> ResolvedTime:
        """Resolves a time of the file to a number [beats] or a reference; 0 after a mistake."""
        if not isinstance(time, str):
            return time
        matches = [match for pattern in _PATTERNS if (match := pattern.fullmatch(time.strip()))]
        if not matches:
            self._record_unknown(spot, time, "")
            return 0.0
        names = {*self._marks, *self._named_cues, *self._cues}
        match = next((candidate for candidate in matches if candidate[1] in names), matches[-1])
        # `wave.end-1` is a beat before the end, unless wave has a moment called `end-1`.
        cues = (
            [self._named_cues[match[1]]]
            if match[1] in self._named_cues
            else self._cues.get(match[1], [])
        )
        if match[2] and not any(match[2] in cue.moment_names for cue in cues):
            match = next(
                (
                    candidate
                    for candidate in matches
                    if candidate[1] == match[1]
                    and any(candidate[2] in cue.moment_names for cue in cues)
                ),
                match,
            )
        name, moment = match[1], match[2]
        offset = float(match[4] or 0.0) * (-1.0 if match[3] == "-" else 1.0)
        if moment is None and name in self._marks:
            return TimeReference(self._marks[name], "", offset)
        if name not in self._named_cues and name not in self._cues:
            self._record_unknown(spot, time, name if moment is None else f"{name}.{moment}")
            return 0.0
        cue = self._unique_cue(name, spot)
        if cue is None:
            return 0.0
        if moment is None:
            text = f"found {shown(time)}; needed: which moment of {name}, as in {name}."
            self._log.mistakes.add(spot, f"{text}{cue.moment_names[0]}")
        elif moment not in cue.moment_names:
            text = f"{name} has no mark {moment!r}{did_you_mean(moment, cue.moment_names)}"
            self._log.mistakes.add(spot, text)
        else:
            return TimeReference(cue.spot, moment, offset)
        return 0.0

    def _unique_cue(self, name: str, spot: Spot) -> CueWithMoments | None:
        """The only cue of a name; None after a mistake."""
        if name in self._named_cues:
            return self._named_cues[name]
        first, *others = self._cues[name]
        if not others:
            return first
        lines = [str(self._log.located.line(cue.spot)) for cue in (first, *others)]
        text = f"{len(lines)} cues play {name!r}, on lines {', '.join(lines)}; give one of them "
        self._log.mistakes.add(spot, text + "a `name`, and use it here")
        return None

    def _record_unknown(self, spot: Spot, time: str, name: str) -> None:
        moments = [
            f"{cue.name}.{moment}"
            for cue in (
                *self._named_cues.values(),
                *(cue for cues_of_name in self._cues.values() for cue in cues_of_name),
            )
            for moment in cue.moment_names
        ]
        text = f"found {shown(time)}; needed: a time, a mark, or a moment of a cue, with an offset"
        self._log.mistakes.add(spot, text + did_you_mean(name or time, [*self._marks, *moments]))


def circular_wait(needs: Mapping[Spot, list[Spot]], located: Located) -> tuple[Spot, str] | None:
    """Mistake of cues and marks that wait for each other in a circle; None if there is an order.

    Args:
        needs: keys of a cue or mark -> keys of those before it.
        located: finder of keys' lines in the file.
    """
    try:
        TopologicalSorter(needs).prepare()
    except CycleError as error:
        cycle = error.args[1][:-1]
    else:
        return None
    first_spot = min(cycle, key=lambda spot: located.line(spot) or 0)
    other_spots = [spot for spot in cycle if spot != first_spot]
    if not other_spots:
        return first_spot, "waits for itself"
    others_text = ", ".join(
        f"{located.problem(spot, '').key} (line {located.line(spot)})" for spot in other_spots
    )
    return first_spot, f"waits for itself, by way of {others_text}"
