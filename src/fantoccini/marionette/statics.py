"""Equilibria by letting go: stopped again and again, refined by Newton, pushed off saddles.

The puppet is let go and stopped whenever its kinetic energy peaks, until it hardly moves; Newton's
method on the equilibrium's equations then takes it to rounding. An equilibrium that a small push
would leave is pushed, and the search goes on from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, Status
from fantoccini.marionette.analysis import energies
from fantoccini.marionette.closed import CLOSED
from fantoccini.marionette.dynamics import forward_dynamics
from fantoccini.marionette.instant import Instant, instant_at
from fantoccini.marionette.model import Model
from fantoccini.marionette.projection import onto_rows, retract
from fantoccini.motion import Input, State, rotation
from fantoccini.puppet import Stepper as StepperMotor
from fantoccini.runtime import Run
from fantoccini.tree import DriveRow

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
_FIRM = np.array([[np.inf, 0.0, 0.0]])
"""A winch that does not slip, and catches without bouncing."""
_STANDS = 1e-6
"""Distance from an equilibrium at which the puppet stands on it, rather than passes it by."""
_GIVES_WAY = 0.1
"""Move from which on a drive counts as giving way [m or rad]."""
_PUSHES = 8
_PUSH_SIZES = (0.05, 0.01, 0.002)
"""Largest parts of the pushes that are tried off an unstable equilibrium [rad or m]."""
_FALLS = 1e-12
"""Fall of V that is none but rounding, over the puppet's weight [m]."""
_UNSTABLE = 1e-6
"""Growth rate squared that counts as unstable, relative to the fastest oscillation's."""


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


def check_winches(model: Model, found: Equilibrium) -> None:
    """Raises StateError where the strings cannot hold the puppet without slipping."""
    upper = model.upper
    if not np.any(np.isfinite(upper)):
        return
    acc, tension = forward_dynamics(model, found.x)
    if np.max(np.abs(acc), initial=0.0) > _STANDS:
        names = model.tree.row_names
        slips = [f"{names[i]} ({upper[i]:g} N)" for i in np.flatnonzero(tension >= upper)]
        raise StateError(
            "the puppet cannot rest there: the largest tension of "
            f"{', '.join(slips) or 'its winches'} does not hold it; raise max_tension, or let "
            "other strings carry more"
        )


def _instability(model: Model, found: Equilibrium) -> Array | None:
    """A push (n_vD,) along which V falls while the strings hold; None at a minimum.

    On the rows' null space the accelerations that answer a small move are -M^-1 H move, with H the
    Hessian of V + tau . h: self-adjoint in the metric of M_DD, so its eigenvalues are real.
    """
    instant = instant_at(model, found.x)
    K, A = slopes(model, found)
    n = len(found.x.v_D)
    answer = instant.back(K.T).T if n else K
    pull = instant.back(instant.W[:, found.rows].T).T if len(found.rows) else np.zeros((n, 0))
    free = np.eye(n) - pull @ np.linalg.pinv(A @ pull, rcond=1e-10) @ A
    values, vectors = np.linalg.eig(free @ answer @ free)
    worst = int(np.argmax(values.real))
    if values[worst].real < _UNSTABLE * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = free @ vectors[:, worst].real
    return push / np.max(np.abs(push))


def pushed(model: Model, x: State, push: Array) -> State | None:
    """A state lower than an equilibrium, to either side of it along a push; None where none is.

    Rows that are closed and do not pull are in no equilibrium's equations: they may hold a puppet
    on what would be a saddle without them.

    Args:
        model: the puppet.
        x: the equilibrium.
        push: (n_vD,) with 1 as its largest part.
    """
    V, least = energies(model, x)[1], _FALLS * sizes(model)[1]
    for size in _PUSH_SIZES:
        for sign in (1.0, -1.0):
            moved = x.replace(q_D=retract(model, x.q_D, sign * size * push))
            other, worst = onto_rows(model, moved)
            # Motors' work is not in V: what a push off their equilibrium does is seen later.
            if worst <= CLOSED and (
                model.tree.drives or energies(model, other)[1] < V - least
            ):
                return other
    return None


def dropped(model: Model, x: State) -> Equilibrium:
    """The equilibrium into which a puppet falls that is let go and stopped again and again.

    Raises:
        StateError: it went on moving, or no run can begin or go on there.
    """
    q_D = x.q_D
    for _ in range(_PUSHES):
        lower = None
        for q_D in _relaxed(model, x):
            found = newton(model, x.replace(q_D=q_D))
            if found is None:
                continue
            push = _instability(model, found)
            stands = np.max(np.abs(found.x.q_D - q_D)) < _STANDS
            if push is not None and stands:
                lower = pushed(model, found.x, push)
            if push is None or (stands and lower is None):
                return _in_step(model, found)
            if lower is not None:
                break
        if lower is None:
            break
        x = lower
    why = _giving_way(model, x, q_D)
    raise StateError(f"let go and stopped, the puppet keeps moving{why}")


def hauled(model: Model, x: State) -> State:
    """A state that breaks rows, moved towards them by time-stepping, which hauls strings in."""
    options = model.run_options(dt=_RELAX_DT)
    run = Run(
        model.library, "timestepping", options, x.replace(t=0.0), model.p,
        np.tile(_FIRM, (len(model.tree.strings), 1)),
        Input.hold(model.coordinates).bound(x.q_K),
    )  # fmt: skip
    rows = np.concatenate([r for r, _ in run.advance(_RELAX_PIECE)])
    return x.replace(q_D=model.row_layout.split(rows)["q_D"][-1]) if len(rows) else x


def _relaxed(model: Model, x: State):
    """Configurations ever closer to an equilibrium."""
    options = model.run_options(dt=_RELAX_DT)
    table = model.coordinates
    hold = Input.hold(table).bound(x.q_K)
    q_D, v_D = x.q_D, np.zeros(table.n_vD)
    start, try_at = np.array(q_D), 4
    for piece in range(_RELAX_PIECES):
        run = Run(
            model.library, "timestepping", options, x.replace(t=0.0, q_D=q_D, v_D=v_D),
            model.p, np.tile(_FIRM, (len(model.tree.strings), 1)), hold,
        )  # fmt: skip
        rows = np.concatenate([r for r, _ in run.advance(_RELAX_PIECE)])
        # Steppers may lose steps on the way: they are set back in step afterwards.
        if run.status not in (Status.DONE, Status.LOST_STEPS):
            why = _giving_way(model, x, q_D)
            raise StateError(f"let go, {run.status.message}{why}")
        parts = model.row_layout.split(rows)
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


def sizes(model: Model) -> tuple[float, float]:
    """Mass [kg] and weight [N] that numbers are measured against: positive, whatever has none.

    Where nothing but rotors moves they are the rotors' inertia, and 1 N or N m.
    """
    rotors = sum(row.inertia(model.number) for row in model.tree.drives)
    return model.mass or rotors or 1.0, model.weight or 1.0


def _giving_way(model: Model, start: State, q_D: Array) -> str:
    """Drives that a puppet without an equilibrium moves away from where they are held, in words."""
    said = []
    for row in model.tree.drives:
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


def poles(model: Model) -> list[tuple[DriveRow, float]]:
    """The drives that step, and how far apart the places are where they hold alike [rad or m]."""
    found = []
    for row in model.tree.drives:
        motor, drive = row.drive.motor, row.drive
        if isinstance(motor, StepperMotor):
            turn = 1.0 if drive.drum is None and drive.mass is not None else 2.0 * np.pi
            found.append((row, 4.0 / motor.steps * turn / row.ratio(model.number)))
    return found


def in_step(model: Model, x: State) -> State:
    """The state with stepper motors moved by whole poles to where they are in step."""
    q_D = x.q_D.copy()
    for row, pole in poles(model):
        q_D[row.q] -= pole * np.round((q_D[row.q] - x.q_K[row.command[0]]) / pole)
    return x if np.array_equal(q_D, x.q_D) else x.replace(q_D=q_D)


def _in_step(model: Model, found: Equilibrium) -> Equilibrium:
    """The equilibrium with stepper motors in step, which letting go may have pulled out of it."""
    x = in_step(model, found.x)
    return found if x is found.x else newton(model, x) or found


def newton(model: Model, x: State) -> Equilibrium | None:
    """The equilibrium near a configuration, or None when Newton's method does not settle on it."""
    n = model.coordinates.n_vD
    scale = model.row_scales(x.q_D, x.q_K)
    mass, weight = sizes(model)
    size = weight / np.sqrt(mass)
    rows = None
    for _ in range(_NEWTON_ROUNDS):
        instant = instant_at(model, x)
        if rows is None:
            near = np.flatnonzero((instant.h > -1e-3 * scale) | model.two_sided)
            hddot = instant.gamma[near] + instant.W[:, near].T @ instant.w0
            bound = np.full(len(scale), model.tension_cap)
            tension = instant.complementarity(near, hddot, model.two_sided, bound).x
            rows = near[(tension > 1e-9 * weight) | model.two_sided[near]]
            left = np.linalg.norm(instant.w0 - instant.W[:, near] @ tension)
            if left > _CLOSE * size:
                return None
        W = instant.W[:, rows]
        tension = np.linalg.lstsq(W, instant.w0, rcond=1e-10)[0] if len(rows) else np.zeros(0)
        force = instant.w0 - W @ tension
        shift = np.max(np.abs(instant.h[rows]) / scale[rows], initial=0.0)
        if np.linalg.norm(force) < 1e-13 * size and shift < 1e-14:
            changed = _changed(model, instant, rows, tension, scale)
            if changed is None:
                return Equilibrium(x, rows, tension)
            rows = changed
            continue
        K, A = slopes(model, Equilibrium(x, rows, tension))
        system = np.block([[K, -W], [A, np.zeros((len(rows), len(rows)))]])
        step = np.linalg.lstsq(system, -np.concatenate([force, instant.h[rows]]), rcond=1e-9)[0]
        move = step[:n]
        largest = np.max(np.abs(move), initial=0.0)
        if not np.isfinite(largest):
            return None
        x = x.replace(q_D=retract(model, x.q_D, move * min(1.0, _LONGEST / (largest or 1.0))))
        settled = largest < 1e-15
        if settled and _changed(model, instant, rows, tension, scale) is None:
            return Equilibrium(x, rows, tension)
    instant = instant_at(model, x)
    force = instant.w0 - instant.W[:, rows] @ tension
    balanced = np.linalg.norm(force) < 1e-11 * size
    if balanced and _changed(model, instant, rows, tension, scale) is None:
        return Equilibrium(x, rows, tension)
    return None


def _changed(
    model: Model, instant: Instant, rows: Array, tension: Array, scale: Array
) -> Array | None:
    """The rows that should pull instead: without those that push, with those that are overstepped.

    None when the rows are right.
    """
    pushing = (tension < -1e-9 * sizes(model)[1]) & ~model.two_sided[rows]
    beyond = (instant.h > CLOSED * scale) & ~model.two_sided
    if not np.any(pushing) and not np.any(beyond):
        return None
    return np.union1d(rows[~pushing], np.flatnonzero(beyond))


def slopes(model: Model, at: Equilibrium) -> tuple[Array, Array]:
    """Derivatives of w0 - W tau (n_vD, n_vD) and of h (len(rows), n_vD) by a small move."""
    n = len(at.x.v_D)
    moves = np.concatenate([np.eye(n), -np.eye(n)]) * _STEP
    force, h = np.zeros((2 * n, n)), np.zeros((2 * n, len(at.rows)))
    for i, q_D in enumerate(retract(model, at.x.q_D, moves)):
        instant = instant_at(model, at.x.replace(q_D=q_D))
        force[i] = instant.w0 - instant.W[:, at.rows] @ at.tension
        h[i] = instant.h[at.rows]
    return tuple((part[:n] - part[n:]).T / (2 * _STEP) for part in (force, h))
