"""Accelerations and tensions of a state: Eqs. 10 and 11 with the rules of Sec. IV."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.marionette.closed import check_mode, closed_rows
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.model import Model
from fantoccini.motion import State

ROUNDED = 1e-14
"""hddot below which it is rounding, relative to its largest terms or gravity."""


class ForwardDynamics(NamedTuple):
    """What :func:`forward_dynamics` gives.

    Attributes:
        acc_D: (n_vD,) dynamic accelerations [rad/s^2 or m/s^2].
        tension: (n_rows,) forces of strings and then limits, >= 0 [N or N m]; the least-norm one
            where several give the same motion.
    """

    acc_D: Array
    tension: Array


def forward_dynamics(
    model: Model, x: State, acc_K: Array | None = None, u_D: Array | None = None
) -> ForwardDynamics:
    """M_DD acc_D = u_D - c - M_DK acc_K + A_D^T lambda, with strings that only pull.

    Over the rows that are taut in the state's mode, and those with h = 0 and hdot = 0:
    tau >= 0, hddot <= 0, tau . hddot = 0.

    Args:
        model: the puppet.
        x: the state. Gaps and speeds that a fixed step has left of its taut rows stay as they are.
        acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
        u_D: (n_vD,) user forces; 0 when not given.

    Raises:
        StateError: no acceleration keeps the rows, as when two inputs pull a string apart; or
            the mode says of slack rows that they are taut.
    """
    instant = instant_at(model, x, acc_K, u_D)
    check_mode(model, x, instant)
    closed = closed_rows(model, x, instant)
    tension = np.where(closed.slipping, model.upper, 0.0)
    w0 = instant.w0 - instant.W[:, closed.slipping] @ tension[closed.slipping]
    rows = np.flatnonzero(closed.held)
    hddot = instant.gamma[rows] + instant.W[:, rows].T @ w0
    # Rounding alone must not set rows that oppose one another at odds.
    terms = np.abs(instant.gamma[rows]) + np.abs(instant.W[:, rows]).T @ np.abs(w0)
    top = max(float(np.max(terms, initial=0.0)), model.weight / (model.mass or 1.0))
    hddot[np.abs(hddot) <= ROUNDED * top] = 0.0
    found = instant.complementarity(rows, hddot, model.two_sided, model.upper)
    if not found.solved:
        raise StateError(
            "no acceleration keeps these strings and limits: "
            + ", ".join(model.rows_of(rows, found.ray))
        )
    tension[rows] = found.x
    return ForwardDynamics(instant.back(w0 - instant.W[:, rows] @ found.x), tension)


def with_mode(model: Model, x: State) -> State:
    """The state with its taut rows found."""
    return x.replace(taut=(forward_dynamics(model, x).tension > 0.0) | model.two_sided)
