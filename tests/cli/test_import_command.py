"""``fantoccini import``: files, report, exit codes."""

from __future__ import annotations

import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan

MODEL = """<mujoco model="swing">
  <worldbody>
    <body name="seat" pos="0 0 1"><joint name="rope" axis="0 1 0"/>
      <geom type="cylinder" size="0.1 0.2"/></body>
  </worldbody>
  <actuator><motor name="push" joint="rope"/></actuator>
  <keyframe><key name="up" qpos="0.5"/></keyframe>
</mujoco>"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "swing.xml").write_text(MODEL)
    return tmp_path


def test_the_puppet_is_written_and_the_report_printed(folder):
    result = fantoccini("import", "swing.xml", "swing.yaml", "--keyframe", "up")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[0] == (
        "swing.xml:6: actuator push: left out: the joint or body that it moves is free"
    )
    assert "swing.yaml: 1 joint, 1 mesh beside it; 2 differences from the model" in result.stderr
    assert (folder / "swing_meshes" / "cylinder.stl").is_file()
    assert fan.model.load("swing.yaml").pose == {"rope": 0.5}
    assert fantoccini("check", "swing.yaml").exit_code == 0


def test_quiet_prints_nothing(folder):
    result = fantoccini("import", "swing.xml", "swing.yaml", "-q")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")


def test_an_existing_file_is_kept(folder):
    (folder / "swing.yaml").write_text("mine")
    assert "swing.yaml exists already; use --force" in " ".join(
        mistake("import", "swing.xml", "swing.yaml").split()
    )
    assert (folder / "swing.yaml").read_text() == "mine"
    assert fantoccini("import", "swing.xml", "swing.yaml", "--force").exit_code == 0
    assert (folder / "swing.yaml").read_text().startswith("# swing: converted from")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none.xml", "a.yaml"), "none.xml: found nothing here"),
        (("swing.xml", "a.xml"), "allowed: .yaml, .yml"),
        (("swing.xml", "none/a.yaml"), "there is no folder none"),
        (("swing.xml", "a.yaml", "--keyframe", "down"), "no keyframe is called 'down'"),
        (("broken.xml", "a.yaml"), "broken.xml:2: MuJoCo says: "),
    ],
)
def test_wrong_arguments_are_mistakes(arguments, message, folder):
    (folder / "broken.xml").write_text("<mujoco>\n<bodies/></mujoco>")
    assert message in " ".join(mistake("import", *arguments).split())
    assert not (folder / "a.yaml").exists()


def test_info_shows_rotors(folder):
    (folder / "swing.xml").write_text(MODEL.replace("axis=", 'armature="0.25" axis='))
    assert fantoccini("import", "swing.xml", "swing.yaml").exit_code == 0
    lines = fantoccini("info", "swing.yaml").stdout.splitlines()
    assert any("armature" in line for line in lines)
    assert any("seat" in line and "0.25" in line for line in lines)
