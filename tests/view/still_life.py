"""A marionette's handle without a compiled model: poses by plain forward kinematics."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini import puppets
from fantoccini.errors import Status
from fantoccini.motion import Event, Trajectory
from fantoccini.motion.columns import Columns
from fantoccini.puppet import Parameter, Puppet, load
from fantoccini.tree import WORLD, Role, grow
from fantoccini.world import World


def number(x):
    return x.value if isinstance(x, Parameter) else float(x)


def numbers(xs):
    return np.array([number(x) for x in xs])


class StillLife:
    """Offers what the view asks of a Marionette."""

    def __init__(self, puppet: Puppet):
        self.world = World.of(puppet)
        self.tree = grow(self.world)
        self.coordinates = self.tree.coordinates

    def poses(self, q_D, q_K):
        q_D, q_K = np.atleast_2d(q_D), np.atleast_2d(q_K)
        out = np.zeros((len(q_D), len(self.tree.links), 3, 4))
        for k, link in enumerate(self.tree.links):
            q = (q_D if link.role is Role.DYNAMIC else q_K)[:, link.q]
            up = np.broadcast_to(np.eye(3, 4), (len(q_D), 3, 4))
            if link.parent != WORLD:
                up = out[:, link.parent]
            R, p = joint(link, q)
            R0, p0 = link.rotation, numbers(link.offset)
            out[:, k, :, :3] = up[:, :, :3] @ R0 @ R
            out[:, k, :, 3] = np.einsum("tij,tj->ti", up[:, :, :3], p0 + p @ R0.T) + up[:, :, 3]
        return out

    def string_points(self, q_D, q_K):
        poses = self.poses(q_D, q_K)
        still = np.broadcast_to(np.eye(3, 4), (len(poses), 3, 4))
        rows = []
        for string in self.tree.strings:
            row = []
            for point in string.points:
                pose = still if point.link == WORLD else poses[:, point.link]
                row.append(pose[:, :, :3] @ numbers(point.at) + pose[:, :, 3])
            rows.append(np.stack(row, axis=1))
        return rows

    def string_lengths(self, q_K):
        q_K = np.atleast_2d(q_K)
        columns = [
            np.full(len(q_K), number(s.length))
            if s.length_index is None
            else q_K[:, s.length_index[0]]
            for s in self.tree.strings
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((len(q_K), 0))


def joint(link, q):
    """Rotation (T, 3, 3) and translation (T, 3) of a joint's motion."""
    n = len(q)
    R, p = np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3))
    if link.kind == "revolute":
        R = Rotation.from_rotvec(q * link.axes[:, 0]).as_matrix()
    elif link.kind in ("prismatic", "translation"):
        p = q @ link.axes.T
    elif link.kind == "ball":
        R = Rotation.from_quat(q, scalar_first=True).as_matrix()
    elif link.kind == "free":
        p, R = q[:, :3], Rotation.from_quat(q[:, 3:], scalar_first=True).as_matrix()
    return R, p


def bundled(name: str) -> StillLife:
    return StillLife(load(puppets.path(name)))


def swinging(marionette: StillLife, duration: float = 1.0, rows: int = 41) -> Trajectory:
    """An invented motion: free and ball joints turn a little, every third string goes slack."""
    table, tree = marionette.coordinates, marionette.tree
    t = np.linspace(0.0, duration, rows)
    q_D = np.tile(table.start_D, (rows, 1))
    for q, _ in table.quaternions_D:
        turn = np.column_stack([0.1 * np.sin(t), 0.3 * np.sin(3.0 * t + q), 0.0 * t])
        q_D[:, q : q + 4] = Rotation.from_rotvec(turn).as_quat(scalar_first=True)
    q_K = np.tile(np.nan_to_num(table.start_K), (rows, 1))
    n = len(tree.strings)
    taut, tension = np.ones((rows, n), dtype=bool), np.zeros((rows, n))
    for k, (string, points) in enumerate(
        zip(tree.strings, marionette.string_points(q_D, q_K), strict=True)
    ):
        spare = 0.2 * np.maximum(0.0, np.sin(4.0 * t)) if k % 3 == 2 else 0.0 * t
        if string.length_index is not None:
            span = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
            q_K[:, string.length_index[0]] = span + spare
        taut[:, k] = spare == 0.0
        tension[:, k] = np.where(taut[:, k], 1.0 + k, 0.0)
    names, limits = [s.name for s in tree.strings], [row.name for row in tree.limits]
    v_D, v_K = np.zeros((rows, table.n_vD)), np.zeros((rows, table.n_vK))
    energy = np.column_stack([np.sin(t) ** 2, 3.0 + np.cos(t), -t, 0 * t, 0 * t, t, 1e-6 * t])
    entries = ("kinetic", "potential", "damping", "impact", "slip", "work", "residual")
    return Trajectory(
        t=t, q_D=q_D, v_D=v_D, acc_D=v_D, q_K=q_K, v_K=v_K, acc_K=v_K,
        tension=Columns(names, tension, "string"),
        limit_force=Columns(limits, np.zeros((rows, len(limits))), "limit"),
        taut=Columns(names, taut, "string"),
        ledger=Columns(entries, energy, "entry"),
        events=(Event(0.8 * duration, "catch", names[-1], 0.1, 0.2),),
        status=Status.DONE, method="event", coordinates=table, puppet=marionette.world.puppets[0],
    )  # fmt: skip
