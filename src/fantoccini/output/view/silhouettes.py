"""Solids as painted polygons: shaded outlines in perspective.

A round solid is a stack of copies of its outline, shrunk towards the light in increasingly light
colours; a flat-sided solid is its visible faces with Lambert shading. Outlines of ellipsoids are
exact; those of capsules are the hulls of the discs of their end spheres.

Lambert shading makes a face lighter the more it is turned towards the light. A link is a body on
its joint.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import cross, perpendicular, unit
from fantoccini.output.view.camera import Camera, Viewport
from fantoccini.output.view.theme import Theme, mix_colours

_LIGHT_ON_PICTURE = np.array([-0.53, 0.85])
"""Direction towards the light in the picture, right and up."""
_LIGHT = np.array([-0.42, 0.72, 0.55])
"""Direction towards the light, in camera axes right, up, back."""

_WHITE = np.ones(3)

TRANSPARENT = (0.0, 0.0, 0.0, 0.0)
"""Colour without opacity."""


@dataclass(frozen=True)
class Solid:
    """Shape on a link, in the link's frame.

    Attributes:
        link: index of the link; -1 for the world.
        kind: capsule, ellipsoid or faces.
        colour: (3,) colour; the mean of ``colours``, if there are any.
        points: (2, 3) ends of a capsule; (1, 3) centre of an ellipsoid; (n, 3) vertices of faces
            [m].
        radius: radius of a capsule [m].
        half_axes: (3, 3) half axes, as columns, of an ellipsoid, or of the one that replaces a
            solid with faces in the painting order [m]; zero for a capsule.
        faces: indices of each face's corners in ``points``, anticlockwise seen from outside.
        smooth: True for a mesh: edges between faces are not drawn.
        colours: (m, 3) colours of the faces, if they differ; else None.
        detailed: the same mesh with more triangles, for renderers with a depth buffer; else None.
        axis: (2, 3) ends of the longest line inside, for the painting order [m].
        half_thickness: distance from that line to the surface [m].
    """

    link: int
    kind: str
    colour: np.ndarray
    points: np.ndarray
    axis: np.ndarray
    half_thickness: float
    radius: float = 0.0
    half_axes: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    faces: tuple[np.ndarray, ...] | np.ndarray = ()
    smooth: bool = False
    colours: np.ndarray | None = None
    detailed: Solid | None = None

    @property
    def most_detailed(self) -> Solid:
        """The solid with all its triangles."""
        return self if self.detailed is None else self.detailed


@dataclass(frozen=True)
class Polygon:
    """Polygon to paint.

    Attributes:
        outline: (n, 2) corners [px].
        face: (4,) colour and opacity inside.
        edge: (4,) colour and opacity of the outline.
        width: width of the outline [px].
    """

    outline: np.ndarray
    face: tuple[float, ...]
    edge: tuple[float, ...]
    width: float


def capsule_solid(link: int, colour: np.ndarray, ends: np.ndarray, radius: float) -> Solid:
    """Capsule, or ball if the (2, 3) ends [m] coincide."""
    ends = np.asarray(ends, dtype=float)
    return Solid(link, "capsule", colour, ends, ends, radius, radius=radius)


def ellipsoid_solid(
    link: int, colour: np.ndarray, centre: np.ndarray, half_axes: np.ndarray
) -> Solid:
    """Ellipsoid with centre (3,) and half axes, the columns of (3, 3) [m]."""
    axis, half_thickness = _long_axis(centre, half_axes)
    return Solid(
        link, "ellipsoid", colour, np.array([centre]), axis, half_thickness, half_axes=half_axes
    )


def box_solid(link: int, colour: np.ndarray, centre: np.ndarray, half_axes: np.ndarray) -> Solid:
    """Box with centre (3,) and half edges, the columns of (3, 3) [m]."""
    signs = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
    face_corners = (
        (0, 2, 3, 1),
        (4, 5, 7, 6),
        (0, 1, 5, 4),
        (2, 6, 7, 3),
        (0, 4, 6, 2),
        (1, 3, 7, 5),
    )
    faces = [np.array(c) for c in face_corners]
    if np.linalg.det(half_axes) < 0.0:
        faces = [f[::-1] for f in faces]
    axis, half_thickness = _long_axis(centre, half_axes)
    corners = centre + signs @ half_axes.T
    return Solid(
        link,
        "faces",
        colour,
        corners,
        axis,
        half_thickness,
        half_axes=half_axes,
        faces=tuple(faces),
    )


def mesh_solid(
    link: int,
    colour: np.ndarray,
    vertices: np.ndarray,
    faces: np.ndarray,
    colours: np.ndarray | None = None,
) -> Solid:
    """Triangle mesh: vertices (n, 3) [m], faces (m, 3) anticlockwise seen from outside.

    Faces have the colour (3,), or ``colours`` (m, 3), whose area-weighted mean is the outline's.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    half = np.diag(np.maximum(0.5 * (high - low), 1e-9))
    axis, half_thickness = _long_axis(0.5 * (low + high), half)
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
        half_thickness,
        half_axes=half,
        faces=faces,
        smooth=True,
        colours=colours,
    )


def _long_axis(centre: np.ndarray, half_axes: np.ndarray) -> tuple[np.ndarray, float]:
    lengths = np.linalg.norm(half_axes, axis=0)
    order = np.argsort(lengths)
    longest, second = order[2], order[1]
    half_axis = half_axes[:, longest] * (1.0 - lengths[second] / max(lengths[longest], 1e-12))
    return np.array([centre - half_axis, centre + half_axis]), float(lengths[order[0]])


def paint_solid(
    solid: Solid,
    pose: np.ndarray,
    camera: Camera,
    viewport: Viewport,
    theme: Theme,
    line_width: float,
) -> list[Polygon]:
    """Polygons of one solid, in painting order.

    Args:
        solid: solid to paint.
        pose: (3, 4) pose of its link in the world frame.
        camera, viewport: the view.
        theme: colours.
        line_width: width of outlines [px].
    """
    outline_colour = (*(solid.colour * theme.outline), 1.0)
    points = camera.to_camera(solid.points @ pose[:, :3].T + pose[:, 3])
    if np.any(points[:, 2] <= 1e-6):
        return []
    if solid.kind == "faces":
        return _paint_faces(solid, points, camera, viewport, outline_colour, line_width)
    if solid.kind == "capsule":
        centres = camera.to_pixels(points, viewport)
        radii = solid.radius * camera.scale(points[:, 2], viewport)
        size = float(radii.max())
        stack = _capsule_stack(centres, radii, _shade_count(size))
    else:
        contour = _visible_contour(solid.points[0], solid.half_axes, pose, camera.eye)
        outline = camera.project(contour, viewport)[:, :2]
        middle = outline.mean(axis=0)
        brightest = outline[np.argmax((outline - middle) @ _LIGHT_ON_PICTURE)]
        highlight = middle + 0.42 * (brightest - middle)
        size = 0.5 * float(np.ptp(outline, axis=0).min())
        shrink = np.linspace(1.0, 0.1, _shade_count(size))[:, None, None]
        stack = highlight + shrink * (outline - highlight)
    colours = _shades(solid.colour, len(stack))
    return [
        Polygon(
            outline, (*colour, 1.0), *((TRANSPARENT, 0.0) if k else (outline_colour, line_width))
        )
        for k, (outline, colour) in enumerate(zip(stack, colours, strict=True))
    ]


def shadow_outline(solid: Solid, pose: np.ndarray, floor: float, ray: np.ndarray) -> np.ndarray:
    """Outline (n, 3) of the shadow on the plane z = floor, for light along ray (3,) [m]."""
    points = solid.points @ pose[:, :3].T + pose[:, 3]
    if solid.kind == "ellipsoid":
        half = pose[:, :3] @ solid.half_axes
        points = points[0] + _great_circle(np.linalg.solve(half, ray)) @ half.T
    outline = points[:, :2] + ((floor - points[:, 2:]) / ray[2]) * ray[:2]
    if solid.kind == "capsule":
        outline = _capsule_stack(outline, np.full(2, solid.radius), 1)[0]
    elif solid.kind == "faces":
        outline = _hull(outline)
    return np.column_stack([outline, np.full(len(outline), floor)])


def _paint_faces(
    solid: Solid,
    points: np.ndarray,
    camera: Camera,
    viewport: Viewport,
    outline_colour: tuple[float, ...],
    line_width: float,
) -> list[Polygon]:
    pixels = camera.to_pixels(points, viewport)
    polygons, depths = [], []
    camera_points = points * np.array([1.0, 1.0, -1.0])
    for k, face in enumerate(solid.faces):
        colour = solid.colour if solid.colours is None else solid.colours[k]
        corners = camera_points[face]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        size = np.linalg.norm(normal)
        if size == 0.0 or normal @ corners[0] >= 0.0:
            continue
        shade = max(0.0, float(normal @ _LIGHT) / float(size))
        shaded_colour = mix_colours(colour * 0.55, mix_colours(colour, _WHITE, 0.22), shade)
        edge, width = (
            ((*shaded_colour, 1.0), 0.4) if solid.smooth else (outline_colour, 0.8 * line_width)
        )
        polygons.append(Polygon(pixels[face], (*shaded_colour, 1.0), edge, width))
        depths.append(points[face, 2].mean())
    polygons = [polygons[k] for k in np.argsort(depths)[::-1]]
    if solid.smooth:
        # The outline: the same triangles underneath, wider by one line width.
        underlay = [
            Polygon(p.outline, outline_colour, outline_colour, 2.0 * line_width) for p in polygons
        ]
        return underlay + polygons
    return polygons


def _shade_count(size: float) -> int:
    return int(np.clip(size / 1.5, 4, 28))


def _shades(colour: np.ndarray, n: int) -> np.ndarray:
    light = np.linspace(0.0, 1.0, n)[:, None]
    dark, bright = colour * 0.66, mix_colours(colour, _WHITE, 0.30)
    return np.where(
        light < 0.45,
        mix_colours(dark, colour, light / 0.45),
        mix_colours(colour, bright, (light - 0.45) / 0.55),
    )


def _capsule_stack(centres: np.ndarray, radii: np.ndarray, tones: int) -> np.ndarray:
    """(tones, n, 2) outlines of two discs and their outer tangents, shrinking towards the light."""
    offset = centres[1] - centres[0]
    distance = float(np.hypot(*offset))
    count = int(np.clip(radii.max() * 0.9, 9, 26)) if tones > 1 else 12
    if distance <= abs(radii[0] - radii[1]) + 1e-9:
        larger = int(np.argmax(radii))
        angles = np.linspace(0.0, 2.0 * np.pi, 2 * count, endpoint=False)
        middle, radius = (
            np.tile(centres[larger], (2 * count, 1)),
            np.full(2 * count, radii[larger]),
        )
    else:
        direction = np.arctan2(offset[1], offset[0])
        half_opening = np.arccos((radii[0] - radii[1]) / distance)
        angles = np.concatenate(
            [
                np.linspace(
                    direction + half_opening, direction + 2.0 * np.pi - half_opening, count
                ),
                np.linspace(direction - half_opening, direction + half_opening, count),
            ]
        )
        middle, radius = np.repeat(centres, count, axis=0), np.repeat(radii, count)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    shrink = np.linspace(1.0, 0.12, tones)[:, None, None]
    return middle + radius[:, None] * (shrink * circle + 0.52 * (1.0 - shrink) * _LIGHT_ON_PICTURE)


def _visible_contour(
    centre: np.ndarray, half: np.ndarray, pose: np.ndarray, eye: np.ndarray
) -> np.ndarray:
    """Points (n, 3) of an ellipsoid at which lines from the eye are tangent.

    With x = c + H u and |u| = 1 these points satisfy u . H^-1 (eye - c) = 1: a circle.
    """
    centre = pose[:, :3] @ centre + pose[:, 3]
    half = pose[:, :3] @ half
    view = np.linalg.solve(half, eye - centre)
    height = 1.0 / max(float(view @ view), 1.0 + 1e-9)
    circle = height * view + np.sqrt(1.0 - height) * _great_circle(view)
    return centre + circle @ half.T


def _great_circle(normal: np.ndarray, n: int = 40) -> np.ndarray:
    """(n, 3) points of the unit circle perpendicular to a vector."""
    normal = unit(normal)
    first = perpendicular(normal)
    second = cross(normal, first)
    angles = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)[:, None]
    return np.cos(angles) * first + np.sin(angles) * second


def _hull(points: np.ndarray) -> np.ndarray:
    """Convex hull (n, 2), anticlockwise, by Andrew's monotone chain."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]

    def chain(sequence: np.ndarray) -> list[np.ndarray]:
        hull: list[np.ndarray] = []
        for p in sequence:
            while len(hull) >= 2:
                a, b = hull[-1] - hull[-2], p - hull[-2]
                if a[0] * b[1] - a[1] * b[0] > 0.0:
                    break
                hull.pop()
            hull.append(p)
        return hull[:-1]

    return np.array(chain(ordered) + chain(ordered[::-1]))
