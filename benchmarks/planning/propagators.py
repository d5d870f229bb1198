"""Propagation and validity of states, for other planners.

Both reuse their arrays from call to call, so that little time is added.
"""

from __future__ import annotations

import ctypes
from itertools import pairwise

import numpy as np

from fantoccini.base.arrays import Array
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import StateArrays
from fantoccini.dynamics.mujoco import MuJoCoPuppet
from fantoccini.kernel.runtime import RolloutPool, RolloutSettings
from fantoccini.kernel.runtime.clearance import Exact, clearance_arrays
from fantoccini.kernel.runtime.functions import pointer

SLACK = 1e-3
"""Gap of a string in MuJoCo that counts as slack [m]."""


class Layout:
    """Vectors (n,) of q_D, v_D, q_K and v_K in order.

    Attributes:
        parts: slice of each part.
        n: length of a row.
        slip: (1, n_strings) slips of all states [m]: no winch of the puppet slips.
    """

    def __init__(self, problem: Problem):
        table = problem.marionette.coordinates
        ends = np.cumsum([0, table.n_qD, table.n_vD, table.n_qK, table.n_vK]).tolist()
        self.parts = [slice(a, b) for a, b in pairwise(ends)]
        self.n = ends[-1]
        self.slip = problem.start.slip[None]

    def row(self, states: StateArrays) -> Array:
        """The row (n,) of one state (1,)."""
        parts = (states.q_D, states.v_D, states.q_K, states.v_K)
        return np.concatenate([part[0] for part in parts])

    def states(self, row: Array) -> StateArrays:
        """The states (1,) of a row (n,)."""
        q_D, v_D, q_K, v_K = (row[None, part] for part in self.parts)
        return StateArrays(q_D, v_D, self.slip, q_K, v_K)


class OwnPropagator(RolloutPool):
    """Our time-stepper, which checks clearance, bounds and strings in the same call."""

    def __init__(self, problem: Problem, layout: Layout):
        m, marionette, bounds = problem.rollouts, problem.marionette, problem.rollouts.bounds
        settings = RolloutSettings(
            m.run_options,
            1,
            marionette.p,
            marionette.winches,
            vars(bounds),
            m.margin,
            m.slack,
            m.clearance.solids,
            problem.goal.numbers,
            -1.0,
        )
        super().__init__(marionette.libraries.rollouts, settings, 1)
        self._before, self._there = np.empty(layout.n), np.empty(layout.n)
        self._acc_K, self._distance = np.empty(len(bounds.speed)), np.empty(1)
        self._zero, self._one = np.zeros(1, np.int64), np.ones(1, np.int32)
        self._n_checks, self._slips = np.empty(2, np.int32), np.concatenate([layout.slip] * 2)
        arrays = self._arrays
        self._exact = Exact(m.clearance.solids)
        self._measured = clearance_arrays(m.clearance.solids, self._exact)
        arrays.solids = ctypes.addressof(self._measured)
        arrays.n = arrays.segments = 1
        for into, row, slip in (
            (arrays, self._before, self._slips[0]),
            (arrays.out, self._there, self._slips[1]),
        ):
            into.q_D, into.v_D, into.q_K, into.v_K = (pointer(row[p]) for p in layout.parts)
            into.slip = pointer(slip)
        arrays.acc_K, arrays.lead_time = pointer(self._acc_K), pointer(self._distance)
        arrays.start, arrays.law = pointer(self._zero), pointer(self._zero)
        arrays.n_segments = arrays.n_given = pointer(self._one)
        arrays.out.distance = pointer(self._distance)
        arrays.out.n_checks, arrays.out.catches = (pointer(self._n_checks[k:]) for k in (0, 1))

    def after(self, row: Array, acc_K: Array) -> Array:
        """The row (n,) one check later, NaN if invalid; acc_K (n_vK,) [m/s^2]."""
        self._before[:], self._acc_K[:] = row, acc_K
        self._there.fill(np.nan)
        self._work(self._arrays)
        return self._there.copy()

    def clear(self, row: Array) -> bool:
        """Whether a propagated state is valid."""
        return bool(np.isfinite(row[0]))


class MuJoCoPropagator:
    """The same puppet in MuJoCo, by Euler's method with steps of the same length.

    It is not reset when it diverges: states that are not finite do not count as clear.
    """

    def __init__(self, problem: Problem, layout: Layout):
        self.rollouts, self.parts = problem.rollouts, layout.parts
        self.puppet = puppet = MuJoCoPuppet(problem.marionette, self.rollouts.options.dt)
        if puppet.twists:
            raise ValueError(
                "limits of twists need an update at every step, which is not made here"
            )
        mujoco, option = puppet.mujoco, puppet.model.opt
        option.integrator = mujoco.mjtIntegrator.mjINT_EULER
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        mujoco.set_mju_user_warning(lambda text: None)
        self._step = mujoco.mj_step
        self._slack = puppet.model.tendon_range[puppet.strings, 1] - SLACK
        self._warm, self._lengths = puppet.data.qacc_warmstart, puppet.data.ten_length
        self._qpos, self._qvel = puppet.data.qpos, puppet.data.qvel
        self._clearance = _OneClearance(problem)

    def after(self, row: Array, acc_K: Array) -> Array:
        """The row (n,) one check later, NaN if a string went slack that must not; acc_K (n_vK,)
        [m/s^2]."""
        puppet, rollouts, t = self.puppet, self.rollouts, self.rollouts.options.interval
        q_D, v_D, q_K, v_K = (row[part] for part in self.parts)
        puppet.set_dynamic(q_D, v_D)
        # An Euler step uses its last velocity throughout: that in its middle is exact.
        puppet.set_driven(q_K, v_K - 0.5 * rollouts.options.dt * acc_K, acc_K)
        self._warm[:] = 0.0
        self._step(puppet.model, puppet.data, rollouts.options.steps_per_check)
        if not rollouts.slack and (self._lengths[puppet.strings] < self._slack).any():
            return np.full(len(row), np.nan)
        there = self._qpos[puppet.q_D], self._qvel[puppet.v_D]
        return np.concatenate([*there, q_K + t * (v_K + 0.5 * t * acc_K), v_K + t * acc_K])

    def clear(self, row: Array) -> bool:
        """Whether a state is valid: its speeds, its ranges, its clearance."""
        bounds, (q_D, _, q_K, v_K) = self.rollouts.bounds, (row[part] for part in self.parts)
        return bool(
            np.isfinite(row).all()
            and (np.abs(v_K) <= bounds.speed * (1.0 + 1e-12)).all()
            and ((q_K >= bounds.low) & (q_K <= bounds.high)).all()
            and self._clearance(q_D, q_K) >= self.rollouts.margin
        )


class _OneClearance:
    """``Clearance.at`` for one configuration at a time."""

    def __init__(self, problem: Problem):
        marionette, q = problem.marionette, problem.start
        measured = problem.rollouts.clearance.solids
        self._exact = Exact(measured)
        solids = self._solids = clearance_arrays(measured, self._exact)
        self._given = q.q_D.copy(), q.q_K.copy(), np.array(marionette.p, dtype=float)
        self._found, self._pair = np.empty(1), np.empty(1, np.int64)
        self._call = marionette.libraries.clearances.dll.fan_clearance
        self._arguments = (
            ctypes.c_longlong(1),
            *map(pointer, self._given),
            ctypes.byref(solids),
            pointer(self._found),
            pointer(self._pair),
        )

    def __call__(self, q_D: Array, q_K: Array) -> float:
        """The clearance [m]."""
        self._given[0][:], self._given[1][:] = q_D, q_K
        if self._call(*self._arguments):
            raise MemoryError("no memory for clearances")
        return float(self._found[0])


PROPAGATORS: dict[str, type] = {"own": OwnPropagator, "mujoco": MuJoCoPropagator}
"""Propagators by name."""
