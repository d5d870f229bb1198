"""Small changes of the state across a catch: the saltation matrix.

A change dz of the state moves the time of the catch, h = 0, by dt = -dh / hdot-. With the impulse
v+ = R(q, v-) of Eqs. 13-15 and f = (v_D, acc_D),

    dz+ = dR (dz- + f- dt) - f+ dt,

for changes of the state alone the saltation matrix dR + (f+ - dR f-) (-dh/dz) / hdot-. dR comes
from the impulse's own equations, over the rows that are struck or held afterwards:

    M (v+ - v-) + A_D^T Lambda = 0,   hdot+ = -e max(hdot-, 0)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, SimulationError, Status
from fantoccini.base.documents import Parameter
from fantoccini.dynamics.compiled import ROW_TOLERANCES, Evaluation
from fantoccini.dynamics.derivatives import KKTSystem, row_derivatives_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.input_piece import InputVariation
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.motion import State

VELOCITY_ERROR = 1e-4
"""Difference from the run's velocities after a catch, relative to 1 or to them: beyond it the
equations are not the run's."""
NEGLIGIBLE = 1e-9
"""Impulses and speeds that are rounding, relative to the largest."""


@dataclass(frozen=True, eq=False)
class Passage:
    """A catch of a run, a touch, or a point of contact that stops; and its saltation matrix.

    Attributes:
        t: time [s].
        rows: names of the strings and limits caught, of the parts that touch, as ``foot|floor``, or
            of those that stop sliding on one another.
        speed: at which the gap closes that decides the time [m/s or rad/s]; 0 where a point stops.
        jump: (2 n_vD, 2 n_vD) saltation matrix: changes of (q_D, v_D) from before to after.
        sharp: whether the derivative exists there: one row is caught, or one point touches, or
            several that always do so at once, and no other is at its bound by chance. Otherwise
            ``jump`` holds for changes that keep the sequence of events.
    """

    t: float
    rows: tuple[str, ...]
    speed: float
    jump: Array
    sharp: bool


class Catch:
    """One catch of a run.

    Args:
        marionette: the puppet.
        before, after: the states on its two sides.
        held: rows taut before, and after.

    Raises:
        SimulationError: the run's velocities are not those of the impulse's equations.
    """

    def __init__(
        self, marionette: Marionette, before: State, after: State, held: tuple[Indices, Indices]
    ):
        self._marionette, self._before = marionette, before
        self._at = at = Evaluation.of(marionette, before)
        wires, n_rows = marionette.two_sided, marionette.tree.n_rows
        was, stays = np.zeros((2, n_rows), dtype=bool)
        was[held[0]] = stays[held[1]] = True
        scale = marionette.row_scales(before.q_D, before.q_K)
        closed = np.abs(at.h) <= ROW_TOLERANCES.start_gap * scale
        rows = np.flatnonzero(was | closed | wires)
        self._restitution = string_restitution(marionette, at)
        stopped = (1.0 + self._restitution) * at.hdot
        found = at.complementarity(rows, stopped[rows], wires)
        strikes = np.zeros(n_rows, dtype=bool)
        strikes[rows] = np.abs(found.x) > NEGLIGIBLE * np.max(np.abs(found.x), initial=0.0)
        # The run has stopped the rows that it holds afterwards, if only from speeds close to rest.
        self._rows = np.flatnonzero(strikes | wires | stays)
        self._system = KKTSystem(at, self._rows)
        still = np.zeros((len(before.v_D), 1))
        kick, impulse = self._system.solve(still, stopped[self._rows, None])
        self._kick, self._impulse = kick[:, 0], np.zeros(n_rows)
        self._impulse[self._rows] = impulse[:, 0]
        self._v_after = before.v_D + self._kick
        off = np.abs(self._v_after - after.v_D) / (1.0 + np.abs(after.v_D))
        if not found.solved or np.max(off, initial=0.0) > VELOCITY_ERROR:
            raise SimulationError(
                Status.NOT_SETTLED,
                f"the catch at t = {before.t:.6g} s cannot be differentiated: its velocities are "
                "not those of the impulse on the strings that it strikes and holds, as when "
                "unequal restitutions are scaled down",
            )
        fast = np.max(np.abs(at.hdot[rows]), initial=0.0)
        self.caught = np.flatnonzero(closed & ~was & ~wires & (at.hdot > NEGLIGIBLE * fast))
        speeds = at.hdot[self.caught]
        self.speed = float(np.max(speeds, initial=0.0))
        self._guard = self.caught[np.argmax(speeds)] if len(speeds) else None
        touching = closed & ~was & (at.hdot > -ROW_TOLERANCES.rest_speed)
        self.sharp = bool(
            len(self.caught) == 1 and np.sum(touching) == 1 and not np.any(stays & ~was & ~strikes)
        )

    def across(
        self, Z: Array, by_input: InputVariation, acc: tuple[Array, Array], acc_K: Array
    ) -> tuple[Array, Passage]:
        """Changes after the catch, and the catch with its saltation matrix.

        Arguments are those of :meth:`carried`.
        """
        m, n = Z.shape[1], len(Z)
        both = np.concatenate([Z, np.eye(n)], axis=1)
        found = self.carried(both, by_input.widened(n), acc, acc_K)
        names = tuple(self._marionette.tree.row_names[i] for i in self.caught)
        passage = Passage(self._before.t, names, self.speed, found[:, m:], self.sharp)
        return found[:, :m], passage

    def carried(
        self, Z: Array, by_input: InputVariation, acc: tuple[Array, Array], acc_K: Array
    ) -> Array:
        """Changes after the catch, at a fixed time.

        Args:
            Z: (2 n_vD, m) the changes before it.
            by_input: changes of inputs and parameters.
            acc: acc_D before and after.
            acc_K: (n_vK,) driven acceleration before it.
        """
        x, n, p = self._before, len(self._before.v_D), by_input.p
        sides = np.stack([x.v_D, self._v_after])
        found = row_derivatives_at(self._marionette, x, sides)
        before, after = ({name: part[i] for name, part in found.items()} for i in (0, 1))
        q_D, v_D, q_K, v_K = Z[:n], Z[n:], by_input.q_K, by_input.v_K
        late = np.zeros((1, Z.shape[1]))
        if self._guard is not None:
            r = self._guard
            gap = before["A_D"][r] @ q_D + before["A_K"][r] @ q_K + before["h_p"][r] @ p
            late = -gap[None] / self.speed
        q_D, v_D = q_D + x.v_D[:, None] * late, v_D + acc[0][:, None] * late
        q_K, v_K = q_K + x.v_K[:, None] * late, v_K + acc_K[:, None] * late
        speed = rate_change(before, q_D, q_K, v_K, p) + before["A_D"] @ v_D
        rate = rate_change(after, q_D, q_K, v_K, p) + after["A_D"] @ v_D
        rate += self._restitution[:, None] * speed
        rate += restitution_change(self._marionette, self._at) @ p
        force = force_change(self._marionette, x, self._kick, self._impulse, q_D, q_K, p)
        v_D = v_D + self._system.solve(force, rate[self._rows])[0]
        q_D = q_D - self._v_after[:, None] * late
        return np.concatenate([q_D, v_D - acc[1][:, None] * late])


def string_restitution(marionette: Marionette, at: Evaluation) -> Array:
    """(n_rows,) restitutions of the rows that close."""
    out = np.zeros(len(at.hdot))
    out[: len(marionette.tree.strings)] = marionette.winches[:, WINCH_AT["restitution"]]
    out[at.hdot <= 0.0] = 0.0
    return out


def force_change(
    marionette: Marionette,
    before: State,
    kick: Array,
    impulse: Array,
    q_D: Array,
    q_K: Array,
    p: Array,
) -> Array:
    """Change of M (v+ - v-) + A_D^T Lambda at fixed v+ - v- and Lambda.

    It is the residual of the equations of motion at rest with the kick as acc_D, less that of
    gravity and springs.
    """
    x = before.replace(v_D=np.zeros_like(before.v_D), v_K=np.zeros_like(before.v_K))
    values = marionette.at(x) | {
        "acc_D": np.stack([kick, np.zeros_like(kick)]),
        "acc_K": x.v_K,
        "tension": np.stack([impulse, np.zeros_like(impulse)]),
        "dt": np.array(0.0),
    }
    compiled = marionette.libraries.derivatives
    found = compiled.at("force_by_q", values) | compiled.at("force_by_K", values)
    by = {name: part[0] - part[1] for name, part in found.items()}
    return by["r_q"] @ q_D + by["r_qK"] @ q_K + by["r_p"] @ p


def restitution_change(marionette: Marionette, at: Evaluation) -> Array:
    """(n_rows, n_p) derivative of e max(hdot-, 0) by the parameters."""
    out = np.zeros((marionette.tree.n_rows, len(marionette.p)))
    for i, string in enumerate(marionette.tree.strings):
        if isinstance(string.restitution, Parameter):
            place = marionette.parameter_index[string.restitution.parameter]
            out[i, place] = max(at.hdot[i], 0.0)
    return out


def rate_change(found: dict[str, Array], q_D: Array, q_K: Array, v_K: Array, p: Array) -> Array:
    """(n_rows, m) changes of hdot at fixed v_D; ``found`` from :func:`row_derivatives_at`."""
    return found["hdot_q"] @ q_D + found["hdot_qK"] @ q_K + found["A_K"] @ v_K + found["hdot_p"] @ p
