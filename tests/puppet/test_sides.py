"""Warnings on the halves of a puppet: missing twins, wrong sides, long strings."""

from __future__ import annotations

import pytest

import fantoccini as fan
from fantoccini.dynamics.equilibrium import warnings

PAIR = """
puppet: pair
bodies:
  - {name: torso, joint: {type: free, at: [0, 0, 0.4]}, mass: 1, inertia: [0.01, 0.01, 0.01]}
  - {name: arm_left, parent: torso, mass: 0.1, com: [0, 0, -0.1], inertia: [1e-3, 1e-3, 1e-4],
     joint: {name: shoulder_left, type: ball, at: [0, 0.06, 0.1]}}
  - {name: leg_left, parent: torso, mass: 0.1, com: [0, 0, -0.1], inertia: [1e-3, 1e-3, 1e-4],
     joint: {name: hip_left, type: ball, at: [0, 0.04, -0.1]}}
strings:
  - {name: top, path: [{body: torso, at: [0, 0, 0.1]}, {driven: [x], at: [0, 0, 1.0]}],
     length: driven}
  - {name: hand_left, path: [{body: arm_left, at: [0, 0, -0.2]}, {driven: [x], at: [0, 0.06, 1.0]}],
     length: driven}
mirror: {plane: xz, from: left, to: right}
pose: {top.length: 0.5}
"""

WRONG = {
    "a string without its word": (
        "name: hand_left, path",
        "name: hand, path",
        "found 'hand' without 'left', though the string holds arm_left",
    ),
    "a part on the other side": (
        "[0, 0.04, -0.1]",
        "[0, -0.04, -0.1]",
        "found leg_left on the side of the parts named right",
    ),
    "twins in one another": (
        "[0, 0.06, 0.1]",
        "[0, 0, 0.1]",
        "found arm_left and arm_right in one another",
    ),
    "a string that is a metre too long": (
        "top.length: 0.5",
        "top.length: 1.5",
        "found 1.5 m; in the start pose its path measures 0.5 m: it is slack by 1 m",
    ),
}


def remarks(text: str) -> list[str]:
    return [remark for _, remark in warnings(fan.loads(text))]


def test_a_symmetric_puppet_gets_no_remark() -> None:
    assert remarks(PAIR) == []


@pytest.mark.parametrize(("old", "new", "remark"), WRONG.values(), ids=WRONG)
def test_an_asymmetry_is_remarked(old, new, remark) -> None:
    assert PAIR.count(old) == 1
    (first,) = remarks(PAIR.replace(old, new))
    assert first.startswith(remark)


def test_pairs_are_found_by_name_without_a_mirror() -> None:
    arm = "- {name: arm_left, parent: torso, mass: 0.1, com: [0, 0, -0.1],"
    swapped = PAIR.replace("mirror: {plane: xz, from: left, to: right}\n", "")
    twin = """  - {name: arm_right, parent: torso, mass: 0.1, com: [0, 0, -0.1],
     inertia: [1e-3, 1e-3, 1e-4], joint: {name: shoulder_right, type: ball, at: [0, -0.06, 0.1]}}
strings:"""
    assert arm in swapped
    both = swapped.replace("strings:", twin)
    (remark,) = remarks(both)
    assert remark.startswith("found 'hand_left' and no string 'hand_right'")
    assert "such as arm_left and arm_right" in remark
    for name in ("hand_right", "other"):  # a string of the twin body is the twin by any name
        tied = f"""
  - {{name: {name}, path: [{{body: arm_right}}, {{driven: [x], at: [0, -0.06, 1.0]}}],
     length: driven}}
pose:"""
        assert remarks(both.replace("\npose:", tied)) == []
    held = both.replace("name: hand_left, path", "name: hand_right, path")
    (remark,) = remarks(held)
    assert remark.startswith("found 'hand_right' for a string that holds")


def test_members_of_a_scene_may_face_one_another() -> None:
    assert warnings(fan.puppets.visit()) == []
