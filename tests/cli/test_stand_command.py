"""`fantoccini stand check`, and the output of `check` and `schema` for stands."""

from __future__ import annotations

import json

import pytest
from tests.cli.command import fantoccini as command
from tests.stand.hoist import HOIST, STAND, lift

import fantoccini as fan


def fantoccini(*arguments, code=0):
    """The result of a command that ends with an exit code."""
    done = command(*arguments)
    assert done.exit_code == code, (done.stdout, done.stderr, done.exception)
    return done


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stand")
    (folder / "hoist.yaml").write_text(HOIST)
    text = "puppet: hoist.yaml\n" + STAND.replace("    speed: 1\n", "    speed: 2\n").lstrip()
    (folder / "good.yaml").write_text(text.replace("TORQUE", "0.5"))
    (folder / "weak.yaml").write_text(text.replace("TORQUE", "[[0, 0.05], [20, 0.04]]"))
    lift(fan.load(folder / "hoist.yaml")).save(folder / "run.npz")
    return folder


def test_a_sufficient_stand(files):
    done = fantoccini("stand", "check", files / "good.yaml", files / "run.npz")
    assert "one_winch can do it: the smallest margin is 14 %, the travel of winch" in done.stdout
    assert done.stdout.splitlines()[0] == "Margins [%]"


def test_an_insufficient_stand(files):
    page = files / "page.html"
    done = fantoccini(
        "stand", "check", files / "weak.yaml", files / "run.npz", "--report", page, code=1
    )
    assert "cannot do it: at t = 0." in done.stdout
    assert "winch loses" in done.stdout and "remedy: winch: a motor with" in done.stdout
    assert "slower, simulated again: 1." in done.stdout and "moves differently" in done.stdout
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/png") == 2 and "https://" not in text


def test_json(files):
    done = fantoccini(
        "stand", "check", files / "weak.yaml", files / "run.npz", "--json", "--no-slower", code=1
    )
    data = json.loads(done.stdout)
    assert data["ok"] is False and data["first"]["quantity"] == "torque"
    assert data["lost_steps"]["winch"]["since"] == data["first"]["broken"]
    assert data["slower"] is None and done.stderr == ""
    done = fantoccini("stand", "check", files / "good.yaml", files / "run.npz", "--json")
    data = json.loads(done.stdout)
    assert data["ok"] is True and data["first"] is None and data["remedies"] == []


def test_wrong_arguments(files):
    wrong = {
        "the name of a bundled stand; did you mean 'desktop6'": ("desktop", files / "run.npz"),
        "winch.moves.line.length: line.length is not a driven": (
            files / "good.yaml",
            _other(files),
        ),
        "arm2d has other coordinates than the run": (
            files / "good.yaml",
            files / "run.npz",
            "--puppet",
            "arm2d",
        ),
        "allowed: .html": (files / "good.yaml", files / "run.npz", "--report", files / "page.pdf"),
    }
    for words, arguments in wrong.items():
        done = fantoccini("stand", "check", *arguments, code=2)
        assert words in " ".join(done.stderr.split()), done.stderr


def _other(files):
    path = files / "other.npz"
    arm = fan.puppets.arm2d()  # has no string of this name
    fan.simulate(arm, arm.rest(), t_end=0.1, method="timestepping").save(path)
    return path


def test_check_and_schema_know_stands(files):
    (files / "move.yaml").write_text(
        "duration: 1\ncoordinates:\n  head.length: [[0, 0.72], [1, 0.7]]\n"
    )
    done = fantoccini("check", files / "good.yaml", "six_winches")
    assert f"{files / 'good.yaml'}: no mistakes; 1 axes, moves hoist" in done.stdout
    assert "six_winches: no mistakes; 6 axes, moves stand6" in done.stdout
    fantoccini("check", "six_winches", "--inputs", files / "move.yaml")
    (files / "bad.yaml").write_text(
        "stand: bad\npuppet: stand6\naxes:\n  knees:\n"
        + STAND.split("  winch:\n")[1].replace("TORQUE", "1").replace("line.l", "knees.l")
    )
    done = fantoccini("check", files / "bad.yaml", "--inputs", files / "move.yaml", code=2)
    assert "bad.yaml:3: axes: no axis moves head.length" in done.stderr
    assert json.loads(fantoccini("schema", "stand").stdout)["title"] == "fantoccini stand"


def test_export_and_dry_run(files):
    out = files / "out.gcode"
    arguments = (files / "good.yaml", files / "run.npz")
    done = fantoccini("stand", "export", *arguments, out, "--controller", "grbl", "--slack", "5")
    assert "76 set points of 1 axes, 1.5 s" in done.stdout
    sent = [line for line in out.read_text().splitlines() if not line.startswith(";")]
    before = sorted(files.iterdir())
    dry = fantoccini(
        "stand",
        "stream",
        *arguments,
        "--controller",
        "grbl",
        "--slack",
        "5",
        "--dry-run",
        "--port",
        files / "none",
    )
    assert dry.stdout.splitlines() == sent
    assert sorted(files.iterdir()) == before


def test_export_refuses_impossible_options(files):
    weak = (files / "weak.yaml", files / "run.npz", files / "weak.csv", "--controller", "csv")
    done = fantoccini("stand", "export", *weak, code=1)
    assert "cannot do it" in done.stderr and "--force" in done.stderr
    assert not (files / "weak.csv").exists()
    for option in ("--force", "--anyway"):  # the second is the former name of the first
        fantoccini("stand", "export", *weak, option)
        assert (files / "weak.csv").exists()
        (files / "weak.csv").unlink()
    good = (files / "good.yaml", files / "run.npz")
    done = fantoccini("stand", "export", *good, files / "a.bvh", "--controller", "csv", code=2)
    assert ".gcode" in done.stderr
    done = fantoccini("stand", "export", *good, files / "a.csv", "--controller", "cvs", code=2)
    assert "did you mean 'csv'" in done.stderr
    done = fantoccini("stand", "stream", *good, "--controller", "grbl", code=2)
    assert "needed: --port" in done.stderr
