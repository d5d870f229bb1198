"""What is played on a performance on top of what the hands hold: gestures, a take, a score."""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from collections.abc import Collection

import numpy as np

from fantoccini.base import ConfigK, MaskRows, StateError, UnknownNameError, VecK
from fantoccini.motion import State, channel_names, check_same_puppet
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.perform.outside import Steered
from fantoccini.theatre.perform.recording import Recording
from fantoccini.theatre.perform.score_voice import ScoreVoice


class Playing(Steered):
    """A performance on which gestures, a take and a score can be played."""

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that are played, or are about to be."""
        with self._lock:
            return self._player.playing

    def play(
        self, gesture: Gesture, *, after: float | None = None, again: bool = False
    ) -> float:
        """Plays a gesture on top of what the hands hold; returns after how long it begins [s].

        Offsets of several gestures add up. One that moves all that another moves takes over from
        it, and so does one that ends in a place of its own from another that does, as sitting from
        kneeling: position and velocity never jump. A gesture that would pass the hands' bounds is
        played slower.

        Args:
            gesture: of this puppet.
            after: time after which it is to begin, as on a beat [s]; it begins later if the way to
                its start takes longer.
            again: begin again at its end, until :meth:`play_once`.

        Raises:
            StateError: a law moves the hands.
            ValueError: it is of another puppet.
        """
        check_same_puppet([self.marionette.coordinates, gesture.coordinates])
        with self._lock:
            self._refuse_targets()
            player = self._player
            on = None if after is None else player.t + after
            return player.play(gesture, on=on, again=again) - player.t

    def play_once(self, name: str) -> None:
        """Lets a gesture end that begins again and again."""
        with self._lock:
            self._player.once(name)

    def hold(self) -> None:
        """Stops all hands: sets their targets to where they are."""
        with self._lock:
            self._player.clear()
            self._wanted = np.array(self._x.q_K)

    def go_home(self) -> None:
        """Takes back all gestures; where there are none, the hands go to where they began."""
        with self._lock:
            self._refuse_targets()
            if self._player.away:
                self._player.play(Gesture.rest(self.marionette, self.tick))
            else:
                self._wanted = np.array(self._start().q_K)

    @property
    def lanes(self) -> tuple[str, ...]:
        """What can be armed for an overdub: strings and joints with driven coordinates."""
        names = channel_names(self.marionette.coordinates)
        return tuple(dict.fromkeys(name.rsplit(".", 1)[0] for name in names))

    @property
    def take_time(self) -> float | None:
        """How far the take that is played has come [s]; None without one."""
        with self._lock:
            player = self._player
            return None if player.take is None else player.take.time(player.t)

    def play_take(
        self, take: Recording, *, armed: Collection[str] = (), again: bool = False
    ) -> None:
        """Takes the puppet to the start of a take, and moves the hands as the take does.

        With :meth:`record` this is an overdub: armed lanes are in the hands, the others repeat the
        take. At its end the hands stay where they are.

        Args:
            take: of this puppet.
            armed: lanes that the take does not move.
            again: begin again at its end, joined by state, until :meth:`stop_take`.

        Raises:
            StateError: a law moves the hands; or the take turns a driven body by nearly 180
                degrees or more.
            UnknownNameError: no lane is called that.
            ValueError: it is of another puppet.
        """
        check_same_puppet([self.marionette.coordinates, take.marionette.coordinates])
        motion = self._without(Gesture.of_input(take.inputs, name="take"), armed)
        with self._lock:
            self._refuse_targets()
            self._go_to(take.start)
            self._player.play_take(motion, take.start.v_K, again)

    def stop_take(self) -> None:
        """Ends the take; the hands stop where they are."""
        with self._lock:
            self._fold(self._player.stop_take())

    # -- a score -----------------------------------------------------------------------------

    @property
    def score(self) -> ScoreVoice | None:
        """The score that is played or paused, or None."""
        return self._player.score

    def play_score(self, score: Score, *, armed: Collection[str] = ()) -> ScoreVoice:
        """Plays a score from its start, on top of what the hands hold; returns :attr:`score`.

        ::

            live.play_score(fan.load_score(puppet, "number.yaml"))
            live.advance(10.0)
            live.score.conductor.go()       # where it waits
            live.score.running = False      # a pause
            live.score.seek("turn")         # a mark; the way there keeps the bounds

        Args:
            score: of this puppet.
            armed: lanes that the score does not move.

        Raises:
            StateError: a law moves the hands.
            UnknownNameError: no lane is called that.
            ValueError: it is of another puppet.
        """
        check_same_puppet([self.marionette.coordinates, score.gesture.coordinates])
        motion = self._without(score.gesture, armed)
        with self._lock:
            self._refuse_targets()
            return self._player.play_score(score, motion)

    def stop_score(self) -> None:
        """Ends the score: what it moved goes home."""
        with self._lock:
            self._player.stop_score()

    def leave_lanes(self, lanes: Collection[str]) -> None:
        """Leaves lanes of the score that is played to the hands; they stop, the others go on.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane is called that.
        """
        moves = self._moved_by(lanes)
        with self._lock:
            self._refuse_targets()
            self._played_score().leave(moves)

    def lead_back(self, lanes: Collection[str]) -> None:
        """Lets lanes do what the score does, from where the hands are; the way keeps the bounds.

        The hands' own targets are those of the start again.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane is called that.
        """
        moves = self._moved_by(lanes)
        with self._lock:
            self._refuse_targets()
            voice, x, start = self._played_score(), self._x, self._start().q_K
            rate = np.array(x.v_K)
            for _, w in self.marionette.coordinates.quaternions_K:
                rate[w : w + 3] = 0.0  # rates of rotation vectors are others; it stops first
            voice.lead_back(moves, self._hands.away(start, x.q_K), rate)
            names = self.marionette.coordinates.q_K
            back = [name.rsplit(".", 1)[0] in lanes for name in names]
            self._wanted = np.where(back, start, self._wanted)

    # -- inside ------------------------------------------------------------------------------

    def _played_score(self) -> ScoreVoice:
        if self._player.score is None:
            raise StateError("no score is played: play_score begins one")
        return self._player.score

    def _moved_by(self, lanes: Collection[str]) -> MaskRows:
        """(n_vK,) the driven velocities of lanes."""
        for name in lanes:
            if name not in self.lanes:
                raise UnknownNameError("lane", name, list(self.lanes))
        table = self.marionette.coordinates
        found: MaskRows = np.zeros(table.n_vK, dtype=bool)
        for name, (_, v) in channel_names(table).items():
            found[v] |= name.rsplit(".", 1)[0] in lanes
        return found

    def _without(self, motion: Gesture, armed: Collection[str]) -> Gesture:
        """The motion without the lanes that are armed."""
        free: MaskRows = motion.named & ~self._moved_by(armed)
        return dataclasses.replace(
            motion, named=free, coef=motion.coef * free[:, None], travel=motion.travel * free
        )

    @property
    @abstractmethod
    def _x(self) -> State:
        """The state, at the stepper's time."""

    @abstractmethod
    def _start(self) -> State:
        """The state that a reset returns to."""

    @abstractmethod
    def _go_to(self, x: State) -> None:
        """Continues from another state of the puppet, with the hands there."""

    def _aimed(self) -> ConfigK:
        """(n_qK,) targets with what is played on top."""
        player = self._player
        return self._wanted if player.idle else self._hands.moved(self._wanted, player.offsets().d)

    def _fold(self, d: VecK) -> None:
        """Makes offsets part of the targets."""
        if d.any():
            self._wanted = self._hands.moved(self._wanted, d)

    def _velocity(self, x: State) -> VecK:
        """(n_vK,) velocities that targets, and what is played on top of them, want."""
        player = self._player
        if player.idle:
            return self._hands.wanted_velocity(x, self._wanted, self.tick)
        velocity = self._hands.wanted_velocity(x, self._wanted, self.tick, player.step())
        self._fold(player.settle())
        return velocity
