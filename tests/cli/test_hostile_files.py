"""Malformed files: a located message, exit code 2, and never a traceback."""

from __future__ import annotations

import itertools
import re
from functools import partial

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.base.errors import FileError

pytestmark = pytest.mark.medium

_ARM = """\
puppet: p
bodies:
  - name: arm
    joint: {type: revolute, axis: [0, 1, 0]}
    mass: 1
    com: [1, 0, 0]
    inertia: [1, 1, 1]
"""
_STRING = "strings:\n  - {name: s, length: 1, path: [%s]}\n"
_ANCHORS = "abcdefghij"
_BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{new}: &{new} [{', '.join(['*' + old] * 9)}]\n" for old, new in itertools.pairwise(_ANCHORS)
)

# Content of the file, line of the mistake, a part of the message.
PUPPETS = {
    "nothing": ("", 1, "the file is empty"),
    "no mapping": ("- a\n", 1, "needed: a mapping"),
    "bytes": (b"\x00\xff\xfe\x80", 1, "UTF-8"),
    "no YAML": ("puppet: p\nbodies: [", 2, "not YAML"),
    "NaN": (_ARM.replace("mass: 1", "mass: .nan"), 5, "found nan; needed: a finite number"),
    "infinite": (_ARM.replace("[1, 0, 0]", "[.inf, 0, 0]"), 6, "found inf"),
    "negative mass": (_ARM.replace("mass: 1", "mass: -1"), 5, "found -1"),
    "massless": ("\n".join(_ARM.splitlines()[:4]), 4, "moves no mass"),
    "impossible inertia": (_ARM.replace("[1, 1, 1]", "[1, 1, 5]"), 7, "inertia"),
    "no axis": (_ARM.replace("[0, 1, 0]", "[0, 0, 0]"), 4, "zero length"),
    "a zero quaternion": (
        _ARM + "  - {name: b, parent: arm, joint: {orientation: {quaternion: [0, 0, 0, 0]}}}\n",
        8,
        "zero length",
    ),
    "a cycle of parents": (
        "puppet: p\nbodies:\n  - {name: a, parent: b}\n  - {name: b, parent: a}\n",
        3,
        "parent",
    ),
    "a missing parent": (_ARM.replace("mass", "parent: leg\n    mass"), 5, "leg"),
    "a name twice": (_ARM + "  - {name: arm, mass: 1}\n", 8, "arm"),
    "a string to nowhere": (
        _ARM + _STRING % "{body: leg}, {world: [0, 0, 1]}",
        9,
        "no body is called 'leg'",
    ),
    "a string without length": (
        _ARM + _STRING.replace("length: 1, ", "") % "{body: arm}, {world: [0, 0, 1]}",
        9,
        "missing",
    ),
    "a path of one point": (_ARM + _STRING % "{body: arm}", 9, "at least 2"),
    "a path of no length": (_ARM + _STRING % "{body: arm}, {body: arm}", 9, "length is zero"),
    "a negative length": (
        _ARM + _STRING.replace("length: 1", "length: -1") % "{body: arm}, {world: [0, 0, 1]}",
        9,
        "found -1",
    ),
    "an alias bomb": (_BOMB, 5, "aliases repeat more than"),
    "depth": ("bodies: " + "[" * 3000, 1, "nested deeper"),
    "code in a tag": ("puppet: !!python/object/apply:os.system [ls]", 1, "tags are not read"),
    "ten megabytes": ("#" * 10_000_000, None, "larger than 2 MB"),
}
_NAMES = ('a"b', "a'b", "a*/b", "a;rm -rf /", "$(id)", "`id`", "a.b", "a b", "", "-a", "é", "../x")


@pytest.mark.parametrize(("text", "line", "message"), PUPPETS.values(), ids=PUPPETS)
def test_a_malformed_puppet_is_a_located_mistake(text, line, message, tmp_path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    place = f"{path}:" if line is None else f"{path}:{line}:"
    stderr = mistake("check", path).splitlines()
    assert any(row.startswith(place) and message in row for row in stderr), stderr
    for command in ("info", "equations", "simulate"):
        assert mistake(command, path).splitlines() == stderr


@pytest.mark.parametrize("name", [*_NAMES, "a\\nb", "a\\e[0m"])
def test_a_name_that_could_reach_code_is_refused(name, tmp_path) -> None:
    path = tmp_path / "bad.yaml"
    quoted = name.replace('"', '\\"')
    path.write_text(_ARM.replace("name: arm", f'name: "{quoted}"'))
    stderr = mistake("check", path)
    assert re.search(r"bad\.yaml:3: bodies\[0\]\.name: found .* a name is up to 64", stderr)
    assert mistake("export", path, tmp_path / "c") == stderr
    assert not (tmp_path / "c").exists()


INPUTS = {
    "nothing": ("x.yaml", "", 1, "the file is empty"),
    "an unknown key": ("x.yaml", "coordinate: {}\n", 1, "did you mean 'coordinates'?"),
    "an unknown coordinate": ("x.yaml", "coordinates:\n  hand.y: [[0, 1]]\n", 2, "hand.x"),
    "a dynamic coordinate": ("x.yaml", "coordinates:\n  elbow: [[0, 1]]\n", 2, "elbow"),
    "no waypoints": ("x.yaml", "coordinates:\n  hand.x: []\n", 2, "hand.x"),
    "no pair": ("x.yaml", "coordinates:\n  hand.x:\n    - [0, 1]\n    - [1]\n", 4, "hand.x[1]"),
    "NaN": ("x.yaml", "coordinates:\n  hand.x: [[0, .nan]]\n", 2, "nan"),
    "time that runs back": ("x.yaml", "coordinates:\n  hand.x: [[1, 0], [0, 1]]\n", 2, "hand.x"),
    "a step": ("x.yaml", "coordinates:\n  hand.x: [[0, 0], [0, 1]]\n", 2, "hand.x"),
    "a length below zero": (
        "x.yaml",
        "coordinates:\n  hand.length: [[0, 0.8], [1, -0.2]]\n",
        2,
        "hand.length",
    ),
    "a duration below zero": ("x.yaml", "duration: -1\n", 1, "positive"),
    "forces on a driven coordinate": ("x.yaml", "forces:\n  hand.x: [[0, 1]]\n", 2, "hand.x"),
    "bytes": ("x.yaml", b"\xff\xfe\x00", 1, "UTF-8"),
    "an alias bomb": ("x.yaml", _BOMB, 5, "aliases"),
    "an empty table": ("x.csv", "", 1, "the file is empty"),
    "a table without time": ("x.csv", "hand.x\n1\n2\n", 1, "column t"),
    "a cell that is a word": ("x.csv", "t,hand.x\n0,1\n1,a\n", 3, "needed: a number"),
    "a cell that is NaN": ("x.csv", "t,hand.x\n0,1\n1,nan\n2,1\n", 3, "nan"),
    "a short row": ("x.csv", "t,hand.x\n0,1\n1\n", 3, "found 1 columns"),
    "two equal columns": ("x.csv", "t,hand.x,hand.x\n0,1,1\n1,1,1\n", 1, "two columns"),
    "Latin-1": ("x.csv", b"t,hand.x\n0,\xe9\n", 2, "UTF-8"),
    "no archive": ("x.npz", b"PK junk", None, "npz"),
    "an unknown ending": ("x.txt", "hello", None, "has the ending '.txt'"),
}


@pytest.mark.parametrize(("name", "text", "line", "message"), INPUTS.values(), ids=INPUTS)
def test_malformed_inputs_are_a_located_mistake(name, text, line, message, tmp_path) -> None:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    place = f"{path}:" if line is None else f"{path}:{line}:"
    stderr = mistake("check", "--quiet", "arm2d", "--inputs", path).splitlines()
    assert any(row.startswith(place) and message in row for row in stderr), stderr
    assert mistake("simulate", "--quiet", "arm2d", "--inputs", path).splitlines() == stderr


def test_an_archive_of_objects_is_not_read(tmp_path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, t=np.array([0, {}], dtype=object))
    assert "t: is not a plain array: holds object" in mistake(
        "check", "-q", "arm2d", "--inputs", path
    )


def test_files_that_are_not_files(tmp_path) -> None:
    assert "found a folder" in mistake("check", tmp_path)
    assert "found nothing" in mistake("check", "-q", "arm2d", "--inputs", tmp_path / "none.yaml")
    assert "ending ''" in mistake("check", "-q", "arm2d", "--inputs", tmp_path)
    assert "File name too long" in mistake("check", "x" * 5000)
    loop = tmp_path / "loop.yaml"
    loop.symlink_to(loop)
    assert str(loop) in mistake("check", loop)


def test_good_inputs_are_reported(tmp_path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("coordinates: {hand.length: [[0, 0.8], [1, 0.7]]}\n")
    result = fantoccini("check", "arm2d", "--inputs", path)
    assert result.exit_code == 0
    assert f"{path}: no mistakes; drives arm2d for 1 s" in result.stdout


IMPOSSIBLE_NAMES = (
    "x" * 300,
    "x" * 300 + ".yaml",
    "é" * 200,
    "x" * 5000,
    "a/" * 3000 + "b",
    "x\0y",
)
"""Names that no file can have."""


@pytest.mark.parametrize(
    "name", IMPOSSIBLE_NAMES, ids=[f"{len(n)} {n[:2]!r}" for n in IMPOSSIBLE_NAMES]
)
def test_a_name_that_no_file_can_have_is_one_mistake_for_every_reader(name, tmp_path) -> None:
    arm = fan.puppets.arm2d().coordinates
    readers = (
        fan.load,
        fan.theatre.load_bvh,
        fan.control.load_task,
        fan.control.load_problem,
        fan.load_play,
        fan.stand.load_stand,
        fan.lab.load_record,
        fan.import_model,
        fan.theatre.retarget.load_mapping,
        fan.model.load,
        partial(fan.Input.load, arm),
        partial(fan.theatre.load_gesture, arm),
        fan.Trajectory.load,
        fan.theatre.Recording.load,
        partial(fan.load_score, arm),
    )
    for read in readers:
        with pytest.raises((FileError, ValueError)) as caught:
            read(name)
        assert not isinstance(caught.value, OSError), read


@pytest.mark.parametrize("name", IMPOSSIBLE_NAMES[:3], ids=["ASCII", "an ending", "two bytes each"])
def test_a_name_that_is_too_long_is_a_mistake_on_the_command_line(name, tmp_path) -> None:
    for command in (
        ("check",),
        ("info",),
        ("equations",),
        ("simulate",),
        ("plan",),
        ("optimise",),
        ("play",),
        ("perform",),
        ("identify",),
        ("stand", "check"),
        ("show",),
        ("follow", "jumps"),
        ("follow",),
        ("check", "-q", "arm2d", "--inputs"),
        ("simulate", "-q", "arm2d", "--inputs"),
    ):
        more = {("stand", "check"): ("run.npz",), ("follow",): ("marionette",)}.get(command, ())
        stderr = mistake(*command, name, *more)
        assert "internal error" not in stderr, command
    (tmp_path / "r.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    assert mistake("import", name, tmp_path / "r.yaml")
    assert mistake("import", tmp_path / "r.urdf", f"{name}.yaml")
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"scene: s\npuppets:\n  - {{name: a, puppet: {name}}}\n")
    assert f"{scene}:3:" in mistake("check", scene)
