"""How the end of a segment answers small changes of its start and of its accelerations.

In z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

    z_end = A z_start + B dacc_K

by central differences, all of them side by side: of the time-stepper in lanes, or of any other way
to go on from many states.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.marionette import Marionette
from fantoccini.motion import tangent
from fantoccini.planning.goals import Rows, all_rows
from fantoccini.runtime import POSE, GoalNumbers, RunOptions, Solids, Sweeper, Terms

_EPS = 1e-4
"""Of central differences, where nothing else is said [rad, m and their rates]."""

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
    apart: float = _EPS,
) -> tuple[Array, Array]:
    """Slopes of segments.

    Args:
        marionette: the puppet.
        starts: (m,) where they begin.
        acceleration: (m, n_vK) of the driven coordinates.
        options: of the time-stepper; ``save_every`` steps make a look.
        looks: that they last.
        threads: that share the work.
        onto: (m, n_z, n_z) project changes of the starts, so that no string is stretched by them.
        apart: size of the changes [rad, m and their rates].

    Returns:
        A (m, n_z, n_z) and B (m, n_z, n_vK).
    """
    sweeper = Sweeper(
        marionette.model.compiled.motions, _free(marionette, options, looks), threads
    )

    def made(near: Rows, acc_K: Array) -> Rows:
        every = np.arange(len(acc_K))
        return Rows(**sweeper(near.parts, every, acc_K[:, None], np.ones(len(every))).states)

    return slopes_of(marionette, made, starts, acceleration, onto, apart)


Move = Callable[[Rows, Array], Rows]
"""Rows (n,) and accelerations (n, n_vK) -> where they lead."""


def slopes_of(
    marionette: Marionette,
    move: Move,
    starts: Rows,
    acceleration: Array,
    onto: Array | None = None,
    apart: float = _EPS,
) -> tuple[Array, Array]:
    """Slopes of where many states lead; arguments and results as of :func:`segment_slopes`.

    Args:
        marionette: the puppet.
        move: gets (2 n_changes) neighbours of every start, start by start.
        starts: (m,).
        acceleration: (m, n_vK).
        onto: (m, n_z, n_z).
        apart: size of the changes [rad, m and their rates].
    """
    table, m = marionette.coordinates, len(acceleration)
    n, k = table.n_vD, table.n_vK
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    size = 2 * n + 3 * k
    changes = np.tile(np.eye(size), (m, 1, 1))
    if onto is not None:
        changes[:, : size - k, : size - k] = onto.swapaxes(1, 2)
    z = apart * np.concatenate([changes, -changes], axis=1)
    q_D, v_D, q_K, v_K, acc_K = np.split(z, np.cumsum([n, n, k, k]), axis=2)
    near = Rows(
        tangent.moved(*places_D, starts.q_D[:, None], q_D),
        starts.v_D[:, None] + v_D,
        np.repeat(starts.slip[:, None], 2 * size, axis=1),
        tangent.moved(*places_K, starts.q_K[:, None], q_K),
        starts.v_K[:, None] + v_K,
    )
    found = move(near.flat, all_rows(acceleration[:, None] + acc_K))
    ends = {name: a.reshape(m, 2, size, -1) for name, a in found.parts.items()}
    answers = (
        tangent.between(*places_D, ends["q_D"][:, 1], ends["q_D"][:, 0], n),
        ends["v_D"][:, 0] - ends["v_D"][:, 1],
        tangent.between(*places_K, ends["q_K"][:, 1], ends["q_K"][:, 0], k),
        ends["v_K"][:, 0] - ends["v_K"][:, 1],
    )
    slopes = np.concatenate(answers, axis=2).swapaxes(1, 2) / (2.0 * apart)
    return slopes[:, :, : size - k], slopes[:, :, size - k :]


def _free(marionette: Marionette, options: RunOptions, looks: int) -> Terms:
    """Motions that nothing ends."""
    table = marionette.coordinates
    fast, far = np.full(table.n_vK, np.inf), np.full(table.n_qK, np.inf)
    none_D, none_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    nowhere = GoalNumbers(
        POSE, np.zeros(table.n_qD), np.zeros(table.n_qD), none_D, none_D, none_K
    )
    return Terms(
        options=options,
        looks=looks,
        p=marionette.p,
        winches=marionette.winches,
        bounds={"speed": fast, "acceleration": fast, "low": -far, "high": far},
        margin=0.0,
        slack=True,
        solids=Solids.none(len(marionette.tree.strings)),
        goal=nowhere,
        tolerance=-1.0,
    )


def taut(marionette: Marionette, at: Rows, held: MaskRows) -> Array:
    """The projections of changes onto those that leave taut strings taut::

        dh = A_D dq_D + A_K dq_K = 0
        dhdot = A_D dv_D + A_K dv_K + (d hdot / dq) dq = 0

    dq_D and then dv_D give way, by the least that is needed.

    Args:
        marionette: the puppet.
        at: (m,) states.
        held: (m, n_strings) bool, the strings that are taut.

    Returns:
        (m, n_z, n_z).
    """
    table = marionette.coordinates
    n, k = table.n_vD, table.n_vK
    m, ways = len(held), n + k
    steps = _STEP * np.concatenate([np.zeros((1, ways)), np.eye(ways)])
    places_D = table.scalars_D, table.quaternions_D
    places_K = table.scalars_K, table.quaternions_K
    q_D = tangent.moved(*places_D, at.q_D[:, None], steps[:, :n]).reshape(m * (ways + 1), -1)
    q_K = tangent.moved(*places_K, at.q_K[:, None], steps[:, n:]).reshape(m * (ways + 1), -1)
    v_D, v_K = (np.repeat(v, ways + 1, axis=0) for v in (at.v_D, at.v_K))
    h = marionette.model.library.evaluate("rows", q_D=q_D, q_K=q_K, p=marionette.p).h
    hdot = marionette.model.library.evaluate(
        "dynamics", q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K, acc_K=np.zeros_like(v_K),
        u_D=np.zeros_like(v_D), p=marionette.p,
    ).hdot  # fmt: skip
    strings = held.shape[1]
    h_q, hdot_q = (
        _by_places(a[:, :strings].reshape(m, ways + 1, strings), held) for a in (h, hdot)
    )
    back = np.linalg.pinv(h_q[..., :n], rcond=1e-6)
    one = np.tile(np.eye(ways), (m, 1, 1))
    one[:, :n] -= back @ h_q
    place = np.concatenate([np.arange(n), 2 * n + np.arange(k)])
    rate = np.concatenate([n + np.arange(n), 2 * n + k + np.arange(k)])
    onto = np.zeros((m, 2 * ways, 2 * ways))
    onto[:, place[:, None], place] = onto[:, rate[:, None], rate] = one
    onto[:, n : 2 * n, place] = -back @ hdot_q @ one
    return onto


def _by_places(found: Array, held: MaskRows) -> Array:
    """(m, n_strings, ways) slopes from (m, 1 + ways, n_strings) values; 0 where nothing is held."""
    return (found[:, 1:] - found[:, :1]).swapaxes(1, 2) / _STEP * held[..., None]
