"""Contacts at a state: points, their modes and forces, as event-driven runs choose them.

A contact point is open, sticks or slides: its mode. acc_D and acc_K are the accelerations of the
dynamic and the driven coordinates; a row is a string or a joint limit, and the taut ones are the
active set. h is the gap of a string, path length minus string length; hdot and hddot are its rates.
With the inertia matrix M_DD = F^T F, w0 = F^-T f are the scaled forces f without strings, and W =
F^-T A_D^T those of unit tensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, StateError, Status
from fantoccini.dynamics.compiled import (
    TOUCHING_GAP,
    CompiledPuppet,
    Evaluation,
    PairGeometry,
    Screws,
    check_start,
    forward_dynamics,
    taut_mask,
)
from fantoccini.dynamics.derivatives.contact_modes import (
    TOLERANCES,
    Contacts,
    closed_without_force,
    geometries,
    mode_of,
    speed_tolerance,
)
from fantoccini.dynamics.derivatives.contact_rows import (
    ContactMode,
    ContactRows,
    HeldPoint,
    PointMode,
)
from fantoccini.dynamics.derivatives.kkt import KKTSystem
from fantoccini.dynamics.derivatives.mode_system import ModeSystem, solve_in_modes
from fantoccini.dynamics.steppers import held_input
from fantoccini.kernel.runtime import Piece, Run, contact_points
from fantoccini.motion import ContactPoints, State, pair_name

MIN_IMPACT_CHANGE = 1e-6
"""Change of velocities at the start of a run that is an impact, relative to 1 or the largest."""
MAX_CLOSED_GAP = 1e-6
"""Largest gap of a point that touches [m], as at the start of an event-driven run."""


@dataclass(frozen=True, eq=False)
class RestMotion:
    """Accelerations, tensions and contacts at a state.

    Attributes:
        acc_D: (n_vD,) accelerations.
        tension: (n_rows,) forces of strings and limits.
        contacts: contacts with their modes.
    """

    acc_D: Array
    tension: Array
    contacts: Contacts


def motion_with_contact(
    marionette: CompiledPuppet, x: State, acc_K: Array, u_D: Array
) -> RestMotion:
    """Forces and modes at a state in which solids touch.

    Raises:
        StateError: solids strike one another there, or no event-driven run can begin.
    """
    sample, piece = _first_sample(marionette, x, acc_K, u_D)
    assert marionette.contacts is not None
    touching_points = contact_points(piece.contacts, marionette.contacts.names).at_sample(
        len(piece.samples) - 1
    )
    screws = Screws(marionette, x, sample["acc_D"], acc_K)
    contacts = _contacts(marionette, screws, x, touching_points)
    return RestMotion(sample["acc_D"], sample["tension"], contacts)


def motion_at(marionette: CompiledPuppet, x: State) -> RestMotion:
    """Accelerations, tensions and contacts at a state with its inputs at rest.

    Raises:
        StateError: see :func:`motion_with_contact` and :func:`forward_dynamics`.
    """
    if touches(marionette, x):
        table = marionette.coordinates
        return motion_with_contact(marionette, x, np.zeros(table.n_vK), np.zeros(table.n_vD))
    return RestMotion(*forward_dynamics(marionette, x), Contacts((), ()))


def touches(marionette: CompiledPuppet, x: State) -> bool:
    """Whether solids touch at a state."""
    return bool(marionette.overlaps(x.q_D, x.q_K, -TOUCHING_GAP))


def with_active_set(marionette: CompiledPuppet, x: State) -> State:
    """The state with its taut rows determined, with contact forces taken into account.

    If the motion begins with an impact, or cannot begin, the rows marked taut are unchanged.
    """
    if not touches(marionette, x):
        tension = forward_dynamics(marionette, x).tension
    else:
        table = marionette.coordinates
        try:
            tension = _first_sample(marionette, x, np.zeros(table.n_vK), np.zeros(table.n_vD))[0][
                "tension"
            ]
        except StateError:
            return x.replace(taut=taut_mask(marionette, x) | marionette.two_sided)
    return x.replace(taut=(tension > 0.0) | marionette.two_sided)


def _first_sample(
    marionette: CompiledPuppet, x: State, acc_K: Array, u_D: Array
) -> tuple[dict[str, Array], Piece]:
    """The first sample of an event-driven run, and the piece with its contacts."""
    check_start(marionette, x)
    options = marionette.run_options()
    inputs = held_input(marionette, x, options.dt, acc_K, u_D)
    run = Run(marionette.library, "event", options, x, marionette.p, marionette.winches, inputs)
    if run.status is not Status.RUNNING:
        raise StateError(f"no motion begins at this state: {run.status.message}")
    piece = run.present()
    sample = {
        name: column[-1] for name, column in marionette.sample_layout.split(piece.samples).items()
    }
    speed_scale = max(1.0, float(np.max(np.abs(x.v_D), initial=0.0)))
    if np.max(np.abs(sample["v_D"] - x.v_D), initial=0.0) > MIN_IMPACT_CHANGE * speed_scale:
        raise StateError(
            "solids or strings strike at this state: it lies between two motions, and has no "
            "derivative"
        )
    return sample, piece


def _contacts(
    marionette: CompiledPuppet, screws: Screws, x: State, touching_points: ContactPoints
) -> Contacts:
    """Contacts from points with forces; ``screws`` must have the accelerations."""
    assert marionette.contacts is not None
    rest_speed = speed_tolerance(screws)
    held_points: list[HeldPoint] = []
    edges: list[str] = []
    open_points: list[tuple[str, PairGeometry, int, float]] = []
    for pair in geometries(marionette, screws, x, sorted(set(touching_points.pair.tolist()))):
        name, points_of_pair = (
            pair_name(marionette.contacts.names[pair.pair]),
            touching_points.subset(touching_points.pair == pair.pair),
        )
        mu, used_features = float(marionette.contacts.friction[pair.pair]), set()
        for k in range(len(points_of_pair)):
            feature = pair.nearest(points_of_pair.point[k], MAX_CLOSED_GAP)
            if feature is None:
                raise StateError(f"{name} touch only where an event-driven run moves them first")
            used_features.add(feature)
            touch = pair.touch(feature)
            force, u = points_of_pair.force[k], pair.velocity(screws, points_of_pair.point[k])
            mode, along, turns, edge = mode_of(mu, touch.normal, force, u, rest_speed)
            point_mode = PointMode(name, pair.pair, feature, mode, mu, along, turns)
            point = HeldPoint.in_mode(point_mode, touch, force, u)
            if edge and (sliding_point := _begins_to_slide(screws, pair, point)):
                point, edge = (
                    sliding_point,
                    "begins to slide, in a direction that has no derivative",
                )
            held_points.append(point)
            if touch.normal @ force < TOLERANCES.force * marionette.reference_force:
                edge = edge or "touches without force"
            edges += [f"{name}: {edge}"] if edge else []
        for feature, values in pair.points.items():
            if feature not in used_features and values[0] <= MAX_CLOSED_GAP:
                opening_speed = pair.velocity(screws, values[1:4]) @ values[4:]
                open_points.append((name, pair, feature, float(opening_speed)))
    edges += closed_without_force(screws, held_points, open_points, rest_speed)
    return Contacts(tuple(held_points), tuple(dict.fromkeys(edges)))


def _begins_to_slide(screws: Screws, pair: PairGeometry, point: HeldPoint) -> HeldPoint | None:
    """A point at the edge of its cone as a sliding one; None if it does not accelerate."""
    touch = pair.touch(point.feature, pair.twist(screws))
    rows = ContactRows(screws, [replace(point, touch=touch)], 0.0)
    if np.linalg.norm(rows.accelerations()[1:]) <= TOLERANCES.acceleration:
        return None
    tangential = point.force - touch.normal * (touch.normal @ point.force)
    along = -tangential / np.linalg.norm(tangential)
    return replace(point, mode=ContactMode.SLIDE, along=along)


class FrozenModes:
    """Points in fixed modes, evaluated at nearby states.

    Args:
        marionette: the puppet.
        points: points in their modes; directions of sliding are those of the velocities or, for
            points almost at rest, their ``along``.
    """

    def __init__(self, marionette: CompiledPuppet, points: Sequence[PointMode]):
        self._marionette, self._points = marionette, tuple(points)

    def at(self, screws: Screws) -> list[HeldPoint]:
        """The points at a state, with second derivatives and without forces.

        Raises:
            StateError: a point is lost.
        """
        pairs: dict[int, PairGeometry] = {}
        points = []
        for point in self._points:
            feature = point.feature
            if point.pair not in pairs:
                pairs[point.pair] = PairGeometry(self._marionette, screws.poses, point.pair)
            pair = pairs[point.pair]
            if feature not in pair.points:
                raise StateError(f"{point.name} touch no longer where they did")
            touch = pair.touch(feature, pair.twist(screws))
            u = pair.velocity(screws, touch.point)
            along, turns = point.along, False
            if point.mode is ContactMode.SLIDE and point.friction > 0.0 and point.turns:
                tangential = u - touch.normal * (touch.normal @ u)
                speed = float(np.linalg.norm(tangential))
                turns = speed > TOLERANCES.speed
                along = tangential / speed if turns else along
            contact = HeldPoint.in_mode(point, touch, np.zeros(3), u)
            points.append(replace(contact, along=along, turns=turns))
        return points

    def accelerations_and_forces(
        self, evaluation: Evaluation, x: State, acc_K: Array, held: Indices
    ) -> tuple[Array, Array, list[HeldPoint]]:
        """Accelerations acc_D, tensions of the held rows, and the points with their forces.

        Args:
            evaluation: the model at the state.
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs.
            held: indices of the strings and limits that are held.
        """
        unconstrained_acc = evaluation.solve_factor(evaluation.w0)
        if not self._points:
            hddot = evaluation.gamma[held, None] + evaluation.W[:, held].T @ evaluation.w0[:, None]
            acc, y = KKTSystem(evaluation, held).solve(np.zeros((len(unconstrained_acc), 1)), hddot)
            return unconstrained_acc + acc[:, 0], y[:, 0], []
        screws = Screws(self._marionette, x, unconstrained_acc, acc_K)
        points = self.at(screws)
        rows = ContactRows(screws, points, 0.0)
        hddot = evaluation.gamma[held] + evaluation.W[:, held].T @ evaluation.w0
        rate = np.concatenate([hddot, rows.accelerations()])[:, None]
        zeros = np.zeros((len(unconstrained_acc), 1))
        acc, y = ModeSystem(evaluation, held, rows).solve(zeros, rate)
        tension, loaded_points, first_multiplier = y[: len(held), 0], [], len(held)
        for point in points:
            k = len(point.directions)
            loaded_points.append(
                replace(point, force=point.pushes.T @ y[first_multiplier : first_multiplier + k, 0])
            )
            first_multiplier += k
        return unconstrained_acc + acc[:, 0], tension, loaded_points

    def solve(
        self,
        evaluation: Evaluation,
        x: State,
        acc: tuple[Array, Array],
        held: Indices,
        points: Sequence[HeldPoint],
        force: Array,
        rate: Array,
    ) -> tuple[Array, Array, Array]:
        """Changes of acc_D, of the held rows' tensions, and of the points' forces (3 points, m).

        Args:
            evaluation: the model at the state.
            x: the state.
            acc: accelerations acc_D and acc_K.
            held: indices of the strings and limits that are held.
            points: points from :meth:`accelerations_and_forces`.
            force: (n_vD, m) changes of the other forces at fixed acc_D and tensions.
            rate: (len(held), m) changes of the held rows' hddot.
        """
        if not points:
            return *KKTSystem(evaluation, held).solve(force, rate), np.zeros((0, force.shape[1]))
        screws = Screws(self._marionette, x, *acc)

        def rows(selected: Sequence[HeldPoint]) -> tuple[ContactRows, Array]:
            contact = ContactRows(screws, selected, 0.0)
            return contact, contact.acceleration_by()

        return solve_in_modes(evaluation, held, force, rate, rows, points)
