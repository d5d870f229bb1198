"""STL files as programs write them: binary with trailing data, and text in any layout."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh
from tests.meshes.test_gltf import mesh
from tests.meshes.written import CORNERS, CUBE

from fantoccini.model.meshes import read
from fantoccini.model.puppet.shapes import load_mesh

BINARY = trimesh.Trimesh(CORNERS, CUBE, process=False).export(file_type="stl")
TEXT = (
    "solid cube\n"
    + "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in CORNERS[face].tolist())
        + " endloop\nendfacet\n"
        for face in CUBE
    )
    + "endsolid cube\n"
)
VARIANTS = {
    "binary": BINARY,
    "a byte behind": BINARY + b"\0",
    "a line behind": BINARY + b"\r\n",
    "a word behind": BINARY + b"endsolid something\n",
    "many bytes behind": BINARY + bytes(1000),
    "binary that says solid": b"solid cube".ljust(80) + BINARY[80:],
    "binary that says solid, more behind": b"solid cube\n".ljust(80) + BINARY[80:] + b"\n",
    "text": TEXT.encode(),
    "CR": TEXT.replace("\n", "\r").encode(),
    "CR LF": TEXT.replace("\n", "\r\n").encode(),
    "tabs": TEXT.replace(" ", "\t").encode(),
    "one line": TEXT.replace("\n", " ").encode(),
    "capitals": TEXT.upper().encode(),
    "a byte order mark": b"\xef\xbb\xbf" + TEXT.encode(),
    "a name of words": TEXT.replace("cube", "vertex of a solid loop").encode(),
    "a name in Latin-1": TEXT.replace("cube", "Würfel").encode("latin-1"),
    "no name": TEXT.replace(" cube", "").encode(),
    "no end": TEXT.replace("endsolid cube\n", "").encode(),
    "two solids": (
        TEXT[: len(TEXT) // 2].rpartition("facet")[0]
        + "endsolid\nsolid b\nfacet"
        + TEXT.removeprefix(TEXT[: len(TEXT) // 2].rpartition("facet")[0] + "facet")
    ).encode(),
}


@pytest.mark.parametrize("content", VARIANTS.values(), ids=VARIANTS)
def test_a_cube_is_a_cube(content, tmp_path):
    (tmp_path / "a.stl").write_bytes(content)
    assert load_mesh(mesh(tmp_path, "a.stl")).volume == pytest.approx(1.0)
    assert len(read(tmp_path / "a.stl", tmp_path).faces) == 12


LINES = TEXT.splitlines()
WRONG = {
    "cut short": (BINARY[:-60], "counts 12 triangles; the file has room for 10"),
    "no count": (BINARY[:80] + struct.pack("<I", 0) + BINARY[84:], "counts 0 triangles"),
    "a count too large": (BINARY[:80] + struct.pack("<I", 2**32 - 1) + BINARY[84:], "room for 12"),
    "two numbers": (TEXT.replace("vertex -0.5 -0.5 -0.5", "vertex -0.5 -0.5", 1), "line 3: found"),
    "two vertices": ("\n".join([*LINES[:5], *LINES[6:]]), "line 3: found a facet that is not"),
    "decimal commas": (TEXT.replace("0.5", "0,5"), "not three numbers"),
    "not finite": (TEXT.replace("-0.5", "nan"), "finite corners"),
    "too far": (TEXT.replace("-0.5", "-1e300"), "a corner at 1e+300"),
    "nothing": ("", "no triangles"),
    "another text": ("once upon a time", "no triangles"),
}


@pytest.mark.parametrize(("content", "says"), WRONG.values(), ids=WRONG)
def test_a_broken_stl_has_a_message(content, says, tmp_path):
    (tmp_path / "a.stl").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError) as caught:
        read(tmp_path / "a.stl", tmp_path)
    assert says in str(caught.value)


@pytest.mark.parametrize("ending", ["ply", "glb"])
def test_a_corner_too_far_away_is_a_mistake_in_every_format(ending, tmp_path):
    box = trimesh.creation.box()
    box.apply_scale(1e20)
    (tmp_path / f"a.{ending}").write_bytes(box.export(file_type=ending))
    with pytest.raises(ValueError, match="allowed: up to 1e"):
        read(tmp_path / f"a.{ending}", tmp_path)
    assert np.isfinite(box.vertices).all()
