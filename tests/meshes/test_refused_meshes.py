"""Broken and hostile mesh files: located mistakes, soon, and no file outside the folder."""

from __future__ import annotations

import json
import struct
import time
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pygltflib as gl
import pytest
from tests.meshes.test_collada import dae
from tests.meshes.written import Writer, puppet

from fantoccini.base.errors import PuppetError
from fantoccini.model.meshes import LIMITS, read
from fantoccini.model.puppet import loads


def mistake_of_file(folder: Path, name: str) -> str:
    """Message of the mistake in the line of the file's name."""
    begin = time.monotonic()
    with pytest.raises(PuppetError) as caught:
        loads(puppet(f"{{type: mesh, file: {name}}}"), folder=folder)
    assert time.monotonic() - begin < 20.0
    (problem,) = caught.value.mistakes
    assert (problem.line, problem.key) == (6, "bodies[0].shapes[0].file")
    assert name in problem.message
    return problem.message


def mistake_of_change(folder: Path, change: Callable[[dict], None]) -> str:
    """Message for a cube in a .gltf with changed JSON."""
    writer = Writer()
    writer.node(writer.mesh())
    path = writer.save(folder / "a.gltf")
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return mistake_of_file(folder, "a.gltf")


@pytest.mark.parametrize(
    "uri",
    [
        "../a.bin",
        "/etc/passwd",
        "http://example.org/a.bin",
        "file:///etc/passwd",
        "C:\\a.bin",
        "%2e%2e/a.bin",
        "..%2fa.bin",
        "x/../../a.bin",
        "a\x00.bin",
        "x" * 300,
    ],
)
def test_a_buffer_lies_in_the_files_folder(tmp_path, uri):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "a.bin").write_bytes(bytes(1000))
    assert "in its folder or below" in mistake_of_change(
        folder, lambda c: c["buffers"][0].update(uri=uri)
    )


def test_a_link_does_not_lead_out(tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "out.bin").write_bytes(bytes(1000))
    (folder / "b.bin").symlink_to(tmp_path / "out.bin")
    said = mistake_of_change(folder, lambda c: c["buffers"][0].update(uri="b.bin"))
    assert "leads out of the folder" in said


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c["buffers"][0].update(uri="no.bin"), "names 'no.bin', which does not exist"),
        (lambda c: c["buffers"][0].update(byteLength=10**9), "bytes instead of 1000000000"),
        (lambda c: c["buffers"][0].update(uri="data:,abc"), "not base64"),
        (lambda c: c["bufferViews"][0].update(byteLength=10**6), "beyond its buffer"),
        (lambda c: c["accessors"][0].update(count=10**6), "beyond its bufferView"),
        (lambda c: c["accessors"][0].update(count=10**15), "accessor of 10+ elements"),
        (lambda c: c["accessors"][0].update(count=-1), "whole number of at least 0"),
        (lambda c: c["accessors"][0].update(byteOffset=-8), "whole number of at least 0"),
        (lambda c: [a.pop("bufferView") for a in c["accessors"]], "no triangles|not there"),
        (lambda c: c["nodes"][0].update(children=[0]), "two parents"),
        (lambda c: c["nodes"][0].update(mesh=7), "IndexError"),
        (lambda c: c["nodes"][0].update(rotation=[0, 0, 0, 0]), "rotation of zero"),
        (lambda c: c["nodes"][0].update(matrix=[1.0]), "cannot reshape"),
        (lambda c: c["nodes"][0].update(translation=["a", 0, 0]), "a"),
        (lambda c: c["nodes"][0].update(scale=[float("nan")] * 3), "no triangles with finite"),
        (lambda c: c["asset"].update(version="1.0"), "glTF 1.0; allowed: 2.0"),
        (
            lambda c: c.update(extensionsRequired=["KHR_draco_mesh_compression"]),
            "needs the extensions KHR_draco_mesh_compression; export it without them",
        ),
        (lambda c: c["meshes"][0]["primitives"][0].update(mode=1), "no triangles"),
        (lambda c: c["meshes"][0]["primitives"][0].update(mode=9), "mode 9"),
        (lambda c: c["meshes"][0]["primitives"][0].pop("attributes"), "KeyError"),
        (lambda c: c["accessors"][0].update(componentType=1), "KeyError"),
    ],
)
def test_a_broken_gltf_is_a_located_mistake(tmp_path, change, says):
    import re

    assert re.search(says, mistake_of_change(tmp_path, change))


def test_a_corner_must_be_there(tmp_path):
    writer = Writer()
    writer.node(writer.mesh(faces=np.array([[0, 1, 8]])))
    writer.save(tmp_path / "a.glb")
    assert "a corner that does not exist" in mistake_of_file(tmp_path, "a.glb")


def test_repetitions_are_bounded(tmp_path, monkeypatch):
    """Nodes that repeat a mesh; with a smaller limit here."""
    monkeypatch.setattr("fantoccini.model.meshes.part.LIMITS", LIMITS._replace(max_triangles=1000))
    writer = Writer()
    cube = writer.mesh()
    for _ in range(84):
        writer.node(cube)
    writer.save(tmp_path / "a.glb")
    assert "more than 1000 triangles" in mistake_of_file(tmp_path, "a.glb")


def test_an_image_is_measured_before_it_is_unpacked(tmp_path):
    """A PNG of 100 kB that would take 30 GB."""
    writer = Writer()
    look = writer.material(image=np.zeros((2, 2, 3), "uint8"))
    uv = writer.numbers(np.zeros((8, 2), "float32"))
    writer.node(writer.mesh(material=look, TEXCOORD_0=uv))

    def chunk(kind: bytes, data: bytes) -> bytes:
        checked = kind + data
        return struct.pack(">I", len(data)) + checked + struct.pack(">I", zlib.crc32(checked))

    side = 100_000
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
    bomb += chunk(b"IDAT", zlib.compress(bytes(10**7))) + chunk(b"IEND", b"")
    writer.gltf.images[0] = gl.Image(uri="big.png")
    (tmp_path / "big.png").write_bytes(bomb)
    writer.save(tmp_path / "a.gltf")
    assert "big.png" in mistake_of_file(tmp_path, "a.gltf")
    (tmp_path / "big.png").write_bytes(b"<svg/>")
    assert "not a PNG, JPEG or WebP" in mistake_of_file(tmp_path, "a.gltf")


@pytest.mark.parametrize("size", [3, 11, 12, 19, 30, 400])
def test_a_glb_that_ends_early_is_a_mistake(tmp_path, size):
    writer = Writer()
    writer.node(writer.mesh())
    path = writer.save(tmp_path / "a.glb")
    path.write_bytes(path.read_bytes()[:size])
    mistake_of_file(tmp_path, "a.glb")


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"asset": {"version": "2.0"}}', "[" * 100_000, "\xff\xfe"]
)
def test_text_that_is_no_gltf_is_a_mistake(tmp_path, text):
    (tmp_path / "a.gltf").write_bytes(text.encode("latin-1"))
    mistake_of_file(tmp_path, "a.gltf")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("<COLLADA", '<!DOCTYPE a [<!ENTITY b "c">]><COLLADA', "without a document type"),
        ("</COLLADA>", "", "broken"),
        ("#g0", "#no", "broken"),
        ("0 2 3", "0 2 99", ""),
        ('<scene><instance_visual_scene url="#s"/></scene>', "", "no scene"),
    ],
)
def test_a_broken_collada_file_is_a_located_mistake(tmp_path, old, new, says):
    text = dae("<node><instance_geometry url='#g0'/></node>")
    assert old in text
    (tmp_path / "a.dae").write_text(text.replace(old, new, 1))
    assert says in mistake_of_file(tmp_path, "a.dae")


def test_doubling_nodes_are_counted_first(tmp_path):
    """2^40 places of one mesh, or of nothing, in 40 lines."""
    for inner in ("<instance_geometry url='#g0'/>", ""):
        nodes = f"<node id='n0'>{inner}</node>" + "".join(
            f"<node id='n{k + 1}'>{2 * f'<instance_node url={chr(34)}#n{k}{chr(34)}/>'}</node>"
            for k in range(40)
        )
        text = dae("<node><instance_node url='#n40'/></node>", library=nodes)
        (tmp_path / "a.dae").write_text(text)
        assert "more than 100000 nodes" in mistake_of_file(tmp_path, "a.dae")


@pytest.mark.parametrize("name", ["a.glb", "a.gltf", "a.dae", "a.obj", "a.ply", "a.stl"])
def test_any_change_is_read_or_refused(tmp_path, name):
    """Bytes are changed, omitted and repeated at random: the only error is ValueError."""
    writer = Writer()
    colour = writer.material((0.5, 0.2, 0.1), np.zeros((2, 2, 3), "uint8"))
    uv = writer.numbers(np.zeros((8, 2), "float32"))
    writer.node(writer.mesh(material=colour, TEXCOORD_0=uv), scale=[0.1, 0.2, 0.3])
    if name.endswith(("glb", "gltf")):
        path = writer.save(tmp_path / name)
    elif name.endswith("dae"):
        path = tmp_path / name
        path.write_text(dae("<node><instance_geometry url='#g0'/></node>"))
    else:
        import trimesh

        path = tmp_path / name
        trimesh.creation.box().export(path)
    good, rng = path.read_bytes(), np.random.default_rng(11)
    n_read = 0
    for _ in range(300):
        bad = bytearray(good)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(bad)))
            match rng.integers(4):
                case 0:
                    bad[at] = int(rng.integers(256))
                case 1:
                    del bad[at : at + int(rng.integers(1, 9))]
                case 2:
                    bad[at:at] = bad[at : at + int(rng.integers(1, 9))]
                case 3:
                    bad[at] = ord(rng.choice(list('0123456789-.e[]{},"')))
        path.write_bytes(bad)
        try:
            file = read(path, tmp_path)
        except ValueError:
            continue
        n_read += 1
        assert file.faces.max() < len(file.vertices) and np.isfinite(file.vertices).all()
    assert 0 < n_read < 300


@pytest.mark.parametrize("shared", [True, False])
def test_a_small_gltf_takes_little_memory(tmp_path, shared):
    """Arrays without content, named by many primitives or by one each."""
    accessors = [{"componentType": 5126, "type": "VEC3", "count": 3_000_000} for _ in range(30)]
    none = {"componentType": 5125, "type": "SCALAR", "count": 0}
    primitives = [
        {"attributes": {"POSITION": 0 if shared else k}, "indices": 30} for k in range(30)
    ]
    content = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "accessors": [*accessors, none],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    tracemalloc.start()
    message = mistake_of_file(tmp_path, "a.gltf")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert ("no triangles" if shared else "too many elements in total") in message
    assert peak < 6e8
