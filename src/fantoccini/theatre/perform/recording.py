"""Recordings of performances: the motion of the hands, tick by tick, and the trajectory.

q_K are the driven coordinates, which the hands move, and acc_K their accelerations. A tick is the
interval at which a performance advances. In names, D stands for dynamic coordinates, which move by
the equations of motion.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, Status, Times, check_positive, floats, frozen, npz
from fantoccini.dynamics.compiled import MethodName
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import trajectory_of_samples, with_verdict
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import Piece
from fantoccini.motion import RECORDING_FORMATS, Input, State, Trajectory
from fantoccini.theatre.perform import archive, state_transfer
from fantoccini.theatre.perform.archive import RecordedOutput, ReferenceSamples
from fantoccini.theatre.perform.looping import return_motion
from fantoccini.theatre.perform.smoothing import smoothed

METHOD: MethodName = "timestepping"
_ACCUMULATED_PARTS = ("work", "damping", "impact", "slip_loss", "friction")
"""Parts of a sample that accumulate from the start of a run [J]."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded performance, which can be repeated to the last bit.

    It consists of a start state and the hands' accelerations over n ticks. ``trajectory`` is the
    recorded one; that of an edited recording is simulated.

    Attributes:
        marionette: puppet with the winches of the performance.
        start: start state, at t = 0.
        acc_K: (n, n_vK) accelerations of the driven coordinates, constant over each tick
            [m/s^2 or rad/s^2]; for a rotation, of its rotation vector.
        tick: duration of a tick [s].
        steps: number of time steps in a tick.
        end_reason: reason why it ended by itself; empty if the user stopped it.
        output: recorded output; None if it must be simulated.
        references: samples of a file, to compare with the simulated output; None without a file.
    """

    marionette: Marionette
    start: State
    acc_K: Array
    tick: float
    steps: int
    end_reason: str = ""
    output: RecordedOutput | None = field(default=None, repr=False)
    references: ReferenceSamples | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "acc_K", frozen(self.acc_K))
        shape = (len(self.acc_K), self.marionette.coordinates.n_vK)
        if self.acc_K.shape != shape or not len(self.acc_K):
            raise ValueError(f"acc_K has the shape {self.acc_K.shape}; it must be (n, {shape[1]})")
        if not np.isfinite(self.acc_K).all():
            raise ValueError("acc_K holds a number that is not finite")
        if not (0.0 < floats(self.tick) < np.inf and self.steps >= 1):
            raise ValueError(f"found {self.steps} steps in ticks of {self.tick} s")

    def __repr__(self) -> str:
        return f"<Recording {self.marionette.name}: {self.duration:g} s, {len(self)} ticks>"

    def __len__(self) -> int:
        """Number of ticks."""
        return len(self.acc_K)

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return len(self) * self.tick

    @property
    def dt(self) -> float:
        """Step of the time-stepper [s]."""
        return self.tick / self.steps

    @property
    def times(self) -> Times:
        """(n + 1,) times of the ticks [s]."""
        return self.start.t + self.tick * np.arange(len(self) + 1, dtype=float)

    @cached_property
    def inputs(self) -> Input:
        """Motion of the hands, for ``simulate(recording.marionette, recording.start, ...)``."""
        x = self.start
        return Input.segments(self.marionette, self.times, x.q_K, x.v_K, self.acc_K)

    @cached_property
    def trajectory(self) -> Trajectory:
        """Recorded trajectory, one sample per tick; :meth:`replay` of an edited recording.

        Its status is checked as that of :func:`simulate`, by the samples.

        The trajectory of a file is simulated again, with the same bits on the same machine. On a
        machine with other rounding, each second is simulated from the recorded state.
        """
        return self._trajectory_of(self._output())

    def replay(self) -> Trajectory:
        """Trajectory of a new simulation of the performance: the same bits on the same machine.

        An edited recording may end early, with a status.
        """
        return self._trajectory_of(self._simulated())

    def trimmed(self, begin: float, end: float) -> Recording:
        """Part from ``begin`` to ``end`` [s] after the start; its start is the state at ``begin``.

        The time-stepper starts without memory of earlier steps.

        Raises:
            ValueError: the times are not in order, or not inside.
        """
        if not 0.0 <= begin < end <= self.duration * (1.0 + 1e-9):
            raise ValueError(
                f"found {begin} s to {end} s; it must be a part of 0 s to {self.duration:g} s"
            )
        trajectory = self.trajectory
        first_tick, last_tick = (round(t / self.tick) for t in (begin, end))
        last_tick = min(last_tick, len(trajectory) - 1)
        if last_tick <= first_tick:
            raise ValueError(f"there is no tick of {self.tick:g} s from {begin} s to {end} s")
        start = self.start
        if first_tick:
            start = state_transfer.feasible_state(
                self.marionette, trajectory.state(first_tick).replace(t=0.0)
            )
        return self.edited(start=start, acc_K=self.acc_K[first_tick:last_tick])

    def smoothed(self, seconds: float) -> Recording:
        """Copy with the hands' paths averaged over about ``seconds``, except at start and end.

        The puppet is simulated again, under the smoothed motion of the hands.
        """
        return self.edited(acc_K=smoothed(self.inputs, len(self), self.tick, seconds))

    def stretched(self, factor: float) -> Recording:
        """Copy ``factor`` times as long: the same paths of the hands, at 1/factor of the velocity.

        The acceleration of q_K(t / factor) is 1/factor^2 times the original one.
        """
        check_positive(factor=factor)
        x = self.start
        return self.edited(
            start=x.replace(v_D=x.v_D / factor, v_K=x.v_K / factor),
            acc_K=self.acc_K / factor / factor,
            tick=self.tick * factor,
            steps=max(1, math.ceil(self.steps * factor - 1e-9)),
        )

    def looped(self, count: int) -> Recording:
        """Copy repeated several times; in between, the hands return to the start.

        Their return is C^1 and within bounds. The puppet follows the hands, and keeps its swing.

        Raises:
            ValueError: ``count`` is not a whole number from 1 to 1000.
            StateError: no return keeps the default bounds of gestures.
        """
        if not isinstance(count, int) or not 1 <= count <= 1000:
            raise ValueError(f"count is {count!r}; it must be a whole number from 1 to 1000")
        x, inputs = self.start, self.inputs
        q = inputs.evaluate(inputs.end)[0]
        # An input is at rest from its end on; take the velocity just before.
        v = inputs.evaluate(np.nextafter(inputs.end, 0.0))[1]
        motion_back = return_motion(inputs.coordinates, (q, v), (x.q_K, x.v_K), self.tick)
        repetition = np.concatenate([motion_back, self.acc_K])
        return self.edited(acc_K=np.concatenate([self.acc_K, *[repetition] * (count - 1)]))

    def edited(self, **changes: Any) -> Recording:
        """Copy with changed fields, which is simulated again."""
        return dataclasses.replace(self, output=None, references=None, end_reason="", **changes)

    def save(self, path: str | Path) -> None:
        """Writes an npz file that contains everything, with the puppet.

        A minute of the marionette takes some 0.9 MB. An existing file is replaced as a whole.
        """
        complete = self.with_output()
        archive.save(
            {f.name: getattr(complete, f.name) for f in dataclasses.fields(complete)}, path
        )

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Recording of a file that :meth:`save` wrote.

        Raises:
            FileError: the file is damaged or not a recording.
        """
        with npz.opened(path, RECORDING_FORMATS, "a recording") as (arrays, metadata):
            return cls(**archive.fields_of(arrays, metadata))

    # -- internal ----------------------------------------------------------------------------

    def with_output(self) -> Recording:
        """The recording with its output, simulated if necessary."""
        if self.output is not None:
            return self
        return dataclasses.replace(self, output=self._output())

    def _output(self) -> RecordedOutput:
        """Output as recorded, or simulated again and compared with the samples of a file."""
        if self.output is not None:
            return self.output
        output, references = self._simulated(), self.references
        if references is None:
            return output
        samples = output.piece.samples
        last_tick = references.ticks[-1]
        if len(samples) > last_tick and np.array_equal(
            samples[references.ticks], references.samples
        ):
            return output
        return self._in_parts(references)

    def _simulated(self, start: State | None = None, ticks: slice = slice(None)) -> RecordedOutput:
        options = self.marionette.run_options(dt=self.dt, save_every=self.steps)
        x = self.start if start is None else start
        stepper = Stepper(self.marionette, x, METHOD, options)
        recorder = Recorder(self.marionette, stepper, self.tick)
        for acc_K in self.acc_K[ticks]:
            stepper.advance(self.tick, acc_K, throw=False)
            if not stepper.arrived:
                break
            recorder.add(acc_K, stepper)
        return recorder.output_so_far(stepper.reported)

    def _in_parts(self, references: ReferenceSamples) -> RecordedOutput:
        """Output from each saved sample to the next, simulated from the first of the two."""
        layout, parts = self.marionette.sample_layout, list[Piece]()
        for index, (first_tick, last_tick) in enumerate(pairwise(references.ticks.tolist())):
            state = state_transfer.feasible_state(
                self.marionette, layout.state(references.samples[index])
            )
            part = self._simulated(state, slice(first_tick, last_tick))
            samples, _, contacts = part.piece
            # Work and losses continue from those of the sample.
            for name in _ACCUMULATED_PARTS:
                samples[:, layout.columns[name]] += references.samples[index, layout.columns[name]]
            if part.status is Status.DONE:
                samples[-1] = references.samples[index + 1]
            if index:  # begins with the last sample of the part before
                samples = samples[1:]
                contacts = contacts[contacts[:, 0] > 0.0] - np.eye(1, contacts.shape[1])
            parts.append(Piece(samples, part.piece.events, contacts))
            if part.status is not Status.DONE:
                return RecordedOutput(Piece.joined(parts), part.status)
        return RecordedOutput(Piece.joined(parts), references.status)

    def _trajectory_of(self, output: RecordedOutput) -> Trajectory:
        run = trajectory_of_samples(
            self.marionette,
            output.piece,
            output.status,
            METHOD,
            with_effort=True,
            attribution=np.zeros(len(self.marionette.tree.attributable)),
        )
        return with_verdict(self.marionette, run, self.dt)


class Recorder:
    """Collector of the output of a stepper, from its start.

    Args:
        marionette: puppet.
        stepper: stepper of the puppet, not advanced yet.
        tick: duration of a tick [s].
    """

    def __init__(self, marionette: Marionette, stepper: Stepper, tick: float):
        self._marionette = marionette
        self._start, self._tick = stepper.state, tick
        self._output = [_last_sample(stepper)]
        self._acc_K: list[Array] = []
        self._status = Status.DONE

    def __len__(self) -> int:
        return len(self._acc_K)

    def add(self, acc_K: Array, stepper: Stepper) -> None:
        """Adds the stepper's last tick."""
        self._acc_K.append(acc_K)
        self._output.append(_last_sample(stepper))
        self._status = stepper.reported

    def output_so_far(self, status: Status | None = None) -> RecordedOutput:
        """Output so far, with the status of the last tick by default."""
        status = self._status if status is None else status
        return RecordedOutput(Piece.joined(self._output), status)

    def recording(self, steps: int, end_reason: str) -> Recording | None:
        """Recording of all ticks; None without a tick."""
        if not self._acc_K:
            return None
        acc_K = np.array(self._acc_K)
        fields = self._marionette, self._start, acc_K, self._tick, steps, end_reason
        return Recording(*fields, self.output_so_far())


def _last_sample(stepper: Stepper) -> Piece:
    """Last sample of a tick, its contact points, and the tick's events."""
    contacts = stepper.contacts[stepper.contacts[:, 0] == len(stepper.samples) - 1].copy()
    contacts[:, 0] = 0.0
    return Piece(stepper.samples[-1:], stepper.events, contacts)
