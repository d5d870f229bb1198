"""What is performed on a live page: gestures, takes, a score, the beat, and their sound."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from fantoccini.app.live.instrument import Instrument
from fantoccini.app.live.recorder import Recorder
from fantoccini.app.live.sound import SILENCE, Clip, Heard, Sounds
from fantoccini.app.live.takes import Takes
from fantoccini.app.live.watched_file import WatchedFile
from fantoccini.app.live.worker import Worker
from fantoccini.base import FantocciniError, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures import Score, load_score
from fantoccini.theatre.perform import LivePlay, Osc, Performance, Recording, ScoreVoice


class Stage:
    """A live puppet with everything that can be performed on it.

    Attributes:
        performance: the puppet with hands on its strings.
        instrument: its gestures, and the beat.
        takes: recordings of it.
        recorder: makes them.
        worker: writes and films.
        sounds: what is heard.
        score: that is played, or None.
        show: the play that is performed, or None; its score is then played.
        osc: messages from and to the show, or None.
        armed: lanes that a take or a score leaves to the hands.
        factor: speed of the page's time, 0 while it stands still.

    Args:
        performance: see above.
        folder: for recordings, gestures and films.
        file: the puppet's, with gestures beside it; or None.
        score: file of a score, or None.
        show: a play that is performed, or None.

    Raises:
        FileError: with the mistakes of the score.
    """

    def __init__(
        self,
        performance: Performance,
        folder: Path,
        file: Path | None = None,
        score: Path | None = None,
        show: LivePlay | None = None,
    ):
        self.performance, self._score_file, self.show = performance, score, show
        beside = () if file is None else (file.absolute().parent,)
        self.instrument = Instrument(performance, (*beside, folder))
        self.worker = Worker()
        self.takes = Takes(performance, folder, self.worker)
        self.recorder = Recorder(performance, folder, self._made)
        self.sounds = Sounds(self._heard)
        self.osc: Osc | None = None
        self.armed: set[str] = set()
        self.factor = 1.0
        self._overdubs = False
        self._frame = time.perf_counter()
        self._took: list[Callable[[], None]] = []
        self.score: Score | None = None
        self._read_for = performance.marionette
        self._watched: WatchedFile[Score] | None = None
        if score is not None:
            self._watched = WatchedFile(score, self._read)
            self._take_score(self._read(score))
        elif show is not None:
            self._take_score(show.play.score)

    def on_take(self, do: Callable[[], None]) -> None:
        """Calls something whenever there is a new take."""
        self._took.append(do)

    def replace(self, marionette: Marionette) -> tuple[str, ...]:
        """Continues with a changed puppet, and its score where it was.

        Returns:
            Messages about what could not be kept.

        Raises:
            FantocciniError: the puppet cannot be performed; nothing changes then.
        """
        playing = self.performance.score
        lost = self.performance.replace(marionette)
        return lost + self._reload(playing)

    def _reload(self, playing: ScoreVoice | None) -> tuple[str, ...]:
        """Finds gestures and score for a changed puppet; returns what could not be kept."""
        self.instrument.load()
        self.armed &= set(self.performance.lanes)
        if self._score_file is None:
            return ()
        try:
            self._take_score(load_score(self.performance.marionette, self._score_file))
        except FantocciniError as error:
            self.score = None
            self.performance.stop_score()
            return (str(error),)
        ended = playing is not None and self.performance.score is None
        self._go_on(playing)
        return ("the score goes on where it was",) if ended else ()

    def poll(self, now: float) -> tuple[str, ...] | None:
        """Loads the score again when its file was saved, and goes on with it where it was.

        Returns:
            Its mistakes, once; None where it was not saved.
        """
        reload = None if self._watched is None else self._watched.poll(now)
        if reload is None or self._watched is None:
            return None
        if self._read_for is not self.performance.marionette:
            self._watched.again()  # the puppet was changed meanwhile
            return None
        if reload.made is not None:
            self._take_score(reload.made)
            self._go_on(self.performance.score)
        return reload.mistakes

    def frame(self) -> None:
        """A frame has been drawn: the performance is at its time now."""
        self._frame = time.perf_counter()
        if self._overdubs and self.performance.take_time is None:
            self._overdubs = False
            self.recorder.end()

    def finish(self) -> None:
        """Ends a recording, and waits until everything is written."""
        self.recorder.finish()
        self.worker.finish()
        if self.osc is not None:
            self.osc.stop()

    @property
    def messages(self) -> str:
        """What became of OSC messages; empty without them."""
        return "" if self.osc is None else f"OSC: {self.osc.counts}"

    # -- takes -------------------------------------------------------------------------------

    def record(self) -> None:
        """Starts a recording, or ends and writes it."""
        self._overdubs = False
        if self.recorder.running:
            self.recorder.end()
        else:
            self.recorder.begin()

    def play_take(self, again: bool) -> None:
        """Plays the chosen take, or stops it."""
        if self.performance.take_time is not None:
            self.performance.stop_take()
        else:
            self.takes.play(armed=self.armed, again=again)

    def overdub(self) -> None:
        """Records while the chosen take is played; ends with it, and before by :meth:`record`."""
        if self.recorder.running:
            self.recorder.end()
        self.takes.play(armed=self.armed)
        self.recorder.begin()
        self._overdubs = True

    def _made(self, take: Recording, path: Path) -> None:
        self.takes.add(take, path)
        for do in self._took:
            do()

    # -- the score ---------------------------------------------------------------------------

    def play_score(self) -> None:
        """Plays the score from where it is, or pauses it."""
        self._needed()
        playing = self.performance.score
        if playing is None:
            self._begin()
        elif playing.conductor.done:
            playing.seek(0.0)
            playing.running = True
        else:
            playing.running = not playing.running
        self.sounds.changed()

    def stop_score(self) -> None:
        """Ends the score; what it moved goes home."""
        self.performance.stop_score()
        self.sounds.changed()

    def go(self) -> None:
        """GO: ends a wait of the score; begins the score where it is not played or has ended."""
        self._needed()
        playing = self.performance.score
        if self.show is not None:
            self.show.go()
        elif playing is None or playing.conductor.done:
            playing = playing or self._begin()
            playing.seek(0.0)
            playing.running = True
            wait = playing.conductor.upcoming
            if wait is not None and wait.t <= playing.t:
                playing.conductor.go()
        elif not playing.running:
            playing.running = True
        else:
            playing.conductor.go()
        self.sounds.changed()

    def seek(self, to: float | str) -> None:
        """Goes to a time of the score [s], or to a mark or a wait; without playing, waits there."""
        self._needed()
        playing = self.performance.score or self._begin(running=False)
        playing.seek(to)
        self.sounds.changed()

    def _begin(self, running: bool = True) -> ScoreVoice:
        playing = self.performance.play_score(self._needed(), armed=self.armed)
        playing.running = running
        return playing

    def _go_on(self, before: ScoreVoice | None) -> None:
        """Plays the score from where it was in another reading of it."""
        if before is not None:
            self._begin(before.running).seek(min(before.t, self._needed().duration))

    def _needed(self) -> Score:
        if self.score is None:
            raise StateError("there is no score: fantoccini show PUPPET --score FILE")
        return self.score

    def _read(self, path: Path) -> Score:
        self._read_for = self.performance.marionette
        return load_score(self._read_for, path)

    def _take_score(self, score: Score) -> None:
        clips = [Clip(one.path, one.start, one.gain) for one in score.sounds]
        try:
            self.sounds.load(clips)
        except OSError as error:
            raise StateError(f"{error.filename} cannot be read: {error.strerror}") from None
        self.score = score
        if score.tempo is not None:
            self.instrument.set_tempo(score.tempo)

    # -- sound -------------------------------------------------------------------------------

    def _heard(self) -> Heard:
        """What is heard now; the performance has gone on since the last frame."""
        factor = self.factor
        if not factor:
            return SILENCE
        ahead = (time.perf_counter() - self._frame) * factor
        beat, tempo, t = None, self.instrument.tempo, self.performance.t + ahead
        if self.instrument.metronome:
            at = tempo.next(t)
            beat = (at - t) / factor, tempo.beat / factor, round(tempo.beats(at))
        playing = self.performance.score
        if playing is None or playing.still or factor != 1.0:
            return Heard(beat, None)
        return Heard(beat, playing.t + ahead)
