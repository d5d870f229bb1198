"""Rest and repair: equilibria of a hanging puppet, and states brought onto their strings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, Status
from fantoccini.marionette.closed import CLOSED, closed_rows, known_mode
from fantoccini.marionette.instant import Instant
from fantoccini.marionette.tighten import tightened
from fantoccini.motion import Input, State, rotation, tangent
from fantoccini.puppet import Stepper as StepperMotor
from fantoccini.runtime import Run
from fantoccini.tree import DriveRow

if TYPE_CHECKING:
    from fantoccini.marionette.handle import Marionette

_RELAX_DT = 0.002
_RELAX_PIECE = 0.1
_RELAX_PIECES = 1500
_NEWTON_ROUNDS = 30
_STEP = 1e-6
"""Step of the finite differences that give Newton's matrix; it does not limit the accuracy of the
equilibrium, only the speed of convergence."""
_CLOSE = 0.01
"""Unbalanced part of the forces below which Newton's method takes over; from farther away it may
go to another equilibrium, not to the one the puppet falls into."""
_LONGEST = 0.3
"""Longest move of one round of Newton's method [rad or m]."""
_LONGEST_PULL = 1e3
"""Bound on what moves a configuration back onto its strings, over the puppet's mass [m]."""
_FIRM = np.array([[np.inf, 0.0, 0.0]])
"""A winch that does not slip, and catches without bouncing."""
_STANDS = 1e-6
"""Distance from an equilibrium at which the puppet stands on it, rather than passes it by."""
_GIVES_WAY = 0.1
"""Move from which on a drive counts as giving way [m or rad]."""
_HELD = ". Is every free body held by a string, a limit or a joint to the world?"
_PUSHES = 8
_PUSH = 0.05
"""Largest part of a push off an unstable equilibrium [rad or m]."""
_UNSTABLE = 1e-6
"""Growth rate squared that counts as unstable, relative to the fastest oscillation's."""


def retract(marionette: Marionette, q_D: Array, move: Array) -> Array:
    """q_D moved by tangent vectors: scalars add, quaternions turn.

    Args:
        marionette: whose coordinates they are.
        q_D: (n_qD,).
        move: (..., n_vD).

    Returns:
        (..., n_qD).
    """
    table = marionette.coordinates
    return tangent.moved(table.scalars_D, table.quaternions_D, q_D, move)


def project(marionette: Marionette, x: State) -> State:
    """The nearest state, in the metric of M_DD, that no string or limit forbids.

    Positions first (q_K stays), then velocities: min |dq|_M with h + A dq <= 0, repeated; then
    hdot <= 0 on the rows that are closed. Rows that are taut in the state's mode are brought to
    h = 0 and hdot = 0, as far as they do not contradict one another.
    """
    taut = closed_rows(marionette, x, marionette.instant(x)).held & known_mode(marionette, x)
    scale = marionette.row_scales(x.q_D, x.q_K)
    wires = marionette.two_sided
    held = wires.copy()
    for _ in range(100):
        instant = marionette.instant(x)
        rows = np.flatnonzero((instant.h > -0.05 * scale) | held)
        off = np.where(held, np.abs(instant.h), instant.h) > 1e-14 * scale
        if not np.any(off):
            break
        # A row that had to be brought back ends on its bound, not beyond it.
        held |= off
        # Where rows contradict one another the bound lets each go as far as it can.
        bound = np.full(len(held), _LONGEST_PULL * _sizes(marionette)[0])
        pull = instant.complementarity(rows, instant.h[rows], held, bound).x
        move = -instant.back(instant.W[:, rows] @ pull)
        size = float(np.max(np.abs(move), initial=0.0))
        if size < 1e-16:
            break
        x = x.replace(q_D=retract(marionette, x.q_D, move * min(1.0, 0.3 / size)))
    instant = marionette.instant(x)
    beyond = ~(np.where(wires, np.abs(instant.h), instant.h) <= CLOSED * scale)
    if np.any(beyond):
        names = ", ".join(marionette.tree.row_names[i] for i in np.flatnonzero(beyond))
        raise StateError(f"no state of the puppet fits these string ends and lengths: {names}")
    x = tightened(marionette, x, taut)
    instant = marionette.instant(x)
    # Strings on winches that slip give way instead.
    firm = (np.abs(instant.h) <= CLOSED * scale) & ~np.isfinite(marionette.upper)
    rows = np.flatnonzero(firm | wires)
    found = instant.complementarity(rows, instant.hdot[rows], wires | x.taut)
    if not found.solved:
        found = instant.complementarity(rows, instant.hdot[rows], wires)
    if not found.solved:
        names = ", ".join(marionette.rows_of(rows, found.ray))
        raise StateError(f"no velocity of the puppet fits these driven velocities: {names}")
    v_D = x.v_D - instant.back(instant.W[:, rows] @ found.x)
    return marionette.with_mode(x.replace(v_D=v_D, taut=x.taut))


def rest(marionette: Marionette, x: State) -> State:
    """A hanging equilibrium near a state: a local minimum of V subject to h <= 0.

    The puppet is let go and stopped whenever its kinetic energy peaks, until it hardly moves;
    Newton's method on the equilibrium's equations then takes it to rounding. An equilibrium that a
    small push would leave is pushed, and the search goes on from there.

    Args:
        marionette: the puppet.
        x: where to begin; its inputs are held still.

    Raises:
        StateError: there is no equilibrium below, or it was not found, or a winch would slip in it.
    """
    rewinds = marionette.winches[: len(x.slip), 1] > 0
    still = x.replace(
        v_D=np.zeros_like(x.v_D), v_K=np.zeros_like(x.v_K), slip=np.where(rewinds, 0.0, x.slip)
    )
    still = project(marionette, still)
    if not len(still.q_D):
        return marionette.with_mode(still)
    q_D = still.q_D
    for _ in range(_PUSHES):
        pushed = None
        for q_D in _relaxed(marionette, still):
            found = _newton(marionette, still.replace(q_D=q_D))
            if found is None:
                continue
            push = _instability(marionette, found)
            if push is None:
                check_winches(marionette, found)
                return marionette.with_mode(_in_step(marionette, found).x)
            if np.max(np.abs(found.x.q_D - q_D)) < _STANDS:
                pushed = found.x.replace(q_D=retract(marionette, found.x.q_D, push))
                break
        if pushed is None:
            break
        still = project(marionette, pushed)
    raise StateError(
        "no equilibrium was found: the puppet keeps moving"
        + (_giving_way(marionette, still, q_D) or _HELD)
    )


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium: forces w0 - W tau = 0 on the pulling rows, in the metric of M_DD.

    Attributes:
        x: the state.
        rows: the pulling rows.
        tension: (len(rows),) their tensions.
    """

    x: State
    rows: Array
    tension: Array


def check_winches(marionette: Marionette, found: Equilibrium) -> None:
    """Raises StateError where the strings cannot hold the puppet without slipping."""
    upper = marionette.upper
    if not np.any(np.isfinite(upper)):
        return
    acc, tension = marionette.accelerations(found.x)
    if np.max(np.abs(acc), initial=0.0) > _STANDS:
        names = marionette.tree.row_names
        slips = [f"{names[i]} ({upper[i]:g} N)" for i in np.flatnonzero(tension >= upper)]
        raise StateError(
            "the puppet cannot rest there: the largest tension of "
            f"{', '.join(slips) or 'its winches'} does not hold it; raise max_tension, or let "
            "other strings carry more"
        )


def _instability(marionette: Marionette, found: Equilibrium) -> Array | None:
    """A push (n_vD,) along which V falls while the strings hold; None at a minimum.

    On the rows' null space the accelerations that answer a small move are -M^-1 H move, with H the
    Hessian of V + tau . h: self-adjoint in the metric of M_DD, so its eigenvalues are real.
    """
    instant = marionette.instant(found.x)
    K, A = slopes(marionette, found)
    n = len(found.x.v_D)
    answer = instant.back(K.T).T if n else K
    pull = instant.back(instant.W[:, found.rows].T).T if len(found.rows) else np.zeros((n, 0))
    free = np.eye(n) - pull @ np.linalg.pinv(A @ pull, rcond=1e-10) @ A
    values, vectors = np.linalg.eig(free @ answer @ free)
    worst = int(np.argmax(values.real))
    if values[worst].real < _UNSTABLE * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = free @ vectors[:, worst].real
    return _PUSH * push / np.max(np.abs(push))


def _relaxed(marionette: Marionette, x: State):
    """Configurations ever closer to an equilibrium."""
    options = marionette.run_options(dt=_RELAX_DT)
    table = marionette.coordinates
    hold = Input.hold(table).bound(x.q_K)
    q_D, v_D = x.q_D, np.zeros(table.n_vD)
    start, try_at = np.array(q_D), 4
    for piece in range(_RELAX_PIECES):
        run = Run(
            marionette.library, "timestepping", options, x.replace(t=0.0, q_D=q_D, v_D=v_D),
            marionette.p, np.tile(_FIRM, (len(marionette.tree.strings), 1)), hold,
        )  # fmt: skip
        rows = np.concatenate([r for r, _ in run.advance(_RELAX_PIECE)])
        if run.status is not Status.DONE:
            why = _giving_way(marionette, x, q_D)
            raise StateError(f"no equilibrium was found: {run.status.message}{why}")
        parts = marionette.row_layout.split(rows)
        kinetic = parts["kinetic"]
        peaks = np.flatnonzero((kinetic[1:-1] >= kinetic[:-2]) & (kinetic[1:-1] > kinetic[2:]))
        at = int(peaks[0]) + 1 if len(peaks) else len(rows) - 1
        q_D = parts["q_D"][at]
        v_D = np.zeros(table.n_vD) if len(peaks) else parts["v_D"][at]
        if np.max(np.abs(q_D - start), initial=0.0) > 100.0:
            return
        if piece == try_at:
            try_at = 2 * try_at + 1
            yield q_D
    yield q_D


def _sizes(marionette: Marionette) -> tuple[float, float]:
    """Mass [kg] and weight [N] that numbers are measured against: positive, whatever has none.

    Where nothing but rotors moves they are the rotors' inertia, and 1 N or N m.
    """
    rotors = sum(row.inertia(marionette.number) for row in marionette.tree.drives)
    return marionette.mass or rotors or 1.0, marionette.weight or 1.0


def _giving_way(marionette: Marionette, start: State, q_D: Array) -> str:
    """Drives that a puppet without an equilibrium moves away from where they are held, in words."""
    said = []
    for row in marionette.tree.drives:
        if row.turns:
            moved = float(np.linalg.norm(rotation.between(start.q_D[row.q], q_D[row.q])))
        else:
            moved = float(np.abs(q_D[row.q] - start.q_D[row.q])[0])
        if moved < _GIVES_WAY:
            continue
        if not row.drive.follows:
            said.append(f"the drive of {row.name} has no control, so that nothing holds it")
        elif row.drive.motor is not None:
            said.append(f"the motor of {row.name} may be too weak to hold its load")
    return "".join(f"; {text}" for text in said)


def poles(marionette: Marionette) -> list[tuple[DriveRow, float]]:
    """The drives that step, and how far apart the places are where they hold alike [rad or m]."""
    found = []
    for row in marionette.tree.drives:
        motor, drive = row.drive.motor, row.drive
        if isinstance(motor, StepperMotor):
            turn = 1.0 if drive.drum is None and drive.mass is not None else 2.0 * np.pi
            found.append((row, 4.0 / motor.steps * turn / row.ratio(marionette.number)))
    return found


def in_step(marionette: Marionette, x: State) -> State:
    """The state with stepper motors moved by whole poles to where they are in step."""
    q_D = x.q_D.copy()
    for row, pole in poles(marionette):
        q_D[row.q] -= pole * np.round((q_D[row.q] - x.q_K[row.command[0]]) / pole)
    return x if np.array_equal(q_D, x.q_D) else x.replace(q_D=q_D)


def _in_step(marionette: Marionette, found: Equilibrium) -> Equilibrium:
    """The equilibrium with stepper motors in step, which letting go may have pulled out of it."""
    x = in_step(marionette, found.x)
    return found if x is found.x else _newton(marionette, x) or found


def _newton(marionette: Marionette, x: State) -> Equilibrium | None:
    """The equilibrium near a configuration, or None when Newton's method does not settle on it."""
    n = marionette.coordinates.n_vD
    scale = marionette.row_scales(x.q_D, x.q_K)
    mass, weight = _sizes(marionette)
    size = weight / np.sqrt(mass)
    rows = None
    for _ in range(_NEWTON_ROUNDS):
        instant = marionette.instant(x)
        if rows is None:
            near = np.flatnonzero((instant.h > -1e-3 * scale) | marionette.two_sided)
            hddot = instant.gamma[near] + instant.W[:, near].T @ instant.w0
            bound = np.full(len(scale), marionette.tension_cap)
            tension = instant.complementarity(near, hddot, marionette.two_sided, bound).x
            rows = near[(tension > 1e-9 * weight) | marionette.two_sided[near]]
            left = np.linalg.norm(instant.w0 - instant.W[:, near] @ tension)
            if left > _CLOSE * size:
                return None
        W = instant.W[:, rows]
        tension = np.linalg.lstsq(W, instant.w0, rcond=1e-10)[0] if len(rows) else np.zeros(0)
        force = instant.w0 - W @ tension
        shift = np.max(np.abs(instant.h[rows]) / scale[rows], initial=0.0)
        if np.linalg.norm(force) < 1e-13 * size and shift < 1e-14:
            changed = _changed(marionette, instant, rows, tension, scale)
            if changed is None:
                return Equilibrium(x, rows, tension)
            rows = changed
            continue
        K, A = slopes(marionette, Equilibrium(x, rows, tension))
        system = np.block([[K, -W], [A, np.zeros((len(rows), len(rows)))]])
        step = np.linalg.lstsq(system, -np.concatenate([force, instant.h[rows]]), rcond=1e-9)[0]
        move = step[:n]
        largest = np.max(np.abs(move), initial=0.0)
        if not np.isfinite(largest):
            return None
        x = x.replace(q_D=retract(marionette, x.q_D, move * min(1.0, _LONGEST / (largest or 1.0))))
        settled = largest < 1e-15
        if settled and _changed(marionette, instant, rows, tension, scale) is None:
            return Equilibrium(x, rows, tension)
    instant = marionette.instant(x)
    force = instant.w0 - instant.W[:, rows] @ tension
    balanced = np.linalg.norm(force) < 1e-11 * size
    if balanced and _changed(marionette, instant, rows, tension, scale) is None:
        return Equilibrium(x, rows, tension)
    return None


def _changed(
    marionette: Marionette, instant: Instant, rows: Array, tension: Array, scale: Array
) -> Array | None:
    """The rows that should pull instead: without those that push, with those that are overstepped.

    None when the rows are right.
    """
    pushing = (tension < -1e-9 * _sizes(marionette)[1]) & ~marionette.two_sided[rows]
    beyond = (instant.h > CLOSED * scale) & ~marionette.two_sided
    if not np.any(pushing) and not np.any(beyond):
        return None
    return np.union1d(rows[~pushing], np.flatnonzero(beyond))


def slopes(marionette: Marionette, at: Equilibrium) -> tuple[Array, Array]:
    """Derivatives of w0 - W tau (n_vD, n_vD) and of h (len(rows), n_vD) by a small move."""
    n = len(at.x.v_D)
    moves = np.concatenate([np.eye(n), -np.eye(n)]) * _STEP
    force, h = np.zeros((2 * n, n)), np.zeros((2 * n, len(at.rows)))
    for i, q_D in enumerate(retract(marionette, at.x.q_D, moves)):
        instant = marionette.instant(at.x.replace(q_D=q_D))
        force[i] = instant.w0 - instant.W[:, at.rows] @ at.tension
        h[i] = instant.h[at.rows]
    return tuple((part[:n] - part[n:]).T / (2 * _STEP) for part in (force, h))
