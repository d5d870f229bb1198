"""Geometry of a contact under small motions of its solids: derivatives of the narrow phase.

Point P, normal n and gap of a pair are functions of the poses of its two links that move along with
both. So the derivatives by a twist of the first link, (v, w) about the world's origin, determine
those by a twist of the second, too:

    dP = P_1 (xi_1 - xi_2) + v_2 + w_2 x P,   dn = n_1 (xi_1 - xi_2) + w_2 x n

They are central differences of sixth order of the compiled narrow phase at a fixed feature. The
step is the largest that agrees with a smaller one: points of solids in flat contact are smooth
over a small tilt only.
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
        by: (7, 6) derivatives of gap, P and n by a twist about the world's origin.
        rate: (7,) rates of gap, P and n at a relative twist; 0 without one.
        rate_by: (7, 6) derivatives of ``rate`` by a further twist, at the same relative twist.
        smooth: whether the derivatives exist.
    """

    pair: int
    feature: int
    links: tuple[int, int]
    gap: float
    point: Array
    normal: Array
    by: Array
    rate: Array
    rate_by: Array
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
        self._size = max(GEOMETRY_TOLERANCES.min_size, sum(_size(solid) for solid in solids))
        rows = self._touches(self._first[None], GEOMETRY_TOLERANCES.max_gap)[0]
        self.points = {int(row[0]): row[1:] for row in rows if row[0] >= 0.0}
        places = [at[1:4] for at in self.points.values()]
        self._about = np.mean(places, axis=0) if places else np.zeros(3)
        self._cache: dict[tuple[float, bytes | None], dict[int, Array]] = {}

    def nearest(self, point: Array, most: float) -> int | None:
        """Feature of the point nearest to a place (3,) [m], if any is within ``most`` [m]."""
        distances = {f: float(np.max(np.abs(at[1:4] - point))) for f, at in self.points.items()}
        near = [f for f, distance in distances.items() if distance <= most]
        return min(near, key=distances.__getitem__) if near else None

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
        here = self.points[feature]
        scale = np.array([self._size] * 3 + [1.0] * 3)
        values = np.array([self._size] * 4 + [1.0] * 3)
        to_origin = np.eye(6)
        to_origin[:3, 3:] = -rotation.skew(self._about)
        by, smooth = self._converged(feature, None, GEOMETRY_TOLERANCES.first_derivative)
        by = values[:, None] * by / scale @ to_origin
        rate, rate_by = np.zeros(7), np.zeros((7, 6))
        if twist is not None:
            local = to_origin @ twist / scale
            speed = float(np.linalg.norm(local))
            rate = by @ twist
            if speed > 0.0:
                differences, second = self._converged(
                    feature, local / speed, GEOMETRY_TOLERANCES.second_derivative
                )
                rate_by = values[:, None] * differences * speed / scale @ to_origin
                smooth = smooth and second
        return Touch(
            self.pair,
            feature,
            self.links,
            float(here[0]),
            here[1:4],
            here[4:7],
            by,
            rate,
            rate_by,
            smooth,
        )

    def _converged(self, feature: int, along: Array | None, tolerance: float) -> tuple[Array, bool]:
        """Differences (7, 6) at the largest step that agrees with the next, and whether any does.

        Args:
            feature: feature of the point.
            along: (6,) unit twist along which rates are taken; None for first derivatives.
            tolerance: tolerance of the agreement.
        """
        last: Array | None = None
        for h in GEOMETRY_TOLERANCES.steps:
            differences = self._differences(h, along).get(feature)
            if differences is None:
                continue
            if last is not None:
                difference = float(np.max(np.abs(differences - last)))
                if difference <= tolerance * max(1.0, float(np.max(np.abs(last)))):
                    return last, True
            last = differences
        return (np.zeros((7, 6)) if last is None else last), False

    def _differences(self, h: float, along: Array | None) -> dict[int, Array]:
        """Differences (7, 6) at a step, in units of the size, of all points that are not lost."""
        key = h, None if along is None else along.tobytes()
        if key in self._cache:
            return self._cache[key]
        single = (h * OFFSETS[:, None, None] * np.eye(6)).reshape(-1, 6)
        if along is None:
            moves = single[:, None]
        else:  # rates along it, after a twist in each direction
            then = np.tile(h * OFFSETS[:, None] * along, (36, 1))
            moves = np.stack([np.repeat(single, 6, axis=0), then], axis=1)
        margin = GEOMETRY_TOLERANCES.max_gap + GEOMETRY_TOLERANCES.max_separation * h * self._size
        rows = self._touches(self._moved_poses(self._about, moves), margin)
        out = {}
        for feature, here in self.points.items():
            own = rows[:, :, 0] == feature
            if not np.all(np.any(own, axis=1)):
                continue
            values = rows[np.arange(len(rows)), np.argmax(own, axis=1), 1:] - here
            values[:, :4] /= self._size
            if along is None:
                shaped = values.reshape(len(OFFSETS), 6, 7)
                out[feature] = np.einsum("o,ojc->cj", WEIGHTS, shaped) / h
            else:
                shaped = values.reshape(len(OFFSETS), 6, len(OFFSETS), 7)
                inner = np.einsum("ojsc,s->ojc", shaped, WEIGHTS)
                out[feature] = np.einsum("o,ojc->cj", WEIGHTS, inner) / h**2
        self._cache[key] = out
        return out

    def _moved_poses(self, about: Array, twists: Array) -> Array:
        """Poses (n, 12) of the first link after screw motions (n, k, 6) about a point, by size."""
        n = len(twists)
        R = np.broadcast_to(self._first[:9].reshape(3, 3).T, (n, 3, 3))
        r = np.broadcast_to(self._first[9:] - about, (n, 3))
        for twist in np.moveaxis(twists, 1, 0):
            w = twist[:, 3:]
            turn = rotation.matrix(rotation.exp(w))
            # exp of a twist moves the origin by V(w) v, with V(w) the left Jacobian.
            carried = rotation.apply(rotation.right_jacobian(-w), self._size * twist[:, :3])
            r = rotation.apply(turn, r) + carried
            R = turn @ R
        return np.concatenate([R.swapaxes(1, 2).reshape(n, 9), r + about], axis=1)

    def _touches(self, poses: Array, margin: float) -> Array:
        return self._library.touches(self._contacts, self.pair, poses, self._second, margin)


def _size(solid: np.void) -> float:
    """The smallest radius or half edge of a solid [m]."""
    if solid["kind"] in (SolidKind.HALF_SPACE, SolidKind.HULL):
        return GEOMETRY_TOLERANCES.flat_size
    half = float(np.min(solid["half"]))
    return half if half > 0.0 else float(solid["radius"])
