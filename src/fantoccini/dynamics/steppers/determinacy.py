"""Tensions and efforts that a motion does not determine.

Forces x of the active strings, limits and contacts give the motion B x, with B = F^-T A_D^T in the
metric of M_DD = F^T F. Changes dx with B dx = 0 within the bounds of x do not change the motion, as
with redundant taut strings. Near such a state rounding decides: an uncertainty a of a row's
acceleration changes x by

    |dx_i| <= a |(G^-1)_i|,   G = B^T B

An effort, E x, is uncertain in the same way. Redundant contact points share forces arbitrarily as
well; this matters only if a tension or effort takes part.

The effort is the force of the hand on a driven coordinate. A_D are the derivatives of string gaps
by the dynamic coordinates, n_vD and n_vK the numbers of dynamic and driven velocities. h is the gap
of a string, path length minus string length; hdot and hddot are its rates. A winch changes the
length of a string; slip is the length that it lets out at its largest tension. A twist is a
velocity of a link, linear and angular; a screw is the twist per unit of one joint velocity.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, Indices, Mask, nonnegative_least_squares
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.model.tree import WORLD, Role
from fantoccini.motion import Columns, ContactPoints, Trajectory


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the decision whether a motion determines a force."""

    acceleration_uncertainty: float = 1e-6
    """Uncertainty of rows' accelerations [m/s^2]: sampled lengths from an exact inverse kinematics
    contradict one another by as much between samples."""
    significant_change: float = 0.01
    """Significant change of a tension or effort, relative to the puppet's weight."""
    regularisation: float = 0.03
    """Regularisation of G's diagonal, relative to the eigenvalue of significant changes; also
    the smallest significant component of a null vector."""
    min_regularisation: float = 1e-13  # Minimum regularisation, relative to the trace of G
    bound_distance: float = (
        1e-6  # Distance from a bound, relative to the weight, that counts as being at it
    )
    max_rest_speed: float = 1e-5  # Speed above which a winch slips or a contact point slides [m/s]
    max_closed_gap: float = 1e-6  # -h below which a row is closed, relative to its length
    cone_distance: float = 1e-6
    """Distance from a cone, relative to the vector, that counts as inside; and part of a unit
    vector that counts as none."""


TOLERANCES = Tolerances()
_CHUNK_SIZE = 512
"""Number of samples whose matrices are in memory together."""


@dataclass(frozen=True)
class ForceSamples:
    """Samples of a motion with its forces.

    Attributes:
        q_D, v_D, q_K, v_K: (T, ...) motion.
        force: (T, n_rows) forces of strings and limits [N or N m].
        taut: (T, n_strings) taut strings.
        slip: (T, n_strings) slip of winches [m].
        method: method of the run.
        contact: contact points; None without contact.
    """

    q_D: Array
    v_D: Array
    q_K: Array
    v_K: Array
    force: Array
    taut: Mask
    slip: Array
    method: str
    contact: ContactPoints | None = None

    @classmethod
    def from_run(cls, run: Trajectory) -> ForceSamples:
        """Samples of a run."""
        force = np.hstack([run.tension.values, run.limit_force.values])
        taut = np.asarray(run.taut.values, dtype=bool)
        slip = np.zeros(taut.shape) if run.slip is None else run.slip.values
        motion = (run.q_D, run.v_D, run.q_K, run.v_K)
        return cls(*motion, force, taut, slip, run.method, run.contact)

    def __len__(self) -> int:
        return len(self.q_D)

    def part(self, begin: int, end: int) -> ForceSamples:
        """Samples ``begin`` to ``end``, without ``end``."""
        if begin == 0 and end >= len(self):
            return self
        arrays = ("q_D", "v_D", "q_K", "v_K", "force", "taut", "slip")
        selected = replace(self, **{name: getattr(self, name)[begin:end] for name in arrays})
        if self.contact is None:
            return selected
        rows = slice(*np.searchsorted(self.contact.sample, [begin, end]))
        points = {
            field.name: getattr(self.contact, field.name)[rows]
            for field in dataclasses.fields(self.contact)
            if field.name != "names"
        }
        points["sample"] = points["sample"] - begin
        return replace(selected, contact=replace(self.contact, **points))


def undetermined(marionette: CompiledPuppet, run: Trajectory | ForceSamples) -> Columns:
    """Masks (T,) of undetermined tensions and efforts, by string and driven velocity.

    Args:
        marionette: the puppet.
        run: run of the puppet, or samples of several.
    """
    samples = ForceSamples.from_run(run) if isinstance(run, Trajectory) else run
    names = force_names(marionette)
    parts = [
        _flags(marionette, samples.part(k, k + _CHUNK_SIZE))
        for k in range(0, max(1, len(samples)), _CHUNK_SIZE)
    ]
    return Columns(names, np.concatenate(parts), "string or driven velocity")


def force_names(marionette: CompiledPuppet) -> tuple[str, ...]:
    """Names of strings, whose tensions are judged, and driven velocities, whose efforts are."""
    return tuple(s.name for s in marionette.tree.strings) + marionette.coordinates.v_K


def _flags(marionette: CompiledPuppet, run: ForceSamples) -> Mask:
    """Masks (T, n) of :func:`undetermined` for a run with few samples."""
    table, n_s = marionette.coordinates, len(marionette.tree.strings)
    out = np.zeros((len(run), n_s + table.n_vK), dtype=bool)
    if table.n_vD and (n_s or run.contact is not None):
        rows = _RowForces(marionette, run)
        points = _ContactForces(marionette, run, rows.L)
        for samples, held, force_indices in _groups_of_samples(rows.held, points.first):
            B = np.concatenate([rows.B[samples][:, held], points.B[force_indices]], axis=1)
            at_lower = np.concatenate(
                [rows.at_lower[samples][:, held], points.at_lower[force_indices]], axis=1
            )
            at_upper = np.concatenate(
                [rows.at_upper[samples][:, held], np.zeros(force_indices.shape, dtype=bool)], axis=1
            )
            is_weak = _is_nearly_redundant(marionette, B)
            if not np.any(is_weak):
                continue
            samples, B, at_lower, at_upper = (
                samples[is_weak],
                B[is_weak],
                at_lower[is_weak],
                at_upper[is_weak],
            )
            string_selection = np.zeros((len(samples), n_s, B.shape[1]))
            string_columns = np.flatnonzero(held < n_s)
            string_selection[:, held[string_columns], string_columns] = 1.0
            efforts = np.concatenate(
                [rows.efforts(samples, held), points.efforts[force_indices[is_weak]]], axis=1
            )
            S = np.concatenate([string_selection, np.swapaxes(efforts, 1, 2)], axis=1)
            out[samples] = _is_uncertain(marionette, B, S, at_lower, at_upper)
    return out


class _RowForces:
    """Strings and limits of a run, n rows at T samples.

    Attributes:
        L: factors of M_DD at the samples.
        held: (T, n) whether rows are active and do not slip: a slipping winch's force is known.
        B: (T, n, n_vD) motion by their forces.
        at_lower, at_upper: (T, n) whether a force is at its lower or upper bound.
    """

    def __init__(self, marionette: CompiledPuppet, run: ForceSamples):
        self._marionette, self._run = marionette, run
        table, library, tree = marionette.coordinates, marionette.library, marionette.tree
        n_l, n_s = len(tree.limits), len(tree.strings)
        evaluated = library.evaluate(
            "dynamics",
            q_D=run.q_D,
            v_D=run.v_D,
            q_K=run.q_K,
            v_K=run.v_K,
            acc_K=np.zeros(table.n_vK),
            u_D=np.zeros(table.n_vD),
            p=marionette.p,
        )
        self.L = evaluated.L
        T, forces = len(run), run.force
        J = np.zeros((T, n_l, table.n_vD))
        limit, axis, velocity = tree.limit_entries
        J[:, limit, velocity] = evaluated.J_limit[:, axis, limit]
        W_l = (
            library.evaluate("solve_factor_transposed", L=evaluated.L[:, None], x=J).y if n_l else J
        )
        self.B = -np.concatenate([np.swapaxes(evaluated.W, 1, 2), W_l], axis=1)
        bound_distance = TOLERANCES.bound_distance * _force_scale(marionette)
        self.at_lower = ~marionette.two_sided & (forces <= bound_distance)
        self.at_upper = forces >= marionette.max_forces - bound_distance
        # Only some of several dependent rows pull; the others are closed, or open by rounding.
        h = np.hstack([evaluated.h - run.slip, evaluated.h_limit])
        is_held = h >= -TOLERANCES.max_closed_gap * marionette.row_scales(run.q_D, run.q_K)
        if run.method == "event":  # after fixed steps, speeds correct their violations
            is_held[:, :n_s] &= np.abs(evaluated.hdot) <= TOLERANCES.max_rest_speed
        is_held |= np.hstack([run.taut, forces[:, n_s:] > 0.0])
        is_held[:, :n_s] &= ~(self.at_upper[:, :n_s] & (evaluated.hdot > TOLERANCES.max_rest_speed))
        self.held = is_held

    def efforts(self, samples: Indices, held: Indices) -> Array:
        """Efforts (m, k, n_vK) by the forces of rows; those of limits are 0."""
        marionette, run, n_s = self._marionette, self._run, len(self._marionette.tree.strings)
        table = marionette.coordinates
        arguments = {
            name: getattr(run, name)[samples][:, None] for name in ("q_D", "v_D", "q_K", "v_K")
        } | {"acc_D": np.zeros(table.n_vD), "acc_K": np.zeros(table.n_vK)}
        lam = np.zeros((len(held) + 1, n_s))
        strings = np.flatnonzero(held < n_s)
        lam[strings, held[strings]] = -1.0
        force = marionette.library.evaluate("effort", **arguments, lam=lam, p=marionette.p).f_K
        return np.asarray(force[:, :-1] - force[:, -1:])


class _ContactForces:
    """Contact points of a run, as n forces in order.

    Attributes:
        first: (T + 1,) index of the first force of every sample.
        B: (n, n_vD) motion by each force.
        at_lower: (n,) whether a force is at its lower bound.
        efforts: (n, n_vK) efforts of driven coordinates by each force.
    """

    def __init__(self, marionette: CompiledPuppet, run: ForceSamples, L: Array):
        table, contact, contacts = marionette.coordinates, run.contact, marionette.contacts
        self.first = np.zeros(len(run) + 1, dtype=np.intp)
        self.B, self.at_lower = np.zeros((0, table.n_vD)), np.zeros(0, dtype=bool)
        self.efforts = np.zeros((0, table.n_vK))
        if contact is None or contacts is None or not len(contact):
            return
        force_norm = np.linalg.norm(contact.force, axis=1)
        is_idle = force_norm <= TOLERANCES.bound_distance * _force_scale(marionette)
        is_sliding = (contacts.friction[contact.pair] == 0.0) | (
            contact.sliding_speed > TOLERANCES.max_rest_speed
        )
        directions_ = contact.force / np.where(is_idle, 1.0, force_norm)[:, None]
        directions_[is_idle] = contact.normal[is_idle]
        is_sticking = ~(is_idle | is_sliding)
        n_forces = np.where(is_sticking, 3, 1)
        point_of_force = np.repeat(np.arange(len(contact)), n_forces)
        start = np.cumsum(n_forces) - n_forces
        direction = directions_[point_of_force]
        for axis in range(3):
            direction[start[is_sticking] + axis] = np.eye(3)[axis]
        sample = contact.sample[point_of_force]
        self.first = np.searchsorted(sample, np.arange(len(run) + 1)).astype(np.intp)
        self.at_lower = is_idle[point_of_force]
        configuration = {"q_D": run.q_D, "q_K": run.q_K, "p": marionette.p}
        screws = marionette.library.evaluate("screws", **configuration)
        wrench = np.hstack([direction, np.cross(contact.point[point_of_force], direction)])
        force = np.zeros((len(point_of_force), table.n_vD))
        self.efforts = np.zeros((len(point_of_force), table.n_vK))
        links = contacts.solids["link"][contacts.pairs[contact.pair[point_of_force]]]
        for side, sign in ((0, 1.0), (1, -1.0)):
            for link in set(links[:, side].tolist()) - {WORLD}:
                selected = np.flatnonzero(links[:, side] == link)
                for i in marionette.tree.ancestors(link):
                    moving_link = marionette.tree.links[i]
                    is_driven = moving_link.role is Role.DRIVEN
                    screws_of_role = screws.screw_K if is_driven else screws.screw_D
                    for k in range(moving_link.v.start, moving_link.v.stop):
                        screw = screws_of_role[sample[selected], :, k]
                        component = sign * np.einsum("nc,nc->n", screw, wrench[selected])
                        if is_driven:
                            self.efforts[selected, k] -= component
                        elif moving_link.role is Role.DYNAMIC:
                            force[selected, k] += component
        self.B = marionette.library.evaluate("solve_factor_transposed", L=L[sample], x=force).y


def _groups_of_samples(held: Mask, first: Indices) -> Iterator[tuple[Indices, Indices, Indices]]:
    """Samples (m,) with equal held rows (k,) and numbers of contact forces; indices (m, c)."""
    keys = np.hstack([held.astype(np.intp), np.diff(first)[:, None]])
    distinct_keys, key_index = np.unique(keys, axis=0, return_inverse=True)
    for k, key in enumerate(distinct_keys):
        samples = np.flatnonzero(key_index.ravel() == k)
        rows, n_contact_forces = np.flatnonzero(key[:-1]), int(key[-1])
        if len(rows) + n_contact_forces:
            yield samples, rows, first[samples][:, None] + np.arange(n_contact_forces)


def _is_nearly_redundant(marionette: CompiledPuppet, B: Array) -> Mask:
    """Whether some change of forces causes almost no motion: (m,) bool."""
    min_eigenvalue = np.linalg.eigvalsh(B @ np.swapaxes(B, 1, 2))[:, 0]
    return np.asarray(min_eigenvalue < _eigenvalue_threshold(marionette))


def _eigenvalue_threshold(marionette: CompiledPuppet) -> float:
    """Eigenvalue of G below which rounding changes forces significantly [1/kg]."""
    return TOLERANCES.acceleration_uncertainty / (
        TOLERANCES.significant_change * _force_scale(marionette)
    )


def _force_scale(marionette: CompiledPuppet) -> float:
    """Scale of forces: the puppet's weight [N]."""
    return marionette.reference_force or 1.0


def _is_uncertain(
    marionette: CompiledPuppet, B: Array, S: Array, at_lower: Mask, at_upper: Mask
) -> Mask:
    """Whether S x (n,) is significantly uncertain, for forces x (m, k) with bounds: (m, n)."""
    is_uncertain = _is_significant(marionette, B, S)
    for i in np.flatnonzero(np.any(at_lower | at_upper, axis=1) & np.any(is_uncertain, axis=1)):
        size, V = np.linalg.eigh(B[i] @ B[i].T)
        is_free = ~_is_blocked(
            V[:, size < _eigenvalue_threshold(marionette)], at_lower[i], at_upper[i]
        )
        if not np.all(is_free):
            is_uncertain[i] = _is_significant(marionette, B[i][is_free], S[i][:, is_free])
    return is_uncertain


def _is_significant(marionette: CompiledPuppet, B: Array, S: Array) -> Mask:
    """Whether a |S G^-1| is significant: (..., n) bool."""
    if not B.shape[-2]:
        return np.zeros(S.shape[:-1], dtype=bool)
    # Solving is several times faster than decompositions of many small matrices.
    G = B @ np.swapaxes(B, -1, -2)
    min_eigenvalue = TOLERANCES.min_regularisation * np.trace(G, axis1=-2, axis2=-1)
    min_eigenvalue = np.maximum(
        min_eigenvalue, TOLERANCES.regularisation * _eigenvalue_threshold(marionette)
    )[..., None, None]
    G = G + min_eigenvalue * np.eye(G.shape[-1])
    norm = np.linalg.norm(np.linalg.solve(G, np.swapaxes(S, -1, -2)), axis=-2)
    return np.asarray(
        TOLERANCES.acceleration_uncertainty * norm
        > TOLERANCES.significant_change * _force_scale(marionette)
    )


def _is_blocked(null: Array, at_lower: Mask, at_upper: Mask) -> Mask:
    """Forces (k,) at a bound that no combination of vectors (k, r) moves off it.

    By Farkas' lemma, their negative vector lies in the cone of all vectors at bounds.
    """
    inward = np.where(at_upper[:, None], -null, null)
    size = np.linalg.norm(inward, axis=1)
    at_bound = np.flatnonzero((at_lower | at_upper) & (size > TOLERANCES.cone_distance))
    is_blocked = np.zeros(len(null), dtype=bool)
    for i in at_bound:
        distance = nonnegative_least_squares(inward[at_bound].T, -inward[i])[1]
        is_blocked[i] = distance <= TOLERANCES.cone_distance * size[i]
    return is_blocked
