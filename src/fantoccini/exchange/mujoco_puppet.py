"""A puppet in MuJoCo: its model and data, in the order of our coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from fantoccini.arrays import Array, ConfigD, ConfigK, VecD, VecK
from fantoccini.errors import MissingLibraryError
from fantoccini.exchange.joints import all_joints
from fantoccini.exchange.mjcf_model import SPOOL, mjcf
from fantoccini.exchange.twists import Twists
from fantoccini.marionette import Marionette
from fantoccini.tree import Role, Tree

_HARD = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""The highest impedance of a limit."""

_EXACT, _ITERATIONS = 1e-20, 200
"""Of MuJoCo's solver. Heavy joints make its tolerance, which is relative, coarse for the puppet."""


def library() -> ModuleType:
    """MuJoCo.

    Raises:
        MissingLibraryError: it is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingLibraryError("a puppet in MuJoCo", "mujoco", "mujoco") from None
    return mujoco


class MuJoCoPuppet:
    """A puppet in MuJoCo. Strings and limits are as stiff as its safeguard allows: two steps.

    Attributes:
        mujoco: the library.
        model, data: MuJoCo's.
        q_D, v_D, q_K, v_K: places of our coordinates in qpos and qvel.
        strings: places of the strings among the tendons.
        twists: what is to be led anew before every evaluation; :meth:`evaluate` does.

    Args:
        marionette: the puppet.
        dt: longest step [s].

    Raises:
        ExchangeError: the puppet has what MuJoCo cannot do.
        MissingLibraryError: MuJoCo is not installed.
    """

    def __init__(self, marionette: Marionette, dt: float):
        self.mujoco, tree = library(), marionette.tree
        self.model = m = self.mujoco.MjModel.from_xml_string(mjcf(marionette))
        self.data = self.mujoco.MjData(m)
        option = m.opt
        option.timestep = dt
        option.integrator = self.mujoco.mjtIntegrator.mjINT_RK4
        option.tolerance, option.iterations = _EXACT, _ITERATIONS
        for softness in (m.jnt_solref, m.tendon_solref_lim, m.eq_solref):
            softness[:] = 2.0 * dt, 1.0
        for impedance in (m.jnt_solimp, m.tendon_solimp_lim, m.eq_solimp):
            impedance[:] = _HARD
        self.q_D, self.v_D = self._places(marionette, Role.DYNAMIC)
        self.q_K, self.v_K = self._places(marionette, Role.DRIVEN)
        self._heavy = m.dof_armature[self.v_K].copy()
        self.strings = np.array([m.tendon(s.name).id for s in tree.strings], dtype=int)
        for k, tendon in enumerate(m.eq_obj1id):
            wire = tree.strings[list(self.strings).index(tendon)]
            length = SPOOL if wire.length is None else marionette.model.number(wire.length)
            # A wire's length is given as a change from that in MuJoCo's zero pose.
            m.eq_data[k, 0] = length - m.tendon_length0[tendon]
        kinds = self.mujoco.mjtConstraint
        names = "LIMIT_TENDON", "LIMIT_JOINT", "EQUALITY"
        self._kinds = [int(getattr(kinds, f"mjCNSTR_{name}")) for name in names]
        self._stops, self.twists = _Stops.of(m, tree), Twists(m, tree)

    def put(self, q_D: ConfigD, v_D: VecD) -> None:
        """Places the dynamic coordinates."""
        self.data.qpos[self.q_D], self.data.qvel[self.v_D] = q_D, v_D

    def drive(self, q_K: ConfigK, v_K: VecK, acc_K: VecK) -> None:
        """Places the driven coordinates, which go on with constant accelerations."""
        data = self.data
        data.qpos[self.q_K], data.qvel[self.v_K] = q_K, v_K
        data.qfrc_applied[self.v_K] = self._heavy * acc_K

    def evaluate(self) -> None:
        """Computes accelerations and forces."""
        if self.twists:
            self.twists.lead(self.data.qpos)
        self.mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """Goes on from :meth:`evaluate` by the model's step, by Runge and Kutta's method.

        States that are not finite stay so; ``mj_step`` would begin anew.
        """
        self.mujoco.mj_RungeKutta(self.model, self.data, 4)

    def forces(self) -> tuple[Array, Array]:
        """(n_strings,) tensions [N] and (n_limits,) forces of limits, of the last evaluation."""
        d, (of_tendon, of_joint, of_wire) = self.data, self._kinds
        kind, who, force = (a[: d.nefc] for a in (d.efc_type, d.efc_id, d.efc_force))
        pull, turn = np.zeros(self.model.ntendon), np.zeros(self.model.njnt)
        for total, limited in ((pull, of_tendon), (turn, of_joint)):
            on = kind == limited
            total[who[on]] += force[on]
        on = kind == of_wire
        pull[self.model.eq_obj1id[who[on]]] -= force[on]
        stops = self._stops.forces(d, pull, turn)
        stops[self.twists.places] = pull[self.twists.tendons] * self.twists.scale
        return pull[self.strings], stops

    def _places(self, marionette: Marionette, role: Role) -> tuple[Array, Array]:
        """Of the coordinates of a role, in qpos and qvel."""
        q, v = [], []
        for joint in all_joints(marionette.tree):
            if joint.role is role:
                there = self.model.joint(joint.name)
                q.append((joint.q, there.qposadr[0]))
                v.append((joint.v, there.dofadr[0]))
        table = marionette.coordinates
        dynamic = role is Role.DYNAMIC
        sizes = (table.n_qD, table.n_vD) if dynamic else (table.n_qK, table.n_vK)
        return _gathered(q, sizes[0]), _gathered(v, sizes[1])


@dataclass(frozen=True)
class _Stops:
    """What the limits of a puppet are in MuJoCo, but for twists.

    Attributes:
        n: how many there are.
        ends: places of the lower and upper ones among them, the joints they belong to, where
            these stand in qpos, their middles, and whether the upper end is meant.
        cones: places of the cones among them, and their tendons.
    """

    n: int
    ends: tuple[Array, Array, Array, Array, Array]
    cones: tuple[Array, Array]

    @classmethod
    def of(cls, model: Any, tree: Tree) -> _Stops:
        """Of a model."""
        sides = [limit.side for limit in tree.limits]
        ends = [i for i, side in enumerate(sides) if side in ("lower", "upper")]
        cones = [i for i, side in enumerate(sides) if side == "cone"]
        joints = np.array(
            [model.joint(tree.links[tree.limits[i].link].joint).id for i in ends], dtype=int
        )
        upper = np.array([sides[i] == "upper" for i in ends], dtype=bool)
        middle = model.jnt_range[joints].mean(axis=1)
        tendons = [model.tendon(tree.limits[i].name).id for i in cones]
        places = np.array(ends, dtype=int), joints, model.jnt_qposadr[joints], middle, upper
        return cls(len(sides), places, (np.array(cones, dtype=int), np.array(tendons, dtype=int)))

    def forces(self, data: Any, pull: Array, turn: Array) -> Array:
        """(n,) by what tendons (n_tendons,) and joints (n_joints,) are pushed back with."""
        found = np.zeros(self.n)
        places, joints, at, middle, upper = self.ends
        found[places] = np.where((data.qpos[at] > middle) == upper, turn[joints], 0.0)
        places, tendons = self.cones
        # h = cos(max) - a.R b and length^2 = 2 - 2 a.R b, so that dh = length dlength.
        found[places] = pull[tendons] / data.ten_length[tendons]
        return found


def _gathered(found: list[tuple[slice, int]], n: int) -> Array:
    """(n,) places, from pieces of what they are places of and where these begin."""
    out = np.zeros(n, dtype=int)
    for part, first in found:
        out[part] = first + np.arange(part.stop - part.start)
    return out
