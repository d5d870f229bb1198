"""Shapes: geometry for pictures and collisions, and inertia.

A shape with a mass or a density contributes to its body's inertia.

An obstacle is a shape fixed in the world. An inertia has moments and products, about the axes of
its frame. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from fantoccini.base.documents import (
    Located,
    Model,
    Orientation,
    Origin,
    PartName,
    shown,
    sized,
    validation_error,
    value_of,
)
from fantoccini.model import meshes
from fantoccini.model.puppet.quantities import QUANTITIES, Density, Mass, Scale, Size, Sizes, Vector

MIN_MESH_VOLUME = 1e-15
"""Smallest volume of a mesh with mass [m^3]; the inertia of a flatter one is a rounding error."""


def _colour(text: str) -> str:
    if not re.fullmatch(r"#[0-9a-fA-F]{6}", text):
        raise validation_error(f"found {shown(text)}; needed: a colour like '#c08040', in quotes")
    return text


Colour = Annotated[str, AfterValidator(_colour)]


class Shape(Model):
    """A solid of uniform density, fixed on a body."""

    mass: Mass | None = None
    """Mass [kg]; a shape without mass and density has no inertia."""
    density: Density | None = None
    """Density [kg/m^3], instead of a mass."""
    colour: Colour | None = None
    """Colour as `"#rrggbb"`."""

    @field_validator("density")
    @classmethod
    def _mass_or_density(cls, density: Any, info: ValidationInfo) -> Any:
        if density is not None and info.data.get("mass") is not None:
            raise validation_error("found mass and density; allowed: one of the two")
        return density


class Capsule(Shape):
    """A cylinder closed by two half-spheres."""

    type: Literal["capsule"] = "capsule"
    from_: Vector = Field(alias="from")
    """Centre of the first half-sphere [m]."""
    to: Vector
    """Centre of the second half-sphere [m]."""
    radius: Size
    """Radius [m]."""


class Box(Shape):
    """A box, centred at `at`."""

    type: Literal["box"] = "box"
    size: Sizes
    """Lengths of its edges along x, y, z [m]."""
    at: Vector = (0.0, 0.0, 0.0)
    """Centre [m]."""
    orientation: Orientation | None = None
    """Orientation of the box's axes."""


class Sphere(Shape):
    """A ball, centred at `at`."""

    type: Literal["sphere"] = "sphere"
    radius: Size
    """Radius [m]."""
    at: Vector = (0.0, 0.0, 0.0)
    """Centre [m]."""


class Ellipsoid(Shape):
    """An ellipsoid, centred at `at`."""

    type: Literal["ellipsoid"] = "ellipsoid"
    radii: Sizes
    """Semi-axes along x, y, z [m]."""
    at: Vector = (0.0, 0.0, 0.0)
    """Centre [m]."""
    orientation: Orientation | None = None
    """Orientation of the ellipsoid's axes."""


class Mesh(Shape):
    """Triangles from a file (glTF, COLLADA, OBJ, STL, PLY) in the puppet file's folder or below.

    glTF and COLLADA files are converted to metres with z up; the other formats have no unit and no
    upward axis. Without a `colour`, the colours are those of the file's materials.
    """

    type: Literal["mesh"] = "mesh"
    file: str
    """Path relative to the puppet file, with forward slashes."""
    scale: Annotated[tuple[Scale, Scale, Scale], sized(3)] = (1.0, 1.0, 1.0)
    """Factors along x, y, z (file units to metres); a negative factor mirrors."""
    at: Vector = (0.0, 0.0, 0.0)
    """Position of the mesh's origin [m]."""
    orientation: Orientation | None = None
    """Orientation of the mesh's axes."""

    _origin: Origin = PrivateAttr(default_factory=Origin)

    @field_validator("scale", mode="before")
    @classmethod
    def _one_or_three(cls, scale: Any) -> Any:
        return scale if isinstance(scale, (list, tuple, dict, np.ndarray)) else (scale,) * 3

    @field_validator("scale")
    @classmethod
    def _not_flat(cls, scale: tuple[float, ...]) -> tuple[float, ...]:
        if 0.0 in scale:
            raise validation_error(
                "found a factor of zero; needed: three factors that are not zero"
            )
        return scale

    @field_validator("file")
    @classmethod
    def _check_file(cls, file: str, info: ValidationInfo) -> str:
        folder = info.context.folder if isinstance(info.context, Located) else Path.cwd()
        path = PurePosixPath(file)
        is_plain = file.isprintable() and "\\" not in file and ":" not in file and len(file) < 256
        if not is_plain or path.is_absolute() or ".." in path.parts or not path.parts:
            raise validation_error(
                f"found {shown(file)}; needed: a path inside the puppet file's folder"
            )
        if path.suffix.lower() not in meshes.FORMATS:
            raise validation_error(
                f"found {shown(file)}; allowed: {', '.join(meshes.FORMATS)} files"
            )
        try:
            real_path = Path(os.path.realpath(folder / path))
            if not real_path.is_relative_to(os.path.realpath(folder)):
                raise validation_error(
                    f"found {shown(file)}; it leads out of the puppet file's folder"
                )
            if not real_path.is_file():
                raise validation_error(f"found no file {shown(file)} in {folder}")
            size = real_path.stat().st_size
        except OSError as reason:
            raise validation_error(f"found {shown(file)}, which cannot be read: {reason}") from None
        max_bytes = meshes.LIMITS.max_bytes
        if size > max_bytes:
            raise validation_error(
                f"found {size / 1e6:.0f} MB; allowed: up to {max_bytes / 1e6:.0f} MB"
            )
        try:
            meshes.read(folder / path, folder)
        except (OSError, ValueError) as reason:
            raise validation_error(f"{file} is not a mesh that can be read: {reason}") from None
        return file

    def model_post_init(self, context: Any) -> None:
        if isinstance(context, Located):
            self._origin = Origin(context.file, context.folder)

    @model_validator(mode="after")
    def _check_mesh(self) -> Mesh:
        try:
            load_mesh(self)
        except (OSError, ValueError) as reason:
            raise validation_error(str(reason)) from None
        return self

    @property
    def path(self) -> Path:
        """Path of the mesh file."""
        return self._origin.folder / self.file

    def read(self) -> meshes.MeshFile:
        """The content of the mesh file."""
        return meshes.read(self.path, self._origin.folder)

    def digest(self) -> str:
        """SHA-256 of the mesh file and the files to which it refers, in hexadecimal."""
        (_, content), *linked = self.contents().items()
        total = hashlib.sha256(content)
        for name, content in sorted(linked):
            total.update(f"\n{name}\n".encode() + hashlib.sha256(content).digest())
        return total.hexdigest()

    def contents(self) -> dict[str, bytes]:
        """Contents by path relative to the puppet file: the mesh file, then files it refers to."""
        files = meshes.contents(self.path, self._origin.folder)
        folder = PurePosixPath(self.file).parent
        return {self.file if n == "." else (folder / n).as_posix(): c for n, c in files.items()}


AnyShape = Annotated[Capsule | Box | Sphere | Ellipsoid | Mesh, Field(discriminator="type")]


class Obstacle(Shape):
    """A shape fixed in the world."""

    name: PartName
    """The obstacle's name."""
    mass: None = None
    """An obstacle has no mass."""
    density: None = None
    """An obstacle has no density."""


class CapsuleObstacle(Obstacle, Capsule):
    """A capsule fixed in the world."""


class BoxObstacle(Obstacle, Box):
    """A box fixed in the world."""


class SphereObstacle(Obstacle, Sphere):
    """A ball fixed in the world."""


class EllipsoidObstacle(Obstacle, Ellipsoid):
    """An ellipsoid fixed in the world."""


class MeshObstacle(Obstacle, Mesh):
    """A mesh fixed in the world."""


AnyObstacle = Annotated[
    CapsuleObstacle | BoxObstacle | SphereObstacle | EllipsoidObstacle | MeshObstacle,
    Field(discriminator="type"),
]


@dataclass(frozen=True, eq=False)
class UnitInertia:
    """Inertia of a solid per unit of its mass.

    Attributes:
        com: (3,) centre of mass in the body frame [m].
        inertia: (3, 3) inertia about the centre of mass, in body axes, per unit mass [m^2].
    """

    com: np.ndarray
    inertia: np.ndarray


def shape_inertia(shape: Shape) -> tuple[float, UnitInertia]:
    """Volume and unit inertia of a solid of uniform density.

    Args:
        shape: any shape.

    Returns:
        The volume [m^3], and centre of mass and inertia per unit mass.
    """
    match shape:
        case Sphere(radius=r):
            return 4 / 3 * math.pi * r**3, _uniform_inertia(shape, (0.4 * r * r,) * 3)
        case Box(size=(x, y, z)):
            moments = (y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12
            return x * y * z, _uniform_inertia(shape, moments)
        case Ellipsoid(radii=(a, b, c)):
            moments = (b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5
            return 4 / 3 * math.pi * a * b * c, _uniform_inertia(shape, moments)
        case Capsule():
            return _capsule(shape)
        case Mesh():
            return _mesh(shape)
    raise TypeError(f"{type(shape).__name__} is not a shape")


def _uniform_inertia(
    shape: Box | Sphere | Ellipsoid, moments: tuple[float, float, float]
) -> UnitInertia:
    """R diag(moments) R^T about the shape's centre, for principal moments per unit mass [m^2]."""
    orientation = None if isinstance(shape, Sphere) else shape.orientation
    R = np.eye(3) if orientation is None else orientation.matrix
    return UnitInertia(np.array(shape.at), R @ np.diag(moments) @ R.T)


def _capsule(shape: Capsule) -> tuple[float, UnitInertia]:
    """Volume and unit inertia of a cylinder of length l and two half-spheres of radius r.

    A half-sphere of mass m has its centre of mass 3/8 r beyond its flat face, and a transverse
    moment of (2/5 - 9/64) m r^2 about it: m (2/5 r^2 + l^2/4 + 3/8 l r) about the capsule's centre.
    """
    start, end, r = np.array(shape.from_), np.array(shape.to), shape.radius
    length = float(np.linalg.norm(end - start))
    cylinder, ball = math.pi * r * r * length, 4 / 3 * math.pi * r**3
    volume = cylinder + ball
    axial = (cylinder * r * r / 2 + ball * 0.4 * r * r) / volume
    transverse = (
        cylinder * (length**2 / 12 + r * r / 4)
        + ball * (0.4 * r * r + length**2 / 4 + 0.375 * length * r)
    ) / volume
    axis = (end - start) / length if length > 0 else np.zeros(3)
    inertia = transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)
    return volume, UnitInertia((start + end) / 2, inertia)


def _mesh(shape: Mesh) -> tuple[float, UnitInertia]:
    """Volume and unit inertia of the enclosed solid."""
    mesh = load_mesh(shape)
    volume = float(mesh.volume)
    return volume, UnitInertia(np.array(mesh.center_mass), np.array(mesh.moment_inertia) / volume)


def load_mesh(shape: Mesh) -> Any:
    """The mesh in the body frame, as a ``trimesh.Trimesh``.

    Args:
        shape: mesh with its file, scale and pose.

    Raises:
        ValueError: the file is not a mesh, or the mesh has a mass but is not closed, or its size is
            not allowed.
    """
    import trimesh

    file = shape.read()
    mesh = trimesh.Trimesh(file.vertices.copy(), file.faces.copy(), process=False)
    transform = np.eye(4)
    transform[:3, :3] = np.eye(3) if shape.orientation is None else shape.orientation.matrix
    transform[:3, :3] = transform[:3, :3] @ np.diag(shape.scale)
    transform[:3, 3] = shape.at
    mesh.apply_transform(transform)
    length, extent = QUANTITIES["length"], float(np.max(mesh.extents))
    if not length.min_size <= extent <= length.max_size:
        text = f"{shape.file} measures {extent:g} m with its scale"
        raise ValueError(f"{text}; allowed: {length.min_size:g} to {length.max_size:g} m")
    if has_mass(shape) and not file.closed:
        raise ValueError(f"{shape.file} {unclosed(mesh)}, so its centre of mass is undefined")
    if mesh.volume < 0:
        mesh.invert()
    if has_mass(shape) and not mesh.volume >= MIN_MESH_VOLUME:
        raise ValueError(f"{shape.file} has no volume, so its centre of mass is undefined")
    return mesh


def unclosed(mesh: Any) -> str:
    """Predicate of a message about a mesh that is not closed, "is not closed" for example."""
    if mesh.is_watertight:
        return "has neighbouring triangles that face inwards and outwards"
    return "is not closed"


def has_mass(shape: Shape) -> bool:
    """Whether a shape contributes to its body's inertia."""
    return any(n is not None and value_of(n) > 0 for n in (shape.mass, shape.density))
