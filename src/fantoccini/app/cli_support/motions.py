"""Motions from the files of `--inputs`: inputs files, recordings and scores.

A score times gestures of a puppet; a cue is a line of it, a lane a list of cues in order, and a
mark a named time of a gesture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fantoccini.app.cli_support.terminal import print_message, print_output, print_table
from fantoccini.base import Mistake
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input
from fantoccini.theatre.gestures import LimbLateness, Rehearsal, Score, load_score, rehearse
from fantoccini.theatre.script import is_score


@dataclass(frozen=True)
class FileMotion:
    """Motion from a file.

    Attributes:
        inputs: inputs of the driven coordinates.
        score: the score, if the file is one.
        rehearsal: the rehearsal, if the score has been rehearsed.
    """

    inputs: Input
    score: Score | None = None
    rehearsal: Rehearsal | None = None

    @property
    def changes(self) -> tuple[Mistake, ...]:
        """Changes that compiling the score made."""
        return () if self.score is None else self.score.changes

    @property
    def film_options(self) -> dict[str, Any]:
        """Captions and sounds, as arguments of :func:`fantoccini.output.film`."""
        return {} if self.score is None else film_options(self.score)

    def rehearsed(self) -> FileMotion:
        """The motion, rehearsed until the limbs are on the beat."""
        if self.score is None:
            return self
        rehearsal = rehearse(self.score)
        return FileMotion(rehearsal.inputs, self.score, rehearsal)


def load_motion(marionette: Marionette, path: Path) -> FileMotion:
    """Reads the inputs of a file.

    Raises:
        FileError: the file has mistakes; lists all of them.
    """
    if is_score(path):
        score = load_score(marionette, path)
        return FileMotion(score.inputs(marionette.rest()), score)
    return FileMotion(Input.load(marionette, path))


def film_options(score: Score) -> dict[str, Any]:
    """Captions and sounds of a score, as arguments of :func:`fantoccini.output.film`."""
    return {"captions": score.captions, "sounds": score.sounds}


def score_lines(score: Score) -> list[str]:
    """Lines of text about the waits, sounds and captions of a score."""
    lines = []
    for wait in score.waits:
        loop = "" if wait.loop_start is None else f", repeating from {wait.loop_start:.2f} s"
        lines.append(f"performed live, it waits for GO at {wait.name}, {wait.t:.2f} s{loop}")
    for sound in score.sounds:
        gain = "" if sound.gain == 1.0 else f", {sound.gain:g} times as loud"
        lines.append(f"{sound.path.name} from {sound.start:.2f} s for {sound.duration:.2f} s{gain}")
    if score.captions:
        n = len(score.captions)
        lines.append(f"{n} caption{'s' * (n > 1)}")
    return lines


def report_score(score: Score, out: Sequence[Path]) -> None:
    """Prints waits, sounds and captions of a score, and whether an output is silent."""
    for line in score_lines(score):
        print_output(line)
    if score.sounds and any(path.suffix.lower() == ".gif" for path in out):
        print_message("a .gif is silent; an .mp4 has the score's sound")


def report_lateness(rehearsal: Rehearsal) -> None:
    """Prints the delays of limbs at their marks, as written and as rehearsed."""
    print_table(
        f"Delays at the marks, after {rehearsal.rounds} rounds [ms]",
        ("lane", "gesture", "mark", "string", "at [s]>", "as written>", "rehearsed>"),
        [
            (
                before.cue.lane,
                before.cue.gesture,
                before.mark,
                before.string,
                f"{before.cue.marks[before.mark]:.2f}",
                _ms_text(before),
                _ms_text(after),
            )
            for before, after in zip(
                rehearsal.initial_lateness, rehearsal.final_lateness, strict=True
            )
        ],
    )


def _ms_text(late: LimbLateness) -> str:
    return f"{1e3 * late.seconds:.0f}"
