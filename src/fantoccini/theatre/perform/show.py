"""Live performance of a play, cue by cue.

A cue is a line of the play: a verb with its player and time. A lane is a list of gestures in order.
In names, K stands for driven coordinates: ends and lengths of strings, driven joints. A tick is the
interval at which a performance advances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import StateError, UnknownNameError
from fantoccini.motion import State
from fantoccini.theatre.gestures import Wait
from fantoccini.theatre.perform.performance import Performance
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.steady import Steadying
from fantoccini.theatre.plays import CueOfPlay, Play

_BOUND_SHARES = np.array([[0.5], [0.25]])
"""Shares of the bounds of speed and acceleration for transitions to a cue; with the full bounds
puppets would swing for long."""
_TIME_TOLERANCE = 1e-6
"""Interval within which cues count as simultaneous [s]."""


@dataclass(frozen=True)
class ShowEvent:
    """Event of a show.

    Attributes:
        kind: ``act``, ``wait``, or ``start`` or ``end`` of a cue.
        name: name of the act, the wait or the cue.
        number: number of the cue; 0 for the other kinds.
        t: time in the play [s].
    """

    kind: str
    name: str
    number: int
    t: float


class LivePlay:
    """Play that is performed live: the hands follow the compiled motion, directed by commands.

    ::

        show = fan.theatre.LivePlay(fan.load_play("bows.yaml"))
        show.go()                # begins
        show.advance(2.0)
        show.take("pierrot")     # the others play on
        show.give("pierrot")
        show.skip()

    In every tick the hands move from their present places towards those of the play, within the
    stage's bounds, whatever has pushed them away.

    Attributes:
        play: compiled play.
        performance: simulated stage with its hands.
        taken: players whose hands follow targets instead of the play.
        steady: shifts the hands against swing; None for no shifts.
        message: last refusal or event, in words.

    Args:
        play: play that is performed.
    """

    def __init__(self, play: Play):
        self.play = play
        stage = play.cast.file.stage
        speed, acceleration = _hand_peaks(play)
        self.performance = Performance(
            play.marionette,
            play.x0,
            speed=max(stage.speed, speed),
            acceleration=max(stage.acceleration, acceleration),
        )
        self.taken: frozenset[str] = frozenset()
        self.message = ""
        self.steady: Steadying | None = Steadying(play, self.performance)
        playable = (cue for cue in play.cues if not cue.refused)
        self._playable_cues = tuple(sorted(playable, key=lambda cue: cue.start))
        self._listeners: list[Callable[[ShowEvent], None]] = []
        self._playing_numbers: tuple[int, ...] = ()
        self._act_name, self._wait_name, self._halted = "", "", False

    def __repr__(self) -> str:
        return f"<LivePlay of {self.play.name!r} at {self.t:.2f} s>"

    def listen(self, callback: Callable[[ShowEvent], None]) -> None:
        """Adds a callback for events, called in the tick in which they happen."""
        self._listeners.append(callback)

    # -- state -------------------------------------------------------------------------------

    @property
    def voice(self) -> ScoreVoice | None:
        """Motion of the play; None before the first GO, and after a reset."""
        return self.performance.score

    @property
    def t(self) -> float:
        """Time in the play [s]."""
        return 0.0 if self.voice is None else self.voice.t

    @property
    def is_held(self) -> bool:
        """Whether it is held."""
        return self.voice is not None and not self.voice.running

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.voice is not None and self.voice.conductor.done

    @property
    def waiting(self) -> Wait | None:
        """Wait that GO would end."""
        return None if self.voice is None else self.voice.conductor.waiting

    @property
    def playing_cues(self) -> tuple[CueOfPlay, ...]:
        """Cues that are being played."""
        return tuple(self.play.cues[number - 1] for number in self._playing_numbers)

    @property
    def latest_cue(self) -> CueOfPlay | None:
        """Cue that began last."""
        begun_cues = [
            cue for cue in self._playable_cues if cue.start < self._reference_time - _TIME_TOLERANCE
        ]
        return begun_cues[-1] if begun_cues else None

    @property
    def next_cue(self) -> CueOfPlay | None:
        """Target of :meth:`skip`: the first cue after the present or waiting one."""
        t, wait = self._reference_time, self.waiting
        if wait is not None:
            t = max(t, self._cue_of(wait).start)
        return next((cue for cue in self._playable_cues if cue.start > t + _TIME_TOLERANCE), None)

    @property
    def standing_by(self) -> CueOfPlay | None:
        """Cue that GO begins, now or at its time; None after the last one."""
        if self.voice is None:
            return self._playable_cues[0] if self._playable_cues else None
        wait = self.voice.conductor.upcoming
        return None if wait is None else self._cue_of(wait)

    @property
    def released(self) -> bool:
        """Whether GO has been given already for the cue that stands by."""
        return self.voice is not None and self.voice.conductor.released

    # -- directing ---------------------------------------------------------------------------

    def go(self) -> None:
        """Begins the play, continues it after a hold, or begins the next cue that waits for GO.

        An early GO is stored: the play does not stop at the wait. A second GO before that wait is
        refused, with a :attr:`message`.
        """
        voice = self.voice
        if voice is None or voice.conductor.done:
            voice = self._begin()
            if voice.conductor.upcoming is not None and voice.conductor.upcoming.t <= voice.t:
                voice.conductor.go()
        elif not voice.running:
            self.resume()
        else:
            cue = self.standing_by
            if voice.conductor.go(np.inf):
                early = voice.conductor.released and cue is not None
                self.message = f"GO is kept for {_cue_in_words(cue)}" if early and cue else ""
            elif cue is None:
                self.message = "GO is refused: no cue waits any more"
            else:
                self.message = f"GO is refused: it has been given for {_cue_in_words(cue)} already"

    def hold(self) -> None:
        """Pauses the play; the hands come to rest within 0.3 s."""
        if self.voice is not None:
            self.voice.running = False
            self.message = "held"

    def resume(self) -> None:
        """Continues after :meth:`hold` or :meth:`panic`."""
        voice = self.voice
        if voice is None:
            return
        if self._halted:
            self._lead_back([name for name in self.play.cast.players if name not in self.taken])
        voice.running, self._halted, self.message = True, False, ""

    def skip(self) -> None:
        """Goes to the beginning of the next cue; if it waits for GO, the play waits there."""
        cue = self.next_cue
        if cue is None:
            self.message = "skip is refused: this is the last cue"
        else:
            self._seek(cue, begin=False)

    def repeat(self) -> None:
        """Goes to the beginning of the present cue, and plays it again."""
        cue = self.latest_cue
        if cue is None:
            self.message = "repeat is refused: no cue has begun"
        else:
            self._seek(cue, begin=True)

    def start(self, number: int) -> None:
        """Goes to the beginning of a cue, and plays it without waiting for GO.

        Raises:
            StateError: there is no such cue, or it cannot be done.
        """
        cues = self.play.cues
        if not 1 <= number <= len(cues):
            raise StateError(f"found cue {number}; {self.play.name} has cues 1 to {len(cues)}")
        cue = cues[number - 1]
        if cue.refused:
            raise StateError(f"cue {number} cannot be done: {cue.refused}")
        self._seek(cue, begin=True)

    def take(self, who: str) -> None:
        """Releases a player from the play: its strings stop, and its hands follow targets.

        Raises:
            UnknownNameError: no player has this name.
        """
        lanes = self._lanes(who)
        if self.voice is not None:
            self.performance.leave_lanes(lanes)
            self._end_shifts([who])
        self.taken |= {who}
        self.message = f"{who} is in your hands"

    def give(self, who: str) -> None:
        """Returns a player to the play: its hands move to their places in it.

        Raises:
            UnknownNameError: no player has this name.
        """
        self._lanes(who)
        self.taken -= {who}
        if self.voice is not None and not self._halted:
            self._lead_back([who])
        self.message = f"{who} plays on"

    def panic(self) -> None:
        """Stops all hands as fast as their bounds allow; :meth:`resume` or GO continues."""
        if self.voice is not None:
            self.voice.halt()
            self._end_shifts(list(self.play.cast.players))
            self._halted = True
        self.message = "all hands have stopped"

    def reset(self) -> None:
        """Returns to the start, before the first GO."""
        self.performance.reset()
        self.taken, self._playing_numbers, self._act_name, self._wait_name = frozenset(), (), "", ""
        self._halted, self.message = False, ""

    # -- time --------------------------------------------------------------------------------

    def advance(self, duration: float) -> State:
        """Advances by the whole ticks in a duration [s]; the remainder is added to the next."""
        remaining = float(duration)
        while True:
            step = min(remaining, self.performance.tick)
            if self.steady is not None and self.voice is not None:
                self.steady.update(self.voice, self.performance.state, self.taken)
            x = self.performance.advance(step)
            self._report_events()
            remaining -= step
            if remaining <= 0.0:
                return x

    # -- internal ----------------------------------------------------------------------------

    @property
    def _reference_time(self) -> float:
        """Time in the play; during a transition to a cue, just after the cue's beginning [s]."""
        voice = self.voice
        is_leading = voice is not None and voice.is_leading and voice.conductor.waiting is None
        return self.t + 2.0 * _TIME_TOLERANCE * is_leading

    def _begin(self) -> ScoreVoice:
        """Begins the play."""
        voice = self.performance.play_score(self.play.score)
        voice.bound_shares = _BOUND_SHARES
        self._halted, self.message = False, ""
        self._lead_back([name for name in self.play.cast.players if name not in self.taken])
        for name in self.taken:
            self.performance.leave_lanes(self._lanes(name))
        return voice

    def _seek(self, cue: CueOfPlay, begin: bool) -> None:
        """Moves to the beginning of a cue; ``begin``: without waiting for GO."""
        voice = self.voice or self._begin()
        if self._halted:
            self.resume()
        wait = next(
            (score_wait for score_wait in self.play.score.waits if self._cue_of(score_wait) is cue),
            None,
        )
        voice.seek(cue.start if begin or wait is None else wait.t)
        if begin:
            voice.running = True
            if voice.conductor.waiting is not None:
                voice.conductor.go()
        self.message = f"to {_cue_in_words(cue)}"

    def _lanes(self, who: str) -> list[str]:
        """Lanes of a player."""
        cast = self.play.cast
        if who not in cast.players:
            raise UnknownNameError("player", who, list(cast.players))
        prefix = cast.prefix(who)
        return [lane for lane in self.performance.lanes if lane.startswith(prefix)]

    def _lead_back(self, players: list[str]) -> None:
        self.performance.lead_back([lane for who in players for lane in self._lanes(who)])

    def _end_shifts(self, players: list[str]) -> None:
        """Ends the shifts of players' hands, when they stop."""
        if self.steady is not None:
            for who in players:
                self.steady.end_shift(who)

    def _cue_of(self, wait: Wait) -> CueOfPlay:
        """Cue that a wait precedes."""
        return self.play.cues[int(wait.name.split()[-1]) - 1]

    def _report_events(self) -> None:
        """Reports the events of a tick."""
        voice = self.voice
        if voice is None:
            self._playing_numbers, self._act_name, self._wait_name = (), "", ""
            return
        t = voice.t
        if not voice.is_leading:
            begun_acts = [name for name, start in self.play.acts.items() if start <= t]
            if begun_acts and begun_acts[-1] != self._act_name:
                self._act_name = begun_acts[-1]
                self._report("act", self._act_name)
        playing_numbers = self._current_cues(voice)
        for number in self._playing_numbers:
            if number not in playing_numbers:
                self._report("end", self.play.cues[number - 1].name, number)
        for number in playing_numbers:
            if number not in self._playing_numbers:
                self._report("start", self.play.cues[number - 1].name, number)
        self._playing_numbers = playing_numbers
        wait = voice.conductor.waiting
        name = "" if wait is None or voice.is_leading else wait.name
        if name and name != self._wait_name:
            self._report("wait", name)
        self._wait_name = name

    def _current_cues(self, voice: ScoreVoice) -> tuple[int, ...]:
        """Numbers of the cues that are being played."""
        if voice.is_leading or voice.conductor.done:
            return ()
        wait, t = voice.conductor.waiting, voice.t
        waiting_cue = None if wait is None else self._cue_of(wait)
        return tuple(
            cue.number
            for cue in self._playable_cues
            if cue.start < t < max(cue.end, cue.start + _TIME_TOLERANCE) and cue is not waiting_cue
        )

    def _report(self, kind: str, name: str, number: int = 0) -> None:
        """Calls the callbacks with an event."""
        for callback in self._listeners:
            callback(ShowEvent(kind, name, number, self.t))


def _cue_in_words(cue: CueOfPlay) -> str:
    return f"cue {cue.number} ({cue.description})"


def _hand_peaks(play: Play) -> tuple[float, float]:
    """Largest speed [m/s] and acceleration [m/s^2] of a hand in the play.

    A hand moves along three axes, each of which may use the stage's bound.
    """
    peaks = play.score.gesture.peaks_of_pieces**2
    hand_of_coordinate = np.array(
        [name.rsplit(".", 1)[0] for name in play.marionette.coordinates.v_K]
    )
    squared_peaks = [
        np.sum(peaks[:, :, hand_of_coordinate == hand], axis=2).max(axis=0)
        for hand in np.unique(hand_of_coordinate)
    ]
    speed, acceleration = np.sqrt(np.max(squared_peaks, axis=0))
    return float(speed), float(acceleration)
