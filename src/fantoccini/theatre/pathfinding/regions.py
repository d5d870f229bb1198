"""Parts of a stage seen from above: obstacles, and the space of the hands.

    distance of a point p from a box:  | max(|R^T (p - c)| - h, 0) |,   from a disk:  |p - c| - r

Points are complex, x + i y in the scene's frame [m].

A box has the centre c, the axes R and the half lengths h; a disk has the centre c and the radius r.
A leg is a straight part of a path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.theatre.gestures import Complex

_SQUARE_CORNERS = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])
"""Corners of a square."""
_CHAMFER_RATIO = float(np.tan(np.pi / 8.0))
"""Distance between the end of a side and the tangent at the middle of a rounded corner, relative to
the corner's radius."""
_N_DISK_CORNERS = 8
"""Number of corners of the polygon around a disk."""
_TOLERANCE = 1e-9
"""Distance outside of a rectangle up to which a place counts as inside [m]."""


class Region(Protocol):
    """Convex part of the stage from which puppets keep clear."""

    @property
    def name(self) -> str:
        """Name of the obstacle."""
        ...

    @property
    def centre(self) -> tuple[float, float]:
        """Midpoint [m]."""
        ...

    def distance(self, points: Complex) -> Array:
        """(...) distances of points (...) from its border; 0 or less inside [m]."""
        ...

    def distance_of_legs(self, starts: Complex, ends: Complex) -> Array:
        """(...) least distances of straight legs (...) [m]."""
        ...

    def corners(self, clearance: float) -> Complex:
        """(n,) corners of a polygon around all points nearer than the clearance [m]."""
        ...


@dataclass(frozen=True)
class Box:
    """Rectangle in any direction, such as a table or a wall.

    Attributes:
        name: name of the obstacle.
        centre: (x, y) [m].
        half_sizes: half its lengths along its own axes [m].
        yaw: angle of its first axis from x, to the left [rad].
    """

    name: str
    centre: tuple[float, float]
    half_sizes: tuple[float, float]
    yaw: float = 0.0

    def distance(self, points: Complex) -> Array:
        """(...) distances of points (...) from its border; 0 inside [m]."""
        return np.abs(_outside_offsets(self._local(points), complex(*self.half_sizes)))

    def distance_of_legs(self, starts: Complex, ends: Complex) -> Array:
        """(...) least distances of straight legs (...) [m]."""
        local_starts, local_ends, half_sizes = (
            self._local(starts),
            self._local(ends),
            complex(*self.half_sizes),
        )
        distance = np.minimum(
            np.abs(_outside_offsets(local_starts, half_sizes)),
            np.abs(_outside_offsets(local_ends, half_sizes)),
        )
        for corner in (
            _SQUARE_CORNERS.real * half_sizes.real + 1j * _SQUARE_CORNERS.imag * half_sizes.imag
        ):
            distance = np.minimum(distance, _distance_from_leg(corner, local_starts, local_ends))
        return np.where(_meets_box(local_starts, local_ends, half_sizes), 0.0, distance)

    def corners(self, clearance: float) -> Complex:
        """(8,) corners of a polygon around all points nearer than the clearance [m]."""
        # The outline at the clearance has rounded corners; the polygon has tangents there.
        offsets = np.array([1.0 + 1j * _CHAMFER_RATIO, _CHAMFER_RATIO + 1j]) * clearance
        corners = [
            complex(
                sign.real * (self.half_sizes[0] + x.real), sign.imag * (self.half_sizes[1] + x.imag)
            )
            for sign in _SQUARE_CORNERS
            for x in offsets
        ]
        return np.array(corners) * np.exp(1j * self.yaw) + complex(*self.centre)

    def _local(self, points: Complex) -> Complex:
        """(...) points in the axes of the box, from its centre."""
        return (np.asarray(points) - complex(*self.centre)) * np.exp(-1j * self.yaw)


@dataclass(frozen=True)
class Disk:
    """Round part of the stage, such as a pillar or a well.

    Attributes:
        name: name of the obstacle.
        centre: (x, y) [m].
        radius: radius [m].
    """

    name: str
    centre: tuple[float, float]
    radius: float

    def distance(self, points: Complex) -> Array:
        """(...) distances of points (...) from its border; below 0 inside [m]."""
        return np.abs(np.asarray(points) - complex(*self.centre)) - self.radius

    def distance_of_legs(self, starts: Complex, ends: Complex) -> Array:
        """(...) least distances of straight legs (...) [m]."""
        return _distance_from_leg(complex(*self.centre), starts, ends) - self.radius

    def corners(self, clearance: float) -> Complex:
        """(8,) corners of a polygon around all points nearer than the clearance [m]."""
        angles = 2.0 * np.pi / _N_DISK_CORNERS * np.arange(_N_DISK_CORNERS)
        radius = (self.radius + clearance) / np.cos(np.pi / _N_DISK_CORNERS)
        return complex(*self.centre) + radius * np.exp(1j * angles)


@dataclass(frozen=True)
class Rectangle:
    """Bounds of the hands: least and largest x and y of the puppet's middle [m]."""

    lower: tuple[float, float]
    upper: tuple[float, float]

    def holds(self, points: Complex) -> Mask:
        """(...) whether points (...) are inside."""
        p = np.asarray(points)
        return (
            (p.real >= self.lower[0] - _TOLERANCE)
            & (p.real <= self.upper[0] + _TOLERANCE)
            & (p.imag >= self.lower[1] - _TOLERANCE)
            & (p.imag <= self.upper[1] + _TOLERANCE)
        )

    def nearest(self, point: complex) -> complex:
        """Place inside that is nearest to a point."""
        x, y = np.clip([point.real, point.imag], self.lower, self.upper)
        return complex(x, y)


def _outside_offsets(points: Complex, half: complex) -> Complex:
    """(...) offsets of points in a box's axes from the box, along each axis."""
    x, y = np.abs(points.real) - half.real, np.abs(points.imag) - half.imag
    return np.maximum(x, 0.0) + 1j * np.maximum(y, 0.0)


def _distance_from_leg(point: complex, starts: Complex, ends: Complex) -> Array:
    """(...) distances of a point from straight legs."""
    leg, offset = np.asarray(ends) - starts, point - np.asarray(starts)
    squared_length = np.maximum(np.abs(leg) ** 2, np.finfo(float).tiny)
    share = np.clip((leg.conj() * offset).real / squared_length, 0.0, 1.0)
    return np.abs(offset - share * leg)


def _meets_box(starts: Complex, ends: Complex, half: complex) -> Mask:
    """(...) bool, whether legs meet a box: their parts between its two pairs of sides overlap."""
    entry, exit_ = np.zeros(np.shape(starts)), np.ones(np.shape(starts))
    is_inside = np.ones(np.shape(starts), dtype=bool)
    for start, length, half_size in (
        (starts.real, ends.real - starts.real, half.real),
        (starts.imag, ends.imag - starts.imag, half.imag),
    ):
        is_moving = length != 0.0
        divisor = np.where(is_moving, length, 1.0)
        first_crossing, second_crossing = (
            (-half_size - start) / divisor,
            (half_size - start) / divisor,
        )
        entry = np.where(
            is_moving, np.maximum(entry, np.minimum(first_crossing, second_crossing)), entry
        )
        exit_ = np.where(
            is_moving, np.minimum(exit_, np.maximum(first_crossing, second_crossing)), exit_
        )
        is_inside &= is_moving | (np.abs(start) <= half_size)
    return is_inside & (entry <= exit_)
