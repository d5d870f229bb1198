"""Volume and inertia of shapes: closed forms compared with integrals, limits and meshes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from fantoccini.base.documents import Orientation
from fantoccini.base.errors import PuppetError
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Mesh, Shape, Sphere, loads
from fantoccini.model.puppet.shapes import load_mesh, shape_inertia

pytestmark = pytest.mark.own_puppets

TURNED = Orientation(axis=(1, 2, -1), angle="40 deg")


def points(shape: Shape, n: int = 400_000) -> np.ndarray:
    """Random points (n, 3) inside the shape, uniform."""
    rng = np.random.default_rng(7)
    at = np.array(getattr(shape, "at", (0.0, 0.0, 0.0)))
    R = TURNED.matrix if getattr(shape, "orientation", None) else np.eye(3)
    match shape:
        case Box(size=size):
            return at + (rng.uniform(-0.5, 0.5, (n, 3)) * np.array(size)) @ R.T
        case Sphere(radius=r):
            p = rng.uniform(-1, 1, (n, 3))
            return at + r * p[(p * p).sum(1) < 1]
        case Ellipsoid(radii=radii):
            p = rng.uniform(-1, 1, (n, 3))
            return at + (np.array(radii) * p[(p * p).sum(1) < 1]) @ R.T
        case Capsule(radius=r):
            a, b = np.array(shape.from_), np.array(shape.to)
            p = rng.uniform(np.minimum(a, b) - r, np.maximum(a, b) + r, (n, 3))
            s = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
            return p[((p - a - s[:, None] * (b - a)) ** 2).sum(1) < r * r]
    raise TypeError


SHAPES = [
    Box(size=(0.3, 0.2, 0.1), at=(0.1, 0.2, 0.3), orientation=TURNED),
    Sphere(radius=0.2, at=(0.1, 0.0, -0.3)),
    Ellipsoid(radii=(0.1, 0.2, 0.3), at=(0.0, 0.1, 0.0), orientation=TURNED),
    Capsule(from_=(0.1, 0.0, 0.0), to=(0.0, 0.3, 0.1), radius=0.08),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.type)
def test_inertia_is_that_of_points_spread_evenly_in_the_shape(shape: Shape) -> None:
    inside = points(shape)
    _, unit = shape_inertia(shape)
    d = inside - inside.mean(0)
    sampled = np.mean((d * d).sum(1)) * np.eye(3) - d.T @ d / len(d)
    size = np.trace(unit.inertia)
    np.testing.assert_allclose(unit.com, inside.mean(0), atol=2e-3 * np.sqrt(size))
    np.testing.assert_allclose(unit.inertia, sampled, atol=4e-3 * size)


def test_a_capsule_is_the_integral_of_its_slices() -> None:
    r, length = 0.07, 0.31
    volume, unit = shape_inertia(Capsule(from_=(0, 0, 0), to=(0, 0, length), radius=r))

    def radius2(z: float) -> float:
        beyond = max(-z, z - length, 0.0)
        return r * r - beyond * beyond

    def integral(f) -> float:
        return sum(
            quad(f, a, b, epsabs=1e-15)[0] for a, b in ((-r, 0), (0, length), (length, length + r))
        )

    exact = integral(lambda z: np.pi * radius2(z))
    along = integral(lambda z: np.pi * radius2(z) ** 2 / 2)
    across = integral(lambda z: np.pi * radius2(z) * (radius2(z) / 4 + (z - length / 2) ** 2))
    assert volume == pytest.approx(exact, rel=1e-12)
    moments = np.diag([across, across, along]) / exact
    np.testing.assert_allclose(unit.inertia, moments, rtol=0, atol=1e-12 * across / exact)
    np.testing.assert_allclose(unit.com, [0, 0, length / 2])


def test_a_capsule_without_length_is_a_sphere() -> None:
    ball, point = Sphere(radius=0.2), Capsule(from_=(0, 0, 0), to=(0, 0, 0), radius=0.2)
    for value, known in zip(shape_inertia(point), shape_inertia(ball), strict=True):
        if isinstance(known, float):
            assert value == pytest.approx(known, rel=1e-14)
        else:
            np.testing.assert_allclose(value.inertia, known.inertia, atol=1e-15)  # type: ignore[attr-defined]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a closed mesh, an open mesh and a file without a mesh."""
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((0.3, 0.2, 0.1))
    box.apply_translation((0.05, 0.0, 0.0))
    box.export(tmp_path / "box.stl")
    trimesh.Trimesh(box.vertices, box.faces[:-1]).export(tmp_path / "open.obj")
    (tmp_path / "none.ply").write_text("ply\nnonsense\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_mesh_of_a_box_is_a_box(folder) -> None:
    at, scale = (0.1, 0.2, 0.3), (2.0, 1.0, -1.0)
    mesh = Mesh(file="box.stl", at=at, scale=scale, orientation=TURNED, density=100)
    centre = np.array(at) + TURNED.matrix @ np.array([0.1, 0.0, 0.0])
    box = Box(size=(0.6, 0.2, 0.1), at=tuple(centre), orientation=TURNED)
    (v1, u1), (v2, u2) = shape_inertia(mesh), shape_inertia(box)
    assert v1 == pytest.approx(v2, rel=1e-6)
    np.testing.assert_allclose(u1.com, u2.com, atol=1e-7)
    np.testing.assert_allclose(u1.inertia, u2.inertia, atol=1e-7)
    assert load_mesh(mesh).volume > 0


def mesh_puppet(shape: str) -> str:
    return f"puppet: p\nbodies:\n  - name: a\n    shapes:\n      - {shape}\n"


def test_meshes_are_found_beside_the_puppet_file(folder, tmp_path_factory, monkeypatch) -> None:
    text = mesh_puppet("{type: mesh, file: box.stl, mass: 1}")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    puppet = loads(text, folder=folder)
    assert puppet.bodies[0].shapes[0].path == folder / "box.stl"
    assert loads(puppet.to_yaml(), folder=folder) == puppet
    before = puppet.canonical()
    (folder / "box.stl").write_bytes((folder / "box.stl").read_bytes() + b"\0" * 8)
    assert puppet.canonical() != before
    assert puppet.expanded().bodies[0].shapes[0].path == folder / "box.stl"


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("{type: mesh, file: open.obj, mass: 1}", "open.obj is not closed"),
        ("{type: mesh, file: none.ply}", "none.ply is not a mesh"),
        ("{type: mesh, file: out.stl}", "leads out of the puppet file's folder"),
        ("{type: mesh, file: box.stl, scale: [1, 0, 1]}", "a factor of zero"),
    ],
)
def test_bad_meshes_are_located(folder, shape: str, message: str) -> None:
    outside = folder.parent / f"{folder.name}-outside.stl"
    outside.write_bytes((folder / "box.stl").read_bytes())
    (folder / "out.stl").symlink_to(outside)
    with pytest.raises(PuppetError, match=message) as caught:
        loads(mesh_puppet(shape))
    assert [p.line for p in caught.value.mistakes] == [5]


def test_an_open_mesh_may_be_looked_at(folder) -> None:
    assert loads(mesh_puppet("{type: mesh, file: open.obj}")).bodies[0].shapes[0].scale == (1, 1, 1)
