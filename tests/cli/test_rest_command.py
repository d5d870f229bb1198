"""``fantoccini rest``: lengths, tensions, slack, contact, a picture, and mistakes."""

from __future__ import annotations

import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan

HUNG = """
puppet: hung
bodies:
  - name: plumb
    mass: 2.0
    joint: {name: slide, type: prismatic, axis: [0, 0, 1]}
strings:
  - {name: fixed, path: [{body: plumb}, {world: [0, 0, 1]}], length: 0.4}
  - {name: loose, path: [{body: plumb}, {world: [0, 0, 1]}], length: 0.45}
  - {name: reel, path: [{body: plumb}, {world: [0, 0, 1]}], length: driven}
pose: {slide: 0.25}
"""


def test_the_weight_hangs_from_the_shorter_string(tmp_path):
    path = tmp_path / "hung.yaml"
    path.write_text(HUNG, encoding="utf-8")
    done = fantoccini("rest", path, "--start", "reel.length=1.0", "--quiet")
    assert done.exit_code == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["fixed", "0.400000", f"{2.0 * 9.81:.4f}", "taut"] in lines
    assert ["loose", "0.450000", "0.0000", "slack", "by", "50.0", "mm"] in lines


def test_a_string_that_carries_nothing_is_not_called_taut(tmp_path):
    """A level string on an upright slide."""
    path = tmp_path / "hung.yaml"
    text = HUNG.replace("[0, 0, 1]}], length: driven", "[0.3, 0, 0.6]}], length: driven")
    path.write_text(text, encoding="utf-8")
    done = fantoccini("rest", path, "--start", "reel.length=0.3", "--quiet")
    assert done.exit_code == 0, done.stderr
    (line,) = [line.split() for line in done.stdout.splitlines() if line.startswith("reel ")]
    assert line[2:] == ["0.0000", "straight,", "without", "tension"]


def test_its_last_lines_begin_a_file_of_inputs(tmp_path):
    done = fantoccini("rest", "arm2d", "--start", "hand.length=0.8", "--quiet")
    assert done.exit_code == 0, done.stderr
    path = tmp_path / "lift.csv"
    lines = done.stdout.splitlines()[-2:]
    path.write_text("\n".join([*lines, "1,0.45,0.7"]) + "\n", encoding="utf-8")
    arm = fan.puppets.arm2d()
    inputs = fan.Input.load(arm, path)
    assert inputs.first_values() == {"hand.x": 0.45, "hand.length": 0.8}


def test_info_gives_the_length_at_which_a_string_is_just_taut(tmp_path):
    path = tmp_path / "hung.yaml"
    path.write_text(HUNG, encoding="utf-8")
    assert "0.75, just taut" in fantoccini("info", path).stdout


def test_it_draws_the_puppet(tmp_path):
    path = tmp_path / "arm.png"
    assert fantoccini("rest", "arm2d", "--out", path, "--quiet").exit_code == 0
    assert path.read_bytes()[:4] == b"\x89PNG"


WRONG = {
    "an unknown puppet": (["arm2"], "did you mean 'arm2d'?"),
    "an unknown coordinate": (["arm2d", "--start", "hand=1"], "hand"),
    "a picture of another kind": (["arm2d", "--out", "x.txt"], "x.txt"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_mistakes(arguments, message):
    assert message in " ".join(mistake("rest", *arguments).split())


def test_runs_and_stands_are_no_puppets(tmp_path):
    """A run was "larger than 2 MB", and a bundled stand an unknown puppet."""
    with pytest.raises(
        fan.errors.PuppetError, match=r"found a run or inputs.*fan\.Trajectory\.load"
    ):
        fan.load(tmp_path / "run.npz")
    assert "found a bundled stand" in fantoccini("info", "six_winches").stderr
