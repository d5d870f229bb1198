"""A run in MuJoCo as a trajectory."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.errors import Status
from fantoccini.exchange.mujoco_puppet import MuJoCoPuppet
from fantoccini.marionette import Marionette, bind_input, check_start
from fantoccini.motion import Columns, Input, State, Trajectory
from fantoccini.motion.trajectory import LEDGER

_SAME_TIME = 1e-9
"""Breaks that lie nearer to one another are one [s]."""


def mujoco_run(
    marionette: Marionette, x0: State, inputs: Input, t_end: float, dt: float
) -> Trajectory:
    """What MuJoCo makes of a puppet's inputs, by Runge and Kutta's method of order 4.

    Driven coordinates are put right at every step, and constantly accelerated in between; user
    forces are constant there. Strings and limits are soft: ``violation`` has by how much. There are
    no events; of the ledger, what was lost and worked since the start is nan.

    Args:
        marionette: the puppet.
        x0: where it starts.
        inputs: what the driven coordinates do, and user forces; breaks are ends of steps.
        t_end: end of the run [s].
        dt: longest step [s].

    Returns:
        A row for every step; up to where it was finite.

    Raises:
        ExchangeError: the puppet has what MuJoCo cannot do.
        MissingLibraryError: MuJoCo is not installed.
        StateError: ``x0`` breaks a string or limit.
    """
    check_start(marionette.model, x0, "timestepping")
    puppet = MuJoCoPuppet(marionette, dt)
    data = puppet.data
    t = _steps(x0.t, t_end, inputs.breaks, dt)
    bound = bind_input(marionette.model, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    q_K, v_K, acc_K = bound.evaluate(t)
    h = np.diff(t)
    u_D = inputs.evaluate_force(np.append(t[:-1] + 0.5 * h, t[-1]))
    rates = np.concatenate([np.diff(v_K, axis=0) / h[:, None], acc_K[-1:]])
    puppet.put(x0.q_D, x0.v_D)
    rows: list[Any] = []
    pulls: list[Any] = []
    stops: list[Any] = []
    for k in range(len(t)):
        puppet.drive(q_K[k], v_K[k], rates[k])
        data.qfrc_applied[puppet.v_D] = u_D[k]
        moved = np.concatenate([data.qpos[puppet.q_D], data.qvel[puppet.v_D]])
        if not np.all(np.isfinite(moved)):
            break
        puppet.evaluate()
        rows.append(np.concatenate([moved, data.qacc[puppet.v_D]]))
        for kept, force in zip((pulls, stops), puppet.forces(), strict=True):
            kept.append(force)
        if k < len(h):
            puppet.model.opt.timestep = h[k]
            puppet.step()
    n, table = len(rows), marionette.coordinates
    ends = np.cumsum([table.n_qD, table.n_vD])
    q_D, v_D, acc_D = np.split(np.array(rows), ends, axis=1)
    made = t[:n], q_D, v_D, acc_D, q_K[:n], v_K[:n], acc_K[:n]
    status = Status.DONE if n == len(t) else Status.NOT_FINITE
    return _trajectory(marionette, made, np.array(pulls), np.array(stops), status)


def _steps(start: float, end: float, breaks: Times, dt: float) -> Times:
    """Times from start to end, at most ``dt`` apart, breaks among them."""
    inner = breaks[(breaks > start + _SAME_TIME) & (breaks < end - _SAME_TIME)]
    corners = np.concatenate([[start], inner, [end]])
    pieces = [
        np.linspace(a, b, int(np.ceil((b - a) / dt - 1e-6)), endpoint=False)
        for a, b in pairwise(corners)
    ]
    return np.append(np.concatenate(pieces), end)


def _trajectory(
    marionette: Marionette, made: tuple[Array, ...], pulls: Array, stops: Array, status: Status
) -> Trajectory:
    names = "t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K"
    part = dict(zip(names, made, strict=True))
    tree, n = marionette.tree, len(part["t"])
    strings = tuple(s.name for s in tree.strings)
    beyond = _violation(marionette, part)
    state = {name: part[name] for name in ("q_D", "v_D", "q_K", "v_K")}
    energy = marionette.model.library.evaluate("energy", **state, p=marionette.p)
    ledger = np.full((n, len(LEDGER)), np.nan)
    ledger[:, LEDGER.index("kinetic")] = energy.T
    ledger[:, LEDGER.index("potential")] = energy.V
    return Trajectory(
        **part,
        tension=Columns(strings, pulls, "string"),
        limit_force=Columns(tuple(limit.name for limit in tree.limits), stops, "limit"),
        taut=Columns(strings, pulls != 0.0, "string"),
        ledger=Columns(LEDGER, ledger, "entry"),
        events=(),
        status=status,
        method="mujoco",
        coordinates=marionette.coordinates,
        puppet=marionette.model.described,
        violation=Columns(tree.row_names, beyond, "string or limit"),
        slip=Columns(strings, np.zeros((n, len(strings))), "string"),
    )


def _violation(marionette: Marionette, part: dict[str, Array]) -> Array:
    """max(h, 0) of every row, |h| of wires (T, n_rows)."""
    h = marionette.model.library.evaluate(
        "rows", q_D=part["q_D"], q_K=part["q_K"], p=marionette.p
    ).h
    return np.where(marionette.model.two_sided, np.abs(h), np.maximum(h, 0.0))
