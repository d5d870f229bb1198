"""Targets of hands: where they are to be, what is played on top of that, or a law instead.

q_K(t) = q_K,held(t) + d(t),   d(t): the sum of what is played
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from fantoccini.base import ConfigK, Quaternion, StateError, Vec3, VecK
from fantoccini.motion import State, check_same_puppet
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.perform.handle import Place
from fantoccini.theatre.perform.hands import Hands
from fantoccini.theatre.perform.influences import Influences
from fantoccini.theatre.perform.lanes import places_of, without
from fantoccini.theatre.perform.player import Player
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.tick_run import TickRun


class Targets:
    """Targets of the hands of a run, with a player on top of them; first, where the hands are.

    Attributes:
        q_K: (n_qK,) targets, without what is played.
        player: gestures, a take and a score.

    Args:
        hands: whose targets they are.
        run: in which they move.
        influences: among them a law that moves the hands instead.
        player: goes on with what it plays; otherwise nothing is played.
    """

    def __init__(
        self, hands: Hands, run: TickRun, influences: Influences, player: Player | None = None
    ):
        self._hands, self._run, self._influences = hands, run, influences
        most = np.array([list(bound.values()) for bound in hands.each()[1:]])
        self.player = player or Player(most, run.tick)
        self.player.bound(most)
        self.q_K: ConfigK = np.array(run.x.q_K)

    def keep(self, before: Targets) -> None:
        """Takes over the targets of coordinates that keep their names."""
        old, new = (own._hands.marionette.coordinates.q_K for own in (before, self))
        places = {name: i for i, name in enumerate(old)}
        for i, name in enumerate(new):
            if name in places:
                self.q_K[i] = before.q_K[places[name]]

    def check_free(self) -> None:
        """Raises StateError while a law moves the hands."""
        if self._influences.law is not None:
            raise StateError("a law moves the hands; they take no targets until let(None)")

    def velocity(self) -> VecK:
        """(n_vK,) velocities that the hands are to have after the next tick, which is played."""
        x, player = self._run.x, self.player
        law = self._influences.law
        if law is not None:
            asked = law.acceleration(x.replace(t=self._run.t))
            self.q_K = np.array(x.q_K)
            return self._hands.bounded(x.v_K + self._run.tick * asked)
        if player.idle:
            return self._hands.wanted_velocity(x, self.q_K, self._run.tick)
        velocity = self._hands.wanted_velocity(x, self.q_K, self._run.tick, player.step())
        self._fold(player.settle())
        return velocity

    # -- hands -------------------------------------------------------------------------------

    def place(self, name: str) -> Place:
        """A handle's position (3,) [m] and orientation (w, x, y, z) in the world."""
        return self._hands.place(name, self._run.x)

    def target(self, name: str) -> Place:
        """A handle's target, as :meth:`place`."""
        return self._hands.place_at(name, self.q_K, self._run.x)

    def aim(self, name: str) -> Place:
        """Where a handle is to be now: its target with what is played on top, as :meth:`place`."""
        aimed = self.q_K
        if not self.player.idle:
            aimed = self._hands.moved(aimed, self.player.offsets().d)
        return self._hands.place_at(name, aimed, self._run.x)

    def move(self, name: str, position: Vec3 | None = None, wxyz: Quaternion | None = None) -> None:
        """Sets the target of a handle; parts that its joint cannot reach are projected away.

        A joint that drives move in part moves as a whole by the handle of its body or string end;
        ``bar.carriage1`` and so on are handles of its parts. A target on a moving body moves with
        the body.

        Args:
            name: of the handle.
            position: (3,) in the world [m]; unchanged when not given.
            wxyz: (4,) orientation in the world; likewise.

        Raises:
            UnknownNameError: no handle is called that.
            StateError: a position or orientation that is none, or a law moves the hands.
        """
        self.check_free()
        self.q_K = self._hands.brought(self.q_K, name, position, wxyz, self._run.x)

    def wind(self, string: str, length: float) -> None:
        """Sets the target length of a driven string [m], clipped to its range.

        Raises:
            UnknownNameError: no string with a driven length is called that.
            StateError: the length is not a finite number, or a law moves the hands.
        """
        self.check_free()
        place = self._hands.length_place(string)
        if not np.isfinite(length):
            raise StateError(f"{string}: found {length}; a length is a finite number")
        self.q_K[place] = np.clip(length, *self._hands.lengths[string])

    def length(self, string: str) -> float:
        """The present length of a driven string [m]."""
        return float(self._run.x.q_K[self._hands.length_place(string)])

    def wanted_length(self, string: str) -> float:
        """The target length of a driven string [m]."""
        return float(self.q_K[self._hands.length_place(string)])

    def hold(self) -> None:
        """Stops all hands: sets their targets to where they are."""
        self.player.clear()
        self.q_K = np.array(self._run.x.q_K)

    # -- what is played on top ---------------------------------------------------------------

    def play(self, gesture: Gesture, *, after: float | None = None, again: bool = False) -> float:
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
        self._check_puppet(gesture)
        self.check_free()
        player = self.player
        on = None if after is None else player.t + after
        return player.play(gesture, on=on, again=again) - player.t

    def play_once(self, name: str) -> None:
        """Lets a gesture end that begins again and again."""
        self.player.once(name)

    def go_home(self, start: State) -> None:
        """Takes back all gestures; where there are none, the hands go to where they began.

        Args:
            start: where they began.

        Raises:
            StateError: a law moves the hands.
        """
        self.check_free()
        if self.player.away:
            self.player.play(Gesture.rest(self._hands.marionette, self._run.tick))
        else:
            self.q_K = np.array(start.q_K)

    def stop_take(self) -> None:
        """Ends the take; the hands stop where they are."""
        self._fold(self.player.stop_take())

    def play_score(self, score: Score, *, armed: Collection[str] = ()) -> ScoreVoice:
        """Plays a score from its start, on top of what the hands hold; returns ``score``.

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
        self._check_puppet(score.gesture)
        motion = without(score.gesture, armed)
        self.check_free()
        return self.player.play_score(score, motion)

    def stop_score(self) -> None:
        """Ends the score: what it moved goes home."""
        self.player.stop_score()

    def leave_lanes(self, lanes: Collection[str]) -> None:
        """Leaves lanes of the score that is played to the hands; they stop, the others go on.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane is called that.
        """
        places = places_of(self._hands.marionette.coordinates, lanes)
        self.check_free()
        self._played_score().leave(places.v)

    def lead_back(self, lanes: Collection[str], start: State) -> None:
        """Lets lanes do what the score does, from where the hands are; the way keeps the bounds.

        Args:
            lanes: which.
            start: has the targets of their hands from now on.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane is called that.
        """
        table, x = self._hands.marionette.coordinates, self._run.x
        places = places_of(table, lanes)
        self.check_free()
        rate = np.array(x.v_K)
        for _, w in table.quaternions_K:
            rate[w : w + 3] = 0.0  # rates of rotation vectors are others; it stops first
        away = self._hands.away(start.q_K, x.q_K)
        self._played_score().lead_back(places.v, away, rate)
        self.q_K = np.where(places.q, start.q_K, self.q_K)

    # -- inside ------------------------------------------------------------------------------

    def _check_puppet(self, gesture: Gesture) -> None:
        check_same_puppet([self._hands.marionette.coordinates, gesture.coordinates])

    def _played_score(self) -> ScoreVoice:
        if self.player.score is None:
            raise StateError("no score is played: play_score begins one")
        return self.player.score

    def _fold(self, d: VecK) -> None:
        """Makes offsets part of the targets."""
        if d.any():
            self.q_K = self._hands.moved(self.q_K, d)
