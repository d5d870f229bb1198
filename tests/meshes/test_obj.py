"""OBJ files as programs write them: indices, blank space, comments, encodings, materials."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.exchange.test_import_urdf import import_text
from tests.meshes.test_gltf import mesh
from tests.meshes.written import CORNERS, CUBE, SIDES

import fantoccini as fan
from fantoccini.model.meshes import read
from fantoccini.model.puppet.shapes import load_mesh

PLACES = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 1.0]])
SIZES = (1.0, 2.0, 1.5)


def blocks(relative: bool) -> str:
    """Three cubes, each with its vertices before its faces."""
    lines = []
    for k, (at, size) in enumerate(zip(PLACES, SIZES, strict=True)):
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in (size * CORNERS + at).tolist()]
        first = -8 if relative else 8 * k + 1
        lines += [f"f {' '.join(str(first + i) for i in face)}" for face in CUBE.tolist()]
    return "\n".join(lines) + "\n"


def test_negative_indices_count_back_from_their_line(tmp_path):
    (tmp_path / "a.obj").write_text(blocks(relative=True))
    (tmp_path / "b.obj").write_text(blocks(relative=False))
    relative, wanted = (load_mesh(mesh(tmp_path, name)) for name in ("a.obj", "b.obj"))
    assert relative.volume == pytest.approx(sum(s**3 for s in SIZES), rel=1e-12)
    assert np.array_equal(relative.triangles, wanted.triangles)
    com = np.average(PLACES, axis=0, weights=np.array(SIZES) ** 3)
    np.testing.assert_allclose(relative.center_mass, com, atol=1e-12)


def test_negative_indices_of_a_urdfs_mesh_count_back_from_their_line(tmp_path):
    (tmp_path / "a.obj").write_text(blocks(relative=True))
    puppet = import_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="a.obj"/></geometry>'
        "</visual></link></robot>",
        tmp_path,
    )
    puppet.save(tmp_path / "r.yaml")
    (body,) = fan.model.load(tmp_path / "r.yaml").bodies
    assert load_mesh(body.shapes[0]).volume == pytest.approx(sum(s**3 for s in SIZES), rel=1e-6)


def test_negative_indices_of_textures_and_normals_count_likewise(tmp_path):
    """Random numbers of each before every face, with absolute indices for comparison."""
    rng = np.random.default_rng(3)
    Image.fromarray(rng.integers(0, 256, (8, 8, 3)).astype("uint8")).save(tmp_path / "p.png")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd p.png\n")
    back, ahead = ["mtllib a.mtl", "usemtl m"], ["mtllib a.mtl", "usemtl m"]
    counts = np.zeros(3, int)
    for _ in range(40):
        new = rng.integers(3, 6, 3)
        keys = [key for key, n in zip(("v", "vt", "vn"), new, strict=True) for _ in range(n)]
        vectors = [f"{key} {' '.join(map(repr, rng.uniform(size=3).tolist()))}" for key in keys]
        counts += new
        picked = [rng.choice(n, 3, replace=False) + 1 for n in counts]
        back += [
            *vectors,
            "f "
            + " ".join(
                "/".join(str(i - n - 1) for i, n in zip(corner, counts, strict=True))
                for corner in zip(*picked, strict=True)
            ),
        ]
        ahead += [
            *vectors,
            "f " + " ".join("/".join(map(str, c)) for c in zip(*picked, strict=True)),
        ]
    (tmp_path / "a.obj").write_text("\n".join(back))
    (tmp_path / "b.obj").write_text("\n".join(ahead))
    file, wanted = read(tmp_path / "a.obj", tmp_path), read(tmp_path / "b.obj", tmp_path)
    assert np.array_equal(file.vertices[file.faces], wanted.vertices[wanted.faces])
    assert np.array_equal(file.colours, wanted.colours)


PLAIN = blocks(relative=True)
LINES = PLAIN.splitlines()
VARIANTS = {
    "tabs": PLAIN.replace(" ", "\t"),
    "several blanks": PLAIN.replace(" ", " \t  "),
    "indented": "".join(f"  \t{line}\n" for line in LINES),
    "blanks at ends": "".join(f"{line} \t\n" for line in LINES),
    "comments at ends": "".join(f"{line} # {k}\n" for k, line in enumerate(LINES)),
    "comments without a blank": "".join(f"{line} #{k}\n" for k, line in enumerate(LINES)),
    "comments between": "".join(f"# v 1 2 3\n{line}\n\n#f 1 2 3\n" for line in LINES),
    "CR LF": PLAIN.replace("\n", "\r\n"),
    "CR": PLAIN.replace("\n", "\r"),
    "no end": PLAIN.rstrip("\n"),
    "a byte order mark": "\ufeff" + PLAIN,
    "capitals": PLAIN.replace("v ", "V ").replace("f ", "F "),
    "continued": "".join(line.replace(" ", " \\\n", 1) + "\n" for line in LINES),
    "normals": "".join(
        f"{line}\n"
        if line[0] == "v"
        else f"vn 0 0 1\n{line[:2]}" + " ".join(f"{i}//-1" for i in line[2:].split()) + "\n"
        for line in LINES
    ),
    "a name of a lost library": "# mtllib none.mtl\nmtllib no such.mtl\no é\ng a b\ns 1\n" + PLAIN,
    "comments that end in a backslash": "".join(f"# C:\\out\\\n{line}\n" for line in LINES),
    "marks behind numbers": "".join(f"{line}#{k}\n" for k, line in enumerate(LINES)),
    "a last line continued": PLAIN.rstrip("\n") + " \\\n",
    "a w": "".join(f"{line} 1.0\n" if line[0] == "v" else f"{line}\n" for line in LINES),
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=VARIANTS)
def test_blank_space_comments_and_ends_of_lines_are_free(text, tmp_path):
    (tmp_path / "a.obj").write_bytes(text.encode())
    (tmp_path / "b.obj").write_text(PLAIN)
    file, wanted = read(tmp_path / "a.obj", tmp_path), read(tmp_path / "b.obj", tmp_path)
    assert np.array_equal(file.vertices[file.faces], wanted.vertices[wanted.faces])


@pytest.mark.parametrize("encoding", ["utf-16", "cp932", "gbk", "latin-1", "utf-8-sig"])
def test_any_encoding_is_read_and_materials_stay_apart(encoding, tmp_path):
    names = {"latin-1": ("ä", "ö"), "cp932": ("表", "右")}.get(encoding, ("左", "右"))
    library = "".join(f"newmtl {name}\nKd {k} 0 1\n" for k, name in enumerate(names))
    (tmp_path / "a.mtl").write_bytes(library.encode(encoding))
    text = "mtllib a.mtl\n" + PLAIN.replace("v ", f"usemtl {names[0]}\nv ", 1)
    text = text[::-1].replace(" v\n", f" v\n{names[1]} ltmesu\n", 1)[::-1]
    (tmp_path / "a.obj").write_bytes(text.encode(encoding))
    file = read(tmp_path / "a.obj", tmp_path)
    reds = np.bincount(file.colours[:, 0].astype(int))
    assert reds.tolist() == [24, 12] and np.all(file.colours[:, 2] == 1.0)


def test_polygons_are_fans_with_any_other_elements(tmp_path):
    """A hexagon may have as many numbers as a triangle with textures."""
    quads = "".join(f"f {' '.join(f'{i + 1}/1' for i in side)}\n" for side in SIDES[:3])
    quads += "".join(f"f {' '.join(f'{i + 1}' for i in side)}\n" for side in SIDES[3:])
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS.tolist())
    (tmp_path / "a.obj").write_text(f"{corners}vt 0 0\n{quads}")
    assert load_mesh(mesh(tmp_path, "a.obj")).volume == pytest.approx(1.0)
    ring = [(math.cos(a), math.sin(a)) for a in np.arange(6) * math.pi / 3]
    prism = "".join(f"v {x!r} {y!r} {z}\n" for z in (0, 1) for x, y in ring) + "vt 0 0\n"
    prism += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n"
    for k in range(6):
        a, b = k + 1, (k + 1) % 6 + 1
        prism += f"f {a}/1 {b}/1 {b + 6}/1\nf {a}//1 {b + 6}//1 {a + 6}//1\n"
    (tmp_path / "a.obj").write_text(f"{prism}vn 0 0 1\n")
    assert load_mesh(mesh(tmp_path, "a.obj")).volume == pytest.approx(1.5 * 3**0.5)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("f 0 1 2", "line 9: found the index 0"),
        ("f -9 -2 -1", "line 9: found the index -9; allowed here: 1 and more, or -8 to -1"),
        ("f 1 2 9", "line 9: names vertex 9; the file has 8"),
        ("f 1 2 99999999999999999999", "line 9: found the index 99999999999999999999"),
        ("f 1/0 2/1 3/1", "line 9: found the index 0"),
        ("f 1 2 x", "line 9: found '1 2 x'; needed: vertices"),
        ("f 1.5 2 3", "line 9: found '1.5 2 3'"),
        ("v 1 2", "line 9: found 'v 1 2'; needed: 3 numbers"),
        ("v 1,5 2,5 3,5", "decimal points"),
        ("v 1 2 nan\nf 1 2 9", "finite corners"),
        ("v 1 2 1e400\nf 1 2 9", "finite corners"),
        ("v 1 2 1e300\nf 1 2 9", "a corner at 1e+300; allowed: up to 1e+09"),
        ("v 1 2 -1e12\nf 1 2 9", "a corner at 1e+12"),
    ],
)
def test_a_mistake_of_an_obj_has_its_line(line, says, tmp_path):
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS.tolist())
    (tmp_path / "a.obj").write_text(f"{corners}{line}\nf 1 2 3\n")
    with pytest.raises(ValueError) as caught:
        read(tmp_path / "a.obj", tmp_path)
    assert says in str(caught.value)


def textured(folder: Path, library: str) -> fan.model.meshes.MeshFile:
    """A cube in a material with a red image."""
    red = np.zeros((4, 4, 3), "uint8") + np.array([255, 0, 0], "uint8")
    for name in ("p.png", "my picture.png", "50%25.png"):
        Image.fromarray(red).save(folder / name)
    Image.fromarray(0 * red).save(folder / "picture.png")
    (folder / "a.mtl").write_bytes(library.encode())
    text = "mtllib a.mtl\nusemtl m\nvt 0.5 0.5\n"
    text += "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS.tolist())
    text += "".join("f " + " ".join(f"{i + 1}/1" for i in t) + "\n" for t in CUBE.tolist())
    (folder / "a.obj").write_text(text)
    return read(folder / "a.obj", folder)


LIBRARY = "newmtl m\nKd 0 1 0\nmap_Kd p.png\nd 0.5\n"


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t,
        lambda t: t.replace(" ", "\t"),
        lambda t: t.replace(" ", " \t "),
        lambda t: "".join(f"\t{line}\t\n" for line in t.splitlines()),
        lambda t: t.replace("\n", "\r"),
        lambda t: "\ufeff" + t.replace("\n", "\r\n"),
        lambda t: t.replace("\n", "\t# a comment\n"),
        lambda t: t.upper().replace("P.PNG", "p.png").replace("NEWMTL M", "newmtl m"),
        lambda t: t.replace("d 0.5", "Tr\t0.5"),
        lambda t: t.replace("map_Kd p.png", "map_Kd\t-s 1 1 1 p.png"),
        lambda t: t.replace("map_Kd p.png", "map_Kd\tC:\\textures\\p.png"),
        lambda t: t.replace("p.png", '"p.png"'),
        lambda t: t.replace("p.png", "P.PNG"),
        lambda t: t.replace("p.png", "my picture.png"),
        lambda t: t.replace("p.png", "-clamp on\t-s 2\t-mm 0 1 my picture.png"),
        lambda t: t.replace("p.png", "50%25.png"),
    ],
)
def test_image_and_transparency_are_found_with_any_separators(change, tmp_path):
    file = textured(tmp_path, change(LIBRARY))
    assert np.allclose(file.colours, [1.0, 0.0, 0.0], atol=1e-9)
    assert file.lost == {"textures", "transparency"}


def test_colours_of_corners_are_those_that_trimesh_reads(tmp_path):
    rng = np.random.default_rng(0)
    box = trimesh.creation.box()
    box.visual.vertex_colors = rng.integers(0, 256, (8, 4)).astype("uint8")
    (tmp_path / "a.obj").write_text(box.export(file_type="obj"))
    again = trimesh.load(tmp_path / "a.obj", process=False)
    file = read(tmp_path / "a.obj", tmp_path)
    wanted = again.visual.vertex_colors[again.faces][:, :, :3].mean(axis=1) / 255.0
    assert np.allclose(file.colours, wanted, atol=1.01 / 255)
