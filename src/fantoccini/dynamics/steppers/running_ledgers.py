"""Energy ledgers of runs that are advanced piece by piece: of one run, and of runs in lanes.

A ledger is the table of energies and work of a run. Lanes are runs that the vector unit of the
processor advances together. In names, D stands for dynamic coordinates, which move by the equations
of motion, and K for driven ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import copy
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, Status
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.dynamics.steppers.ledgers import ledger_of
from fantoccini.dynamics.steppers.soundness import (
    BOUNDS,
    LedgerCheck,
    excused_share,
    fault_of_run,
    faults,
    springs_swing,
)
from fantoccini.kernel.contract import ENERGY_TERMS
from fantoccini.kernel.runtime import LaneRecord
from fantoccini.motion import LEDGER, State

_MAX_SAMPLES = 1000
"""Largest number of samples before the ledger is checked without a request."""


class RunningLedger:
    """Ledger of a run in fixed steps, from a sample on; checked when its status is asked for.

    Args:
        marionette: the puppet.
        method: method of the run.
        dt: length of the steps [s].
        x: state at the start.
        sample: (1, width) sample at the start.
    """

    def __init__(self, marionette: CompiledPuppet, method: str, dt: float, x: State, sample: Array):
        self._marionette, self._method, self._dt, self._x = marionette, method, dt, x
        columns = marionette.sample_layout.split(sample)
        self._start_energy = columns["kinetic"] + columns["potential"]
        ledger = dict(zip(LEDGER, ledger_of(columns)[0], strict=True))
        self._check = LedgerCheck(marionette, dt, ledger, columns["t"][0])
        self._unchecked = list[Array]()
        self._swings: bool | None = None

    def __copy__(self) -> RunningLedger:
        other = object.__new__(RunningLedger)
        other.__dict__.update(self.__dict__)
        other._check, other._unchecked = copy.copy(self._check), list(self._unchecked)
        return other

    def add_samples(self, samples: Array) -> None:
        """Takes further samples (T, width)."""
        self._unchecked.append(samples)
        if sum(map(len, self._unchecked)) > _MAX_SAMPLES:
            self._add()

    def status(self, violation: float) -> Status:
        """``DONE``, or the fault of the steps so far.

        Args:
            violation: largest violation so far [m, rad or 1].
        """
        self._add()
        share = excused_share(self._method, float(self._check.share), self._springs_swing)
        return fault_of_run(violation, float(self._check.gain), share)

    def _add(self) -> None:
        if self._unchecked:
            columns = self._marionette.sample_layout.split(np.concatenate(self._unchecked))
            ledger = np.moveaxis(ledger_of(columns, self._start_energy), -1, 0)
            self._check.add(dict(zip(LEDGER, ledger, strict=True)), columns["t"])
            self._unchecked = []

    def _springs_swing(self) -> bool:
        if self._swings is None:
            self._swings = springs_swing(self._marionette, self._x.q_D, self._x.q_K, self._dt)
        return self._swings


class LaneLedgers:
    """Ledgers of runs in lanes, checked at the ends of all pieces.

    Args:
        marionette: the puppet.
        dt: length of the steps [s].
        record: record of the runs at their start.
        t: (n,) times of the start [s].
    """

    def __init__(self, marionette: CompiledPuppet, dt: float, record: LaneRecord, t: Array):
        self._marionette, self._dt = marionette, dt
        self._start_energy = np.zeros((len(t), 1))
        self._q_D, self._q_K, self._p = record.q_D.copy(), record.q_K.copy(), record.p
        self._swings: dict[int, bool] = {}
        start = self._entries(record, slice(None))
        self._check = LedgerCheck(marionette, dt, start, t, record.p)

    def restart(self, runs: NDArray[np.intp], record: LaneRecord, t: Array) -> None:
        """Begins again with some of the runs."""
        self._q_D[runs], self._q_K[runs] = record.q_D[runs], record.q_K[runs]
        for i in runs.tolist():
            self._swings.pop(i, None)
        self._check.restart(runs, self._entries(record, runs), t[runs], record.p[runs])

    def add(self, record: LaneRecord, t: Array) -> None:
        """Adds the ends of a piece."""
        terms = np.concatenate([record.energy, record.energy_terms], axis=1)[:, None]
        columns = dict(zip(ENERGY_TERMS, np.moveaxis(terms, -1, 0), strict=True))
        ledger = np.moveaxis(ledger_of(columns, self._start_energy), -1, 0)
        self._check.add(dict(zip(LEDGER, ledger, strict=True)), t[:, None])

    def faults(self, violation: Array) -> NDArray[np.int32]:
        """``Status`` numbers (n,): DONE or the fault of the steps so far."""
        share = self._check.share.copy()
        for i in np.flatnonzero(share > BOUNDS.max_unbalanced).tolist():
            share[i] = excused_share("timestepping", share[i], partial(self._springs_swing, i))
        return faults(violation, self._check.gain, share).astype(np.int32)

    def _entries(self, record: LaneRecord, runs: NDArray[np.intp] | slice) -> dict[str, Array]:
        """Entries (m,) of ledgers at the start of runs; also sets their energy at the start."""
        terms = np.concatenate([record.energy, record.energy_terms], axis=1)[runs]
        self._start_energy[runs] = np.sum(record.energy[runs], axis=1, keepdims=True)
        columns = dict(zip(ENERGY_TERMS, terms.T, strict=True))
        ledger = ledger_of(columns, self._start_energy[runs, 0])
        return dict(zip(LEDGER, ledger.T, strict=True))

    def _springs_swing(self, i: int) -> bool:
        if i not in self._swings:
            marionette = self._marionette.with_p(self._p[i])
            self._swings[i] = springs_swing(marionette, self._q_D[i], self._q_K[i], self._dt)
        return self._swings[i]
