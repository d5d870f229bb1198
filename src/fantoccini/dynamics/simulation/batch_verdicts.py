"""The verdicts on the runs of a batch.

A ledger is the table of energies and work of a run. q_D are the dynamic and q_K the driven
coordinates.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from fantoccini.base import ARRIVED, Array, Status, Times
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.judging import ends_fast, violations_after_last_step
from fantoccini.dynamics.steppers import (
    CONTRADICTION_STATUSES,
    Contradiction,
    LedgerCheck,
    contradiction,
    decide,
    deepest,
    excused_share,
    fault_of_run,
    faults,
    first_excess_tension,
    ledgers_of_terms,
    may_be_redundant,
    measuring_times,
    prescribed_overlaps,
    springs_swing,
)
from fantoccini.kernel.runtime import Batch
from fantoccini.motion import LEDGER, Inputs, State


class BatchVerdicts:
    """Decides the statuses of the runs of a batch.

    Runs completed in fixed steps are examined for contradicting strings if tensions are saved with
    the motion, and for their energy if the ledger is saved.

    Args:
        marionette: the puppet.
        batch: the runs, which have ended.
        inputs: inputs of the runs, one for all or one for each.
        method: method of the runs.
    """

    def __init__(self, marionette: Marionette, batch: Batch, inputs: Inputs, method: str):
        self._marionette = marionette
        self._batch, self._inputs = batch, inputs
        self._method, self._fixed = method, method != "event"
        self._redundant = may_be_redundant(self._marionette)
        self._at_end = np.isin(batch.status, ARRIVED) & (batch.reached >= batch.t_end)
        self._depths: dict[tuple[int, int], float] = {}
        self._doubtful = np.zeros(batch.n, dtype=bool)
        if self._fixed:
            self._gain, self._share = self._energies()
            self._ends_fast = ends_fast(batch.end_v_D, batch.options.dt)
            outcome = faults(batch.violation, self._gain, self._share)
            self._doubtful = self._at_end & (self._ends_fast | (outcome != Status.DONE))

    def decide(self) -> None:
        """Replaces statuses and attributions of the batch by the verdicts."""
        batch, names = self._batch, [s.name for s in self._marionette.tree.strings]
        check_all = self._redundant or self._marionette.prescribed is not None
        for i in map(
            int, np.flatnonzero(np.isfinite(batch.reached) & (self._doubtful | check_all))
        ):
            reported = Status(int(batch.status[i]))
            checks = [partial(self._prescribed_verdict, i)] if self._at_end[i] else []
            if self._fixed and self._at_end[i]:
                checks.insert(0, partial(self._soundness_verdict, i))
            outcome = decide(reported, self._contradiction(i), checks)
            if outcome.status is reported:
                continue
            batch.status[i], batch.attribution[i] = outcome.status, 0.0
            if outcome.contradiction:
                batch.attribution[
                    i, [names.index(name) for name in outcome.contradiction.names]
                ] = 1.0

    def _contradiction(self, i: int) -> Contradiction | None:
        """Contradiction of the redundant strings that stopped a run or carry excess tension."""
        batch, parts = self._batch, self._batch.parts
        if not self._redundant:
            return None
        marionette = self._marionette.with_p(batch.p[i if len(batch.p) > 1 else 0])
        if batch.status[i] in CONTRADICTION_STATUSES:
            return contradiction(
                marionette, *self._motion(i, batch.reached[i], batch.end_q_D[i], batch.end_v_D[i])
            )
        is_examined = self._fixed and {"q_D", "v_D", "force"} <= set(parts)
        if not is_examined or batch.status[i] not in ARRIVED:
            return None

        def saved_motion(k: int) -> tuple[State, Array]:
            return self._motion(i, batch.times[k], parts["q_D"][i, k], parts["v_D"][i, k])

        tension = parts["force"][i, :, : len(marionette.tree.strings)]
        first_excess = first_excess_tension(marionette, tension, saved_motion)
        return (
            None if first_excess is None else contradiction(marionette, *saved_motion(first_excess))
        )

    def _motion(self, i: int, t: float, q_D: Array, v_D: Array) -> tuple[State, Array]:
        """State of a run and accelerations of its inputs at a time [s]."""
        q_K, v_K, acc_K = self._inputs[self._input_index(i)].evaluate(t)
        # Only rigid strings are examined, so the slip of winches is irrelevant.
        zeros = np.zeros(self._marionette.tree.n_rows, dtype=bool)
        table = self._marionette.coordinates
        return State(float(t), q_D, v_D, q_K, v_K, zeros, coordinates=table), acc_K

    def _input_index(self, i: int) -> int:
        return i if len(self._inputs) > 1 else 0

    def _energies(self) -> tuple[Array, Array]:
        """Gains and shares (n,) of the ledgers; see :class:`LedgerCheck`."""
        batch, is_done = self._batch, self._at_end
        gain, share = np.zeros(batch.n), np.zeros(batch.n)
        if "energy_terms" in batch.parts and np.any(is_done):
            columns = np.moveaxis(ledgers_of_terms(batch.parts["energy_terms"][is_done]), -1, 0)
            ledger = dict(zip(LEDGER, columns, strict=True))
            start = {name: values[:, 0] for name, values in ledger.items()}
            p = batch.p[is_done] if len(batch.p) > 1 else batch.p.repeat(np.sum(is_done), axis=0)
            dt = batch.options.dt
            check = LedgerCheck(self._marionette, dt, start, batch.times[0], p)
            later_entries = {name: values[:, 1:] for name, values in ledger.items()}
            check.add(later_entries, batch.times[1:])
            gain[is_done], share[is_done] = check.gain, check.share
        return gain, share

    def _soundness_verdict(self, i: int) -> tuple[Status, str]:
        """Verdict on violations and energy of a run in fixed steps, without text."""
        batch, marionette = self._batch, self._marionette
        max_violation = float(batch.violation[i])
        if self._ends_fast[i]:
            q_K = self._inputs[self._input_index(i)].evaluate(batch.t_end)[0]
            max_violation = max(
                [
                    max_violation,
                    *violations_after_last_step(marionette, batch.end_q_D[i], q_K).values(),
                ]
            )

        def do_springs_swing() -> bool:
            q_K = self._inputs[self._input_index(i)].evaluate(batch.t)[0]
            q_D = batch.q_D[i if len(batch.q_D) > 1 else 0]
            p = batch.p[i if len(batch.p) > 1 else 0]
            return springs_swing(marionette.with_p(p), q_D, q_K, batch.options.dt)

        share = excused_share(self._method, float(self._share[i]), do_springs_swing)
        return fault_of_run(max_violation, float(self._gain[i]), share), ""

    def _prescribed_verdict(self, i: int) -> tuple[Status, str]:
        """Verdict on inputs that move solids through one another, without text."""
        batch, marionette = self._batch, self._marionette
        if marionette.prescribed is None:
            return Status.DONE, ""
        key = self._input_index(i), i if len(batch.p) > 1 else 0
        if key not in self._depths:
            run_input = self._inputs[key[0]]

            def motion(t: Times) -> Array:
                return run_input.evaluate(t)[0]

            times = measuring_times(run_input.breaks, batch.t, batch.t_end)
            overlaps = prescribed_overlaps(marionette.with_p(batch.p[key[1]]), motion, times)
            self._depths[key] = deepest(overlaps)
        return Status.OVERSTEPPED if self._depths[key] else Status.DONE, ""
