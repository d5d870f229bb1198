"""One time step and its derivatives: the call of :func:`linearise_steps` with one state.

Its result adds the contacts by name: the points that push, their modes, the changes of their
forces, and contacts between two modes.

acc_K are the accelerations of the driven coordinates q_K, q_D the dynamic coordinates. A row is a
string or a joint limit; the taut ones are the active set. Slip is the length of string that a winch
lets out at its largest tension. The gap of two solids is their distance, negative in an overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import ARRIVED, Array, ShortRepr, SimulationError, StateError, Status
from fantoccini.dynamics.compiled import CompiledPuppet, Screws, Touch, integrate, vector
from fantoccini.dynamics.derivatives.contact_rows import ContactMode, ContactRows, HeldPoint
from fantoccini.dynamics.derivatives.driven_step import DrivenStep
from fantoccini.dynamics.derivatives.linearisation import Partials
from fantoccini.dynamics.derivatives.step_partials import StepInputs, StepOptions, linearised
from fantoccini.dynamics.steppers import CONTRADICTION_STATUSES, contradiction, decide
from fantoccini.kernel.contract import StepEdge
from fantoccini.kernel.runtime import LaneRecord, StepTouches
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State, pair_name


@dataclass(frozen=True, eq=False, repr=False)
class StepLinearisation(ShortRepr):
    """One step of the time-stepper and its derivatives, with the active set of the step.

    As a discrete system in z = (dq_D, dv_D, dq_K, dv_K), with tangent vectors dq::

        z_next = A z + B dacc_K + B_u du_D + B_p dp

    where acc_K and u_D are constant over the step, as a stepper's are. Derivatives are exact for
    small changes consistent with all held rows and points; for others, such as tilting one of two
    flat soles, they are least-squares ones.

    Attributes:
        x, x_next: states before and after the step.
        dt: length of the step [s].
        rows: names of the strings and limits held in the step.
        tension: (n_rows,) impulses over dt [N or N m].
        A: (2 n_vD + 2 n_vK,) squared, derivatives by z.
        B: (2 n_vD + 2 n_vK, n_vK) derivatives by the driven acceleration.
        B_u: (2 n_vD + 2 n_vK, n_vD) derivatives by the user's forces.
        B_p: (2 n_vD + 2 n_vK, n_p) derivatives by the parameters.
        tension_partials: derivatives of ``tension`` (n_rows, ...); 0 for rows that are not held.
        contacts: the points that push, in their modes.
        force_partials: derivatives of their forces (3 n, ...), in the world; of least norm where
            the law does not determine them, as the forces are.
        edges: contacts between two modes, such as a point that touches without force: A, B, B_u
            and B_p are then derivatives of the modes taken, towards one side.
        coordinates: names and places of the coordinates.
    """

    x: State
    x_next: State
    dt: float
    rows: tuple[str, ...]
    tension: Array
    A: Array
    B: Array
    B_u: Array
    B_p: Array
    tension_partials: Partials
    contacts: tuple[HeldPoint, ...]
    force_partials: Partials
    edges: tuple[str, ...]
    coordinates: CoordinateTable

    @property
    def differentiable(self) -> bool:
        """Whether the derivative exists towards all sides: no contact is between two modes."""
        return not self.edges


def linearise_step(
    marionette: CompiledPuppet,
    x: State,
    acc_K: Array | None = None,
    u_D: Array | None = None,
    dt: float = 0.002,
) -> StepLinearisation:
    """The first time step from a state; see :meth:`Marionette.linearise_step`."""
    t = marionette.coordinates
    n, k, n_p = t.n_vD, t.n_vK, len(marionette.p)
    acc_K, u_D = vector("acc_K", acc_K, k), vector("u_D", u_D, n)
    slip = marionette.states([x]).slip[0]
    motion = x.q_D, x.v_D, x.q_K, x.v_K
    step_inputs = StepInputs.from_arrays(marionette, motion, acc_K, u_D, None, dt, slip)
    options = StepOptions(forces=True, tension_partials=True, threads=1)
    linearised_ = linearised(marionette, step_inputs, options, shares=True)
    steps, results = linearised_.steps, linearised_.record
    _check_arrived(marionette, x, results, acc_K, dt)
    touches = results if isinstance(results, StepTouches) else None
    points = () if touches is None else _held_points(marionette, touches)
    _check_differentiable(
        marionette, touches, points, int(steps.edges[0]), bool(linearised_.shortened[0])
    )
    driven_step = DrivenStep(t.quaternions_K, x.v_K, acc_K, dt)
    widths = [n, n, k, k, k, n, n_p]
    columns = Partials.from_columns(
        np.concatenate([steps.motion[0], driven_step.end_derivatives(n, n_p)]), widths
    )
    x_next = _state_after(marionette, x, results, dt)
    assert steps.tension_partials is not None
    force_changes = np.zeros((0, sum(widths)))
    if points:
        assert (
            touches is not None and linearised_.shares is not None and linearised_.moved is not None
        )
        step_state, chain_rule = (
            x.replace(v_K=driven_step.rate, v_D=x_next.v_D),
            driven_step.chain_rule(n, n_p),
        )
        if delay := float(touches.delay[0]):
            step_state = step_state.replace(
                q_D=integrate(marionette, x.q_D, delay * x.v_D),
                q_K=integrate(marionette, x.q_K, delay * driven_step.rate, driven=True),
            )
            chain_rule[:n], chain_rule[2 * n : 2 * n + k] = np.split(linearised_.moved[0], [n])
        contact_rows = ContactRows(Screws(marionette, step_state), points, dt)
        multiplier_changes = linearised_.shares[0, : len(contact_rows.multipliers)]
        acc_changes = steps.motion[0, n:].copy()
        acc_changes[:, n : 2 * n] -= np.eye(n)
        force_changes = _force_changes(
            contact_rows, multiplier_changes, acc_changes / dt, chain_rule
        )
    return StepLinearisation(
        x=x,
        x_next=x_next,
        dt=dt,
        rows=tuple(marionette.tree.row_names[i] for i in np.flatnonzero(steps.active[0])),
        tension=steps.tension[0],
        A=np.concatenate([columns.q_D, columns.v_D, columns.q_K, columns.v_K], axis=1),
        B=columns.acc_K,
        B_u=columns.u_D,
        B_p=columns.p,
        tension_partials=Partials.from_columns(steps.tension_partials[0], widths),
        contacts=points,
        force_partials=Partials.from_columns(force_changes, widths),
        edges=() if touches is None else _named_edges(marionette, touches),
        coordinates=t,
    )


def _check_arrived(
    marionette: CompiledPuppet, x: State, results: LaneRecord | StepTouches, acc_K: Array, dt: float
) -> None:
    """Raises SimulationError unless the step reached its end."""
    status, cause = Status(int(results.status[0])), None
    if status in CONTRADICTION_STATUSES:
        cause = contradiction(marionette, _state_after(marionette, x, results, dt), acc_K)
    status = decide(status, cause).status
    if status is Status.RUNAWAY or status not in ARRIVED:
        raise SimulationError(status, f"at t = {x.t:.6g} s{f': {cause}' if cause else ''}")


def _state_after(
    marionette: CompiledPuppet, x: State, results: LaneRecord | StepTouches, dt: float
) -> State:
    names = ("q_D", "v_D", "q_K", "v_K", "taut", "slip")
    parts = {name: getattr(results, name)[0] for name in names}
    return State(x.t + dt, **parts, coordinates=marionette.coordinates)


def _force_changes(
    rows: ContactRows, multiplier_changes: Array, acc_changes: Array, chain_rule: Array
) -> Array:
    """Changes (3 points, m) of the forces.

    Args:
        rows: rows of the points, at the velocities after the step.
        multiplier_changes: (k, m) changes of their multipliers.
        acc_changes: (n_vD, m) changes of acc_D.
        chain_rule: (m, m) derivatives of rates and means of the driven coordinates by v_K and
            acc_K, which ``multiplier_changes`` and ``acc_changes`` include already.
    """
    at_fixed_multipliers = rows.push_by(
        np.zeros_like(multiplier_changes), np.zeros_like(acc_changes)
    )
    return (
        rows.push_by(multiplier_changes, acc_changes)
        - at_fixed_multipliers
        + at_fixed_multipliers @ chain_rule
    )


def _held_points(marionette: CompiledPuppet, touches: StepTouches) -> tuple[HeldPoint, ...]:
    """Points that push in the first of several steps, in their modes."""
    assert marionette.contacts is not None
    results = []
    for point in touches.points[0, : touches.n_points[0]]:
        pair, feature = int(point["pair"]), int(point["feature"])
        position, normal = point["at"].copy(), point["normal"].copy()
        by_twist, zeros = point["by"].reshape(7, 6).copy(), np.zeros((7, 6))
        links = (int(point["links"][0]), int(point["links"][1]))
        smooth = not touches.pair_edges[0, pair] & StepEdge.NOT_SMOOTH
        gap = float(point["gap"])
        touch = Touch(
            pair, feature, links, gap, position, normal, by_twist, zeros[:, 0], zeros, smooth
        )
        results.append(
            HeldPoint(
                name=pair_name(marionette.contacts.names[pair]),
                pair=pair,
                feature=feature,
                mode=ContactMode.STICK if point["sticks"] else ContactMode.SLIDE,
                friction=float(point["friction"]),
                along=point["along"].copy(),
                turns=bool(point["turns"]),
                touch=touch,
                force=point["force"].copy(),
                velocity=point["velocity"].copy(),
                closing_rate=float(point["closes"]),
                restitution=float(point["bounces"]),
            )
        )
    return tuple(results)


def _named_edges(marionette: CompiledPuppet, touches: StepTouches) -> tuple[str, ...]:
    """Edges between two modes in the first of several steps, with their pairs."""
    assert marionette.contacts is not None
    edges_of_pair = touches.pair_edges[0]
    return tuple(
        dict.fromkeys(
            f"{pair_name(marionette.contacts.names[pair])}: {meaning.removeprefix('a point ')}"
            for pair in np.flatnonzero(edges_of_pair)
            for meaning in StepEdge.meanings(int(edges_of_pair[pair]))
        )
    )


def _check_differentiable(
    marionette: CompiledPuppet,
    touches: StepTouches | None,
    points: Sequence[HeldPoint],
    edges: int,
    shortened: bool,
) -> None:
    """Raises StateError for a step that has no derivative."""
    names = ", ".join(dict.fromkeys(point.name for point in points))
    if touches is not None and marionette.contacts is not None and edges & StepEdge.LAW_CHANGED:
        pairs = np.flatnonzero(touches.pair_edges[0] & StepEdge.LAW_CHANGED)
        wedged = dict.fromkeys(pair_name(marionette.contacts.names[pair]) for pair in pairs)
        raise StateError(
            f"{', '.join(wedged)} moves after this step in a way that the contact law does not "
            "determine: bodies are wedged in, restitution is scaled down so that no energy is "
            "added, or points touch and spring back one after the other; such a step has no "
            "derivative"
        )
    if shortened:
        raise StateError(
            "the time-stepper scaled the velocities of the step down, because strings are violated "
            "too far or too fast; such a step has no derivative"
        )
    if edges & StepEdge.JAMS:
        raise StateError(
            f"friction jams at {names}: no forces keep these modes, so that derivatives do not "
            "exist"
        )
    if edges & StepEdge.OPEN_SHARES:
        raise StateError(
            f"{names} slide on more points than the law can share force among, and how a motion "
            "near by turns depends on the shares: it has no derivative"
        )
