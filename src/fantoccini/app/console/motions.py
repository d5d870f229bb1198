"""What `--inputs` may name: inputs files, recordings and scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fantoccini.app.console.terminal import say, table, write
from fantoccini.base import Mistake
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input
from fantoccini.theatre.gestures import Late, Rehearsal, Score, load_score, rehearse
from fantoccini.theatre.script import is_score


@dataclass(frozen=True)
class Motion:
    """The motion of a file.

    Attributes:
        inputs: of the hands.
        score: where the file is one.
        rehearsal: where it has been rehearsed.
    """

    inputs: Input
    score: Score | None = None
    rehearsal: Rehearsal | None = None

    @property
    def changes(self) -> tuple[Mistake, ...]:
        """What compiling a score changed."""
        return () if self.score is None else self.score.changes

    @property
    def of_films(self) -> dict[str, Any]:
        """Captions and sounds, as :func:`fantoccini.output.film` takes them."""
        return {} if self.score is None else films_of(self.score)

    def rehearsed(self) -> Motion:
        """The same with the limbs on the beat."""
        if self.score is None:
            return self
        found = rehearse(self.score)
        return Motion(found.inputs, self.score, found)


def motion(marionette: Marionette, path: Path) -> Motion:
    """The inputs in a file.

    Raises:
        FileError: with every mistake in the file.
    """
    if is_score(path):
        score = load_score(marionette, path)
        return Motion(score.inputs(marionette.rest()), score)
    return Motion(Input.load(marionette, path))


def films_of(score: Score) -> dict[str, Any]:
    """A score's captions and sounds, as :func:`fantoccini.output.film` takes them."""
    return {"captions": score.captions, "sounds": score.sounds}


def parts(score: Score) -> list[str]:
    """The waits, sounds and captions of a score, as lines of text."""
    found = []
    for wait in score.waits:
        loop = "" if wait.loop_start is None else f", repeating from {wait.loop_start:.2f} s on"
        found.append(f"live it waits for GO at {wait.name}, {wait.t:.2f} s{loop}")
    for sound in score.sounds:
        gain = "" if sound.gain == 1.0 else f", {sound.gain:g} times as loud"
        found.append(f"{sound.path.name} from {sound.start:.2f} s for {sound.duration:.2f} s{gain}")
    if score.captions:
        n = len(score.captions)
        found.append(f"{n} caption{'s' * (n > 1)}")
    return found


def report_score(score: Score, out: Sequence[Path]) -> None:
    """Prints what a score has beside motion, and which of the outputs lack its sound."""
    for line in parts(score):
        write(line)
    if score.sounds and any(path.suffix.lower() == ".gif" for path in out):
        say("a .gif is silent; an .mp4 has the score's sound")


def report_lateness(found: Rehearsal) -> None:
    """Prints how late limbs are on their marks, as written and as rehearsed."""
    table(
        f"On the beat, after {found.rounds} rounds [ms late]",
        ("lane", "gesture", "mark", "string", "at [s]>", "as written>", "rehearsed>"),
        [
            (
                one.cue.lane,
                one.cue.gesture,
                one.mark,
                one.string,
                f"{one.cue.marks[one.mark]:.2f}",
                _ms(one),
                _ms(now),
            )
            for one, now in zip(found.before, found.late, strict=True)
        ],
    )


def _ms(late: Late) -> str:
    return f"{1e3 * late.seconds:.0f}"
