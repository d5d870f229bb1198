"""Targets of hands: held positions plus played offsets; or a control law moves the hands.

q_K(t) = q_K,held(t) + d(t),   d(t): sum of the gestures, the take and the score

q_K are the driven coordinates that the hands move, with the velocities v_K. A handle is a driven
string end, or a body on a driven joint; a take is a recording for editing. A lane is here a string
or joint with its driven coordinates. A tick is the interval at which a performance advances.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from fantoccini.base import ConfigK, Quaternion, StateError, Vec3, VecK
from fantoccini.motion import State, check_same_puppet
from fantoccini.theatre.gestures import Gesture, Score
from fantoccini.theatre.perform.handle import HandlePose
from fantoccini.theatre.perform.hands import Hands
from fantoccini.theatre.perform.influences import Influences
from fantoccini.theatre.perform.lanes import lane_masks, without_lanes
from fantoccini.theatre.perform.player import MotionPlayer
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.tick_run import TickRun


class Targets:
    """Targets of the hands of a run, initially their positions, and a player that adds offsets.

    Attributes:
        q_K: (n_qK,) targets, without the offsets of the player.
        player: player of gestures, a take and a score.

    Args:
        hands: hands whose targets they are.
        run: run in which the hands move.
        influences: influences on the run; a control law among them moves the hands instead.
        player: player of an earlier run, to continue; by default nothing is played.
    """

    def __init__(
        self, hands: Hands, run: TickRun, influences: Influences, player: MotionPlayer | None = None
    ):
        self._hands, self._run, self._influences = hands, run, influences
        bounds = np.array([list(bound.values()) for bound in hands.coordinate_bounds()[1:]])
        self.player = player or MotionPlayer(bounds, run.tick)
        self.player.set_bounds(bounds)
        self.q_K: ConfigK = np.array(run.x.q_K)

    def copy_targets(self, earlier: Targets) -> None:
        """Takes over the earlier targets of all coordinates that exist in both puppets."""
        old_names, new_names = (
            targets._hands.marionette.coordinates.q_K for targets in (earlier, self)
        )
        old_index = {name: i for i, name in enumerate(old_names)}
        for i, name in enumerate(new_names):
            if name in old_index:
                self.q_K[i] = earlier.q_K[old_index[name]]

    def check_no_law(self) -> None:
        """Raises StateError while a law moves the hands."""
        if self._influences.law is not None:
            raise StateError("a law moves the hands; they take no targets until set_hand_law(None)")

    def velocity(self) -> VecK:
        """(n_vK,) wanted velocities after the next tick; advances the player by this tick."""
        x, player = self._run.x, self.player
        law = self._influences.law
        if law is not None:
            acceleration = law.acceleration(x.replace(t=self._run.t))
            self.q_K = np.array(x.q_K)
            return self._hands.bounded_velocity(x.v_K + self._run.tick * acceleration)
        if player.is_idle:
            return self._hands.wanted_velocity(x, self.q_K, self._run.tick)
        velocity = self._hands.wanted_velocity(x, self.q_K, self._run.tick, player.step())
        self._add_to_targets(player.settle())
        return velocity

    # -- hands -------------------------------------------------------------------------------

    def place(self, name: str) -> HandlePose:
        """Position (3,) [m] and orientation (w, x, y, z) of a handle in the world."""
        return self._hands.place(name, self._run.x)

    def target(self, name: str) -> HandlePose:
        """Target of a handle, in the form of :meth:`place`."""
        return self._hands.place_at(name, self.q_K, self._run.x)

    def aim(self, name: str) -> HandlePose:
        """Target of a handle plus the player's present offsets, in the form of :meth:`place`."""
        q_K = self.q_K
        if not self.player.is_idle:
            q_K = self._hands.with_offsets(q_K, self.player.offsets().d)
        return self._hands.place_at(name, q_K, self._run.x)

    def move(self, name: str, position: Vec3 | None = None, wxyz: Quaternion | None = None) -> None:
        """Sets the target of a handle; components that its joint cannot reach are projected away.

        A joint with several drives has a handle for the whole, that of its body or string end, and
        one for each part (``bar.carriage1``). A target on a moving body moves with it.

        Args:
            name: name of the handle.
            position: (3,) position in the world [m]; unchanged by default.
            wxyz: (4,) orientation in the world; unchanged by default.

        Raises:
            UnknownNameError: no handle has this name.
            StateError: a position or orientation is invalid, or a law moves the hands.
        """
        self.check_no_law()
        self.q_K = self._hands.configuration_at(self.q_K, name, position, wxyz, self._run.x)

    def wind(self, string: str, length: float) -> None:
        """Sets the target length of a driven string [m], clipped to its range.

        Raises:
            UnknownNameError: no string with a driven length has this name.
            StateError: the length is not a finite number, or a law moves the hands.
        """
        self.check_no_law()
        index = self._hands.length_index(string)
        if not np.isfinite(length):
            raise StateError(f"{string}: found {length}; a length is a finite number")
        self.q_K[index] = np.clip(length, *self._hands.lengths[string])

    def length(self, string: str) -> float:
        """Present length of a driven string [m]."""
        return float(self._run.x.q_K[self._hands.length_index(string)])

    def target_length(self, string: str) -> float:
        """Target length of a driven string [m]."""
        return float(self.q_K[self._hands.length_index(string)])

    def hold(self) -> None:
        """Stops all hands: sets their targets to their present places."""
        self.player.clear()
        self.q_K = np.array(self._run.x.q_K)

    # -- gestures, takes and scores ----------------------------------------------------------

    def play(self, gesture: Gesture, *, after: float | None = None, repeat: bool = False) -> float:
        """Plays a gesture on top of the held positions; returns the time until it begins [s].

        Offsets of several gestures add up. A gesture that moves all coordinates of another
        replaces it, and so does one that ends in a place of its own if the other one does, such as
        sitting after kneeling: position and velocity are continuous. A gesture that would exceed
        the hands' bounds is played slower.

        Args:
            gesture: gesture of this puppet.
            after: time after which it should begin, for instance on a beat [s]; it begins later if
                the way to its start takes longer.
            repeat: whether to repeat it, until :meth:`stop_repeating`.

        Raises:
            StateError: a law moves the hands.
            ValueError: the gesture is of another puppet.
        """
        self._check_puppet(gesture)
        self.check_no_law()
        player = self.player
        wanted_start = None if after is None else player.t + after
        return player.play(gesture, wanted_start=wanted_start, repeat=repeat) - player.t

    def stop_repeating(self, name: str) -> None:
        """Ends the repetition of a gesture after the present round."""
        self.player.finish(name)

    def go_home(self, start: State) -> None:
        """Moves the hands back from all gestures; if there are none, back to their start.

        Args:
            start: start state of the hands.

        Raises:
            StateError: a law moves the hands.
        """
        self.check_no_law()
        if self.player.is_away:
            self.player.play(Gesture.rest(self._hands.marionette, self._run.tick))
        else:
            self.q_K = np.array(start.q_K)

    def stop_take(self) -> None:
        """Ends the take; the hands stop where they are."""
        self._add_to_targets(self.player.stop_take())

    def play_score(self, score: Score, *, armed: Collection[str] = ()) -> ScoreVoice:
        """Plays a score from its start, on top of the held positions; returns ``player.score``.

        ::

            live.play_score(fan.load_score(puppet, "number.yaml"))
            live.advance(10.0)
            live.score.conductor.go()       # continues at a wait
            live.score.running = False      # pauses
            live.score.seek("turn")         # moves to a mark, within the bounds

        Args:
            score: score of this puppet.
            armed: lanes that the score does not move, because the hands will record them.

        Raises:
            StateError: a law moves the hands.
            UnknownNameError: no lane has this name.
            ValueError: the score is of another puppet.
        """
        self._check_puppet(score.gesture)
        motion = without_lanes(score.gesture, armed)
        self.check_no_law()
        return self.player.play_score(score, motion)

    def stop_score(self) -> None:
        """Ends the score: its coordinates return home."""
        self.player.stop_score()

    def leave_lanes(self, lanes: Collection[str]) -> None:
        """Leaves lanes of the score to the hands, which stop; other lanes are played further.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane has this name.
        """
        masks = lane_masks(self._hands.marionette.coordinates, lanes)
        self.check_no_law()
        self._current_score().leave(masks.v)

    def lead_back(self, lanes: Collection[str], start: State) -> None:
        """Moves lanes from the hands' present positions back to the score's motion, within bounds.

        Args:
            lanes: names of the lanes.
            start: state whose q_K are the targets of their hands when they are back.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane has this name.
        """
        table, x = self._hands.marionette.coordinates, self._run.x
        masks = lane_masks(table, lanes)
        self.check_no_law()
        rates = np.array(x.v_K)
        for _, v_index in table.quaternions_K:
            rates[v_index : v_index + 3] = (
                0.0  # rotations begin at rest: v_K is not the rate of a rotation vector
            )
        offset = self._hands.displacement(start.q_K, x.q_K)
        self._current_score().lead_back(masks.v, offset, rates)
        self.q_K = np.where(masks.q, start.q_K, self.q_K)

    # -- inside ------------------------------------------------------------------------------

    def _check_puppet(self, gesture: Gesture) -> None:
        check_same_puppet([self._hands.marionette.coordinates, gesture.coordinates])

    def _current_score(self) -> ScoreVoice:
        if self.player.score is None:
            raise StateError("no score is played: play_score begins one")
        return self.player.score

    def _add_to_targets(self, d: VecK) -> None:
        """Adds offsets to the targets."""
        if d.any():
            self.q_K = self._hands.with_offsets(self.q_K, d)
