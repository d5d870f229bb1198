"""``fantoccini rig``: the map is written into the file, whose comments and layout stay."""

from __future__ import annotations

import shutil

import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.base.documents import with_section
from fantoccini.base.errors import StateError

pytestmark = pytest.mark.medium


@pytest.fixture
def copy(tmp_path):
    """A copy of the bundled marionette's file."""
    return shutil.copy(fan.puppets.path("marionette"), tmp_path / "own.yaml")


def test_it_writes_the_guess_and_leaves_the_rest_as_it_was(copy):
    before = copy.read_text(encoding="utf-8")
    done = fantoccini("rig", copy)
    assert done.exit_code == 0, done.stderr
    after = copy.read_text(encoding="utf-8")
    assert after.startswith(before + "rig:\n")
    assert "upper_arm_right" not in after[len(before) :]  # the mirror makes the other half
    assert fan.load(copy).body_map == fan.load(fan.puppets.path("marionette")).body_map
    assert copy.with_name("own_rig.png").read_bytes()[:4] == b"\x89PNG"
    assert "arm_left" in done.stdout
    assert "the puppet looks along 1, 0, 0 in the frame of torso" in done.stdout


def test_it_replaces_a_rig_only_if_asked(copy):
    text = copy.read_text(encoding="utf-8").replace(
        "strings:\n", "rig: # own\n  looking: [hand_left] # wrong\n# end\n\nstrings:\n"
    )
    copy.write_text(text, encoding="utf-8")
    assert "has a rig already; use --force" in mistake("rig", copy)
    assert copy.read_text(encoding="utf-8") == text
    assert fantoccini("rig", copy, "--force", "--quiet").exit_code == 0
    after = copy.read_text(encoding="utf-8")
    assert "looking: [head]\n# end\n\nstrings:\n" in after
    assert "wrong" not in after and "# The shoulders carry" in after


def test_it_refuses_bundled_puppets_scenes_and_puppets_without_limbs(tmp_path):
    assert "is a bundled puppet; copy" in mistake("rig", "marionette")
    scene = shutil.copy(fan.puppets.path("promenade"), tmp_path / "scene.yaml")
    assert "is a scene; name the file of one of its puppets" in mistake("rig", scene)
    arm = shutil.copy(fan.puppets.path("arm2d"), tmp_path / "arm.yaml")
    before = arm.read_text(encoding="utf-8")
    assert "has no body map" in mistake("rig", arm, "--quiet")
    assert arm.read_text(encoding="utf-8") == before


def test_info_prints_the_map_or_the_reason():
    done = fantoccini("info", "marionette_bar")
    assert "its strings hang from bar" in done.stdout
    assert "no body map: crane has no body map" in fantoccini("info", "crane").stdout


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: 1 # one\n", "a: 1 # one\nrig: 2\n"),
        ("a: 1", "a: 1\nrig: 2\n"),
        ("a: 1\n...\n", "a: 1\nrig: 2\n...\n"),
        ("rig: {b: 3} # old\n\n# next\nc: 4\n", "rig: 2\n\n# next\nc: 4\n"),
        ("a: 1\nrig:\n  - x\n  - {y: 1}\n\n# next\n", "a: 1\nrig: 2\n\n# next\n"),
    ],
)
def test_a_section_is_replaced_or_added(text, expected):
    assert with_section(text, "rig", "rig: 2\n") == expected


def test_a_text_in_braces_is_refused():
    with pytest.raises(StateError, match="in braces"):
        with_section("{a: 1}", "rig", "rig: 2\n")
