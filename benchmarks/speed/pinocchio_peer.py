"""Pinocchio as a peer, from its Python wheel: the articulated-body algorithm, without strings.

Its constraints are coincident points and frames. A string's length is neither, so its constrained
dynamics cannot hold the puppet up.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.base.arrays import Array

from .by_joint import dynamic_joints, pack_rates
from .mujoco_peer import PeerError
from .subject import still_tree

CALLS = 2000


class Pinocchio:
    """A model, and calls of it.

    Attributes:
        version: version of the wheel.
        constraints: kinds of contact of its constrained dynamics.
    """

    def __init__(self, text: str):
        """Creates the model from MJCF text.

        Raises:
            PeerError: it is not installed.
        """
        try:
            import pinocchio
        except ImportError:
            raise PeerError("not installed") from None
        self.pin, self.version = pinocchio, pinocchio.__version__
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "puppet.xml")
            path.write_text(text, encoding="utf-8")
            self.model = pinocchio.buildModelFromMJCF(str(path))
        self.data = self.model.createData()
        names = pinocchio.ContactType.names
        self.constraints = tuple(n for n in names if not n.endswith("UNDEFINED"))

    def acceleration(self, q_D: Array, v_D: Array) -> Array:
        """(n_vD,) without strings, in our order and axes."""
        q, v, tau = self._state(q_D, v_D)
        acc = self.pin.aba(self.model, self.data, q, v, tau)
        rates = {}
        for name, joint in dynamic_joints(still_tree(), q_D, v_D).items():
            part = acc[self._places(name)[1]]
            if joint.kind == "free":
                R = _rotation(joint.q[3:])
                part = np.concatenate([R @ (part[:3] + np.cross(v[3:6], v[:3])), part[3:]])
            rates[name] = part
        return pack_rates(still_tree(), rates)

    def burst(self, q_D: Array, v_D: Array) -> float:
        """Time of a call [s]."""
        aba, model, data = self.pin.aba, self.model, self.data
        q, v, tau = self._state(q_D, v_D)
        start = time.thread_time()
        for _ in range(CALLS):
            aba(model, data, q, v, tau)
        return (time.thread_time() - start) / CALLS

    def _state(self, q_D: Array, v_D: Array) -> tuple[Array, Array, Array]:
        """Its configuration, velocity, and the forces of the joints' damping."""
        q, v = np.zeros(self.model.nq), np.zeros(self.model.nv)
        tau = np.zeros(self.model.nv)
        damping = {link.joint: link.damping for link in still_tree().links}
        for name, joint in dynamic_joints(still_tree(), q_D, v_D).items():
            at_q, at_v = self._places(name)
            rate = np.array(joint.v)
            if joint.kind == "hinge":
                q[at_q] = joint.q
            else:
                w, *xyz = joint.q[-4:]
                q[at_q] = [*joint.q[:-4], *xyz, w]
            if joint.kind == "free":
                rate[:3] = _rotation(joint.q[3:]).T @ rate[:3]
            v[at_v], tau[at_v] = rate, -damping[name] * rate
        return q, v, tau

    def _places(self, name: str) -> tuple[slice, slice]:
        i = self.model.getJointId(name)
        q, v = self.model.idx_qs[i], self.model.idx_vs[i]
        return slice(q, q + self.model.nqs[i]), slice(v, v + self.model.nvs[i])


def _rotation(q: tuple[float, ...]) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z)."""
    w, *xyz = q
    return Rotation.from_quat([*xyz, w]).as_matrix()
