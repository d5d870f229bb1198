"""Motions of links by their joints' screws, and the derivatives of these motions.

With s_k the screw of velocity k, twists about the world's origin in world axes, (v, w):

    V = sum of s_k v_k,   A = sum of s_k a_k + sdot_k v_k,   sdot_k = [Omega_k, s_k]

over the velocities that move a link. Omega_k is the twist of the carrier of the axis of k, and
[a, b] = (w_a x v_b + v_a x w_b, w_a x w_b). A small change dq moves a link by the twist
xi = sum of s_k dq_k and turns the screws as a motion does: ds_k = [xi_k, s_k].

a_k is the rate of v_k, and [a, b] the Lie bracket. q_D and q_K are the dynamic and the driven
coordinates, n_vD and n_vK the numbers of their velocities.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.model.tree import TURNS_WITH_LINK, WORLD, Role, Tree
from fantoccini.motion import State

PARAMETER_STEP = 1e-3
"""Step of differences by parameters, relative to 1 or the parameter, with an error near 1e-12."""

OFFSETS = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
"""Offsets of a central difference of sixth order, in steps."""
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
"""Weights of this central difference."""


def bracket(a: Array, b: Array) -> Array:
    """Lie bracket [a, b] of twists (..., 6): the rate of b when carried along by a."""
    v = np.cross(a[..., 3:], b[..., :3]) + np.cross(a[..., :3], b[..., 3:])
    return np.concatenate([v, np.cross(a[..., 3:], b[..., 3:])], axis=-1)


class Screws:
    """Motions of links at a state, and their changes by q_D, v_D, q_K, v_K, acc_K, u_D and p.

    Changes are m columns, in this order or as given by ``changes``; acc_D is constant.

    Args:
        marionette: the puppet.
        x: the state.
        acc_D, acc_K: (n_vD,), (n_vK,) accelerations; 0 by default.
        changes: (n_columns, m) changes of these quantities; the unit matrix by default.
    """

    def __init__(
        self,
        marionette: CompiledPuppet,
        x: State,
        acc_D: Array | None = None,
        acc_K: Array | None = None,
        changes: Array | None = None,
    ):
        t, p = marionette.coordinates, marionette.p
        self.n_D, n_K = t.n_vD, t.n_vK
        n = self.n_D + n_K
        self._moves, self._carries = moving_and_carrying(marionette.tree)
        results = marionette.library.evaluate("screws", q_D=x.q_D, q_K=x.q_K, p=p)
        self.poses = results.poses.T
        self.s = np.concatenate([results.screw_D.T, results.screw_K.T])
        self._v = np.concatenate([x.v_D, x.v_K])
        zeros_D, zeros_K = np.zeros(self.n_D), np.zeros(n_K)
        acc_D, acc_K = zeros_D if acc_D is None else acc_D, zeros_K if acc_K is None else acc_K
        self._a = np.concatenate([acc_D, acc_K])
        column_ends = np.cumsum([0, self.n_D, self.n_D, n_K, n_K, n_K, self.n_D, len(p)])
        self.n_columns = int(column_ends[-1])
        slices = [slice(a, b) for a, b in pairwise(column_ends)]
        q_D, v_D, q_K, v_K, a_K, _, p_slice = slices
        self._dq, self._dv, self._da = (np.zeros((n, self.n_columns)) for _ in range(3))
        for target, D, K in ((self._dq, q_D, q_K), (self._dv, v_D, v_K)):
            target[: self.n_D, D], target[self.n_D :, K] = np.eye(self.n_D), np.eye(n_K)
        self._da[self.n_D :, a_K] = np.eye(n_K)
        self._dp = np.zeros((len(p), self.n_columns))
        self._dp[:, p_slice] = np.eye(len(p))
        if changes is not None:
            self.n_columns = changes.shape[1]
            derivatives = (self._dq, self._dv, self._da, self._dp)
            self._dq, self._dv, self._da, self._dp = (columns @ changes for columns in derivatives)
        self._set_parameter_derivatives(marionette, x)

    def _set_parameter_derivatives(self, marionette: CompiledPuppet, x: State) -> None:
        """Sets twists of the links (n_links, 6, n_p) and changes of the screws (n, 6, n_p) by p."""
        p, n_links = marionette.p, len(self.poses)
        self._xi_p, self._s_p = np.zeros((n_links, 6, len(p))), np.zeros((len(self.s), 6, len(p)))
        if not len(p):
            return
        step = PARAMETER_STEP * np.maximum(1.0, np.abs(p))
        shifted_p = p + (OFFSETS[:, None, None] * np.diag(step)).reshape(-1, len(p))
        results = marionette.library.evaluate("screws", q_D=x.q_D, q_K=x.q_K, p=shifted_p)
        screws = np.concatenate([results.screw_D, results.screw_K], axis=-1).swapaxes(-1, -2)
        self._s_p, poses = (
            np.einsum("o,opij->ijp", WEIGHTS, x.reshape(len(OFFSETS), len(p), *x.shape[1:])) / step
            for x in (screws, results.poses.swapaxes(-1, -2))
        )
        for i, pose in enumerate(self.poses):
            R, dR = pose[:9].reshape(3, 3).T, poses[i, :9].reshape(3, 3, -1).swapaxes(0, 1)
            rotation_rate = np.einsum("ijp,kj->ikp", dR, R)
            w = np.stack([rotation_rate[2, 1], rotation_rate[0, 2], rotation_rate[1, 0]])
            self._xi_p[i] = np.concatenate([poses[i, 9:] - np.cross(w.T, pose[9:]).T, w])

    def twist(self, link: int) -> Array:
        """Twist V (6,) of a link [m/s, rad/s]."""
        if link == WORLD:
            return np.zeros(6)
        return np.asarray((self._moves[link] * self._v) @ self.s)

    def acceleration(self, link: int) -> Array:
        """Acceleration A = dV/dt (6,) of a link [m/s^2, rad/s^2]."""
        if link == WORLD:
            return np.zeros(6)
        moves = self._moves[link]
        return np.asarray((moves * self._a) @ self.s + (moves * self._v) @ self._s_dot)

    def pose_by(self, link: int) -> Array:
        """Changes (6, m) of a link's pose, as twists."""
        out = np.zeros((6, self.n_columns))
        if link != WORLD:
            out += (self.s.T * self._moves[link]) @ self._dq
            out += self._xi_p[link] @ self._dp
        return out

    def twist_by(self, link: int) -> Array:
        """Changes (6, m) of V."""
        if link == WORLD:
            return np.zeros((6, self.n_columns))
        moves = self._moves[link]
        by_screws = np.einsum("k,kim->im", moves * self._v, self._ds)
        return np.asarray((self.s.T * moves) @ self._dv + by_screws)

    def acceleration_by(self, link: int) -> Array:
        """Changes (6, m) of A."""
        if link == WORLD:
            return np.zeros((6, self.n_columns))
        moves = self._moves[link]
        return np.asarray(
            (self.s.T * moves) @ self._da
            + np.einsum("k,kim->im", moves * self._a, self._ds)
            + np.einsum("k,kim->im", moves * self._v, self._ds_dot)
            + (self._s_dot.T * moves) @ self._dv
        )

    def subspace(self, link: int) -> Array:
        """Derivatives (6, n_vD) of V by v_D."""
        if link == WORLD:
            return np.zeros((6, self.n_D))
        return np.asarray((self.s.T * self._moves[link])[:, : self.n_D])

    def force_by(self, link: int, wrench: Array, wrench_by: Array) -> Array:
        """Changes (n_vD, m) of the generalised forces of a wrench on a link.

        Args:
            link: index of the link.
            wrench: (6,) force and torque about the world's origin [N, N m].
            wrench_by: (6, m) changes of the wrench.
        """
        if link == WORLD:
            return np.zeros((self.n_D, self.n_columns))
        moves = self._moves[link][: self.n_D, None]
        turned_forces = np.einsum("kim,i->km", self._ds[: self.n_D], wrench)
        return np.asarray(moves * (turned_forces + self.s[: self.n_D] @ wrench_by))

    @cached_property
    def _carrier_twists(self) -> Array:
        """Twists Omega_k (n, 6) of the carriers of the axes."""
        return np.asarray((self._carries * self._v) @ self.s)

    @cached_property
    def _s_dot(self) -> Array:
        """Rates of the screws (n, 6)."""
        return bracket(self._carrier_twists, self.s)

    @cached_property
    def _ds(self) -> Array:
        """Changes of the screws (n, 6, m)."""
        carrier_motions = np.einsum("kj,jm,ji->kmi", self._carries, self._dq, self.s)
        out = bracket(carrier_motions, self.s[:, None]).swapaxes(1, 2)
        return np.asarray(out + self._s_p @ self._dp)

    @cached_property
    def _ds_dot(self) -> Array:
        """Changes of the screws' rates (n, 6, m)."""
        ds = self._ds.swapaxes(1, 2)
        carrier_change = np.einsum("kj,j,jmi->kmi", self._carries, self._v, ds)
        carrier_change += np.einsum("kj,jm,ji->kmi", self._carries, self._dv, self.s)
        out = bracket(carrier_change, self.s[:, None]) + bracket(self._carrier_twists[:, None], ds)
        return np.asarray(out.swapaxes(1, 2))


def moving_and_carrying(tree: Tree) -> tuple[Array, Array]:
    """Velocities that move each link (n_links, n) and carry each screw (n, n): 1, others 0."""
    t = tree.coordinates
    n = t.n_vD + t.n_vK
    moves, carries = np.zeros((len(tree.links), n)), np.zeros((n, n))
    for i, link in enumerate(tree.links):
        if link.parent != WORLD:
            moves[i] = moves[link.parent]
        if link.role is Role.FIXED:
            continue
        first = link.v.start + (t.n_vD if link.role is Role.DRIVEN else 0)
        joint_velocities = np.arange(first, first + link.v.stop - link.v.start)
        carries[joint_velocities] = moves[i]
        moves[i, joint_velocities] = 1.0
        turned_screws = joint_velocities[list(TURNS_WITH_LINK.get(link.kind, ()))]
        carries[np.ix_(turned_screws, joint_velocities)] = 1.0
    return moves, carries
