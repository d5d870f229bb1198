"""The modes of the contacts of one fixed step, and what lies on the edge between two.

    u_n+ >= w,  w = min(-gap/dt, recovery speed) or -e u_n of a new contact that springs back

A mode's derivative is that of the step where the law holds strictly: points that push do so with
force, those that stick stay inside their cone, open ones open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.compiled import (
    GEOMETRY_TOLERANCES,
    LIMITS,
    CompiledPuppet,
    PairGeometry,
    Screws,
)
from fantoccini.dynamics.derivatives.contact_rows import ContactMode, HeldPoint, PointMode
from fantoccini.motion import ContactPoints, State, pair_name


@dataclass(frozen=True)
class ModeTolerances:
    """What counts as nothing where modes are told apart."""

    speed: float = 1e-8
    """Speed that is none, relative to 1 m/s or the largest: the law's residual lies below."""
    force: float = 1e-8  # Force that is none, relative to the weight
    cone: float = 1e-6  # Part of its cone by which a force that sticks must stay inside
    acceleration: float = 1e-6  # Of a point that stays where it is [m/s^2]
    same_place: float = 1e-9  # Distance of points that are one [m]
    dependent: float = 1e-7  # Part of a row that others do not give: below, it follows from them
    askew: float = 1e-6  # Angle between directions of sliding that are one [rad]


TOLERANCES = ModeTolerances()


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts of a step.

    Attributes:
        points: the points that push, with their modes.
        edges: points between two modes, where only one-sided derivatives exist.
    """

    points: tuple[HeldPoint, ...]
    edges: tuple[str, ...]


def still_speed(screws: Screws) -> float:
    """Speed that is none where links move as they do [m/s]."""
    speeds = [float(np.max(np.abs(screws.twist(i)))) for i in range(len(screws.poses))]
    return TOLERANCES.speed * max(1.0, *speeds)


def geometries(
    marionette: CompiledPuppet,
    screws: Screws,
    x: State,
    more: Sequence[int] = (),
    reach: float = 0.0,
) -> list[PairGeometry]:
    """Of all pairs near enough to touch at a state, and of some more.

    Args:
        marionette: the puppet.
        screws: of the links at the state.
        x: the state.
        more: indices of pairs.
        reach: gap up to which points of these count [m].
    """
    contacts = marionette.contacts
    if contacts is None:
        return []
    gaps = marionette.library.gaps(contacts, x.q_D, x.q_K, marionette.p)
    near = np.union1d(np.flatnonzero(np.isfinite(gaps)), np.asarray(more, dtype=int))
    margin = max(GEOMETRY_TOLERANCES.margin, GEOMETRY_TOLERANCES.spare * reach)
    return [PairGeometry(marionette, screws.poses, int(pair), margin) for pair in near]


def step_contacts(
    marionette: CompiledPuppet,
    before: Screws,
    after: Screws,
    kick: Array,
    x: State,
    found: ContactPoints,
    dt: float,
) -> Contacts:
    """The modes of the points that push in a step.

    Args:
        marionette: the puppet.
        before, after: links at the start with the velocities before and after the step.
        kick: (n_vD,) what it adds to v_D without impulses.
        x: the state before it.
        found: the points that the step wrote.
        dt: its length [s].

    Raises:
        StateError: the step did not hold a point as the law asks for.
    """
    assert marionette.contacts is not None
    still = max(still_speed(before), still_speed(after))
    held: list[HeldPoint] = []
    edges: list[str] = []
    open_points: list[tuple[str, PairGeometry, int, float]] = []
    reach = float(np.max(found.gap, initial=0.0))
    for pair in geometries(marionette, before, x, sorted(set(found.pair.tolist())), reach):
        name = pair_name(marionette.contacts.names[pair.pair])
        own = found.some(found.pair == pair.pair)
        taken = set()
        for k in range(len(own)):
            feature = pair.nearest(own.point[k], TOLERANCES.same_place)
            if feature is None:
                raise StateError(f"{name} touch in this step where they did not at its start")
            taken.add(feature)
            made, edge = _held(marionette, name, pair, feature, own.some(np.array([k])), still)
            speed = float(pair.velocity(before, made.touch.point) @ made.touch.normal)
            row = made.touch.normal @ _subspace(before, pair.links, made.touch.point)
            made, verge = _aimed(marionette, made, speed, float(row @ kick), dt, still)
            held.append(made)
            edges += [f"{name}: {one}" for one in (edge, verge) if one]
        for feature, values in pair.points.items():
            if feature not in taken:
                gap, point, normal = values[0], values[1:4], values[4:]
                parting = min(-gap / dt, LIMITS.recovery_speed)
                opens = pair.velocity(after, point) @ normal - parting
                open_points.append((name, pair, feature, float(opens)))
    edges += closed_without_force(after, held, open_points, still)
    return Contacts(tuple(held), tuple(dict.fromkeys(edges)))


def _held(
    marionette: CompiledPuppet,
    name: str,
    pair: PairGeometry,
    feature: int,
    own: ContactPoints,
    still: float,
) -> tuple[HeldPoint, str]:
    """A point that pushes, and what edge it is on."""
    assert marionette.contacts is not None
    touch = pair.touch(feature)
    mu, n = float(marionette.contacts.friction[pair.pair]), touch.normal
    force, u = own.force[0], own.velocity[0]
    mode, along, turns, edge = mode_of(mu, n, force, u, still)
    if not touch.smooth:
        edge = edge or "the place of its points has no derivative"
    elif n @ force < TOLERANCES.force * marionette.reference_force:
        edge = edge or "touches without force"
    point = PointMode(name, pair.pair, feature, mode, mu, along, turns)
    return HeldPoint.of(point, touch, force, u), edge


def mode_of(
    mu: float, n: Array, force: Array, u: Array, still: float
) -> tuple[ContactMode, Array, bool, str]:
    """Mode, direction of sliding, whether that turns with u, and what edge the point is on.

    Args:
        mu: coefficient of friction.
        n: (3,) normal.
        force, u: (3,) on the first solid, and its velocity against the second.
        still: speed that is none [m/s].
    """
    none = np.zeros(3)
    if mu == 0.0:
        return ContactMode.SLIDE, none, False, ""
    u_T, f_T = u - n * (n @ u), force - n * (n @ force)
    speed, size = float(np.linalg.norm(u_T)), float(np.linalg.norm(f_T))
    if speed > still:
        return ContactMode.SLIDE, u_T / speed, True, ""
    strained = size > (1.0 - TOLERANCES.cone) * mu * (n @ force)
    return ContactMode.STICK, none, False, "sticks at the edge of its cone" if strained else ""


def _aimed(
    marionette: CompiledPuppet, made: HeldPoint, speed: float, gain: float, dt: float, still: float
) -> tuple[HeldPoint, str]:
    """The point with what its normal row asks for, and what edge that is on.

    Args:
        marionette: the puppet.
        made: the point.
        speed: u_n before the step [m/s].
        gain: what the step adds to it without impulses [m/s].
        dt: the step [s].
        still: speed that is none [m/s].
    """
    assert marionette.contacts is not None
    after = float(made.touch.normal @ made.velocity)
    e = float(marionette.contacts.restitution[made.pair])
    parting = min(-made.touch.gap / dt, LIMITS.recovery_speed)
    # A gap is known to rounding only.
    rounding = still + TOLERANCES.same_place * 1e-3 / dt
    if abs(after - parting) <= rounding:
        closes = 1.0 / dt if parting < LIMITS.recovery_speed else 0.0
        verge = e > 0.0 and abs(-e * speed - max(parting, -gain)) <= rounding
        return replace(made, closes=closes), "springs back if it is any faster" if verge else ""
    # Without restitution, too: what lands while forces brake it stops where it is.
    if abs(after + e * speed) <= rounding:
        return replace(made, bounces=e), ""
    raise StateError(
        f"{made.name} moves after this step as the law of contact alone does not say: bodies are "
        "wedged in, or restitution is scaled down so that no energy is added; such a step has no "
        "derivative"
    )


def closed_without_force(
    screws: Screws,
    held: Sequence[HeldPoint],
    open_points: Sequence[tuple[str, PairGeometry, int, float]],
    still: float,
) -> list[str]:
    """Edges of points that close without force, but where those that push close them anyway.

    Args:
        screws: of the links.
        held: the points that push.
        open_points: name, pair and feature of others, and the speed at which they open [m/s].
        still: speed that is none [m/s].
    """
    rows = [p.directions @ _subspace(screws, p.touch.links, p.touch.point) for p in held]
    basis = np.concatenate([*rows, np.zeros((0, screws.n_D))])
    _, s, vt = np.linalg.svd(basis, full_matrices=False)
    span = vt[s > TOLERANCES.dependent * np.max(s, initial=0.0)]
    edges = []
    for name, pair, feature, opens in open_points:
        if opens > still:
            continue
        values = pair.points[feature]
        row = values[4:] @ _subspace(screws, pair.links, values[1:4])
        rest = row - span.T @ (span @ row)
        if np.linalg.norm(rest) > TOLERANCES.dependent * np.linalg.norm(row):
            edges.append(f"{name}: touches without force")
        elif _slides_askew(pair.velocity(screws, values[1:4]), values[4:], pair.pair, held, still):
            edges.append(f"{name}: touches without force, and slides askew of those that push")
    return edges


def _slides_askew(
    u: Array, normal: Array, pair: int, held: Sequence[HeldPoint], still: float
) -> bool:
    """Whether a point with velocity u would have friction in another direction than those held.

    A motion near by may then put force on it instead of on them, which turns it otherwise.
    """
    across = u - normal * (normal @ u)
    speed = float(np.linalg.norm(across))
    return any(
        point.pair == pair
        and point.mode is ContactMode.SLIDE
        and point.friction > 0.0
        and (
            speed <= still
            or np.linalg.norm(np.cross(point.along, across)) > TOLERANCES.askew * speed
        )
        for point in held
    )


def _subspace(screws: Screws, links: tuple[int, int], point: Array) -> Array:
    """(3, n_vD) u by v_D."""
    twist = screws.subspace(links[0]) - screws.subspace(links[1])
    return np.asarray(twist[:3] + np.cross(twist[3:].T, point).T)
