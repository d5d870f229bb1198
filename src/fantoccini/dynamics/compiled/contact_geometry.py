"""Geometry of a contact under small motions of its solids: derivatives of the narrow phase.

Point P, normal n and gap of a pair are functions of the poses of its two links that move along with
both. So the derivatives by a twist of the first link, (v, w) about the world's origin, determine
those by a twist of the second, too:

    dP = P_1 (xi_1 - xi_2) + v_2 + w_2 x P,   dn = n_1 (xi_1 - xi_2) + w_2 x n

They are central differences of sixth order of the compiled narrow phase at a fixed feature. The
step is the largest that agrees with a smaller one: points of solids in flat contact are smooth
over a small tilt only.

The narrow phase is the exact computation of the contact points of two solids; a feature is the
vertex, edge or face that touches. The gap is the distance, negative in an overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, rotation
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.screws import OFFSETS, WEIGHTS, Screws
from fantoccini.kernel.contract import SolidKind
from fantoccini.model.tree import WORLD


@dataclass(frozen=True)
class GeometryTolerances:
    """Steps and required agreement of differences; lengths in units of the pair's size."""

    steps: tuple[float, ...] = (1e-2, 2e-3, 4e-4, 8e-5, 1.6e-5, 3e-6)
    first_derivative: float = 1e-7
    """Agreement of first derivatives at two steps: above rounding at the smallest step."""
    second_derivative: float = 1e-5
    """Agreement of second derivatives at two steps."""
    max_gap: float = 1e-3  # Largest gap of the points considered [m], as in compiled code
    min_size: float = 1e-4  # Smallest size of a pair [m]
    max_separation: float = 20.0  # Largest separation during the differences, in steps
    flat_size: float = 0.1  # Size of planes and meshes, which have none of their own [m]


GEOMETRY_TOLERANCES = GeometryTolerances()


@dataclass(frozen=True, eq=False)
class Touch:
    """A contact point and its derivatives by a twist of the first link.

    Attributes:
        pair, feature: indices of the pair and of its point.
        links: links of the two solids; ``WORLD`` for an obstacle.
        gap: distance of the solids [m]; negative where they overlap.
        point: (3,) point P [m].
        normal: (3,) normal n, from the second solid to the first.
        by_twist: (7, 6) derivatives of gap, P and n by a twist about the world's origin.
        rate: (7,) rates of gap, P and n at a relative twist; 0 without one.
        rate_by_twist: (7, 6) derivatives of ``rate`` by a further twist, at the same relative
            twist.
        smooth: whether the derivatives exist.
    """

    pair: int
    feature: int
    links: tuple[int, int]
    gap: float
    point: Array
    normal: Array
    by_twist: Array
    rate: Array
    rate_by_twist: Array
    smooth: bool


class PairGeometry:
    """The contact points of one pair at a configuration.

    Args:
        marionette: the puppet.
        poses: (n_links, 12) poses of all links.
        pair: index of the pair.
    """

    def __init__(self, marionette: CompiledPuppet, poses: Array, pair: int):
        contacts = marionette.contacts
        assert contacts is not None
        self._library, self._contacts, self.pair = marionette.library, contacts, pair
        solids = contacts.solids[contacts.pairs[pair]]
        self.links = int(solids["link"][0]), int(solids["link"][1])
        a, b = self.links
        self._first = poses[a]
        self._second = poses[b] if b != WORLD else np.zeros(12)
        # The curvature of the points' paths scales with the distance of the cores, or is zero.
        self._pair_size = max(
            GEOMETRY_TOLERANCES.min_size, sum(_solid_size(solid) for solid in solids)
        )
        rows = self._touches(self._first[None], GEOMETRY_TOLERANCES.max_gap)[0]
        self.points = {int(row[0]): row[1:] for row in rows if row[0] >= 0.0}
        positions = [at[1:4] for at in self.points.values()]
        self._reference_point = np.mean(positions, axis=0) if positions else np.zeros(3)
        self._cache: dict[tuple[float, bytes | None], dict[int, Array]] = {}

    def nearest(self, point: Array, max_distance: float) -> int | None:
        """Feature of the nearest point, at most ``max_distance`` [m] away; None without one."""
        distances = {
            feature: float(np.max(np.abs(row[1:4] - point))) for feature, row in self.points.items()
        }
        features = [feature for feature, distance in distances.items() if distance <= max_distance]
        return min(features, key=distances.__getitem__) if features else None

    def twist(self, screws: Screws) -> Array:
        """Twist (6,) of the first solid relative to the second."""
        return screws.twist(self.links[0]) - screws.twist(self.links[1])

    def velocity(self, screws: Screws, point: Array) -> Array:
        """Velocity (3,) of the first solid relative to the second at a point [m/s]."""
        twist = self.twist(screws)
        return np.asarray(twist[:3] + np.cross(twist[3:], point))

    def touch(self, feature: int, twist: Array | None = None) -> Touch:
        """A contact point with its derivatives.

        Args:
            feature: feature of the point.
            twist: (6,) twist of the first link relative to the second about the world's origin, for
                the rates [m/s, rad/s].
        """
        row = self.points[feature]
        twist_scale = np.array([self._pair_size] * 3 + [1.0] * 3)
        value_scale = np.array([self._pair_size] * 4 + [1.0] * 3)
        from_origin = np.eye(6)
        from_origin[:3, 3:] = -rotation.skew(self._reference_point)
        by_twist, smooth = self._converged(feature, None, GEOMETRY_TOLERANCES.first_derivative)
        by_twist = value_scale[:, None] * by_twist / twist_scale @ from_origin
        rate, rate_by_twist = np.zeros(7), np.zeros((7, 6))
        if twist is not None:
            local_twist = from_origin @ twist / twist_scale
            speed = float(np.linalg.norm(local_twist))
            rate = by_twist @ twist
            if speed > 0.0:
                differences, second_smooth = self._converged(
                    feature, local_twist / speed, GEOMETRY_TOLERANCES.second_derivative
                )
                rate_by_twist = (
                    value_scale[:, None] * differences * speed / twist_scale @ from_origin
                )
                smooth = smooth and second_smooth
        return Touch(
            self.pair,
            feature,
            self.links,
            float(row[0]),
            row[1:4],
            row[4:7],
            by_twist,
            rate,
            rate_by_twist,
            smooth,
        )

    def _converged(
        self, feature: int, direction: Array | None, tolerance: float
    ) -> tuple[Array, bool]:
        """Differences (7, 6) at the largest step that agrees with the next, and whether any does.

        Args:
            feature: feature of the point.
            direction: (6,) unit twist along which rates are taken; None for first derivatives.
            tolerance: tolerance of the agreement.
        """
        previous: Array | None = None
        for h in GEOMETRY_TOLERANCES.steps:
            differences = self._differences(h, direction).get(feature)
            if differences is None:
                continue
            if previous is not None:
                difference = float(np.max(np.abs(differences - previous)))
                if difference <= tolerance * max(1.0, float(np.max(np.abs(previous)))):
                    return previous, True
            previous = differences
        return (np.zeros((7, 6)) if previous is None else previous), False

    def _differences(self, h: float, direction: Array | None) -> dict[int, Array]:
        """Differences (7, 6) at a step, in units of the size, of all points that are not lost."""
        key = h, None if direction is None else direction.tobytes()
        if key in self._cache:
            return self._cache[key]
        displacements = (h * OFFSETS[:, None, None] * np.eye(6)).reshape(-1, 6)
        if direction is None:
            twists = displacements[:, None]
        else:  # rates along it, after a twist in each direction
            first_displacements = np.tile(h * OFFSETS[:, None] * direction, (36, 1))
            twists = np.stack([np.repeat(displacements, 6, axis=0), first_displacements], axis=1)
        margin = (
            GEOMETRY_TOLERANCES.max_gap + GEOMETRY_TOLERANCES.max_separation * h * self._pair_size
        )
        rows = self._touches(self._moved_poses(self._reference_point, twists), margin)
        differences = {}
        for feature, row in self.points.items():
            is_feature = rows[:, :, 0] == feature
            if not np.all(np.any(is_feature, axis=1)):
                continue
            values = rows[np.arange(len(rows)), np.argmax(is_feature, axis=1), 1:] - row
            values[:, :4] /= self._pair_size
            if direction is None:
                value_grid = values.reshape(len(OFFSETS), 6, 7)
                differences[feature] = np.einsum("o,ojc->cj", WEIGHTS, value_grid) / h
            else:
                value_grid = values.reshape(len(OFFSETS), 6, len(OFFSETS), 7)
                direction_differences = np.einsum("ojsc,s->ojc", value_grid, WEIGHTS)
                differences[feature] = np.einsum("o,ojc->cj", WEIGHTS, direction_differences) / h**2
        self._cache[key] = differences
        return differences

    def _moved_poses(self, centre: Array, twists: Array) -> Array:
        """Poses (n, 12) of the first link after screw motions (n, k, 6) about a point, by size."""
        n = len(twists)
        R = np.broadcast_to(self._first[:9].reshape(3, 3).T, (n, 3, 3))
        r = np.broadcast_to(self._first[9:] - centre, (n, 3))
        for twist in np.moveaxis(twists, 1, 0):
            w = twist[:, 3:]
            turn_matrix = rotation.matrix(rotation.exp(w))
            # exp of a twist moves the origin by V(w) v, with V(w) the left Jacobian.
            translation = rotation.apply(
                rotation.right_jacobian(-w), self._pair_size * twist[:, :3]
            )
            r = rotation.apply(turn_matrix, r) + translation
            R = turn_matrix @ R
        return np.concatenate([R.swapaxes(1, 2).reshape(n, 9), r + centre], axis=1)

    def _touches(self, poses: Array, margin: float) -> Array:
        return self._library.touches(self._contacts, self.pair, poses, self._second, margin)


def _solid_size(solid: np.void) -> float:
    """The smallest radius or half edge of a solid [m]."""
    if solid["kind"] in (SolidKind.HALF_SPACE, SolidKind.HULL):
        return GEOMETRY_TOLERANCES.flat_size
    half = float(np.min(solid["half"]))
    return half if half > 0.0 else float(solid["radius"])
