"""Parts of a stage seen from above: what is in the way, and where the hands reach.

    distance of a point p from a box:  | max(|R^T (p - c)| - h, 0) |,   from a disk:  |p - c| - r

Points are complex, x + i y in the scene's frame [m].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fantoccini.base import Array, Mask
from fantoccini.theatre.gestures import Complex

_CORNERS = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])
_CHAMFER = float(np.tan(np.pi / 8.0))
"""Where a tangent half way round a corner leaves the parallels of the sides, over the radius."""
_DISK_CORNERS = 8
_ROUNDING = 1e-9
"""Places count as within a rectangle up to this [m]."""


class Region(Protocol):
    """A convex part of the stage that puppets stay clear of."""

    @property
    def name(self) -> str:
        """Name of the obstacle."""
        ...

    @property
    def centre(self) -> tuple[float, float]:
        """Its middle [m]."""
        ...

    def distance(self, points: Complex) -> Array:
        """(...) from points (...) to its border; 0 or less within it [m]."""
        ...

    def distance_of_legs(self, first: Complex, last: Complex) -> Array:
        """(...) least distance of straight legs (...) [m]."""
        ...

    def corners(self, clearance: float) -> Complex:
        """(n,) corners of a polygon around all that is nearer than the clearance [m]."""
        ...


@dataclass(frozen=True)
class Box:
    """A rectangle in any direction: a table, a wall.

    Attributes:
        name: of what stands there.
        centre: (x, y) [m].
        half: half its size along its own axes [m].
        yaw: of its first axis from x, to the left [rad].
    """

    name: str
    centre: tuple[float, float]
    half: tuple[float, float]
    yaw: float = 0.0

    def distance(self, points: Complex) -> Array:
        """(...) from points (...) to its border; 0 within it [m]."""
        return np.abs(_outside(self._own(points), complex(*self.half)))

    def distance_of_legs(self, first: Complex, last: Complex) -> Array:
        """(...) least distance of straight legs (...) [m]."""
        a, b, half = self._own(first), self._own(last), complex(*self.half)
        found = np.minimum(np.abs(_outside(a, half)), np.abs(_outside(b, half)))
        for corner in _CORNERS.real * half.real + 1j * _CORNERS.imag * half.imag:
            found = np.minimum(found, _from_leg(corner, a, b))
        return np.where(_crosses(a, b, half), 0.0, found)

    def corners(self, clearance: float) -> Complex:
        """(8,) corners of a polygon around all that is nearer than the clearance [m]."""
        # The rounded corners of what is too near, cut by tangents.
        out = np.array([1.0 + 1j * _CHAMFER, _CHAMFER + 1j]) * clearance
        own = [
            complex(sign.real * (self.half[0] + x.real), sign.imag * (self.half[1] + x.imag))
            for sign in _CORNERS
            for x in out
        ]
        return np.array(own) * np.exp(1j * self.yaw) + complex(*self.centre)

    def _own(self, points: Complex) -> Complex:
        return (np.asarray(points) - complex(*self.centre)) * np.exp(-1j * self.yaw)


@dataclass(frozen=True)
class Disk:
    """A round part of the stage: a pillar, a well.

    Attributes:
        name: of what stands there.
        centre: (x, y) [m].
        radius: [m].
    """

    name: str
    centre: tuple[float, float]
    radius: float

    def distance(self, points: Complex) -> Array:
        """(...) from points (...) to its border; below 0 within it [m]."""
        return np.abs(np.asarray(points) - complex(*self.centre)) - self.radius

    def distance_of_legs(self, first: Complex, last: Complex) -> Array:
        """(...) least distance of straight legs (...) [m]."""
        return _from_leg(complex(*self.centre), first, last) - self.radius

    def corners(self, clearance: float) -> Complex:
        """(8,) corners of a polygon around all that is nearer than the clearance [m]."""
        angles = 2.0 * np.pi / _DISK_CORNERS * np.arange(_DISK_CORNERS)
        out = (self.radius + clearance) / np.cos(np.pi / _DISK_CORNERS)
        return complex(*self.centre) + out * np.exp(1j * angles)


@dataclass(frozen=True)
class Rectangle:
    """Where the hands reach: least and largest x and y of the middle [m]."""

    low: tuple[float, float]
    high: tuple[float, float]

    def holds(self, points: Complex) -> Mask:
        """(...) whether points (...) are within it."""
        p = np.asarray(points)
        return (
            (p.real >= self.low[0] - _ROUNDING)
            & (p.real <= self.high[0] + _ROUNDING)
            & (p.imag >= self.low[1] - _ROUNDING)
            & (p.imag <= self.high[1] + _ROUNDING)
        )

    def nearest(self, point: complex) -> complex:
        """The place in it that is nearest to a point."""
        x, y = np.clip([point.real, point.imag], self.low, self.high)
        return complex(x, y)


def _outside(own: Complex, half: complex) -> Complex:
    """(...) from a box to points in its axes, each way."""
    return np.maximum(np.abs(own.real) - half.real, 0.0) + 1j * np.maximum(
        np.abs(own.imag) - half.imag, 0.0
    )


def _from_leg(point: complex, first: Complex, last: Complex) -> Array:
    """(...) distance of a point from straight legs."""
    way, to = np.asarray(last) - first, point - np.asarray(first)
    square = np.maximum(np.abs(way) ** 2, np.finfo(float).tiny)
    s = np.clip((way.conj() * to).real / square, 0.0, 1.0)
    return np.abs(to - s * way)


def _crosses(a: Complex, b: Complex, half: complex) -> Mask:
    """(...) whether legs meet a box: the parts of them between its pairs of sides overlap."""
    begin, end = np.zeros(np.shape(a)), np.ones(np.shape(a))
    inside = np.ones(np.shape(a), dtype=bool)
    for start, way, h in (
        (a.real, b.real - a.real, half.real),
        (a.imag, b.imag - a.imag, half.imag),
    ):
        moves = way != 0.0
        safe = np.where(moves, way, 1.0)
        one, two = (-h - start) / safe, (h - start) / safe
        begin = np.where(moves, np.maximum(begin, np.minimum(one, two)), begin)
        end = np.where(moves, np.minimum(end, np.maximum(one, two)), end)
        inside &= moves | (np.abs(start) <= h)
    return inside & (begin <= end)
