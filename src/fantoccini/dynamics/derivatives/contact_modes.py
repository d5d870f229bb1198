"""Modes of the contacts at a state, and points on the edge between two modes.

The derivative of a mode is that of the motion where its law holds strictly: points that push have a
force, those that stick stay inside their cone, open ones open.

A contact point is open, sticks or slides: its mode. Its cone contains the forces that friction
permits, and u is its relative velocity. In names, D stands for dynamic coordinates, which move by
the equations of motion, and K for driven ones: ends and lengths of strings, driven joints. The gap
of two solids is their distance, negative in an overlap. A row is a string or a joint limit with its
gap h <= 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.compiled import CompiledPuppet, PairGeometry, Screws
from fantoccini.dynamics.derivatives.contact_rows import ContactMode, HeldPoint
from fantoccini.motion import State


@dataclass(frozen=True)
class ModeTolerances:
    """Tolerances by which contact modes are determined: smaller values count as zero."""

    speed: float = 1e-8
    """Speed that counts as zero, relative to the largest or 1 m/s; above the law's residual."""
    force: float = 1e-8  # Force that counts as zero, relative to the weight
    cone: float = 1e-6  # Smallest distance of a sticking force from its cone, relative
    acceleration: float = 1e-6  # Acceleration of a point at rest [m/s^2]
    dependence: float = 1e-7  # Part of a dependent row outside the span of the others
    sliding_angle: float = 1e-6  # Angle between directions of sliding that count as equal [rad]


TOLERANCES = ModeTolerances()


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts at a state.

    Attributes:
        points: the points that push, with their modes.
        edges: points between two modes, where only one-sided derivatives exist.
    """

    points: tuple[HeldPoint, ...]
    edges: tuple[str, ...]


def speed_tolerance(screws: Screws) -> float:
    """Speed that counts as zero beside the links' motion [m/s]."""
    speeds = [float(np.max(np.abs(screws.twist(i)))) for i in range(len(screws.poses))]
    return TOLERANCES.speed * max(1.0, *speeds)


def geometries(
    marionette: CompiledPuppet, screws: Screws, x: State, extra_pairs: Sequence[int] = ()
) -> list[PairGeometry]:
    """Geometries of all pairs near enough to touch at a state, and of additional pairs.

    Args:
        marionette: the puppet.
        screws: screws of the links at the state.
        x: the state.
        extra_pairs: indices of additional pairs.
    """
    contacts = marionette.contacts
    if contacts is None:
        return []
    gaps = marionette.library.gaps(contacts, x.q_D, x.q_K, marionette.p)
    near = np.union1d(np.flatnonzero(np.isfinite(gaps)), np.asarray(extra_pairs, dtype=int))
    return [PairGeometry(marionette, screws.poses, int(pair)) for pair in near]


def mode_of(
    mu: float, n: Array, force: Array, u: Array, rest_speed: float
) -> tuple[ContactMode, Array, bool, str]:
    """Mode, direction of sliding, whether it turns with u, and text on the edge of two modes.

    Args:
        mu: coefficient of friction.
        n: (3,) normal.
        force, u: (3,) force on the first solid, and its velocity relative to the second.
        rest_speed: speed that counts as zero [m/s].
    """
    zeros = np.zeros(3)
    if mu == 0.0:
        return ContactMode.SLIDE, zeros, False, ""
    u_T, f_T = u - n * (n @ u), force - n * (n @ force)
    speed, friction_force = float(np.linalg.norm(u_T)), float(np.linalg.norm(f_T))
    if speed > rest_speed:
        return ContactMode.SLIDE, u_T / speed, True, ""
    at_cone = friction_force > (1.0 - TOLERANCES.cone) * mu * (n @ force)
    return ContactMode.STICK, zeros, False, "sticks at the edge of its cone" if at_cone else ""


def closed_without_force(
    screws: Screws,
    held: Sequence[HeldPoint],
    open_points: Sequence[tuple[str, PairGeometry, int, float]],
    still: float,
) -> list[str]:
    """Edges of points that close without force, unless the pushing points already close them.

    Args:
        screws: screws of the links.
        held: the points that push.
        open_points: name, pair, feature and opening speed of other points [m/s].
        still: speed that counts as zero [m/s].
    """
    rows = [p.directions @ _subspace(screws, p.touch.links, p.touch.point) for p in held]
    basis = np.concatenate([*rows, np.zeros((0, screws.n_D))])
    _, s, vt = np.linalg.svd(basis, full_matrices=False)
    row_space = vt[s > TOLERANCES.dependence * np.max(s, initial=0.0)]
    edges = []
    for name, pair, feature, opening_speed in open_points:
        if opening_speed > still:
            continue
        values = pair.points[feature]
        row = values[4:] @ _subspace(screws, pair.links, values[1:4])
        remainder = row - row_space.T @ (row_space @ row)
        if np.linalg.norm(remainder) > TOLERANCES.dependence * np.linalg.norm(row):
            edges.append(f"{name}: touches without force")
        elif _slides_elsewhere(
            pair.velocity(screws, values[1:4]), values[4:], pair.pair, held, still
        ):
            edges.append(f"{name}: touches without force, and slides askew of those that push")
    return edges


def _slides_elsewhere(
    u: Array, normal: Array, pair: int, held: Sequence[HeldPoint], still: float
) -> bool:
    """Whether friction at velocity u has another direction than at the held points.

    A nearby motion may then load this point instead of those, and turn differently.
    """
    tangential = u - normal * (normal @ u)
    speed = float(np.linalg.norm(tangential))
    return any(
        point.pair == pair
        and point.mode is ContactMode.SLIDE
        and point.friction > 0.0
        and (
            speed <= still
            or np.linalg.norm(np.cross(point.along, tangential)) > TOLERANCES.sliding_angle * speed
        )
        for point in held
    )


def _subspace(screws: Screws, links: tuple[int, int], point: Array) -> Array:
    """Derivatives (3, n_vD) of u by v_D."""
    twist = screws.subspace(links[0]) - screws.subspace(links[1])
    return np.asarray(twist[:3] + np.cross(twist[3:].T, point).T)
