"""Scores: gestures of a puppet in lanes, on beats; compiled to one motion of its hands.

    q_K(t) = q_K0 + sum over lanes of d_lane(t)
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import FileError, Mistake, StateError, UnknownNameError, nearest
from fantoccini.gestures.gesture import Gesture
from fantoccini.gestures.gesture_file import gesture_names, load_gesture
from fantoccini.gestures.joining import Line
from fantoccini.gestures.score_file import CueFile, ScoreFile, Time
from fantoccini.gestures.transition import limits
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.puppet.located import Located, read_file, validate
from fantoccini.puppet.values import NAME

_MARK = re.compile(rf"({NAME})(?: *([-+]) *(\d+\.?\d*|\.\d+))?", re.ASCII)
_LATE = 1e-6
"""Lateness that is told [s]."""
_ROUNDING = 1e-3
"""Share of a bound by which the estimate of a peak may pass it."""

Spot = tuple[str | int, ...]


@dataclass(frozen=True)
class Caption:
    """Words from one time to another [s]."""

    start: float
    end: float
    text: str


@dataclass(frozen=True)
class Played:
    """A gesture as it is played.

    Attributes:
        lane, gesture: names.
        start, end: [s].
        marks: of the gesture -> time [s].
    """

    lane: str
    gesture: str
    start: float
    end: float
    marks: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Score:
    """A score, compiled. Made by :func:`load_score`; true where all is as it was written.

    Attributes:
        marionette: the puppet.
        gesture: all lanes together.
        cues: what is played when.
        marks: name -> time [s].
        captions: words and their times.
        beat: duration of a beat [s]; 1 where times are in seconds.
        changes: what is not as it was written, and why, with file and line.
        name: of the score.
    """

    marionette: Marionette
    gesture: Gesture
    cues: tuple[Played, ...]
    marks: Mapping[str, float]
    captions: tuple[Caption, ...]
    beat: float
    changes: tuple[Mistake, ...] = ()
    name: str = ""
    speed: float | Mapping[str, float] = field(default=1.0, repr=False)
    acceleration: float | Mapping[str, float] = field(default=6.0, repr=False)

    def __bool__(self) -> bool:
        return not self.changes

    def __repr__(self) -> str:
        changed = f", {len(self.changes)} changes" if self.changes else ""
        return f"<Score {self.name!r}: {self.duration:g} s, {len(self.cues)} gestures{changed}>"

    @property
    def duration(self) -> float:
        """[s]."""
        return self.gesture.duration

    def inputs(self, x0: State) -> Input:
        """The motion of the hands from a state at rest on; the score's time 0 is the state's."""
        made = self.gesture.inputs(x0, speed=self.speed, acceleration=self.acceleration)
        return made.called(self.name)


def load_score(marionette: Marionette, path: str | os.PathLike[str]) -> Score:
    """Reads and compiles a score file.

    Where a gesture cannot begin in time, because the way to its start takes longer within the
    bounds, it begins late, and :attr:`Score.changes` says so. They also say where lanes together
    or gestures by themselves pass a bound.

    Args:
        marionette: who performs it.
        path: of the file.

    Raises:
        FileError: with every mistake found and its location.
    """
    located = read_file(path)
    file = validate(ScoreFile, located)
    return _Compiler(marionette, file, located).score()


def is_score(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a score: YAML with the key `score`."""
    if not os.fspath(path).lower().endswith((".yaml", ".yml")):
        return False
    try:
        data = read_file(path).data
    except (FileError, OSError):
        return False
    return isinstance(data, dict) and "score" in data


class _Compiler:
    """Compiles one score file."""

    def __init__(self, marionette: Marionette, file: ScoreFile, located: Located):
        self._marionette, self._file, self._located = marionette, file, located
        self._table, self._start = marionette.coordinates, marionette.rest()
        self._beat = 1.0 if file.tempo is None else 60.0 / file.tempo
        self._found: list[tuple[Spot, str]] = []
        self._changes: list[Mistake] = []
        self._loaded: dict[str, Gesture] = {}
        self._spots: list[Spot] = []  # of the cues

    def score(self) -> Score:
        """The score.

        Raises:
            FileError: it has mistakes.
        """
        file = self._file
        try:
            most = limits(self._table, file.speed, file.acceleration)
        except UnknownNameError as error:
            raise self._located.error([(("speed",), str(error))], FileError) from None
        lines, cues = [], list[Played]()
        for lane, given in file.lanes.items():
            line = self._lane(lane, given, most, cues)
            if line is not None:
                lines.append(line)
        captions = tuple(self._caption(i) for i in range(len(file.captions)))
        self._refuse()
        last = max((line.end for line in lines), default=0.0)
        end = max(last, (file.duration or 0.0) * self._beat, self._beat)
        whole: Gesture | None = None
        for line in lines:
            line.hold(end)
            one = Gesture(self._table, *line.motion)
            whole = one if whole is None else whole + one
        if whole is None:
            whole = Gesture.rest(self._table, end, everything=False)
        self._check(whole, most, cues)
        marks = {name: t * self._beat for name, t in file.marks.items()}
        return Score(
            self._marionette, whole.called(file.score), tuple(cues), marks, captions, self._beat,
            tuple(self._changes), file.score, file.speed, file.acceleration,
        )  # fmt: skip

    def _lane(
        self, lane: str, given: tuple[CueFile, ...], most: Array, cues: list[Played]
    ) -> Line | None:
        line, before = Line(most), ""
        for i, cue in enumerate(given):
            spot: Spot = ("lanes", lane, i)
            gesture = self._gesture(cue, spot)
            wanted = None if gesture is None else self._begins(cue, gesture, spot)
            if self._found or gesture is None:
                continue
            try:
                whole = gesture.repeated(
                    cue.repeat, speed=self._file.speed, acceleration=self._file.acceleration
                )
            except StateError as error:
                self._found.append((spot, str(error)))
                continue
            lead = line.lead_time(whole.motion)
            if wanted is not None and wanted > line.end + lead:
                if np.any(line.rate != 0.0):
                    line.stop()
                    lead = line.lead_time(whole.motion)
                line.hold(wanted - lead)
            begun = line.add(whole.motion)
            if wanted is not None and begun > wanted + _LATE:
                after = f" after {before}" if before else ""
                self._change(
                    spot, f"{whole.name} begins {self._said(begun)} instead of "
                    f"{self._said(wanted)}: the way there takes {lead:.2f} s{after}",
                )  # fmt: skip
            before = whole.name
            marks = {name: begun + t for name, t in whole.marks.items()}
            cues.append(Played(lane, whole.name, begun, line.end, marks))
            self._spots.append(spot)
        if self._found:
            return None
        if np.any(line.rate != 0.0):
            line.stop()
        return line

    def _gesture(self, cue: CueFile, spot: Spot) -> Gesture | None:
        """The cue's gesture once, as it is changed; None after a mistake."""
        if cue.gesture not in self._loaded:
            beside = self._located.beside(cue.gesture)
            if beside is None and cue.gesture not in gesture_names():
                text = "no gesture file in this one's folder, and no bundled gesture, is called "
                near = nearest(cue.gesture, gesture_names())
                self._found.append(((*spot, "gesture"), f"{text}{cue.gesture!r}{near}"))
                return None
            try:
                self._loaded[cue.gesture] = load_gesture(
                    self._marionette, beside or cue.gesture, self._start
                )
            except FileError as error:
                self._found += [((*spot, "gesture"), str(one)) for one in error.mistakes]
                return None
        made = self._loaded[cue.gesture]
        try:
            made = made.mirrored() if cue.mirrored else made
        except UnknownNameError as error:
            self._found.append(((*spot, "mirrored"), str(error)))
            return None
        made = made.scaled(cue.larger).faster(cue.faster)
        return made if cue.lasts is None else made.lasting(cue.lasts * self._beat)

    def _begins(self, cue: CueFile, gesture: Gesture, spot: Spot) -> float | None:
        """When a cue is to begin [s]; None where it follows the one before."""
        if cue.at is not None:
            return self._time(cue.at, (*spot, "at"))
        if cue.on is None:
            return None
        ((mark, time),) = cue.on.items()
        at = self._time(time, (*spot, "on", mark))
        if mark not in gesture.marks:
            text = f"{gesture.name} has no mark {mark!r}{nearest(mark, gesture.marks)}"
            self._found.append(((*spot, "on"), text))
            return None
        begins = at - gesture.marks[mark]
        if begins < 0.0:
            text = f"{gesture.name} would begin {-begins:.2f} s before the score"
            self._found.append(((*spot, "on", mark), text))
        return max(begins, 0.0)

    def _time(self, given: Time, spot: Spot) -> float:
        """A time of the file [s]; 0 after a mistake."""
        if not isinstance(given, str):
            return given * self._beat
        match = _MARK.fullmatch(given.strip())
        if match is None or match[1] not in self._file.marks:
            text = f"found {given!r}; needed: a time, or a mark of this score with an offset"
            self._found.append((spot, text + nearest(given, self._file.marks)))
            return 0.0
        offset = float(match[3] or 0.0) * (-1.0 if match[2] == "-" else 1.0)
        at = (self._file.marks[match[1]] + offset) * self._beat
        if at < 0.0:
            self._found.append((spot, f"found {given!r}, {-at:.2f} s before the score"))
        return max(at, 0.0)

    def _caption(self, i: int) -> Caption:
        given = self._file.captions[i]
        start = self._time(given.at, ("captions", i, "at"))
        end = self._time(given.until, ("captions", i, "until"))
        if not end > start and not self._found:
            text = f"ends {self._said(end)} and begins {self._said(start)}"
            self._found.append((("captions", i), text))
        return Caption(start, end, given.text)

    def _check(self, whole: Gesture, most: Array, cues: list[Played]) -> None:
        """Notes where a speed or an acceleration passes its bound."""
        for v, name in enumerate(self._table.v_K):
            for row, (what, unit) in enumerate((("moves at", "m/s"), ("changes by", "m/s^2"))):
                size, t = whole.peak(v, row)
                if size <= most[row, v] * (1.0 + _ROUNDING):
                    continue
                playing = [i for i, cue in enumerate(cues) if cue.start <= t <= cue.end]
                spot = self._spots[playing[0]] if playing else ("lanes",)
                self._change(
                    spot, f"{name} {what} {size:.3g} {unit} {self._said(t)}; the bound is "
                    f"{most[row, v]:.3g}: play it smaller or slower",
                )  # fmt: skip

    def _said(self, t: float) -> str:
        if self._file.tempo is None:
            return f"at {t:.2f} s"
        return f"on beat {t / self._beat:.2f} ({t:.2f} s)"

    def _change(self, spot: Spot, text: str) -> None:
        self._changes.append(self._located.problem(spot, text))

    def _refuse(self) -> None:
        if self._found:
            raise self._located.error(self._found, FileError)
