"""A puppet in MuJoCo: its model and data, indexed by the puppet's coordinates.

q_D are the dynamic coordinates and q_K the driven ones: ends and lengths of strings, driven joints.
A wire is a string that also pushes, and a twist the rotation of a ball joint about its own axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from fantoccini.base import Array, ConfigD, ConfigK, MissingLibraryError, VecD, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.mujoco.joints import all_joints
from fantoccini.dynamics.mujoco.mjcf_model import SUBSTITUTES, mjcf
from fantoccini.dynamics.mujoco.twists import Twists
from fantoccini.model.tree import Role, Tree


@dataclass(frozen=True)
class Settings:
    """Settings of MuJoCo's solver and constraints, as exact and as stiff as it permits."""

    tolerance: float = 1e-20
    """Improvement of the scaled cost at which the solver stops [1]. The scale contains the inertias
    of the driven joints, so that ordinary values are coarse for the puppet."""
    iterations: int = 200  # Maximum number of solver iterations in one evaluation
    time_constant: float = 2.0
    """Time in which strings, wires and limits recover, in steps: the least that MuJoCo permits."""
    damping_ratio: float = 1.0  # Damping of that recovery [1]: critical
    impedance: tuple[float, ...] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
    """``solimp`` of strings, wires and limits. The first two numbers are MuJoCo's largest impedance
    [1]. As they are equal, the width [m or rad], midpoint [1] and power [1] have no effect."""


SETTINGS = Settings()


def library() -> ModuleType:
    """The module ``mujoco``.

    Raises:
        MissingLibraryError: it is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingLibraryError("a puppet in MuJoCo", "mujoco", "mujoco") from None
    return mujoco


class MuJoCoPuppet:
    """A puppet in MuJoCo. Strings and limits are as stiff as it permits: see :class:`Settings`.

    Attributes:
        mujoco: the module.
        model, data: MuJoCo's model and data.
        q_D, v_D, q_K, v_K: indices of the puppet's coordinates in qpos and qvel.
        strings: indices of the strings among the tendons.
        twists: tendons that :meth:`evaluate` updates.

    Args:
        marionette: the puppet.
        dt: length of the longest step [s].
        text: MJCF text, such as one with solids that touch; by default that of :func:`mjcf`.

    Raises:
        ExchangeError: MuJoCo cannot model a part of the puppet.
        MissingLibraryError: MuJoCo is not installed.
    """

    def __init__(self, marionette: Marionette, dt: float, text: str | None = None):
        self.mujoco, tree = library(), marionette.tree
        text = mjcf(marionette) if text is None else text
        self.model = m = self.mujoco.MjModel.from_xml_string(text)
        self.data = self.mujoco.MjData(m)
        option = m.opt
        option.timestep = dt
        option.integrator = self.mujoco.mjtIntegrator.mjINT_RK4
        option.tolerance, option.iterations = SETTINGS.tolerance, SETTINGS.iterations
        for reference in (m.jnt_solref, m.tendon_solref_lim, m.eq_solref):
            reference[:] = SETTINGS.time_constant * dt, SETTINGS.damping_ratio
        for impedance in (m.jnt_solimp, m.tendon_solimp_lim, m.eq_solimp):
            impedance[:] = SETTINGS.impedance
        self.q_D, self.v_D = self._coordinate_indices(marionette, Role.DYNAMIC)
        self.q_K, self.v_K = self._coordinate_indices(marionette, Role.DRIVEN)
        self._armature = m.dof_armature[self.v_K].copy()
        self.strings = np.array([m.tendon(s.name).id for s in tree.strings], dtype=int)
        for k, tendon in enumerate(m.eq_obj1id):
            L = tree.strings[list(self.strings).index(tendon)].length
            length = SUBSTITUTES.spool if L is None else marionette.number(L)
            # MuJoCo counts a wire's length from its value in MuJoCo's zero pose.
            m.eq_data[k, 0] = length - m.tendon_length0[tendon]
        kinds = self.mujoco.mjtConstraint
        names = "LIMIT_TENDON", "LIMIT_JOINT", "EQUALITY"
        self._kinds = [int(getattr(kinds, f"mjCNSTR_{name}")) for name in names]
        self._limits, self.twists = _Limits.from_model(m, tree), Twists(m, tree)

    def set_dynamic(self, q_D: ConfigD, v_D: VecD) -> None:
        """Sets the dynamic coordinates."""
        self.data.qpos[self.q_D], self.data.qvel[self.v_D] = q_D, v_D

    def set_driven(self, q_K: ConfigK, v_K: VecK, acc_K: VecK) -> None:
        """Sets the driven coordinates and their accelerations until the next call."""
        data = self.data
        data.qpos[self.q_K], data.qvel[self.v_K] = q_K, v_K
        data.qfrc_applied[self.v_K] = self._armature * acc_K

    def evaluate(self) -> None:
        """Computes accelerations and forces."""
        if self.twists:
            self.twists.update(self.data.qpos)
        self.mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """Advances by one step of the Runge-Kutta method of order 4, after :meth:`evaluate`.

        A state that is not finite remains so; ``mj_step`` would reset it.
        """
        self.mujoco.mj_RungeKutta(self.model, self.data, 4)

    def forces(self) -> tuple[Array, Array]:
        """Tensions (n_strings,) [N] and forces of limits (n_limits,) at the last evaluation."""
        d, (tendon_kind, joint_kind, wire_kind) = self.data, self._kinds
        kinds, owner, force = (a[: d.nefc] for a in (d.efc_type, d.efc_id, d.efc_force))
        tension, torque = np.zeros(self.model.ntendon), np.zeros(self.model.njnt)
        for sums, sensor_kind in ((tension, tendon_kind), (torque, joint_kind)):
            is_kind = kinds == sensor_kind
            sums[owner[is_kind]] += force[is_kind]
        is_kind = kinds == wire_kind
        tension[self.model.eq_obj1id[owner[is_kind]]] -= force[is_kind]
        limit_force = self._limits.forces(d, tension, torque)
        limit_force[self.twists.row_indices] = tension[self.twists.tendons] * self.twists.scale
        return tension[self.strings], limit_force

    def _coordinate_indices(self, marionette: Marionette, role: Role) -> tuple[Array, Array]:
        """Indices in qpos and qvel of the coordinates of a role."""
        q, v = [], []
        for joint in all_joints(marionette.tree):
            if joint.role is role:
                joint_in_mujoco = self.model.joint(joint.name)
                q.append((joint.q, joint_in_mujoco.qposadr[0]))
                v.append((joint.v, joint_in_mujoco.dofadr[0]))
        table = marionette.coordinates
        is_dynamic = role is Role.DYNAMIC
        sizes = (table.n_qD, table.n_vD) if is_dynamic else (table.n_qK, table.n_vK)
        return _index_array(q, sizes[0]), _index_array(v, sizes[1])


@dataclass(frozen=True)
class _Limits:
    """Indices in MuJoCo of a puppet's limits, without twists.

    Attributes:
        n: number of limits, including twists.
        joint_limits: lower and upper limits: indices among all limits, joints, indices of these in
            qpos, middles of their ranges, and whether the limit is the upper one.
        cones: cones: indices among all limits, and tendons.
    """

    n: int
    joint_limits: tuple[Array, Array, Array, Array, Array]
    cones: tuple[Array, Array]

    @classmethod
    def from_model(cls, model: Any, tree: Tree) -> _Limits:
        """The limits of a tree in MuJoCo's model of it."""
        sides = [limit.side for limit in tree.limits]
        joint_limits = [i for i, side in enumerate(sides) if side in ("lower", "upper")]
        cones = [i for i, side in enumerate(sides) if side == "cone"]
        joints = np.array(
            [model.joint(tree.links[tree.limits[i].link].joint).id for i in joint_limits], dtype=int
        )
        is_upper = np.array([sides[i] == "upper" for i in joint_limits], dtype=bool)
        middle = model.jnt_range[joints].mean(axis=1)
        tendons = [model.tendon(tree.limits[i].name).id for i in cones]
        row_indices = (
            np.array(joint_limits, dtype=int),
            joints,
            model.jnt_qposadr[joints],
            middle,
            is_upper,
        )
        return cls(
            len(sides), row_indices, (np.array(cones, dtype=int), np.array(tendons, dtype=int))
        )

    def forces(self, data: Any, tension: Array, torque: Array) -> Array:
        """Forces (n,) of limits, from those of tendons (n_tendons,) and joints (n_joints,)."""
        forces = np.zeros(self.n)
        row_indices, joints, qpos_index, middle, is_upper = self.joint_limits
        forces[row_indices] = np.where(
            (data.qpos[qpos_index] > middle) == is_upper, torque[joints], 0.0
        )
        row_indices, tendons = self.cones
        # h = cos(max) - a.R b and length^2 = 2 - 2 a.R b, so that dh = length d(length).
        forces[row_indices] = tension[tendons] / data.ten_length[tendons]
        return forces


def _index_array(slices_and_addresses: list[tuple[slice, int]], n: int) -> Array:
    """Indices (n,) in MuJoCo of the puppet's coordinates.

    Args:
        slices_and_addresses: coordinates of each joint, and the index in MuJoCo of the first of
            them.
        n: number of coordinates.
    """
    indices = np.zeros(n, dtype=int)
    for coordinates, first in slices_and_addresses:
        indices[coordinates] = first + np.arange(coordinates.stop - coordinates.start)
    return indices
