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

_STEP = 1e-7
"""Of forward differences of strings' lengths [rad or m]."""


def segment_slopes(
    marionette: Marionette,
    starts: Rows,
    acceleration: Array,
    options: RunOptions,
    looks: int,
    threads: int = 1,
    onto: Array | None = None,
) -> tuple[Array, Array]:
    """Slopes of segments.

    Args:
        marionette: the puppet.
        starts: (m,) where they begin.
        acceleration: (m, n_vK) of the driven coordinates.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that they last.
        threads: that share the work.
        onto: (n_z, n_z) projects changes of the start, so that no string is stretched by them.

    Returns:
        A (m, n_z, n_z) and B (m, n_z, n_vK).
    """
    table, m = marionette.coordinates, len(acceleration)
    n, k = table.n_vD, table.n_vK
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    changes = np.eye(size)
    if onto is not None:
        changes[: size - k, : size - k] = onto.T
    z = _EPS * np.concatenate([changes, -changes])
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
    apart = (
        tangent.between(*places_D, ends["q_D"][:, 1], ends["q_D"][:, 0], n),
        ends["v_D"][:, 0] - ends["v_D"][:, 1],
        tangent.between(*places_K, ends["q_K"][:, 1], ends["q_K"][:, 0], k),
        ends["v_K"][:, 0] - ends["v_K"][:, 1],
    )
    slopes = np.concatenate(apart, axis=2).swapaxes(1, 2) / (2.0 * _EPS)
    return slopes[:, :, : size - k], slopes[:, :, size - k :]


def _free(marionette: Marionette, options: RunOptions, looks: int) -> Terms:
    """Motions that nothing ends."""
    table = marionette.coordinates
    fast, far = np.full(table.n_vK, np.inf), np.full(table.n_qK, np.inf)
    nowhere = GoalNumbers(POSE, np.zeros(table.n_qD), np.zeros(table.n_qD), np.zeros(table.n_vD))
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


def taut(marionette: Marionette, q_D: Array, q_K: Array, held: Array) -> Array:
    """The projection (n_z, n_z) of changes onto those that leave taut strings at their length.

    dq_D and dv_D give way, by the least that is needed.

    Args:
        marionette: the puppet.
        q_D, q_K: (n_qD,), (n_qK,).
        held: (n_strings,) bool, strings that are taut.
    """
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    steps = _STEP * np.eye(n + k)
    moved_D = tangent.moved(table.scalars_D, table.quaternions_D, q_D, steps[:, :n])
    moved_K = tangent.moved(table.scalars_K, table.quaternions_K, q_K, steps[:, n:])
    (there,) = marionette.library.evaluate("rows", [moved_D, moved_K, marionette.p])
    (here,) = marionette.library.evaluate("rows", [q_D, q_K, marionette.p])
    slopes = ((there - here) / _STEP).T[: len(held)][held]
    back = np.linalg.pinv(slopes[:, :n], rcond=1e-6) @ slopes
    one = np.eye(n + k)
    one[:n] -= back
    onto = np.zeros((2 * (n + k), 2 * (n + k)))
    for first in (0, 1):  # positions, velocities
        rows = np.concatenate([first * n + np.arange(n), 2 * n + first * k + np.arange(k)])
        onto[np.ix_(rows, rows)] = one
    return onto
