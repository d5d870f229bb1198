"""BVH files: closed forms, random trees compared with SciPy, units, axes, mistakes with lines."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from benchmarks.capture import clips
from scipy.spatial.transform import Rotation

import fantoccini as fan
from fantoccini.base.errors import FileError, UnknownNameError

ARM = """\
HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT upper arm
  {
    OFFSET 0 10 0
    CHANNELS 1 Zrotation
    JOINT hand
    {
      OFFSET 5 0 0
      CHANNELS 3 Yrotation Zrotation Xrotation
      End Site
      {
        OFFSET 2 0 0
      }
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.025
1 2 3 0 0 0 90 0 0 0
0 0 0 90 0 0 0 0 90 0
"""


def write_clip(tmp_path, text: str):
    path = tmp_path / "clip.bvh"
    path.write_text(text, encoding="utf-8")
    return path


def test_joints_are_where_their_channels_put_them(tmp_path):
    clip = fan.theatre.load_bvh(write_clip(tmp_path, ARM))
    assert clip.skeleton.names == ("hips", "upper arm", "hand", "hand.end")
    assert clip.skeleton.parents == (-1, 0, 1, 2) and clip.name == "clip"
    assert clip.t == pytest.approx([0.0, 0.025])
    # The arm's own joint turned it up, then the root turned everything, and the hand turned back.
    np.testing.assert_allclose(
        clip.positions[0], [[1, 2, 3], [1, 12, 3], [1, 17, 3], [1, 19, 3]], atol=1e-12
    )
    np.testing.assert_allclose(
        clip.positions[1], [[0, 0, 0], [-10, 0, 0], [-10, 5, 0], [-12, 5, 0]], atol=1e-12
    )


class RandomTree:
    """A skeleton and its frames, as a BVH file.

    Args:
        rng: random numbers.
        common: three rotations a joint and six channels of the root, as most files have.
    """

    def __init__(self, rng: np.random.Generator, common: bool):
        self.n, self.frames = int(rng.integers(2, 12)), 3
        self.parents = [-1, *(int(rng.integers(0, i)) for i in range(1, self.n))]
        self.offsets = rng.normal(size=(self.n, 3))
        self.orders = [
            "".join(rng.permutation(list("XYZ"))[: 3 if common else rng.integers(1, 4)])
            for _ in range(self.n)
        ]
        self.moves = [i == 0 or (not common and rng.random() < 0.3) for i in range(self.n)]
        self.columns: list[tuple[int, str]] = []
        self.lines = ["HIERARCHY"]
        self.positions = "XYZ" if common else "ZXY"
        self._add(0, 0)
        self.values = rng.normal(size=(self.frames, len(self.columns))) * 50.0
        self.lines += ["MOTION", f"Frames: {self.frames}", "Frame Time: 0.01"]
        self.lines += [" ".join(map(repr, row)) for row in self.values.tolist()]

    @property
    def text(self) -> str:
        return "\n".join(self.lines) + "\n"

    def _add(self, i: int, depth: int) -> None:
        pad = "  " * depth
        kinds = [f"{a}position" for a in self.positions] if self.moves[i] else []
        kinds += [f"{a}rotation" for a in self.orders[i]]
        self.columns.extend((i, kind) for kind in kinds)
        offset = " ".join(map(repr, self.offsets[i].tolist()))
        self.lines += [
            f"{pad}{'ROOT' if i == 0 else 'JOINT'} j{i}",
            f"{pad}{{",
            f"{pad}OFFSET {offset}",
            f"{pad}CHANNELS {len(kinds)} {' '.join(kinds)}",
        ]
        below = [k for k in range(self.n) if self.parents[k] == i]
        for k in below:
            self._add(k, depth + 1)
        if not below:
            self.lines += [f"{pad}End Site", f"{pad}{{", f"{pad}OFFSET 0 1 0", f"{pad}}}"]
        self.lines.append(f"{pad}}}")


def test_positions_near_zero_are_relative_to_offsets(tmp_path):
    """MakeHuman writes poses in this way; as positions they would put all joints in one point."""
    text = ARM.replace("CHANNELS 1 Zrotation", "CHANNELS 4 Xposition Yposition Zposition Zrotation")
    text = text.replace("1 2 3 0 0 0 90 ", "1 2 3 0 0 0 0.01 0 0 90 ")
    text = text.replace("0 0 0 90 0 0 0 ", "0 0 0 90 0 0 0 0.02 0 0 ")
    clip = fan.theatre.load_bvh(write_clip(tmp_path, text))
    np.testing.assert_allclose(clip.positions[0][1], [1.01, 12, 3], atol=1e-12)
    np.testing.assert_allclose(clip.positions[1][1], [-10.02, 0, 0], atol=1e-12)
    (note,) = clip.notes
    assert "taken as relative to their offsets" in note
    other = text.replace("0.01 0 0 90", "0 12 0 90").replace("0 0.02 0 0", "0 11 0 0")
    clip = fan.theatre.load_bvh(write_clip(tmp_path, other))
    np.testing.assert_allclose(clip.positions[0][1], [1, 14, 3], atol=1e-12)
    assert clip.notes == ()


def test_random_trees_agree_with_scipy(tmp_path):
    rng = np.random.default_rng(0)
    for _ in range(20):
        tree = RandomTree(rng, common=False)
        clip = fan.theatre.load_bvh(write_clip(tmp_path, tree.text))
        for frame in range(tree.frames):
            positions, rotations = {}, {}
            for i in range(tree.n):
                joint_values = [
                    (kind, tree.values[frame, c])
                    for c, (j, kind) in enumerate(tree.columns)
                    if j == i
                ]
                local = tree.offsets[i].copy()
                for kind, value in joint_values:
                    if kind.endswith("position"):
                        local["XYZ".index(kind[0])] = value
                angles = [value for kind, value in joint_values if kind.endswith("rotation")]
                rotation = Rotation.from_euler(tree.orders[i], np.atleast_1d(angles), degrees=True)
                rotation = rotation if rotation.single else rotation[0]
                if i == 0:
                    positions[i], rotations[i] = local, rotation
                else:
                    parent_rotation = rotations[tree.parents[i]]
                    positions[i] = positions[tree.parents[i]] + parent_rotation.apply(local)
                    rotations[i] = parent_rotation * rotation
                k = clip.skeleton.index(f"j{i}")
                np.testing.assert_allclose(clip.positions[frame, k], positions[i], atol=1e-10)
                np.testing.assert_allclose(
                    clip.rotations[frame, k], rotations[i].as_matrix(), atol=1e-12
                )


@pytest.mark.filterwarnings("ignore")
def test_common_files_agree_with_pybvh(tmp_path):
    pybvh = pytest.importorskip("pybvh")
    rng = np.random.default_rng(1)
    for _ in range(10):
        path = write_clip(tmp_path, RandomTree(rng, common=True).text)
        clip, other = fan.theatre.load_bvh(path), pybvh.read_bvh_file(path, world_up="+y")
        theirs = pybvh.frames_to_node_positions(other)
        names = [node.name for node in other.nodes]
        for k, name in enumerate(names):
            if name in clip.skeleton.names:
                mine = clip.positions[:, clip.skeleton.index(name)]
                np.testing.assert_allclose(mine, theirs[:, k], atol=1e-9)
        assert sum(name in clip.skeleton.names for name in names) >= 2


@pytest.mark.filterwarnings("ignore")
def test_common_files_agree_with_bvhio(tmp_path):
    bvhio = pytest.importorskip("bvhio")
    rng = np.random.default_rng(2)
    for _ in range(5):
        path = write_clip(tmp_path, RandomTree(rng, common=True).text)
        clip, root = fan.theatre.load_bvh(path), bvhio.readAsHierarchy(str(path))
        for f in range(len(clip.t)):
            root.loadPose(f)
            for joint, _, _ in root.layout():
                mine = clip.positions[f, clip.skeleton.index(joint.Name)]
                np.testing.assert_allclose(mine, np.array(joint.PositionWorld), atol=1e-3)


@pytest.mark.parametrize(("unit", "size"), [("cm", 0.01), ("m", 1.0), ("inches", 0.0254)])
@pytest.mark.parametrize("up", ["y", "z"])
def test_a_person_is_set_upright_in_metres(tmp_path, unit, size, up):
    tall = 1.75 / size
    step = {"y": f"0 {tall} 0", "z": f"0 0 {tall}"}[up]
    text = f"""\
HIERARCHY
ROOT feet
{{
  OFFSET 0 0 0
  CHANNELS 3 Xposition Yposition Zposition
  JOINT head
  {{
    OFFSET {step}
    CHANNELS 1 Yrotation
  }}
}}
MOTION
Frames: 1
Frame Time: 0.01
{1 / size} 0 0 10
"""
    clip = fan.theatre.load_bvh(write_clip(tmp_path, text))
    assert clip.unit == (unit, size) and clip.vertical_axis == {"y": 1, "z": 2}[up]
    upright = clip.upright()
    np.testing.assert_allclose(upright.positions[0], [[1, 0, 0], [1, 0, 1.75]], atol=1e-12)
    np.testing.assert_allclose(upright.skeleton.rest[1], [0, 0, 1.75], atol=1e-12)
    turned = Rotation.from_matrix(upright.rotations[0, 1]).as_rotvec(degrees=True)
    np.testing.assert_allclose(turned, {"y": [0, 0, 10], "z": [0, 10, 0]}[up], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("HIERARCHY", "HIERARCH"), 1, "needed: HIERARCHY"),
        (("ROOT hips\n{", "ROOT hips\n("), 3, "needed: {"),
        (("OFFSET 0 10 0", "OFFSET 0 ten 0"), 8, "three numbers of an offset"),
        (("OFFSET 5 0 0", "OFFSET 5 0"), 13, "three numbers of an offset"),
        (("CHANNELS 1 Z", "CHANNELS 7 Z"), 9, "0 to 6"),
        (("1 Zrotation", "1 Wrotation"), 9, "a channel, Xposition to Zrotation"),
        (("3 Yrotation Zrotation", "3 Yrotation Yrotation"), 13, "Yrotation twice"),
        (("JOINT hand", "JOINT hips"), 10, "second joint"),
        (("End Site", "End Sites"), 14, "needed: SITE"),
        (("Frames: 2", "Frames: two"), 22, "the number of frames"),
        (("Frames: 2", "Frames: 4"), 25, "ends after 2 frames"),
        (("Frames: 2", "Frames: -1"), 22, "a whole number of at least 0"),
        (("Frames: 2", "Frames: 9999999"), 23, "too short for 9999999 frames"),
        (("Frames: 2", "Frames: 0"), 25, "more than 1 frames; its header says 0"),
        (("Time: 0.025", "Time: 0"), 23, "at least 1e-05 s"),
        (("1 2 3 0", "1 2 3"), 24, "found 9 numbers; needed: 10"),
        (("1 2 3 0", "1 2 nan 0"), 24, "not finite"),
        (("1 2 3 0", "1 2 x 0"), 24, "needed: 10 numbers"),
    ],
)
def test_mistakes_have_lines(tmp_path, change, line, message):
    assert change[0] in ARM
    path = write_clip(tmp_path, ARM.replace(change[0], change[1], 1))
    with pytest.raises(FileError, match=message) as error:
        fan.theatre.load_bvh(path)
    assert f"clip.bvh:{line}:" in str(error.value)


FRAME_ROWS = ARM.splitlines(keepends=True)[-2:]


@pytest.mark.parametrize(
    ("header_frames", "rows", "frames"),
    [(2, 1, 1), (2, 3, 3), (3, 2, 2), (1, 1, 1), (1, 2, 2), (0, 1, 1), (5, 4, 4)],
)
def test_another_number_of_frames_than_in_the_header_is_read_and_noted(
    tmp_path, header_frames, rows, frames
):
    text = "".join([*ARM.splitlines(keepends=True)[:-2], *(2 * FRAME_ROWS)[:rows]])
    clip = fan.theatre.load_bvh(
        write_clip(tmp_path, text.replace("Frames: 2", f"Frames: {header_frames}"))
    )
    assert len(clip.t) == frames and np.all(np.diff(clip.t) == pytest.approx(0.025))
    np.testing.assert_allclose(clip.positions[0, 3], [1, 19, 3], atol=1e-12)
    notes = [f"{tmp_path / 'clip.bvh'}: has {frames} frames; its header says {header_frames}"]
    assert list(clip.notes) == (notes if header_frames != frames else [])
    assert clip.upright("y").notes == clip.notes


@pytest.mark.parametrize("interval", ["0.025", "0", "0.0000000", "-1"])
def test_a_single_pose_has_no_use_for_the_time_of_a_frame(tmp_path, interval):
    text = "".join(ARM.splitlines(keepends=True)[:-1]).replace("Frames: 2", "Frames: 1")
    clip = fan.theatre.load_bvh(write_clip(tmp_path, text.replace("0.025", interval)))
    assert clip.t == pytest.approx([0.0]) and not clip.notes
    held = clip.holding_single_pose(1.0)
    assert held.t == pytest.approx([0.0, 1.0]) and held.holding_single_pose(2.0) is held
    assert np.array_equal(held.positions[0], held.positions[1])


def test_without_frames_nothing_turns(tmp_path):
    text = "".join(ARM.splitlines(keepends=True)[:-2]).replace("Frames: 2", "Frames: 0")
    clip = fan.theatre.load_bvh(write_clip(tmp_path, text.replace("0 0 0", "3 2 1", 1)))
    np.testing.assert_array_equal(clip.positions[0, 0], [3, 2, 1])
    np.testing.assert_array_equal(clip.positions[0] - clip.positions[0, 0], clip.skeleton.rest)
    assert "has no frames; read as one pose with all angles 0" in str(clip.notes)


JAPANESE = ("センター", "左ひじ", "右ひじ")


@pytest.mark.parametrize(
    ("encoding", "names"),
    [
        ("utf-8", JAPANESE),
        ("utf-8-sig", JAPANESE),
        ("utf-16", JAPANESE),
        ("cp932", JAPANESE),
        ("utf-8-sig", ("hips", "upper arm", "hand")),
        ("utf-16-le", ("hips", "ä", "ö")),
        ("latin-1", ("Hüfte", "Schlüssel", "Füße")),
    ],
)
def test_names_are_read_in_their_encoding(tmp_path, encoding, names):
    text = ARM
    for plain_clip, name in zip(("hips", "upper arm", "hand"), names, strict=True):
        text = text.replace(plain_clip, name)
    path, mark = tmp_path / "clip.bvh", "\ufeff" if encoding == "utf-16-le" else ""
    path.write_bytes((mark + text).encode(encoding))
    assert fan.theatre.load_bvh(path).skeleton.names == (*names, f"{names[2]}.end")


@pytest.mark.parametrize("encoding", ["gbk", "euc_kr", "big5", "cp932"])
def test_names_in_other_encodings_stay_apart(tmp_path, encoding):
    text, body = ARM, "左" if encoding == "euc_kr" else "本体"  # a brace in Shift-JIS
    for plain_clip, name in zip(("hips", "upper arm", "hand"), ("中", body, "右"), strict=True):
        text = text.replace(plain_clip, name)
    path = tmp_path / "clip.bvh"
    path.write_bytes(text.encode(encoding))
    assert len(set(fan.theatre.load_bvh(path).skeleton.names)) == 4


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n\n", " \t\n"])
def test_line_ends_may_be_lf_crlf_or_cr(tmp_path, end):
    path = tmp_path / "clip.bvh"
    path.write_bytes(ARM.replace("\n", end).encode())
    clip, plain_clip = fan.theatre.load_bvh(path), fan.theatre.load_bvh(write_clip(tmp_path, ARM))
    assert np.array_equal(clip.positions, plain_clip.positions) and not clip.notes


@pytest.mark.parametrize("ending", ["\0" * 40, "\x1a", "\n\0\x1a"])
@pytest.mark.parametrize("label", ["Frames:{}\n", "Frames : {}\n", "FRAMES:\t{}\n"])
def test_padding_and_blanks_around_labels_are_read(tmp_path, ending, label):
    text = ARM.replace("Frames: 2\n", label.format(2)).replace("Frame Time: ", "Frame  Time:")
    clip = fan.theatre.load_bvh(write_clip(tmp_path, text + ending))
    assert clip.t == pytest.approx([0.0, 0.025]) and clip.notes == ()


@pytest.mark.parametrize("width", [1, 3, 4, 9, 10])
def test_frames_may_be_wrapped_over_lines(tmp_path, width):
    """Some programs break lines after so many numbers; a frame begins on a new line."""
    *head, first, last = ARM.splitlines()
    lines = list(head)
    for row in (first, last):
        words = row.split()
        lines += [" ".join(words[k : k + width]) for k in range(0, len(words), width)]
    clip = fan.theatre.load_bvh(write_clip(tmp_path, "\n".join(lines) + "\n"))
    plain_clip = fan.theatre.load_bvh(write_clip(tmp_path, ARM))
    assert np.array_equal(clip.positions, plain_clip.positions) and not clip.notes
    start, n = len(head) + -(-len(first.split()) // width) + 1, width if width < 10 else 11
    with pytest.raises(FileError, match=rf"clip\.bvh:{start}: found {n} number"):
        fan.theatre.load_bvh(write_clip(tmp_path, "\n".join([*lines[:-1], f"{lines[-1]} 7"])))


@pytest.mark.parametrize("encoding", ["cp932", "utf-8", "utf-16", "latin-1", "gbk"])
@pytest.mark.parametrize("layout", ["glued", "one line", "end site"])
def test_braces_may_be_glued_to_names(tmp_path, encoding, layout):
    """Also behind characters whose second byte is a brace in Shift-JIS or GBK."""
    names = {"latin-1": ("Clavé", "Ñandú", "Fußß")}.get(encoding, ("頭", "本体", "体本"))
    text = ARM
    for plain_clip, name in zip(("hips", "upper arm", "hand"), names, strict=True):
        text = text.replace(plain_clip, name)
    if layout == "one line":
        for name in names:
            text = re.sub(rf"{name}\n\s*{{\n\s*", f"{name} {{ ", text)
    else:
        for name in names:
            text = re.sub(rf"{name}\n\s*{{", f"{name}{{", text)
    if layout == "end site":
        text = re.sub(r"End Site\s*{\s*(OFFSET [^\n]*)\n\s*}", r"End Site { \1 }", text)
    path = tmp_path / "clip.bvh"
    path.write_bytes(text.encode(encoding))
    clip, plain_clip = fan.theatre.load_bvh(path), fan.theatre.load_bvh(write_clip(tmp_path, ARM))
    assert len(set(clip.skeleton.names)) == 4
    if encoding in ("utf-8", "utf-16", "latin-1"):
        assert clip.skeleton.names[:3] == names
    assert np.array_equal(clip.positions, plain_clip.positions)  # type: ignore[attr-defined]


def test_damaged_files_end_in_one_error(tmp_path):
    for n in range(0, len(ARM) - 25, 7):
        with pytest.raises(FileError, match=r"clip\.bvh"):
            fan.theatre.load_bvh(write_clip(tmp_path, ARM[:n]))
    with pytest.raises(FileError, match="cannot be read"):
        fan.theatre.load_bvh(tmp_path / "none.bvh")
    deep = "".join(f"JOINT j{i}\n{{\nOFFSET 0 1 0\n" for i in range(400))
    with pytest.raises(FileError, match="200 deep"):
        fan.theatre.load_bvh(write_clip(tmp_path, f"HIERARCHY\nROOT r\n{{\nOFFSET 0 0 0\n{deep}"))


def test_joints_go_by_name(tmp_path):
    clip = fan.theatre.load_bvh(write_clip(tmp_path, ARM))
    with pytest.raises(UnknownNameError, match="did you mean 'hand'"):
        clip.skeleton.index("hnd")


def with_fixed_root(text: str, root_offset: tuple[float, float, float]) -> str:
    """A clip with a joint at the origin above its hips, which walk elsewhere."""
    first, motion = text.split("MOTION")
    root = "ROOT reference\n{\nOFFSET 0 0 0\nCHANNELS 3 Xrotation Yrotation Zrotation\nJOINT"
    first = first.replace("ROOT", root)
    frames, interval, *rows = motion.strip().splitlines()
    moved = []
    for row in rows:
        values = [float(word) for word in row.split()]
        values[:3] = np.add(values[:3], root_offset).tolist()
        moved.append(" ".join(f"{x:.4f}" for x in (0.0, 0.0, 0.0, *values)))
    return first + "}\nMOTION\n" + "\n".join([frames, interval, *moved]) + "\n"


@pytest.mark.parametrize("convention", ["mixamo", "cmu", "lafan1"])
@pytest.mark.parametrize("root_offset", [(0.0, 0.0, 900.0), (-2000.0, 0.0, 50.0)])
def test_a_root_that_stays_at_the_origin_is_no_part_of_the_body(tmp_path, convention, root_offset):
    text = clips.clip("walk", convention)
    size = clips.CONVENTIONS[convention].unit
    root_offset = tuple(0.01 * x / size for x in root_offset)
    plain_clip = fan.theatre.load_bvh(write_clip(tmp_path, text)).without_calibration()
    rooted = fan.theatre.load_bvh(
        write_clip(tmp_path, with_fixed_root(text, root_offset))
    ).without_calibration()
    assert (
        (rooted.vertical_axis, rooted.unit)
        == (plain_clip.vertical_axis, plain_clip.unit)
        == (1, rooted.unit)
    )
    assert rooted.unit[1] == size and rooted.height == pytest.approx(plain_clip.height)
    heads = [
        take.upright().positions[:, take.skeleton.names.index(head), 2].mean()
        for take in (plain_clip, rooted)
        for head in take.skeleton.names
        if head.endswith("Head")
    ]
    assert heads[0] == pytest.approx(heads[1], abs=1e-3) and heads[0] > 1.3


def test_a_bone_from_a_root_on_the_floor_to_the_hips_is_no_part_of_the_body(tmp_path):
    """The hips of somebody who waves stay where they are, which makes a bone of constant length."""
    text = clips.clip("wave", "lafan1")
    plain_clip = fan.theatre.load_bvh(write_clip(tmp_path, text))
    hips = plain_clip.positions[0, 0]
    before, after = with_fixed_root(text, (0.0, 0.0, 0.0)).split("JOINT Hips", 1)
    assert "OFFSET 0.00000 0.00000 0.00000" in after[:50]
    at = f"OFFSET {hips[0]} {hips[1]} {hips[2]}"
    text = before + "JOINT Hips" + after.replace("OFFSET 0.00000 0.00000 0.00000", at, 1)
    rooted = fan.theatre.load_bvh(write_clip(tmp_path, text))
    assert (rooted.vertical_axis, rooted.unit, rooted.height) == (
        1,
        ("cm", 0.01),
        plain_clip.height,
    )


def turned(take: fan.theatre.Capture, turn: Rotation) -> fan.theatre.Capture:
    """A clip with a turned motion and the same rest pose."""
    matrix = turn.as_matrix()
    return dataclasses.replace(
        take, positions=take.positions @ matrix.T, rotations=matrix @ take.rotations
    )


def test_up_is_that_of_the_rest_pose_while_a_person_crawls(tmp_path):
    """A person who sits in the air and leans forward by 90 degrees is on hands and knees."""
    take = fan.theatre.load_bvh(write_clip(tmp_path, clips.clip("sit", "mixamo")))
    sits = slice(int(0.45 * len(take.t)), int(0.55 * len(take.t)))
    take = dataclasses.replace(
        take, t=take.t[sits], positions=take.positions[sits], rotations=take.rotations[sits]
    )
    for heading in (0.0, 90.0, 180.0, 30.0):
        crawls = turned(take, Rotation.from_euler("xy", [90.0, heading], degrees=True))
        assert crawls.vertical_axis == 1 and crawls.unit == ("cm", 0.01), heading
        heights = np.ptp(crawls.upright().positions[..., 2], axis=1)
        assert np.all(heights < 1.3), heading


def test_up_is_the_axis_along_which_a_person_stands_in_a_file_with_a_turned_root(tmp_path):
    take = fan.theatre.load_bvh(write_clip(tmp_path, clips.clip("walk", "mixamo")))
    stands = turned(take, Rotation.from_euler("x", 90.0, degrees=True))
    assert stands.vertical_axis == 2 and stands.unit == ("cm", 0.01)
    # A person who lies all the time looks the same: it is said, unless the vertical was given.
    (note,) = stands.upright().notes
    assert "standing along z" in note and "--up y" in note
    assert stands.upright("y").notes == () == take.upright().notes


@pytest.mark.parametrize("axes", [[2, 0, 1], [0, 2, 1], [2, 1, 0]])
def test_arms_spread_in_the_rest_pose_are_not_its_height(tmp_path, axes):
    """This holds for either facing direction, and with y or z up."""
    take = fan.theatre.load_bvh(write_clip(tmp_path, clips.clip("wave", "mixamo")))
    skeleton = dataclasses.replace(take.skeleton, offsets=take.skeleton.offsets[:, axes])
    other = dataclasses.replace(take, skeleton=skeleton, positions=take.positions[..., axes])
    assert "xyz"[other.vertical_axis] == "xyz"[axes.index(1)]
    assert other.height == pytest.approx(take.height)
