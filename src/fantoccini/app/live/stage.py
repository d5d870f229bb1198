"""Performance on a live page: gestures, takes, a score, the beat, and their sound.

A gesture is a short motion of strings, a score a list of them in time, and a take a recording for
editing.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from fantoccini.app.live.gesture_player import GesturePlayer
from fantoccini.app.live.recorder import Recorder
from fantoccini.app.live.sound import SILENCE, SoundClip, Sounds, SoundState
from fantoccini.app.live.takes import Takes
from fantoccini.app.live.watched_file import WatchedFile
from fantoccini.app.live.worker import Worker
from fantoccini.base import FantocciniError, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.theatre.gestures import Score, load_score
from fantoccini.theatre.perform import LivePlay, Osc, Performance, Recording, ScoreVoice


class Stage:
    """Live puppet with everything that viewers can perform.

    Attributes:
        performance: the puppet with hands on its strings.
        gesture_player: its gestures, and the beat.
        takes: recordings of it.
        recorder: recorder of takes.
        worker: thread that writes files and films.
        sounds: sounds of the page.
        score: score that is played, or None.
        live_play: play that is performed, or None; its score is then played.
        osc: OSC connection of the play, or None.
        armed: lanes that a take or a score leaves to the hands.
        time_factor: speed of the page's time, 0 while it stands still.

    Args:
        performance: see above.
        folder: folder for recordings, gestures and films.
        file: the puppet's file, with gestures beside it; or None.
        score: file of a score, or None.
        live_play: play to perform, or None.

    Raises:
        FileError: the score has mistakes.
    """

    def __init__(
        self,
        performance: Performance,
        folder: Path,
        file: Path | None = None,
        score: Path | None = None,
        live_play: LivePlay | None = None,
    ):
        self.performance, self._score_file, self.live_play = performance, score, live_play
        file_folders = () if file is None else (file.absolute().parent,)
        self.gesture_player = GesturePlayer(performance, (*file_folders, folder))
        self.worker = Worker()
        self.takes = Takes(performance, folder, self.worker)
        self.recorder = Recorder(performance, folder, self._add_take)
        self.sounds = Sounds(self._sound_state)
        self.osc: Osc | None = None
        self.armed: set[str] = set()
        self.time_factor = 1.0
        self._overdubbing = False
        self._frame_time = time.perf_counter()
        self._on_take: list[Callable[[], None]] = []
        self.score: Score | None = None
        self._score_marionette = performance.marionette
        self._watched: WatchedFile[Score] | None = None
        if score is not None:
            self._watched = WatchedFile(score, self._read_score)
            self._adopt_score(self._read_score(score))
        elif live_play is not None:
            self._adopt_score(live_play.play.score)

    def on_take(self, callback: Callable[[], None]) -> None:
        """Registers a callback for new takes."""
        self._on_take.append(callback)

    def replace(self, marionette: Marionette) -> tuple[str, ...]:
        """Continues with a changed puppet, and with its score where it was.

        Returns:
            Messages about what could not be kept.

        Raises:
            FantocciniError: the puppet cannot be performed; then nothing changes.
        """
        voice = self.performance.score
        losses = self.performance.replace(marionette)
        return losses + self._reload(voice)

    def _reload(self, voice: ScoreVoice | None) -> tuple[str, ...]:
        """Loads gestures and score for a changed puppet; returns messages about losses."""
        self.gesture_player.load()
        self.armed &= set(self.performance.lanes)
        if self._score_file is None:
            return ()
        try:
            self._adopt_score(load_score(self.performance.marionette, self._score_file))
        except FantocciniError as error:
            self.score = None
            self.performance.stop_score()
            return (str(error),)
        ended = voice is not None and self.performance.score is None
        self._resume_score(voice)
        return ("the score continues where it was",) if ended else ()

    def poll(self, now: float) -> tuple[str, ...] | None:
        """Loads the score again when its file has changed, and continues where it was.

        Returns:
            The mistakes of a changed file, once; otherwise None.
        """
        reloaded = None if self._watched is None else self._watched.poll(now)
        if reloaded is None or self._watched is None:
            return None
        if self._score_marionette is not self.performance.marionette:
            self._watched.force_reload()  # the puppet has changed meanwhile
            return None
        if reloaded.content is not None:
            self._adopt_score(reloaded.content)
            self._resume_score(self.performance.score)
        return reloaded.mistakes

    def mark_frame(self) -> None:
        """Reports that a frame has been drawn, at the performance's current time."""
        self._frame_time = time.perf_counter()
        if self._overdubbing and self.performance.take_time is None:
            self._overdubbing = False
            self.recorder.end()

    def finish(self) -> None:
        """Ends a recording, and waits until everything is written."""
        self.recorder.finish()
        self.worker.finish()
        if self.osc is not None:
            self.osc.stop()

    @property
    def messages(self) -> str:
        """Counts of OSC messages; empty without OSC."""
        return "" if self.osc is None else f"OSC: {self.osc.counts}"

    # -- takes -------------------------------------------------------------------------------

    def record(self) -> None:
        """Starts a recording, or ends and writes it."""
        self._overdubbing = False
        if self.recorder.running:
            self.recorder.end()
        else:
            self.recorder.begin()

    def play_take(self, repeat: bool) -> None:
        """Plays the chosen take, or stops it."""
        if self.performance.take_time is not None:
            self.performance.stop_take()
        else:
            self.takes.play(armed=self.armed, repeat=repeat)

    def overdub(self) -> None:
        """Records while the chosen take is played, until its end or :meth:`record`."""
        if self.recorder.running:
            self.recorder.end()
        self.takes.play(armed=self.armed)
        self.recorder.begin()
        self._overdubbing = True

    def _add_take(self, take: Recording, path: Path) -> None:
        self.takes.add(take, path)
        for callback in self._on_take:
            callback()

    # -- the score ---------------------------------------------------------------------------

    def play_score(self) -> None:
        """Plays the score from its current time, or pauses it."""
        self._score_or_error()
        voice = self.performance.score
        if voice is None:
            self._begin()
        elif voice.conductor.done:
            voice.seek(0.0)
            voice.running = True
        else:
            voice.running = not voice.running
        self.sounds.changed()

    def stop_score(self) -> None:
        """Ends the score; its hands go home."""
        self.performance.stop_score()
        self.sounds.changed()

    def go(self) -> None:
        """GO: ends a wait of the score, or begins the score if it is not playing."""
        self._score_or_error()
        voice = self.performance.score
        if self.live_play is not None:
            self.live_play.go()
        elif voice is None or voice.conductor.done:
            voice = voice or self._begin()
            voice.seek(0.0)
            voice.running = True
            wait = voice.conductor.upcoming
            if wait is not None and wait.t <= voice.t:
                voice.conductor.go()
        elif not voice.running:
            voice.running = True
        else:
            voice.conductor.go()
        self.sounds.changed()

    def seek(self, target: float | str) -> None:
        """Goes to a time of the score [s], a mark or a wait, and waits there if not playing."""
        self._score_or_error()
        voice = self.performance.score or self._begin(running=False)
        voice.seek(target)
        self.sounds.changed()

    def _begin(self, running: bool = True) -> ScoreVoice:
        voice = self.performance.play_score(self._score_or_error(), armed=self.armed)
        voice.running = running
        return voice

    def _resume_score(self, voice: ScoreVoice | None) -> None:
        """Continues a score that has been read again where it was."""
        if voice is not None:
            self._begin(voice.running).seek(min(voice.t, self._score_or_error().duration))

    def _score_or_error(self) -> Score:
        if self.score is None:
            raise StateError("there is no score: fantoccini show PUPPET --score FILE")
        return self.score

    def _read_score(self, path: Path) -> Score:
        self._score_marionette = self.performance.marionette
        return load_score(self._score_marionette, path)

    def _adopt_score(self, score: Score) -> None:
        clips = [SoundClip(sound.path, sound.start, sound.gain) for sound in score.sounds]
        try:
            self.sounds.load(clips)
        except OSError as error:
            raise StateError(f"{error.filename} cannot be read: {error.strerror}") from None
        self.score = score
        if score.tempo is not None:
            self.gesture_player.set_tempo(score.tempo)

    # -- sound -------------------------------------------------------------------------------

    def _sound_state(self) -> SoundState:
        """State of the sounds now; the performance has advanced since the last frame."""
        time_factor = self.time_factor
        if not time_factor:
            return SILENCE
        elapsed = (time.perf_counter() - self._frame_time) * time_factor
        beat, tempo, t = None, self.gesture_player.tempo, self.performance.t + elapsed
        if self.gesture_player.metronome:
            next_beat = tempo.next_beat_time(t)
            beat = (
                (next_beat - t) / time_factor,
                tempo.beat / time_factor,
                round(tempo.beat_number(next_beat)),
            )
        voice = self.performance.score
        if voice is None or voice.is_still or time_factor != 1.0:
            return SoundState(beat, None)
        return SoundState(beat, voice.t + elapsed)
