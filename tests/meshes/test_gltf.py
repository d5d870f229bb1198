"""glTF as shapes: nodes, primitives, numbers of all kinds; closed forms and trimesh."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pygltflib as gl
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from tests.meshes.written import CORNERS, CUBE, UP, Writer, puppet

from fantoccini.model.meshes import LIMITS, is_closed, read
from fantoccini.model.puppet import Mesh, loads
from fantoccini.model.puppet.shapes import load_mesh, shape_inertia


def mesh(folder: Path, name: str, **keys) -> Mesh:
    """A shape of a file."""
    extra = "".join(f", {key}: {value}" for key, value in keys.items())
    description = loads(puppet(f"{{type: mesh, file: {name}, density: 1{extra}}}"), folder=folder)
    return description.bodies[0].shapes[0]


def box_properties(
    maps: list[tuple[np.ndarray, np.ndarray]],
) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre and inertia per mass of unit cubes under x -> A x + b.

    The covariance of a unit cube is 1/12 of the identity, and C -> A C A^T.
    """
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for A, b in maps:
        v = abs(np.linalg.det(A))
        volume, first = volume + v, first + v * b
        second += v * (A @ A.T / 12 + np.outer(b, b))
    com = first / volume
    spread = second / volume - np.outer(com, com)
    return volume, com, np.trace(spread) * np.eye(3) - spread


def test_nodes_carry_their_meshes_and_y_becomes_z(tmp_path):
    """Translation, rotation, scale (one mirrors), a matrix, an instance: closed forms."""
    writer, turn = Writer(), Rotation.from_rotvec([0.3, -0.8, 0.5])
    cube = writer.mesh()
    root = writer.node(translation=[1.0, 2.0, -0.5], rotation=turn.as_quat().tolist())
    writer.node(cube, root, scale=[0.5, -0.25, 2.0], translation=[0.25, 0.0, 0.0])
    matrix = np.eye(4)
    matrix[:3] = [[1.0, 0.5, 0.0, -4.0], [0.0, 0.75, 0.0, 0.0], [0.25, 0.0, 1.5, 3.0]]
    writer.node(cube, root, matrix=matrix.T.ravel().tolist())
    writer.node(cube, scale=[2.0, 1.0, 0.5])
    writer.save(tmp_path / "a.glb")

    R, r = turn.as_matrix(), np.array([1.0, 2.0, -0.5])
    maps = [
        (R @ np.diag([0.5, -0.25, 2.0]), R @ [0.25, 0.0, 0.0] + r),
        (R @ matrix[:3, :3], R @ matrix[:3, 3] + r),
        (np.diag([2.0, 1.0, 0.5]), np.zeros(3)),
    ]
    volume, com, about = box_properties([(UP @ A, UP @ b) for A, b in maps])
    mass, unit = shape_inertia(mesh(tmp_path, "a.glb"))
    assert mass == pytest.approx(volume, rel=1e-12)
    np.testing.assert_allclose(unit.com, com, atol=1e-12)
    np.testing.assert_allclose(unit.inertia, about, atol=1e-11)


def test_the_scene_is_that_which_trimesh_reads(tmp_path):
    """Files written by trimesh, of random solids; trimesh reads them with y up."""
    rng = np.random.default_rng(5)
    scene = trimesh.Scene()
    for k in range(4):
        solid = (trimesh.creation.icosphere(subdivisions=1), trimesh.creation.cone(0.5, 1.0))[k % 2]
        pose = trimesh.transformations.random_rotation_matrix(rng.random(3))
        pose[:3, 3] = 4.0 * k, *rng.uniform(-1, 1, 2)
        scene.add_geometry(solid, transform=pose)
    for name in ("a.glb", "a.gltf"):
        if name == "a.glb":
            (tmp_path / name).write_bytes(scene.export(file_type="glb"))
        else:
            for file, content in scene.export(file_type="gltf").items():
                (tmp_path / file.replace("model", "a")).write_bytes(content)
        other = trimesh.load(tmp_path / name, force="mesh", process=False)
        other.vertices = other.vertices @ UP.T
        ours = load_mesh(mesh(tmp_path, name))
        assert ours.volume == pytest.approx(other.volume, rel=1e-6)
        np.testing.assert_allclose(ours.center_mass, other.center_mass, atol=1e-6)
        np.testing.assert_allclose(ours.moment_inertia, other.moment_inertia, rtol=1e-5, atol=1e-5)


def test_numbers_of_all_kinds_are_the_same_cube(tmp_path):
    """Indices of 8, 16, 32 bits or none, strips, fans, strides, sparse and normalised numbers."""
    plain = np.unique((CORNERS @ UP.T), axis=0)
    soup = CORNERS[CUBE].reshape(-1, 3)

    def cube(name: str, fill) -> None:
        writer = Writer()
        writer.node(fill(writer))
        file = read(writer.save(tmp_path / name), tmp_path)
        np.testing.assert_allclose(np.unique(file.vertices, axis=0), plain, atol=1e-12)
        assert len(file.faces) == 12 and is_closed(file.faces), name

    cube("soup.glb", lambda w: w.mesh(soup, None))
    for kind in ("uint8", "uint32"):

        def indexed(w: Writer, kind: str = kind) -> int:
            index = w.mesh()
            w.gltf.meshes[index].primitives[0].indices = w.numbers(CUBE.ravel().astype(kind))
            return index

        cube(f"{kind}.glb", indexed)

    def strips(w: Writer) -> int:
        index = w.mesh(faces=[0, 2, 1, 3], mode=5)
        rest = CUBE[2:]
        of = w.gltf.meshes[index].primitives
        of.append(
            gl.Primitive(
                attributes=of[0].attributes,
                mode=6,
                indices=w.numbers(np.array([4, 5, 7, 6], "uint16")),
            )
        )
        of.append(
            gl.Primitive(
                attributes=of[0].attributes, indices=w.numbers(rest[2:].ravel().astype("uint16"))
            )
        )
        of.append(gl.Primitive(attributes=of[0].attributes, mode=1))
        return index

    cube("strips.glb", strips)

    def strided(w: Writer) -> int:
        wide = np.zeros((8, 5), "float32")
        wide[:, 1:4] = CORNERS
        index = w.mesh()
        about = w.gltf.accessors[w.gltf.meshes[index].primitives[0].attributes.POSITION]
        about.bufferView, about.byteOffset = w.view(wide.tobytes(), stride=20), 4
        return index

    cube("strided.glb", strided)

    def sparse(w: Writer) -> int:
        moved = CORNERS.copy()
        moved[[2, 5]] = 9.0
        index = w.mesh(moved)
        about = w.gltf.accessors[w.gltf.meshes[index].primitives[0].attributes.POSITION]
        about.sparse = gl.Sparse(
            count=2,
            indices=gl.AccessorSparseIndices(
                bufferView=w.view(np.array([2, 5], "uint8").tobytes()), componentType=5121
            ),
            values=gl.AccessorSparseValues(
                bufferView=w.view(CORNERS[[2, 5]].astype("float32").tobytes())
            ),
        )
        return index

    cube("sparse.glb", sparse)

    def quantised(w: Writer) -> int:
        w.gltf.extensionsRequired = ["KHR_mesh_quantization"]
        whole = np.zeros((8, 4), "int16")
        whole[:, :3] = np.sign(CORNERS) * 32767
        index = w.mesh()
        w.gltf.accessors.append(
            gl.Accessor(
                bufferView=w.view(whole.tobytes(), stride=8),
                count=8,
                type=gl.VEC3,
                componentType=5122,
                normalized=True,
            )
        )
        w.gltf.meshes[index].primitives[0].attributes.POSITION = len(w.gltf.accessors) - 1
        return index

    writer = Writer()
    writer.node(quantised(writer), scale=[0.5] * 3)
    file = read(writer.save(tmp_path / "q.glb"), tmp_path)
    np.testing.assert_allclose(np.unique(file.vertices, axis=0), plain, atol=1e-12)


def test_numbers_are_in_the_file_or_in_another_one(tmp_path):
    writer = Writer()
    writer.boxes(((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    inner = tmp_path / "meshes"
    inner.mkdir()
    writer.save(inner / "a.glb")
    writer.inline(inner / "b.gltf")
    writer.save(inner / "c.gltf")
    (inner / "c.bin").rename(inner / "c d.bin")
    text = (inner / "c.gltf").read_text().replace("c.bin", "c%20d.bin")
    (inner / "c.gltf").write_text(text)
    for name in "a.glb", "b.gltf", "c.gltf":
        shape = mesh(tmp_path, f"meshes/{name}")
        volume, unit = shape_inertia(shape)
        assert volume == pytest.approx(6.0, rel=1e-12)
        # 1 x 2 x 3 with y up is 1 x 3 x 2 with z up.
        moments = np.array([9 + 4, 1 + 4, 1 + 9]) / 12
        np.testing.assert_allclose(unit.inertia, np.diag(moments), atol=1e-12)
        names = {f"meshes/{name}"} | ({"meshes/c d.bin"} if name == "c.gltf" else set())
        assert set(shape.contents()) == names


def test_the_digest_is_of_all_files(tmp_path):
    writer = Writer()
    writer.boxes(((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    writer.save(tmp_path / "a.gltf")
    shape = mesh(tmp_path, "a.gltf")
    before = shape.digest()
    assert shape.digest() == before
    content = bytearray((tmp_path / "a.bin").read_bytes())
    k = content.index(np.float32(0.5).tobytes())
    content[k : k + 4] = np.float32(0.75).tobytes()
    (tmp_path / "a.bin").write_bytes(content)
    assert shape.digest() != before
    assert load_mesh(shape).bounds[1, 0] == 0.75  # the file in the cache is not used after a change


def test_files_that_are_read_repeatedly_are_cached(tmp_path):
    """This holds with many others in the cache, and with concurrent readers."""
    paths = [tmp_path / f"{k}.stl" for k in range(30)]
    for k, path in enumerate(paths):
        trimesh.creation.box((1, 1, 1 + k)).export(path)
    first = [read(path, tmp_path) for path in paths]
    with ThreadPoolExecutor(4) as pool:
        again = list(pool.map(lambda path: read(path, tmp_path), paths * 4))
    assert all(mesh_file is other for mesh_file, other in zip(first * 4, again, strict=True))


def test_the_cache_is_bounded(tmp_path, monkeypatch):
    """The least recently read file is removed first."""
    monkeypatch.setattr("fantoccini.model.meshes.files.LIMITS", LIMITS._replace(max_triangles=3500))
    paths = [tmp_path / f"{k}.stl" for k in range(4)]
    for k, path in enumerate(paths):
        trimesh.creation.box((2, 1, 1 + k)).export(path)
    first = [read(path, tmp_path) for path in paths[:3]]
    assert read(paths[0], tmp_path) is first[0]
    read(paths[3], tmp_path)
    assert read(paths[0], tmp_path) is first[0] and read(paths[2], tmp_path) is first[2]
    assert read(paths[1], tmp_path) is not first[1]
