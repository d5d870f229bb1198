"""Arguments, exit codes, and the streams of text."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.app.cli import doctor
from fantoccini.app.cli_support.terminal import escape_unprintable
from fantoccini.base.errors import BuildError
from fantoccini.model.puppet import bundled_files
from fantoccini.stand import stand_names
from fantoccini.theatre.plays import play_names

pytestmark = pytest.mark.medium

ROOT = Path(__file__).resolve().parents[2]


COMMANDS = (
    "check",
    "schema",
    "info",
    "rig",
    "rest",
    "equations",
    "export",
    "import",
    "simulate",
    "plan",
    "optimise",
    "identify",
    "follow",
    "mapping",
    "play",
    "show",
    "perform",
    "take",
    "validate-reduction",
    "stand",
    "demo",
    "cache",
    "doctor",
)
SUBCOMMANDS = ("stand check", "stand export", "stand stream", "stand emulate")
"""Commands within groups."""


def test_help_names_every_command_and_the_exit_codes() -> None:
    text = fantoccini("--help").stdout
    for command in COMMANDS:
        assert f"\n  {command} " in text
    for code in ("0 done", "1 the run", "2 mistakes", "130 stopped"):
        assert code in " ".join(text.split())


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("play", "tri"),
            ": found nothing here, and no bundled play of this name; did you mean 'trio'?",
        ),
        (("play", "nosuch"), "; the names are chase, duet, park, trio"),
        (("perform", "tri"), "; did you mean 'trio'?"),
        (("check", "tri"), "; did you mean 'trio'?"),
        (("check", "marionete"), "; did you mean 'marionette'?"),
        (("check", "nosuch"), "no such file, and no bundled puppet, scene, play or stand"),
        (("simulate", "marionete"), "; did you mean 'marionette'?"),
        (("follow", "jump", "marionette"), "; did you mean 'jumps'?"),
        (("follow", "nosuch.bvh", "marionette"), "nosuch.bvh: cannot be read: no such file"),
        (("follow", "jumps", "marionete"), "; did you mean 'marionette'?"),
        (("mapping", "jump"), "; did you mean 'jumps'?"),
    ],
)
def test_a_wrong_name_is_told_at_once_in_one_line(arguments, sentence) -> None:
    (line,) = mistake(*arguments).splitlines()
    assert sentence in line


def test_the_documentation_names_every_option() -> None:
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    for command in (*COMMANDS, *SUBCOMMANDS):
        assert f"fantoccini {command}" in text
        for word in fantoccini(*command.split(), "--help").stdout.split():
            if word.startswith("--") and word.strip(",") != "--help":
                assert word.strip(",") in text, (command, word)


def test_help_loads_nothing_that_only_some_commands_need() -> None:
    code = (
        "import sys; from fantoccini.app.cli.app import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('sympy', 'matplotlib', 'rich.progress', 'imageio_ffmpeg')"
        " if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_version() -> None:
    assert fantoccini("--version").stdout.strip() == fan.__version__


WRONG = {
    "no command": ([], "Usage"),
    "an unknown command": (["bogus"], "No such command"),
    "an unknown option": (["check", "--bogus", "arm2d"], "No such option"),
    "no file": (["check"], "Missing argument"),
    "a name like a bundled one": (["info", "marionete"], "did you mean 'marionette'?"),
    "a file that is not there": (["info", "none.yaml"], "none.yaml: found nothing here"),
    "a folder": (["info", "."], "found a folder here"),
    "an unknown schema": (["schema", "foo"], "puppet"),
    "a puppet as a play": (["perform", fan.puppets.path("arm2d")], "is not a play"),
    "a play that is not there": (["perform", "none.yaml"], "none.yaml"),
    "messages without a port": (["perform", "p.yaml", "--osc-in", "host"], "needed: HOST:PORT"),
    "OSC messages to the own port": (
        ["perform", "p.yaml", "--osc-in", "53001", "--osc-out", "127.0.0.1:53001"],
        "needed: another address",
    ),
    "a negative duration": (["simulate", "arm2d", "--duration", "-1"], "not a positive number"),
    "no duration": (["simulate", "arm2d", "--duration", "0"], "not a positive number"),
    "a duration that is no number": (["simulate", "arm2d", "--duration", "nan"], "nan is not"),
    "a duration without end": (["simulate", "arm2d", "--duration", "inf"], "inf is not"),
    "a word for a duration": (["simulate", "arm2d", "--duration", "x"], "--duration"),
    "a very long duration": (["simulate", "arm2d", "--duration", "1e9"], "longer than 3600 s"),
    "an unknown method": (["simulate", "arm2d", "--method", "euler"], "timestepping"),
    "a step of the other method": (["simulate", "arm2d", "--dt", "0.001"], "timestepping"),
    "a tolerance of the other method": (
        ["simulate", "arm2d", "--method", "timestepping", "--rtol", "1e-6"],
        "applies to --method event only",
    ),
    "a tolerance out of range": (["simulate", "arm2d", "--rtol", "1e-30"], "between 1e-13"),
    "no equals sign": (["simulate", "arm2d", "--start", "elbow"], "needed: NAME=VALUE"),
    "a start twice": (
        ["simulate", "arm2d", "--start", "elbow=1", "--start", "elbow=2"],
        "given twice",
    ),
    "a start that is no number": (["simulate", "arm2d", "--start", "elbow=x"], "needed: an angle"),
    "two numbers for a coordinate": (
        ["simulate", "arm2d", "--start", "v:elbow=1,2"],
        "needed: one",
    ),
    "a component of a quaternion": (
        ["simulate", "arm3d", "--start", "shoulder.qw=1"],
        ".rotation=w,x,y,z",
    ),
    "an output without ending": (["simulate", "arm2d", "--out", "x"], "has no ending"),
    "an output with another ending": (["simulate", "arm2d", "--out", "x.txt"], ".npz, .csv"),
    "an output in no folder": (["simulate", "arm2d", "--out", "no/x.npz"], "there is no folder"),
    "an output twice": (
        ["simulate", "arm2d", "--out", "x.png", "--plot", "x.png"],
        "is given twice",
    ),
    "a film of plots": (["simulate", "arm2d", "--plot", "x.mp4"], ".png, .svg, .pdf"),
    "a report of another kind": (
        ["identify", "swing.yaml", "--report", "x.pdf"],
        "allowed: .json, .html",
    ),
    "a report in no folder": (
        ["identify", "swing.yaml", "--report", "no/x.html"],
        "there is no folder",
    ),
    "a report that is a record": (["identify", "none.yaml", "--report", "x.html"], "none.yaml"),
    "an export into no folder": (["export", "arm2d", "no/x"], "there is no folder"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_mistakes(arguments, message, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = fantoccini(*arguments)
    assert result.exit_code == 2
    assert message in " ".join((result.stdout + result.stderr).split())
    assert list(tmp_path.iterdir()) == []


COMPILED = {
    "an unknown coordinate": ("elbo=1", "did you mean 'elbow'?"),
    "not a number": ("elbow=nan", "must be finite"),
    "a velocity of a driven coordinate": ("v:hand.x=1", "would jump at"),
    "a string that cannot reach": ("hand.length=0.1", "no state of the puppet was found"),
}


@pytest.mark.parametrize(("start", "message"), COMPILED.values(), ids=COMPILED)
def test_an_impossible_start_is_a_mistake(start, message) -> None:
    assert message in mistake("simulate", "arm2d", "--quiet", "--start", start)


def test_names_are_neither_markup_nor_control_characters(tmp_path) -> None:
    path = tmp_path / "[red]x[red]\x1b[31m.yaml"
    assert mistake("check", path).startswith(escape_unprintable(path))
    path.write_text("puppet: '[bold]\\x1b'\n")
    text = mistake("check", path)
    assert "[red]x[red]\\x1b[31m.yaml:1: puppet: found '[bold]" in text
    assert "\x1b" not in text


def test_plain_text_keeps_letters_and_line_breaks() -> None:
    assert (
        escape_unprintable("héllo\n\N{GREEK SMALL LETTER THETA}")
        == "héllo\n\N{GREEK SMALL LETTER THETA}"
    )
    assert escape_unprintable("a\x1b\x07\u202e\udcff") == "a\\x1b\\x07\\u202e\\udcff"


@pytest.mark.parametrize("of", ["puppet", "scene", "inputs", "play", "problem", "task"])
def test_schema_is_json(of) -> None:
    assert json.loads(fantoccini("schema", of).stdout)["type"] == "object"


def test_doctor_reports_versions_compiler_and_cache() -> None:
    result = fantoccini("doctor")
    labels = [line.split("  ")[0] for line in result.stdout.splitlines()]
    assert {"fantoccini", "python", "casadi", "compiler", "cache", "ffmpeg"} <= set(labels)
    assert result.exit_code == (1 if result.stderr else 0)


def test_doctor_ends_with_1_if_something_is_missing(monkeypatch) -> None:
    monkeypatch.setattr(doctor, "describe", lambda: {"compiler": "none", "problem": "no compiler"})
    monkeypatch.setattr(doctor, "required_distributions", lambda: ["numpy", "no-such-distribution"])
    result = fantoccini("doctor")
    assert result.exit_code == 1
    assert "no-such-distribution is missing" in result.stderr
    assert "no compiler" in result.stderr


def test_doctor_looks_for_every_dependency() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = {canonicalize_name(Requirement(line).name) for line in project["dependencies"]}
    assert {canonicalize_name(name) for name in doctor.required_distributions()} == wanted


def test_no_compiler_ends_with_1(monkeypatch) -> None:
    monkeypatch.setenv("FANTOCCINI_CXX", "no-such-compiler")
    result = fantoccini("simulate", "arm2d")
    assert result.exit_code == 1
    assert "no-such-compiler" in result.stderr
    assert "Traceback" not in result.stderr
    assert (
        "cannot be compiled on this machine (see fantoccini doctor)"
        in fantoccini("info", "arm2d").stdout
    )


def test_an_internal_error_is_one_line(monkeypatch) -> None:
    def broken(*_):
        raise ZeroDivisionError("[bold]\x1b")

    monkeypatch.setattr("fantoccini.app.cli.check.load_marionette", broken)
    result = fantoccini("check", "arm2d")
    assert result.exit_code == 1
    assert "internal error: ZeroDivisionError: [bold]\\x1b" in result.stderr
    monkeypatch.setenv("FANTOCCINI_TRACEBACK", "1")
    assert isinstance(fantoccini("check", "arm2d").exception, ZeroDivisionError)


def test_a_build_that_fails_ends_with_1(monkeypatch) -> None:
    def fails(*_):
        raise BuildError("the compiler failed")

    monkeypatch.setattr("fantoccini.app.cli.simulate.load_marionette", fails)
    result = fantoccini("simulate", "arm2d")
    assert (result.exit_code, result.stderr.splitlines()[-1]) == (
        1,
        "fantoccini: the compiler failed",
    )


def test_info_lists_the_bundled_puppets() -> None:
    text = fantoccini("info").stdout
    assert all(f"\n{name} " in text for name in (*fan.puppets.names(), *fan.puppets.scenes()))
    for title, names in {
        "Plays, for `play` and `perform`": play_names(),
        "Performances, for `--inputs`": bundled_files.performances(),
        "Clips, for `follow`": fan.theatre.clip_names(),
        "Gestures, for scores and plays": fan.theatre.gesture_names(),
        "Stands, for `stand`": stand_names(),
    }.items():
        assert names and f"{title}: {', '.join(names)}" in text


def test_info_describes_a_puppet() -> None:
    text = fantoccini("info", "arm3d").stdout
    for part in ("4 degrees of freedom", "shoulder.qw", "elbow.lower", "-0.034907 rad", "dynamics"):
        assert part in text
    assert "m1" in fantoccini("info", "arm2d").stdout


def test_info_shows_existing_winches(tmp_path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(
        "puppet: p\nbodies: [{name: b, joint: {type: translation, axes: [z]}, mass: 1}]\nstrings:\n"
        "  - {name: firm, path: [{body: b}, {world: [0, 0, 1]}], length: 1}\n"
        "  - {name: slips, path: [{body: b}, {world: [0, 0, 1]}], length: 1,\n"
        "     max_tension: {parameter: grip, value: 7.5}, rewind_speed: 0.125}\n"
    )
    text = fantoccini("info", str(path)).stdout
    for part in ("max tension", "rewind speed", "grip = 7.5", "0.125"):
        assert part in text
    assert "restitution" not in text
    assert "max tension" not in fantoccini("info", "arm2d").stdout


def test_info_describes_drives(tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(
        "puppet: p\nbodies: [{name: b, joint: {type: translation, axes: [z]}, mass: 1}]\n"
        "strings: [{name: s, path: [{body: b}, {world: [0, 0, 1]}], length: driven}]\n"
        "pose: {b.z: 0.2}\n"
        "drives: [{on: s.length, mass: 1.5, control: {type: pd, stiffness: 9, damping: 1}}]\n"
    )
    text = fantoccini("info", str(path)).stdout
    assert "Drives" in text and "1.5 kg" in text and "pd" in text


def test_check_counts_and_lists_mistakes_of_all_files(tmp_path) -> None:
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text("puppet: a\nflor: 1\nbodies: []\n")
    second.write_text("puppet: b\n")
    result = fantoccini("check", first, "arm2d", second)
    assert result.exit_code == 2
    lines = result.stdout.splitlines()
    assert lines[0] == "arm2d: no mistakes; 2 DOF, 1 strings, 2 driven"
    assert lines[1].startswith("arm2d: 0.2 kg, ")
    assert [line.split(": ")[1] for line in result.stderr.splitlines()] == [
        "flor",
        "bodies",
        "bodies",
    ]


def test_a_file_of_another_kind_is_named(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    arm = fan.puppets.arm2d()
    fan.simulate(arm, arm.rest(), t_end=0.05).save("run.npz")
    for command in ("simulate", "info", "check"):
        message = mistake(command, "run.npz")
        assert "run.npz: found a motion; needed: a puppet. `fantoccini show run.npz`" in message
    puppet = fan.puppets.path("arm2d")
    assert "this is a puppet file; a problem file has the keys" in mistake("plan", puppet)
    assert "this is a puppet file; a task file has the keys" in mistake("optimise", puppet)
