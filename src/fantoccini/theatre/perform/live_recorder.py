"""Recorder of a live performance; a recording may end by itself.

A recording keeps the accelerations acc_K of the driven coordinates, which the hands move, for every
tick, the interval at which the performance advances.
"""

from __future__ import annotations

from fantoccini.base import Array, StateError
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.steppers import Stepper
from fantoccini.theatre.perform.recording import Recorder, Recording


class LiveRecorder:
    """Recorder of successive steppers, which stores the last recording until it is taken.

    Args:
        tick: duration of a tick [s].
        steps_per_tick: time steps in a tick.
    """

    def __init__(self, tick: float, steps_per_tick: int):
        self._tick, self._steps_per_tick = tick, steps_per_tick
        self._recorder: Recorder | None = None
        self._last_recording: tuple[Recording | None, str] | None = None

    @property
    def is_recording(self) -> bool:
        """Whether it records."""
        return self._recorder is not None

    @property
    def is_empty(self) -> bool:
        """Whether it records and has no tick yet."""
        return self._recorder is not None and not len(self._recorder)

    def start(self, marionette: Marionette, stepper: Stepper) -> None:
        """Records from now on; drops a recording that was not taken.

        Args:
            marionette: puppet.
            stepper: stepper of the puppet, not advanced yet.
        """
        self._recorder, self._last_recording = Recorder(marionette, stepper, self._tick), None

    def add(self, acc_K: Array, stepper: Stepper) -> None:
        """Adds the stepper's last tick, if it records.

        Args:
            acc_K: (n_vK,) accelerations of the driven coordinates in that tick.
            stepper: stepper with which recording was started.
        """
        if self._recorder is not None:
            self._recorder.add(acc_K, stepper)

    def end(self, reason: str) -> None:
        """Ends the recording, if there is one, with a reason; empty if the user stops it."""
        if self._recorder is not None:
            self._last_recording = (self._recorder.recording(self._steps_per_tick, reason), reason)
            self._recorder = None

    def take(self) -> Recording:
        """Ends and returns the recording.

        Raises:
            StateError: nothing was recorded.
        """
        self.end("")
        recording, reason = self._last_recording or (None, "")
        self._last_recording = None
        if recording is None:
            raise StateError(f"nothing was recorded{': ' + reason if reason else ''}")
        return recording
