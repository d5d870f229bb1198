"""How the end of a segment answers small changes of its start and of its accelerations.

In z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

    z_end = A z_start + B dacc_K

by central differences of the time-stepper, all of them side by side in lanes.
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import tangent
from fantoccini.plan.goals import Rows
from fantoccini.runtime import POSE, GoalNumbers, RunOptions, Solids, Sweeper, Terms

_EPS = 1e-4
"""Of central differences [rad, m and their rates]."""


def segment_slopes(
    marionette: Marionette,
    starts: Rows,
    acceleration: Array,
    options: RunOptions,
    looks: int,
    threads: int = 1,
) -> tuple[Array, Array]:
    """Slopes of segments.

    Args:
        marionette: the puppet.
        starts: (m,) where they begin.
        acceleration: (m, n_vK) of the driven coordinates.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that they last.
        threads: that share the work.

    Returns:
        A (m, n_z, n_z) and B (m, n_z, n_vK).
    """
    table, m = marionette.coordinates, len(acceleration)
    n, k = table.n_vD, table.n_vK
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    z = _EPS * np.concatenate([np.eye(size), -np.eye(size)])
    q_D, v_D, q_K, v_K, acc_K = np.split(z, np.cumsum([n, n, k, k]), axis=1)

    def all_of(a: Array) -> Array:
        return a.reshape(-1, a.shape[-1])

    near = {
        "q_D": all_of(tangent.moved(*places_D, starts.q_D[:, None], q_D)),
        "v_D": all_of(starts.v_D[:, None] + v_D),
        "slip": np.repeat(starts.slip, 2 * size, axis=0),
        "q_K": all_of(tangent.moved(*places_K, starts.q_K[:, None], q_K)),
        "v_K": all_of(starts.v_K[:, None] + v_K),
    }
    sweeper = Sweeper(marionette.motions, _free(marionette, options, looks), threads)
    rows = np.arange(2 * size * m)
    made = sweeper(near, rows, all_of(acceleration[:, None] + acc_K)[:, None], np.ones(len(rows)))
    ends = {name: a.reshape(m, 2, size, -1) for name, a in made.states.items()}
    changes = (
        tangent.between(*places_D, ends["q_D"][:, 1], ends["q_D"][:, 0], n),
        ends["v_D"][:, 0] - ends["v_D"][:, 1],
        tangent.between(*places_K, ends["q_K"][:, 1], ends["q_K"][:, 0], k),
        ends["v_K"][:, 0] - ends["v_K"][:, 1],
    )
    slopes = np.concatenate(changes, axis=2).swapaxes(1, 2) / (2.0 * _EPS)
    return slopes[:, :, : size - k], slopes[:, :, size - k :]


def _free(marionette: Marionette, options: RunOptions, looks: int) -> Terms:
    """Motions that nothing ends."""
    table = marionette.coordinates
    fast, far = np.full(table.n_vK, np.inf), np.full(table.n_qK, np.inf)
    nowhere = GoalNumbers(
        POSE, np.zeros(table.n_qD), np.zeros(table.n_qD), np.zeros(table.n_vD)
    )
    return Terms(
        options=options,
        looks=looks,
        p=marionette.p,
        winches=marionette.winches,
        bounds=(fast, fast, -far, far),
        margin=0.0,
        slack=True,
        solids=Solids.none(len(marionette.tree.strings)),
        goal=nowhere,
        tolerance=-1.0,
    )
