"""Implausible values that are no mistakes: `check` warns of them, and prints sizes.

The bundled puppets, the examples and the bundled performances give no warning.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.dynamics.equilibrium import input_warnings, warnings
from fantoccini.dynamics.marionette import loads
from fantoccini.model.tree import measure
from fantoccini.theatre.script import is_score

pytestmark = pytest.mark.medium

ROOT = Path(__file__).resolve().parents[2]
PERFORMANCES = {
    "conduct": "stand6",
    "dance": "marionette_bar",
    "flap": "heron",
    "greeting": "marionette",
    "hello": "hans",
    "hoist": "crane",
    "parade": "airplane",
    "roar": "dragon",
    "stir": "arm3d",
    "stroll": "stroll",
    "toss": "arm2d",
    "visit": "visit",
    "wag": "dachshund",
    "walk": "promenade",
}

DOG = """\
puppet: dog
bodies:
  - name: trunk
    joint: {type: free}
    shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.038, density: 480}]
  - name: neck
    parent: trunk
    joint: {type: ball, at: [0.1, 0, 0.02], cone: {max: 50 deg, axis: [0, 0, 1]}}
    shapes: [{type: sphere, radius: 0.03, at: [0.02, 0, 0.03], mass: 0.05}]
  - name: leg
    parent: trunk
    joint: {name: hip, type: revolute, axis: [0, -1, 0], at: [-0.09, 0, -0.02],
      limits: {lower: -60 deg, upper: 80 deg}, spring: {stiffness: 0.01, rest: 0.1}}
    mass: 0.04
    inertia: [1e-5, 1e-5, 1e-5]
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.05], radius: 0.017}]
strings:
  - {name: front, path: [{body: trunk, at: [0.085, 0, 0.04]}, {world: [0.08, 0, 0.65]}],
     length: 0.6}
  - {name: rear, length: driven,
     path: [{body: trunk, at: [-0.09, 0, 0.04]}, {driven: [x, z], at: [-0.09, 0, 0.65]}]}
pose: {hip: 10 deg, neck.rotation: [0.2, 0, 0], rear.length: 0.61}
"""


@pytest.fixture
def dog(tmp_path, monkeypatch):
    """A function that checks the dog with some text replaced: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def check(old: str = "", new: str = "", *more: object):
        assert old in DOG
        Path("dog.yaml").write_text(DOG.replace(old, new) if old else DOG)
        return fantoccini("check", "dog.yaml", *more)

    return check


def test_check_prints_size_mass_and_height(dog):
    result = dog()
    assert (result.exit_code, result.stderr) == (0, "")
    size = measure(loads(DOG).tree, float)
    assert size.hanging_height == pytest.approx(0.65 + 0.02 + 0.05 + 0.017, abs=0.01)
    assert size.lengths[1] == pytest.approx(0.076)
    lengths = " x ".join(f"{x:.3g}" for x in size.lengths)
    assert result.stdout.splitlines() == [
        "dog.yaml: no mistakes; 10 DOF, 2 strings, 3 driven",
        f"dog.yaml: {size.mass:.4g} kg, {lengths} m (x, y, z); "
        f"its strings begin {size.hanging_height:.3g} m above its lowest point",
    ]


IMPLAUSIBLE = {
    "millimetres": (
        "radius: 0.038",
        "radius: 38",
        {
            "5: bodies[0].shapes": "found a body that measures 76.2 m; usual: 0.0001 to 20 m",
            "2: bodies": " t in all; usual: 0.001 g to 20 t",
        },
    ),
    "g/cm^3": ("480", "0.48", {"5: bodies[0].shapes[0].density": "in g/cm^3? then write 480"}),
    "kg for g": (
        "mass: 0.05",
        "mass: 50",
        {"9: bodies[1].shapes[0].mass": "found 50 kg in 0.000113 m^3, 4.42e+05 kg/m^3; usual: "},
    ),
    "kg for g of a body": ("mass: 0.04", "mass: 40", {"14: bodies[2].mass": "found 40 kg in "}),
    "inertia in g mm^2": (
        "inertia: [1e-5, 1e-5, 1e-5]",
        "inertia: [1e4, 1e4, 1e4]",
        {"15: bodies[2].inertia": "found a radius of gyration of 500 m"},
    ),
    "a limit in degrees": (
        "lower: -60 deg",
        "lower: -60",
        {
            "13: bodies[2].joint.limits.lower": "found -60 rad, 9.55 turns; usual: a limit "
            "within a full turn; is it -60 deg?"
        },
    ),
    "a limit of two turns": (
        "upper: 80 deg",
        "upper: 720 deg",
        {"13: bodies[2].joint.limits.upper": "2 turns; usual: a limit within a full turn"},
    ),
    "a rest in degrees": (
        "rest: 0.1",
        "rest: 30",
        {"13: bodies[2].joint.spring.rest": "is it 30 deg?"},
    ),
    "a pose beyond its limit": (
        "hip: 10 deg",
        "hip: 3",
        {"22: pose.hip": "found 3 rad, beyond the joint's limits, -1.047 to 1.396 rad"},
    ),
    "a pose in degrees": ("hip: 10 deg", "hip: 10", {"22: pose.hip": "is it 10 deg?"}),
    "a pose beyond its cone": (
        "[0.2, 0, 0]",
        "[0, 2, 0]",
        {"22: pose.neck.rotation": "found a swing of 115 deg, beyond the joint's cone of 50 deg"},
    ),
    "a string in centimetres": (
        "length: 0.6}",
        "length: 60}",
        {"19: strings[0].length": "found 60 m; in the start pose its path measures 0.61 m"},
    ),
    "a string in kilometres": (
        "length: 0.6}",
        "length: 0.0006}",
        {"19: strings[0].length": "found 0.0006 m; in the start pose its path measures 0.61 m"},
    ),
    "a driven length in the pose": (
        "rear.length: 0.61",
        "rear.length: 61",
        {"22: pose.rear.length": "found 61 m"},
    ),
    "gravity in cm/s^2": (
        "puppet: dog",
        "puppet: dog\ngravity: [0, 0, -981]",
        {"2: gravity": "found 981 m/s^2; on earth it is 9.81"},
    ),
    "gravity upwards": (
        "puppet: dog",
        "puppet: dog\ngravity: [0, 0, 9.81]",
        {"2: gravity": "found a positive z"},
    ),
}


@pytest.mark.parametrize(("old", "new", "warnings"), IMPLAUSIBLE.values(), ids=IMPLAUSIBLE)
def test_implausible_values_are_warned_of_with_their_places(dog, old, new, warnings):
    """A dog of 509 tonnes, a limit of -60 rad and a pose of 10 rad passed in silence."""
    result = dog(old, new)
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    for place, text in warnings.items():
        warned = [line for line in lines if line.startswith(f"dog.yaml:{place}: warning: ")]
        assert len(warned) == 1, lines
        assert text in warned[0]
    many = "1 warning" if len(lines) == 1 else f"{len(lines)} warnings"
    assert result.stdout.startswith(f"dog.yaml: no mistakes, {many}; ")


def test_a_puppet_without_a_support_is_warned_of(dog, tmp_path):
    """Its control bar is not driven: `rest` would let it fall for ever."""
    text = fan.puppets.path("marionette_bar").read_text()
    driven, free = "joint: {type: free, driven: true}", "joint: {type: free}"
    line = text[: text.index(driven)].count("\n") + 1
    file = tmp_path / "bar.yaml"
    file.write_text(text.replace(driven, free))
    result = fantoccini("check", file)
    (warned,) = result.stderr.splitlines()
    assert warned.startswith(f"{file}:{line}: bodies[") and "warning: nothing holds bar" in warned
    assert result.exit_code == 0 and "no mistakes, 1 warning" in result.stdout


def test_a_mesh_without_its_scale_is_warned_of(tmp_path):
    """A mass of 129 tonnes passed in silence."""
    import trimesh

    trimesh.creation.icosphere(radius=60.0).export(tmp_path / "skull.stl")
    file = tmp_path / "p.yaml"
    file.write_text(
        "puppet: p\nbodies:\n  - name: skull\n    joint: {type: free}\n"
        "    shapes: [{type: mesh, file: skull.stl, density: 450}]\n"
    )
    stderr = fantoccini("check", file).stderr
    assert "p.yaml:5: bodies[0].shapes: warning: found a body that measures 120 m" in stderr
    assert "is the mesh in mm? then write scale: 0.001" in stderr
    file.write_text(file.read_text().replace("skull.stl", "skull.stl, scale: 0.001"))
    assert fantoccini("check", file).stderr == ""


INPUTS = {
    "far": ("rear.z: [[0, 0.65], [3, 10.6]]", "moves 9.95 m away from its start", 2),
    "fast": ("rear.length: [[0, 0.61], [1, 0.6], [1.3, 4]]", "moves at up to 2", 2),
    "absurd": ("rear.length: [[0, 0.61], [0.3, 99]]", "moves 98.39 m away", 2),
}


@pytest.mark.parametrize(("line", "text", "at"), INPUTS.values(), ids=INPUTS)
def test_implausible_inputs_are_warned_of(dog, line, text, at):
    """A waypoint at 10.6 m, and 99 m of thread in 0.3 s, passed in silence."""
    Path("move.yaml").write_text(f"coordinates:\n  {line}\n")
    result = dog("", "", "--inputs", "move.yaml")
    assert result.exit_code == 0
    lines = [line_of_text for line_of_text in result.stderr.splitlines() if text in line_of_text]
    assert len(lines) == 1, result.stderr
    name = line.split(":")[0]
    assert lines[0].startswith(f"move.yaml:{at}: coordinates.{name}[")
    assert "move.yaml: no mistakes, " in result.stdout


def test_simulate_and_info_count_warnings(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    marionette = fan.puppets.path("string_pendulum").read_text()
    assert "gravity" not in marionette
    Path("p.yaml").write_text(marionette + "gravity: [0, 0, -98.1]\n")
    assert "1 warning: fantoccini check p.yaml" in fantoccini("info", "p.yaml").stderr
    result = fantoccini("simulate", "p.yaml", "--duration", 0.01)
    assert "1 warning: fantoccini check p.yaml" in result.stderr
    assert result.exit_code == 0
    assert "warning" not in fantoccini("simulate", "p.yaml", "--duration", 0.01, "-q").stderr


@pytest.mark.parametrize("name", [*fan.puppets.names(), *fan.puppets.scenes(), "bird"])
def test_bundled_files_give_no_warning(name):
    bundled = name != "bird"
    marionette = fan.load(fan.puppets.path(name) if bundled else ROOT / "examples" / "bird.yaml")
    assert warnings(marionette) == []


@pytest.mark.parametrize("name", PERFORMANCES)
def test_the_bundled_performances_give_no_warning(name):
    assert sorted(PERFORMANCES) == sorted(fan.puppets.performances())
    marionette = fan.load(fan.puppets.path(PERFORMANCES[name]))
    path = fan.puppets.performance(name)
    if is_score(path):
        score = fan.load_score(marionette, path)
        assert score.changes == ()
        inputs = score.inputs(marionette.rest())
    else:
        inputs = fan.Input.load(marionette, path)
    assert input_warnings(marionette, inputs) == []
