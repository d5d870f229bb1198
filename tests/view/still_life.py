"""Puppets to be drawn without a compiled model, and an invented motion of theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini import puppets
from fantoccini.base.errors import Status
from fantoccini.model.puppet import Puppet, load
from fantoccini.model.tree import grow
from fantoccini.motion import EventRecord, Trajectory
from fantoccini.motion.columns import Columns
from fantoccini.output.view.still import UncompiledPuppet


class StillLife(UncompiledPuppet):
    """Poses of one puppet, without a compiled model."""

    def __init__(self, puppet: Puppet):
        super().__init__(puppet, grow(puppet))


def bundled_still_life(name: str) -> StillLife:
    return StillLife(load(puppets.path(name)))


def swinging_motion(marionette: StillLife, duration: float = 1.0, rows: int = 41) -> Trajectory:
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
        zip(tree.strings, marionette.string_points(q_D, q_K).values(), strict=True)
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
        t=t,
        q_D=q_D,
        v_D=v_D,
        acc_D=v_D,
        q_K=q_K,
        v_K=v_K,
        acc_K=v_K,
        tension=Columns(names, tension, "string"),
        limit_force=Columns(limits, np.zeros((rows, len(limits))), "limit"),
        taut=Columns(names, taut, "string"),
        ledger=Columns(entries, energy, "entry"),
        events=tuple(EventRecord(0.8 * duration, "catch", name, 0.1, 0.2) for name in names[-1:]),
        status=Status.DONE,
        method="event",
        coordinates=table,
        puppet=marionette.puppet,
    )


def walking_motion(m: StillLife, far: float) -> Trajectory:
    """An invented motion of the marionette on its bar, carried forwards by `far` [m]."""
    run = swinging_motion(m, 3.0)
    by = far * (1.0 - np.cos(np.pi * run.t / 3.0)) / 2.0
    moved = {}
    for name in ("q_D", "q_K"):
        q = np.array(getattr(run, name))
        free = [k for k, n in enumerate(getattr(run.coordinates, name)) if n.endswith(".x")]
        q[:, free] += by[:, None]
        moved[name] = q
    return replace(run, **moved)
