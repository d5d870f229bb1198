"""Transfer of a state to a changed puppet: values by name, projected onto strings and limits.

q_D are the dynamic coordinates and q_K the driven ones, with the velocities v_D and v_K. Projection
means the smallest change after which no string is too short and no limit exceeded. A winch changes
the length of a string; slip is the length that it lets out at its largest tension.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import StateError
from fantoccini.dynamics.compiled import check_step
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.motion import State


def initial_state(marionette: Marionette) -> State:
    """State of rest of a puppet; without an equilibrium, the projected pose of its file."""
    try:
        return marionette.rest()
    except StateError:
        return marionette.project(marionette.state())


def check_steps(marionette: Marionette, x: State, dt: float) -> None:
    """Raises StateError if steps of ``dt`` [s] are too long for a chain or a spring."""
    try:
        check_step(marionette, "timestepping", x.q_D, x.q_K, dt)
    except StateError as error:
        raise StateError(
            f"{error}. A performance has no other method, and `fantoccini show` no other dt: "
            "change the pieces, leave out the string's `chain`, or soften the spring"
        ) from None


def transfer_state(
    old_marionette: Marionette, x: State, new_marionette: Marionette, start: State
) -> tuple[State, tuple[str, ...]]:
    """State of a changed puppet, in which coordinates that exist in both keep their values.

    The hands are at rest.

    Args:
        old_marionette: puppet.
        x: its state.
        new_marionette: changed puppet.
        start: state of the changed puppet, for new coordinates.

    Returns:
        The state, which strings and limits may forbid, and messages about lost and new coordinates.
    """
    old_table, new_table = old_marionette.coordinates, new_marionette.coordinates
    q = dict(zip(old_table.q_D + old_table.q_K, np.concatenate([x.q_D, x.q_K]), strict=True))
    v = dict(zip(old_table.v_D + old_table.v_K, np.concatenate([x.v_D, x.v_K]), strict=True))
    slip = {
        s.name: float(slip_length)
        for s, slip_length in zip(old_marionette.tree.strings, x.slip, strict=True)
    }
    state = State(
        x.t,
        np.array(
            [q.get(name, value) for name, value in zip(new_table.q_D, start.q_D, strict=True)]
        ),
        np.array([v.get(name, 0.0) for name in new_table.v_D]),
        np.array(
            [q.get(name, value) for name, value in zip(new_table.q_K, start.q_K, strict=True)]
        ),
        np.zeros(new_table.n_vK),
        np.zeros(new_marionette.tree.n_rows, dtype=bool),
        np.array([slip.get(s.name, 0.0) for s in new_marionette.tree.strings]),
        new_table,
    )
    names = set(new_table.q_D + new_table.q_K)
    lost_messages = tuple(f"{name} is gone" for name in q if name not in names)
    new_messages = tuple(
        f"{name} is new" for name in new_table.q_D + new_table.q_K if name not in q
    )
    return state, lost_messages + new_messages


def feasible_state(marionette: Marionette, x: State) -> State:
    """State near ``x`` that strings and limits permit; ``x`` itself if there is none.

    If strings are too short for the puppet, their winches slip.

    Args:
        marionette: puppet with winches that slip.
        x: state.
    """
    try:
        return marionette.project(x)
    except StateError:
        n = len(marionette.tree.strings)
        excess = np.maximum(marionette.constraint(x)[:n], 0.0)
        can_slip = np.isfinite(marionette.winches[:, WINCH_AT["max_tension"]])
    x = x.replace(slip=x.slip + np.where(can_slip, excess, 0.0))
    try:
        return marionette.project(x)
    except StateError:
        return x
