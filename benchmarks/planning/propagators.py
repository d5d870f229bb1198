"""What a planner of others calls: a state one look later, and whether a state may be.

Both keep their arrays from call to call, so that little but the look itself is paid for.
"""

from __future__ import annotations

import ctypes
from itertools import pairwise

import mujoco
import numpy as np

from fantoccini.arrays import Array
from fantoccini.plan import Problem, Rows
from fantoccini.runtime import Sweeper, Terms
from fantoccini.runtime.clearance import ClearanceArrays
from fantoccini.runtime.functions import pointer
from fantoccini.tree import Role

from ..speed.exported import Anchored, mjcf, strings

HEAVY = 1e6
"""Mass of a driven coordinate in MuJoCo [kg]: what pulls at it hardly moves it."""

SPOOL = 10.0
"""Longest string in MuJoCo [m]."""

SLACK = 1e-3
"""By how much a string of MuJoCo is too long where it counts as slack [m]."""


class Layout:
    """Rows (n,) that hold q_D, v_D, q_K, v_K one after the other.

    Attributes:
        parts: where each of them is.
        n: entries of a row.
        slip: (1, n_strings) of all states [m]: no winch of the puppet slips.
    """

    def __init__(self, problem: Problem):
        table = problem.marionette.coordinates
        ends = np.cumsum([0, table.n_qD, table.n_vD, table.n_qK, table.n_vK]).tolist()
        self.parts = [slice(a, b) for a, b in pairwise(ends)]
        self.n = ends[-1]
        self.slip = problem.start.slip[None]

    def row(self, rows: Rows) -> Array:
        """(n,) of one state, rows (1,)."""
        return np.concatenate([rows.q_D[0], rows.v_D[0], rows.q_K[0], rows.v_K[0]])

    def rows(self, row: Array) -> Rows:
        """(1,) states of a row (n,)."""
        q_D, v_D, q_K, v_K = (row[None, part] for part in self.parts)
        return Rows(q_D, v_D, self.slip, q_K, v_K)


class Own(Sweeper):
    """Our time-stepper. It looks at clearance, bounds and strings in the same call."""

    def __init__(self, problem: Problem, layout: Layout):
        m, marionette, bounds = problem.motions, problem.marionette, problem.motions.bounds
        limits = bounds.speed, bounds.acceleration, bounds.low, bounds.high
        terms = Terms(
            m.options, 1, marionette.p, marionette.winches, limits, m.margin, m.slack,
            m.clearance.solids, problem.goal.numbers, -1.0,
        )  # fmt: skip
        super().__init__(marionette.motions, terms, 1)
        self._before, self._there = np.empty(layout.n), np.empty(layout.n)
        self._acc_K, self._distance = np.empty(len(bounds.speed)), np.empty(1)
        self._zero, self._one = np.zeros(1, np.int64), np.ones(1, np.int32)
        self._looks, self._slips = np.empty(2, np.int32), np.concatenate([layout.slip] * 2)
        arrays = self._arrays
        arrays.n = arrays.segments = 1
        for into, row, slip in (
            (arrays, self._before, self._slips[0]),
            (arrays.out, self._there, self._slips[1]),
        ):
            into.q_D, into.v_D, into.q_K, into.v_K = (pointer(row[p]) for p in layout.parts)
            into.slip = pointer(slip)
        arrays.acc_K, arrays.reach = pointer(self._acc_K), pointer(self._distance)
        arrays.from_, arrays.which = pointer(self._zero), pointer(self._zero)
        arrays.made = arrays.given = pointer(self._one)
        arrays.out.distance = pointer(self._distance)
        arrays.out.looks, arrays.out.catches = (pointer(self._looks[k:]) for k in (0, 1))

    def after(self, row: Array, acc_K: Array) -> Array:
        """(n,) one look later, nan where it may not be; acc_K (n_vK,) [m/s^2]."""
        self._before[:], self._acc_K[:] = row, acc_K
        self._there.fill(np.nan)
        self._work(self._arrays)
        return self._there.copy()

    def clear(self, row: Array) -> bool:
        """Whether a state that was propagated may be."""
        return bool(np.isfinite(row[0]))


class MuJoCo:
    """The same puppet in MuJoCo: driven coordinates are heavy slides, a string is a tendon.

    The tendon of a string goes on behind a pulley, to a slide that stands for its length: so MuJoCo
    knows how fast it is wound. Limits are as stiff as its safeguard allows: two steps. Where it
    goes astray it is not reset, as it would be: states that are not finite are not clear.
    """

    def __init__(self, problem: Problem, layout: Layout):
        self.motions, self.parts, marionette = problem.motions, layout.parts, problem.marionette
        tree, q_K = marionette.tree, marionette.coordinates.q_K
        spec = mujoco.MjSpec.from_string(mjcf(tree, []))
        spec.option.timestep = self.motions.dt
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        stiff = [2.0 * self.motions.dt, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]
        for row in tree.limits:
            joint = spec.joint(tree.links[row.link].joint)
            joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            joint.range[int(row.side == "upper")] = marionette.number(row.bound)
            joint.solref_limit, joint.solimp_limit = stiff
        for s in strings(marionette, problem.start):
            spec.body(s.body).add_site(name=s.name, pos=s.at)
            _slides(spec, s, q_K)
            line = spec.add_tendon(name=s.name, limited=True, range=[0.0, SPOOL])
            line.solref_limit, line.solimp_limit = stiff
            line.wrap_site(s.name + ".end")
            line.wrap_site(s.name)
            line.wrap_pulley(1.0)
            line.wrap_site(s.name + ".spool")
            line.wrap_site(s.name + ".wound")
        self.model = model = spec.compile()
        self.data = d = mujoco.MjData(model)
        self._views = d.qpos, d.qvel, d.qfrc_applied, d.qacc_warmstart, d.ten_length
        names = *(k.joint for k in tree.links if k.role is Role.DYNAMIC), *q_K
        self.q = _places(model, model.jnt_qposadr, model.nq, names)
        self.v = _places(model, model.jnt_dofadr, model.nv, names)
        mujoco.set_mju_user_warning(lambda text: None)
        self._clearance = _OneClearance(problem)

    def after(self, row: Array, acc_K: Array) -> Array:
        """(n,) one look later, nan where a string went slack that must not; acc_K (n_vK,)
        [m/s^2]."""
        (qpos, qvel, force, warm, lengths), motions = self._views, self.motions
        q_D, v_D, q_K, v_K = (row[part] for part in self.parts)
        n, m, t = len(q_D), len(v_D), motions.interval
        qpos[self.q[:n]], qpos[self.q[n:]] = q_D, q_K
        # An Euler step takes its last velocity for the whole of it: that in its middle is exact.
        qvel[self.v[:m]], qvel[self.v[m:]] = v_D, v_K - 0.5 * motions.dt * acc_K
        force[self.v[m:]] = HEAVY * acc_K
        warm[:] = 0.0
        mujoco.mj_step(self.model, self.data, motions.look)
        if not motions.slack and lengths.min() < SPOOL - SLACK:
            return np.full(len(row), np.nan)
        there = qpos[self.q[:n]], qvel[self.v[:m]]
        return np.concatenate([*there, q_K + t * (v_K + 0.5 * t * acc_K), v_K + t * acc_K])

    def clear(self, row: Array) -> bool:
        """Whether a state may be: its speeds, its ranges, its clearance."""
        bounds, (q_D, _, q_K, v_K) = self.motions.bounds, (row[part] for part in self.parts)
        return bool(
            np.isfinite(row).all()
            and (np.abs(v_K) <= bounds.speed * (1.0 + 1e-12)).all()
            and ((q_K >= bounds.low) & (q_K <= bounds.high)).all()
            and self._clearance(q_D, q_K) >= self.motions.margin
        )


class _OneClearance:
    """``Clearance.at`` for one configuration at a time."""

    def __init__(self, problem: Problem):
        marionette, q = problem.marionette, problem.start
        self._solids: list[np.ndarray] = []
        solids = ClearanceArrays.of(problem.motions.clearance.solids, self._solids)
        self._given = q.q_D.copy(), q.q_K.copy(), np.array(marionette.p, dtype=float)
        self._found, self._pair = np.empty(1), np.empty(1, np.int64)
        self._call = marionette.clearances.handle.fan_clearance
        self._arguments = (
            ctypes.c_longlong(1), *map(pointer, self._given), ctypes.byref(solids),
            pointer(self._found), pointer(self._pair),
        )  # fmt: skip

    def __call__(self, q_D: Array, q_K: Array) -> float:
        """[m]."""
        self._given[0][:], self._given[1][:] = q_D, q_K
        if self._call(*self._arguments):
            raise MemoryError("no memory for clearances")
        return float(self._found[0])


def _slides(spec: mujoco.MjSpec, string: Anchored, driven: tuple[str, ...]) -> None:
    """A string's end, on slides where it is driven, and its spool, ``SPOOL`` less its length."""
    axes = [(f"{string.name}.{axis}", k) for k, axis in enumerate("xyz")]
    moved = [(name, k) for name, k in axes if name in driven]
    place = np.array(string.world)
    place[[k for _, k in moved]] = 0.0
    end = spec.worldbody.add_body(pos=place)
    end.add_site(name=f"{string.name}.end")
    for name, k in moved:
        end.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=np.eye(3)[k])
    spec.worldbody.add_site(name=f"{string.name}.spool")
    winch = spec.worldbody.add_body(pos=[SPOOL, 0.0, 0.0])
    winch.add_site(name=f"{string.name}.wound")
    winch.add_joint(
        name=f"{string.name}.length", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[-1.0, 0.0, 0.0]
    )
    for body in (end, winch):
        body.explicitinertial, body.mass, body.inertia = True, HEAVY, np.full(3, HEAVY)


def _places(model: mujoco.MjModel, first: Array, n: int, names: tuple[str, ...]) -> Array:
    """Places of joints in qpos or qvel, whose joints begin at ``first`` and that has n entries."""
    ends = np.append(first, n)
    which = [model.joint(name).id for name in names]
    return np.concatenate([np.arange(ends[j], ends[j + 1]) for j in which])


PROPAGATORS: dict[str, type] = {"own": Own, "mujoco": MuJoCo}
"""Propagators by name."""
