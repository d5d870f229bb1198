"""Equilibria by dynamic relaxation with kinetic damping, refined by Newton's method.

The puppet is let go and stopped whenever its kinetic energy peaks, until it hardly moves; Newton's
method then takes the equilibrium to rounding. From an unstable one it is pushed off, and the search
continues from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, Status, rotation, tangent
from fantoccini.dynamics.compiled import (
    ROW_TOLERANCES,
    CompiledPuppet,
    Evaluation,
    forward_dynamics,
    retract,
)
from fantoccini.dynamics.equilibrium.letting_go import let_go
from fantoccini.dynamics.equilibrium.projection import difference_quotient, onto_rows
from fantoccini.model.puppet import StepperMotor
from fantoccini.model.tree import DriveRow
from fantoccini.motion import State


@dataclass(frozen=True)
class Search:
    """Bounds of relaxation and of Newton's method. Moves are in rad or m."""

    dt: float = 0.002  # Step of the runs [s]
    piece: float = 0.1
    """Length of a run [s]: shorter than a swing, to stop near the peak of kinetic energy."""
    pieces: int = 1500
    newton_rounds: int = 30
    difference: float = 1e-6
    """Step of the finite differences for Newton's matrix; it limits the speed alone."""
    newton_force: float = 0.01
    """Unbalanced force, relative to the weight, below which Newton's method begins; from farther
    away it may converge to another equilibrium than the one the puppet falls into."""
    newton_move: float = 0.3  # Longest move of one round of Newton's method
    near_gap: float = 1e-3  # Relative -h below which a row may pull at the equilibrium
    min_tension: float = 1e-9  # Tension that is rounding, relative to the weight
    balanced_force: float = 1e-13  # Unbalanced force that is rounding, relative to the weight
    balanced_last: float = 1e-11  # The same after the last round
    met_gap: float = 1e-14  # Relative |h| that is rounding
    min_move: float = 1e-15  # Moves of Newton's method that are rounding
    at_equilibrium: float = 1e-6
    """Distance at which the puppet is at an equilibrium instead of passing it; and the largest
    acceleration there."""
    gives_way: float = 0.1  # Move from which a drive counts as giving way
    farthest: float = 100.0  # Move from which the puppet has no equilibrium
    restarts: int = 8  # Restarts from unstable equilibria
    pushes: tuple[float, ...] = (0.05, 0.01, 0.002)
    """Largest parts of the pushes that are tried off an unstable equilibrium."""
    potential_fall: float = 1e-12  # Fall of V that is not rounding, over the puppet's weight [m]
    unstable: float = 1e-6
    """Growth rate squared of an instability, relative to the fastest oscillation's."""
    turns: int = 12  # Rounds of :func:`as_asked`
    min_turn: float = 1e-13  # Turns below this are rounding
    neutral: float = 1e-6
    """Largest stiffness of a neutral move, relative to the stiffest: the precision of finite
    differences. Newton's method and the energy then decide whether it is neutral."""
    move_weight: float = 1e-6  # Weight of translations [m], relative to rotations [rad]


SEARCH = Search()


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium: forces w0 - W tau = 0 over the pulling rows, in the metric of M_DD.

    Attributes:
        x: the state.
        rows: the pulling rows.
        tension: (len(rows),) their tensions.
    """

    x: State
    rows: Indices
    tension: Array


def check_winches(marionette: CompiledPuppet, found: Equilibrium) -> None:
    """Raises StateError where winches slip at an equilibrium."""
    upper = marionette.upper
    if not np.any(np.isfinite(upper)):
        return
    acc, tension = forward_dynamics(marionette, found.x)
    if np.max(np.abs(acc), initial=0.0) > SEARCH.at_equilibrium:
        names = marionette.tree.row_names
        slips = [f"{names[i]} ({upper[i]:g} N)" for i in np.flatnonzero(tension >= upper)]
        raise StateError(
            "the puppet cannot rest there: the largest tension of "
            f"{', '.join(slips) or 'its winches'} does not hold it; raise max_tension, or let "
            "other strings carry more"
        )


def _instability(marionette: CompiledPuppet, found: Equilibrium) -> Array | None:
    """A push (n_vD,) along which V falls while the strings hold; None at a minimum.

    On the rows' null space a small move accelerates by -M^-1 H move, with H the Hessian of
    V + tau . h: self-adjoint in the metric of M_DD, so its eigenvalues are real.
    """
    at = Evaluation.of(marionette, found.x)
    K, A = derivatives(marionette, found)
    n = len(found.x.v_D)
    response = at.back(K.T).T if n else K
    pull = at.back(at.W[:, found.rows].T).T if len(found.rows) else np.zeros((n, 0))
    free = np.eye(n) - pull @ np.linalg.pinv(A @ pull, rcond=1e-10) @ A
    values, vectors = np.linalg.eig(free @ response @ free)
    worst = int(np.argmax(values.real))
    if values[worst].real < SEARCH.unstable * max(1.0, float(np.max(np.abs(values)))):
        return None
    push = free @ vectors[:, worst].real
    return push / np.max(np.abs(push))


def pushed(marionette: CompiledPuppet, x: State, push: Array) -> State | None:
    """A state with lower V than an equilibrium, to either side along a push; None without one.

    Rows that are closed and do not pull are in no equilibrium's equations: they may stabilise what
    would be a saddle without them.
    """
    V, least = marionette.energies(x)[1], SEARCH.potential_fall * sizes(marionette)[1]
    for size in SEARCH.pushes:
        for sign in (1.0, -1.0):
            moved = x.replace(q_D=retract(marionette, x.q_D, sign * size * push))
            other, worst = onto_rows(marionette, moved)
            # V does not include motors' work: a push off their equilibrium is judged later.
            lower = marionette.tree.drives or marionette.energies(other)[1] < V - least
            if worst <= ROW_TOLERANCES.start_gap and lower:
                return other
    return None


def relaxed(marionette: CompiledPuppet, x: State) -> Equilibrium:
    """The equilibrium into which a puppet falls that is let go and stopped again and again.

    Raises:
        StateError: it went on moving, or no run can begin or continue there.
    """
    q_D = x.q_D
    for _ in range(SEARCH.restarts):
        lower = None
        for q_D in _slowing(marionette, x):
            found = newton(marionette, x.replace(q_D=q_D))
            if found is None:
                continue
            push = _instability(marionette, found)
            there = np.max(np.abs(found.x.q_D - q_D)) < SEARCH.at_equilibrium
            if push is not None and there:
                lower = pushed(marionette, found.x, push)
            if push is None or (there and lower is None):
                x = in_step(marionette, found.x)
                return found if x is found.x else newton(marionette, x) or found
            if lower is not None:
                break
        if lower is None:
            break
        x = lower
    why = _giving_way(marionette, x, q_D)
    raise StateError(f"let go and stopped, the puppet keeps moving{why}")


def hauled_in(marionette: CompiledPuppet, x: State) -> State:
    """A state that violates rows, moved towards them by a time-stepping run."""
    _, samples = let_go(marionette, x, SEARCH.piece, dt=SEARCH.dt, alone=True)
    return x.replace(q_D=samples["q_D"][-1]) if len(samples["q_D"]) else x


def _slowing(marionette: CompiledPuppet, x: State) -> Iterator[Array]:
    """Configurations ever closer to an equilibrium, in ever longer intervals."""
    q_D, v_D = x.q_D, np.zeros(marionette.coordinates.n_vD)
    start, yield_at = np.array(q_D), 4
    for piece in range(SEARCH.pieces):
        at_once = x.replace(q_D=q_D, v_D=v_D)
        status, samples = let_go(marionette, at_once, SEARCH.piece, dt=SEARCH.dt, alone=True)
        # Stepper motors may lose steps on the way: they are set back in step afterwards.
        if status not in (Status.DONE, Status.LOST_STEPS):
            raise StateError(f"let go, {status.message}{_giving_way(marionette, x, q_D)}")
        kinetic = samples["kinetic"]
        peaks = np.flatnonzero((kinetic[1:-1] >= kinetic[:-2]) & (kinetic[1:-1] > kinetic[2:]))
        at = int(peaks[0]) + 1 if len(peaks) else len(kinetic) - 1
        q_D = samples["q_D"][at]
        v_D = np.zeros_like(v_D) if len(peaks) else samples["v_D"][at]
        if np.max(np.abs(q_D - start), initial=0.0) > SEARCH.farthest:
            return
        if piece == yield_at:
            yield_at = 2 * yield_at + 1
            yield q_D
    yield q_D


def sizes(marionette: CompiledPuppet) -> tuple[float, float]:
    """Mass [kg] and weight [N] as scales, always positive.

    Where nothing but rotors moves they are the rotors' inertia, and 1 N or N m.
    """
    rotors = sum(row.inertia(marionette.number) for row in marionette.tree.drives)
    return marionette.mass or rotors or 1.0, marionette.weight or 1.0


def _giving_way(marionette: CompiledPuppet, start: State, q_D: Array) -> str:
    """The drives that a puppet without an equilibrium pushes away, in words."""
    texts = []
    for row in marionette.tree.drives:
        if row.turns:
            moved = float(np.linalg.norm(rotation.between(start.q_D[row.q], q_D[row.q])))
        else:
            moved = float(np.abs(q_D[row.q] - start.q_D[row.q])[0])
        if moved < SEARCH.gives_way:
            continue
        if not row.drive.follows:
            texts.append(f"the drive of {row.name} has no control, so that nothing holds it")
        elif row.drive.motor is not None:
            texts.append(f"the motor of {row.name} may be too weak to hold its load")
    return "".join(f"; {text}" for text in texts)


def poles(marionette: CompiledPuppet) -> list[tuple[DriveRow, float]]:
    """The drives with stepper motors, and the distance of their equivalent poles [rad or m]."""
    found = []
    for row in marionette.tree.drives:
        motor, drive = row.drive.motor, row.drive
        if isinstance(motor, StepperMotor):
            turn = 1.0 if drive.drum is None and drive.mass is not None else 2.0 * np.pi
            found.append((row, 4.0 / motor.steps * turn / row.ratio(marionette.number)))
    return found


def in_step(marionette: CompiledPuppet, x: State) -> State:
    """The state with stepper motors moved by whole poles to where they are in step."""
    q_D = x.q_D.copy()
    for row, pole in poles(marionette):
        if row.command is not None:
            q_D[row.q] -= pole * np.round((q_D[row.q] - x.q_K[row.command[0]]) / pole)
    return x if np.array_equal(q_D, x.q_D) else x.replace(q_D=q_D)


def newton(marionette: CompiledPuppet, x: State) -> Equilibrium | None:
    """The equilibrium near a configuration, or None where Newton's method does not converge."""
    scale = marionette.row_scales(x.q_D, x.q_K)
    mass, weight = sizes(marionette)
    size = weight / np.sqrt(mass)
    at = Evaluation.of(marionette, x)
    near = np.flatnonzero((at.h > -SEARCH.near_gap * scale) | marionette.two_sided)
    hddot = at.gamma[near] + at.W[:, near].T @ at.w0
    cap = np.full(len(scale), marionette.tension_cap)
    tension = at.complementarity(near, hddot, marionette.two_sided, cap).x
    if np.linalg.norm(at.w0 - at.W[:, near] @ tension) > SEARCH.newton_force * size:
        return None
    rows: Indices = near[(tension > SEARCH.min_tension * weight) | marionette.two_sided[near]]
    for _ in range(SEARCH.newton_rounds):
        at = Evaluation.of(marionette, x)
        W = at.W[:, rows]
        tension = np.zeros(0)
        if len(rows):
            tension = np.asarray(np.linalg.lstsq(W, at.w0, rcond=1e-10)[0], dtype=float)
        force = at.w0 - W @ tension
        gap = np.max(np.abs(at.h[rows]) / scale[rows], initial=0.0)
        if np.linalg.norm(force) < SEARCH.balanced_force * size and gap < SEARCH.met_gap:
            changed = _changed(marionette, at, rows, tension, scale)
            if changed is None:
                return Equilibrium(x, rows, tension)
            rows = changed
            continue
        K, A = derivatives(marionette, Equilibrium(x, rows, tension))
        system = np.block([[K, -W], [A, np.zeros((len(rows), len(rows)))]])
        step = np.linalg.lstsq(system, -np.concatenate([force, at.h[rows]]), rcond=1e-9)[0]
        move = step[: len(K)]
        largest = np.max(np.abs(move), initial=0.0)
        if not np.isfinite(largest):
            return None
        move = move * min(1.0, SEARCH.newton_move / (largest or 1.0))
        x = x.replace(q_D=retract(marionette, x.q_D, move))
        converged = largest < SEARCH.min_move
        if converged and _changed(marionette, at, rows, tension, scale) is None:
            return Equilibrium(x, rows, tension)
    at = Evaluation.of(marionette, x)
    force = at.w0 - at.W[:, rows] @ tension
    balanced = np.linalg.norm(force) < SEARCH.balanced_last * size
    if balanced and _changed(marionette, at, rows, tension, scale) is None:
        return Equilibrium(x, rows, tension)
    return None


def as_asked(marionette: CompiledPuppet, asked: State, found: Equilibrium) -> Equilibrium:
    """The equilibrium of the same energy that is rotated least from the state asked for.

    A load's angle about its only string is neutral. Without this choice it would depend on how the
    puppet swung to rest, and no input could undo it. In neutral directions without rotation, the
    translation is the smallest.
    """
    table, n = marionette.coordinates, len(found.x.v_D)
    places = table.scalars_D, table.quaternions_D
    weight = _turn_weights(marionette)
    for _ in range(SEARCH.turns):
        neutral = _neutral(marionette, found)
        to_asked = tangent.between(*places, found.x.q_D[None], asked.q_D[None], n)[0]
        shares = np.linalg.lstsq(weight[:, None] * neutral, weight * to_asked)[0]
        move = neutral @ shares
        largest = float(np.max(np.abs(move), initial=0.0))
        if largest < SEARCH.min_turn:
            break
        move *= min(1.0, SEARCH.newton_move / largest)
        other = newton(marionette, found.x.replace(q_D=retract(marionette, found.x.q_D, move)))
        if other is None or not np.array_equal(other.rows, found.rows):
            break
        risen = marionette.energies(other.x)[1] - marionette.energies(found.x)[1]
        if abs(risen) > SEARCH.potential_fall * sizes(marionette)[1]:
            break
        found = other
    return found


def _turn_weights(marionette: CompiledPuppet) -> Array:
    """(n_vD,) weights: 1 for rotations, small ones for translations."""
    table = marionette.coordinates
    weight = np.ones(table.n_vD)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_D:
        if units[table.q_D[q]] != "rad":
            weight[v] = SEARCH.move_weight
    return weight


def _neutral(marionette: CompiledPuppet, found: Equilibrium) -> Array:
    """(n_vD, r) an orthonormal basis of the moves along which forces and gaps stay as they are."""
    W = Evaluation.of(marionette, found.x).W[:, found.rows]
    K, A = derivatives(marionette, found)
    K = K - W @ (np.linalg.pinv(W) @ K) if len(found.rows) else K
    parts = [part / max(float(np.max(np.abs(part), initial=0.0)), 1e-300) for part in (K, A)]
    _, size, modes = np.linalg.svd(np.concatenate(parts))
    return np.asarray(modes[size < SEARCH.neutral * size[0]].T)


def _changed(
    marionette: CompiledPuppet, at: Evaluation, rows: Indices, tension: Array, scale: Array
) -> Indices | None:
    """The rows without those that push and with those that are violated; None if unchanged."""
    pushing = (tension < -SEARCH.min_tension * sizes(marionette)[1]) & ~marionette.two_sided[rows]
    violated = (at.h > ROW_TOLERANCES.start_gap * scale) & ~marionette.two_sided
    if not np.any(pushing) and not np.any(violated):
        return None
    return np.union1d(rows[~pushing], np.flatnonzero(violated))


def derivatives(marionette: CompiledPuppet, found: Equilibrium) -> tuple[Array, Array]:
    """Derivatives of w0 - W tau (n_vD, n_vD) and of h (len(rows), n_vD) by a small move."""

    def residual(q_D: Array) -> Array:
        at = Evaluation.of(marionette, found.x.replace(q_D=q_D))
        return np.append(at.w0 - at.W[:, found.rows] @ found.tension, at.h[found.rows])

    by_move = difference_quotient(marionette, found.x.q_D, residual, SEARCH.difference)
    return by_move[: len(found.x.v_D)], by_move[len(found.x.v_D) :]
