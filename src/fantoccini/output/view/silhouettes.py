"""Solids as painted polygons: outlines in perspective, shaded.

A round solid is a stack of copies of its outline, shrunk towards the light in lighter and lighter
colours; a flat-sided one is its visible faces with Lambert's shading. Outlines are exact for
ellipsoids; those of capsules are the hulls of the discs of their end spheres.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import cross, perpendicular, unit
from fantoccini.output.view.camera import Camera, Viewport
from fantoccini.output.view.theme import Theme, mix

_LIGHT_ON_PICTURE = np.array([-0.53, 0.85])
_LIGHT = np.array([-0.42, 0.72, 0.55])
"""Towards the light, in camera axes right, up, back."""

_WHITE = np.ones(3)

CLEAR = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Solid:
    """A shape on a link, in the link's frame.

    Attributes:
        link: index of the link; -1 for the world.
        kind: capsule, ellipsoid or faces.
        colour: (3,); the mean of ``colours`` where there are any.
        points: capsule (2, 3) ends; ellipsoid (1, 3) centre; faces (n, 3) vertices [m].
        radius: of a capsule [m].
        half: (3, 3) half axes of an ellipsoid, or of the one that stands for a faced solid in the
            painter's order, as columns [m]; zero for a capsule.
        faces: indices of each face's corners in ``points``, anticlockwise from outside.
        smooth: True for a mesh: edges between faces are not drawn.
        colours: (m, 3) of the faces of a mesh that has several; else None.
        fine: the same mesh with more triangles, for renderers with a depth buffer; else None.
        axis: (2, 3) the longest line inside, for the painter's order [m].
        girth: distance from that line to the surface [m].
    """

    link: int
    kind: str
    colour: np.ndarray
    points: np.ndarray
    axis: np.ndarray
    girth: float
    radius: float = 0.0
    half: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    faces: tuple[np.ndarray, ...] | np.ndarray = ()
    smooth: bool = False
    colours: np.ndarray | None = None
    fine: Solid | None = None

    @property
    def full(self) -> Solid:
        """The solid with all triangles it has."""
        return self if self.fine is None else self.fine


@dataclass(frozen=True)
class Polygon:
    """One polygon to paint.

    Attributes:
        outline: (n, 2) corners [px].
        face: (4,) colour and opacity inside.
        edge: (4,) colour and opacity of the outline.
        width: of the outline [px].
    """

    outline: np.ndarray
    face: tuple[float, ...]
    edge: tuple[float, ...]
    width: float


def capsule(link: int, colour: np.ndarray, ends: np.ndarray, radius: float) -> Solid:
    """A capsule, or a ball where the (2, 3) ends [m] coincide."""
    ends = np.asarray(ends, dtype=float)
    return Solid(link, "capsule", colour, ends, ends, radius, radius=radius)


def ellipsoid(link: int, colour: np.ndarray, centre: np.ndarray, half: np.ndarray) -> Solid:
    """An ellipsoid from its centre (3,) and its half axes, the columns of (3, 3) [m]."""
    axis, girth = _long_axis(centre, half)
    return Solid(link, "ellipsoid", colour, np.array([centre]), axis, girth, half=half)


def box(link: int, colour: np.ndarray, centre: np.ndarray, half: np.ndarray) -> Solid:
    """A box from its centre (3,) and its half edges, the columns of (3, 3) [m]."""
    signs = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    faces = [np.array(c) for c in sides]
    if np.linalg.det(half) < 0.0:
        faces = [f[::-1] for f in faces]
    axis, girth = _long_axis(centre, half)
    corners = centre + signs @ half.T
    return Solid(link, "faces", colour, corners, axis, girth, half=half, faces=tuple(faces))


def mesh(
    link: int,
    colour: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    colours: np.ndarray | None = None,
) -> Solid:
    """A triangle mesh: vertices (n, 3) [m], faces (m, 3) anticlockwise from outside.

    Faces have the colour (3,), or those of ``colours`` (m, 3), whose mean by area is the outline's.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    half = np.diag(np.maximum(0.5 * (high - low), 1e-9))
    axis, girth = _long_axis(0.5 * (low + high), half)
    if colours is not None and len(np.unique(colours, axis=0)) == 1:
        colour, colours = colours[0], None
    elif colours is not None:
        a, b, c = vertices[faces.T]
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        colour = np.average(colours, axis=0, weights=area + 1e-12)
    return Solid(
        link,
        "faces",
        colour,
        vertices,
        axis,
        girth,
        half=half,
        faces=faces,
        smooth=True,
        colours=colours,
    )


def _long_axis(centre: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, float]:
    lengths = np.linalg.norm(half, axis=0)
    order = np.argsort(lengths)
    longest, second = order[2], order[1]
    reach = half[:, longest] * (1.0 - lengths[second] / max(lengths[longest], 1e-12))
    return np.array([centre - reach, centre + reach]), float(lengths[order[0]])


def paint(
    solid: Solid, pose: np.ndarray, camera: Camera, viewport: Viewport, theme: Theme, pen: float
) -> list[Polygon]:
    """The polygons of one solid, in the order of painting.

    Args:
        solid: what to paint.
        pose: (3, 4) of its link in the world.
        camera, viewport: the view.
        theme: colours.
        pen: width of outlines [px].
    """
    ink = (*(solid.colour * theme.outline), 1.0)
    seen = camera.see(solid.points @ pose[:, :3].T + pose[:, 3])
    if np.any(seen[:, 2] <= 1e-6):
        return []
    if solid.kind == "faces":
        return _paint_faces(solid, seen, camera, viewport, ink, pen)
    if solid.kind == "capsule":
        centres = camera.place(seen, viewport)
        radii = solid.radius * camera.scale(seen[:, 2], viewport)
        size = float(radii.max())
        stack = _capsule_stack(centres, radii, _tones(size))
    else:
        rim = _rim(solid.points[0], solid.half, pose, camera.eye)
        outline = camera.project(rim, viewport)[:, :2]
        middle = outline.mean(axis=0)
        far = outline[np.argmax((outline - middle) @ _LIGHT_ON_PICTURE)]
        glint = middle + 0.42 * (far - middle)
        size = 0.5 * float(np.ptp(outline, axis=0).min())
        shrink = np.linspace(1.0, 0.1, _tones(size))[:, None, None]
        stack = glint + shrink * (outline - glint)
    tones = _ramp(solid.colour, len(stack))
    return [
        Polygon(outline, (*tone, 1.0), *((CLEAR, 0.0) if k else (ink, pen)))
        for k, (outline, tone) in enumerate(zip(stack, tones, strict=True))
    ]


def shadow(solid: Solid, pose: np.ndarray, floor: float, ray: np.ndarray) -> np.ndarray:
    """Outline (n, 3) of the shadow on the plane z = floor, under light along ray (3,) [m]."""
    points = solid.points @ pose[:, :3].T + pose[:, 3]
    if solid.kind == "ellipsoid":
        half = pose[:, :3] @ solid.half
        points = points[0] + _great_circle(np.linalg.solve(half, ray)) @ half.T
    fallen = points[:, :2] + ((floor - points[:, 2:]) / ray[2]) * ray[:2]
    if solid.kind == "capsule":
        fallen = _capsule_stack(fallen, np.full(2, solid.radius), 1)[0]
    elif solid.kind == "faces":
        fallen = _hull(fallen)
    return np.column_stack([fallen, np.full(len(fallen), floor)])


def _paint_faces(
    solid: Solid,
    seen: np.ndarray,
    camera: Camera,
    viewport: Viewport,
    ink: tuple[float, ...],
    pen: float,
) -> list[Polygon]:
    placed = camera.place(seen, viewport)
    polygons, depths = [], []
    towards = seen * np.array([1.0, 1.0, -1.0])
    for k, face in enumerate(solid.faces):
        colour = solid.colour if solid.colours is None else solid.colours[k]
        corners = towards[face]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        size = np.linalg.norm(normal)
        if size == 0.0 or normal @ corners[0] >= 0.0:
            continue
        shade = max(0.0, float(normal @ _LIGHT) / float(size))
        tone = mix(colour * 0.55, mix(colour, _WHITE, 0.22), shade)
        edge, width = ((*tone, 1.0), 0.4) if solid.smooth else (ink, 0.8 * pen)
        polygons.append(Polygon(placed[face], (*tone, 1.0), edge, width))
        depths.append(seen[face, 2].mean())
    polygons = [polygons[k] for k in np.argsort(depths)[::-1]]
    if solid.smooth:
        # The silhouette: the same triangles underneath, one pen wider.
        under = [Polygon(p.outline, ink, ink, 2.0 * pen) for p in polygons]
        return under + polygons
    return polygons


def _tones(size: float) -> int:
    return int(np.clip(size / 1.5, 4, 28))


def _ramp(colour: np.ndarray, n: int) -> np.ndarray:
    light = np.linspace(0.0, 1.0, n)[:, None]
    dark, bright = colour * 0.66, mix(colour, _WHITE, 0.30)
    return np.where(
        light < 0.45, mix(dark, colour, light / 0.45), mix(colour, bright, (light - 0.45) / 0.55)
    )


def _capsule_stack(centres: np.ndarray, radii: np.ndarray, tones: int) -> np.ndarray:
    """(tones, n, 2) outlines of two discs and their outer tangents, shrinking to the light."""
    apart = centres[1] - centres[0]
    distance = float(np.hypot(*apart))
    count = int(np.clip(radii.max() * 0.9, 9, 26)) if tones > 1 else 12
    if distance <= abs(radii[0] - radii[1]) + 1e-9:
        big = int(np.argmax(radii))
        angles = np.linspace(0.0, 2.0 * np.pi, 2 * count, endpoint=False)
        middle, radius = np.tile(centres[big], (2 * count, 1)), np.full(2 * count, radii[big])
    else:
        ahead = np.arctan2(apart[1], apart[0])
        open_ = np.arccos((radii[0] - radii[1]) / distance)
        angles = np.concatenate(
            [
                np.linspace(ahead + open_, ahead + 2.0 * np.pi - open_, count),
                np.linspace(ahead - open_, ahead + open_, count),
            ]
        )
        middle, radius = np.repeat(centres, count, axis=0), np.repeat(radii, count)
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    shrink = np.linspace(1.0, 0.12, tones)[:, None, None]
    return middle + radius[:, None] * (shrink * around + 0.52 * (1.0 - shrink) * _LIGHT_ON_PICTURE)


def _rim(centre: np.ndarray, half: np.ndarray, pose: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """The points (n, 3) of an ellipsoid at which lines from the eye are tangent.

    With x = c + H u and |u| = 1 these points satisfy u . H^-1 (eye - c) = 1: a circle.
    """
    centre = pose[:, :3] @ centre + pose[:, 3]
    half = pose[:, :3] @ half
    view = np.linalg.solve(half, eye - centre)
    near = 1.0 / max(float(view @ view), 1.0 + 1e-9)
    circle = near * view + np.sqrt(1.0 - near) * _great_circle(view)
    return centre + circle @ half.T


def _great_circle(normal: np.ndarray, n: int = 40) -> np.ndarray:
    """(n, 3) points of the unit circle normal to a vector."""
    normal = unit(normal)
    first = perpendicular(normal)
    second = cross(normal, first)
    angles = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)[:, None]
    return np.cos(angles) * first + np.sin(angles) * second


def _hull(points: np.ndarray) -> np.ndarray:
    """Convex hull (n, 2), anticlockwise, by Andrew's monotone chain."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]

    def chain(sequence: np.ndarray) -> list[np.ndarray]:
        kept: list[np.ndarray] = []
        for p in sequence:
            while len(kept) >= 2:
                a, b = kept[-1] - kept[-2], p - kept[-2]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))
