"""Runs of a batch of steppers by methods without lanes: a stepper for each run, on threads.

Lanes are runs that the vector unit of the processor advances together. acc_K are the accelerations
of the driven coordinates. In names, D stands for dynamic coordinates, which move by the equations
of motion.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol

import numpy as np

from fantoccini.base import Array, Status
from fantoccini.dynamics.compiled import CompiledPuppet, MethodName
from fantoccini.dynamics.steppers.stepper import Stepper
from fantoccini.kernel.contract import SUMS
from fantoccini.kernel.runtime import LaneRecord, RunOptions
from fantoccini.motion import State

_STATE_FIELDS = ("q_D", "v_D", "q_K", "v_K", "slip")


class Engine(Protocol):
    """Advances the runs of a lane record; a checkpoint has the memory that the record lacks."""

    def checkpoint(self) -> Any: ...

    def restore(self, checkpoint: Any) -> None: ...

    def advance(self, duration: float, acc_K: Array, u_D: Array | None) -> None: ...


class SeparateRuns:
    """Runs of methods without lanes: a stepper for each run, on threads."""

    def __init__(
        self,
        marionette: CompiledPuppet,
        method: MethodName,
        options: RunOptions,
        record: LaneRecord,
        t: Array,
        threads: int,
    ):
        self._marionette, self._method, self._options = marionette, method, options
        self._record, self._t = record, t
        self._steppers: list[Stepper | None] = [None] * len(t)
        self._pool = ThreadPoolExecutor(threads)

    def checkpoint(self) -> list[Stepper | None]:
        """The steppers; see :meth:`restore`."""
        return self._steppers

    def restore(self, checkpoint: list[Stepper | None]) -> None:
        """Continues with the steppers of a checkpoint."""
        self._steppers = checkpoint

    def stepper(self, i: int) -> Stepper:
        """The stepper of run i."""
        stepper = self._steppers[i]
        assert stepper is not None
        return stepper

    def advance(self, duration: float, acc_K: Array, u_D: Array | None) -> None:
        def advance_run(i: int) -> None:
            self._begin(i)
            stepper = self.stepper(i)
            start = stepper.state.t
            if duration > 0.0 and (stepper.status is Status.RUNNING or stepper.arrived):
                force = None if u_D is None else u_D[i % len(u_D)]
                stepper.advance(duration, acc_K[i % len(acc_K)], u_D=force, throw=False)
            self._store(i, stepper, stepper.state.t - start)

        list(self._pool.map(advance_run, range(len(self._t))))

    def _begin(self, i: int) -> None:
        record = self._record
        if not record.fresh[i]:
            return
        record.fresh[i] = False
        marionette = self._marionette.with_p(record.p[i])
        x0 = State(
            float(self._t[i]),
            taut=np.zeros(marionette.tree.n_rows, dtype=bool),
            coordinates=marionette.coordinates,
            **{name: getattr(record, name)[i] for name in _STATE_FIELDS},
        )
        self._steppers[i] = Stepper(marionette, x0, self._method, self._options)

    def _store(self, i: int, stepper: Stepper, advanced: float) -> None:
        record, x = self._record, stepper.state
        for name in _STATE_FIELDS:
            getattr(record, name)[i] = getattr(x, name)
        record.taut[i], record.tension[i] = x.taut, stepper.tension
        record.advanced[i] = advanced
        status = stepper.status
        record.status[i] = Status.DONE if status is Status.RUNNING else status
        record.attribution[i] = stepper.attribution
        if len(stepper.samples):
            split = self._marionette.sample_layout.split(stepper.samples[-1:])
            record.energy_terms[i] = [split[name][0] for name in SUMS]
        record.violation[i] = stepper.violation
