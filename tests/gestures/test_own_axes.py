"""A puppet whose file looks along y moves its control and its strings like one along x.

The oracle is the same puppet written along x: its whole motion, turned by 90 degrees.
"""

from __future__ import annotations

from collections.abc import Callable
from io import StringIO
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.model import scene
from fantoccini.model.puppet import bundled
from fantoccini.theatre import Gesture, load_gesture
from fantoccini.theatre.gestures import Style

pytestmark = pytest.mark.medium

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Turn by 90 degrees to the left."""
QUARTER = [float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]


def puppet_with_change(name: str, change: Callable[[dict[str, Any]], None]) -> fan.Marionette:
    """A bundled puppet with both halves written out, after a change of its document."""
    data = YAML(typ="safe").load(scene.loads(bundled(name).read_text()).expanded().to_yaml())
    change(data)
    return fan.Marionette(scene.loads(_dumped(data)))


def _dumped(data: dict[str, Any]) -> str:
    stream = StringIO()
    YAML(typ="safe").dump(data, stream)
    return stream.getvalue()


def turn_left(at: list[float]) -> list[float]:
    x, y, z = at
    return [-y, x, z]


def turn_with_bar(data: dict[str, Any]) -> None:
    """The control is turned with the puppet."""
    data["pose"] |= {"torso.rotation": QUARTER, "bar.rotation": QUARTER}


def turn_without_bar(data: dict[str, Any]) -> None:
    """The frame of the control is not turned: everything on it is written along y."""
    data["pose"] |= {"torso.rotation": QUARTER}
    bars = ("bar", "leg_bar", "hand_bar")
    for body in data["bodies"]:
        if body["name"] in bars:
            joint = body["joint"]
            joint |= {key: turn_left(joint[key]) for key in ("at", "axis") if key in joint}
            body["shapes"] = []
            body |= {"mass": 0.1, "com": [0.0, 0.0, 0.0], "inertia": [1e-4, 1e-4, 1e-4]}
    for string in data["strings"]:
        for point in string["path"]:
            if point.get("body") in bars:
                point["at"] = turn_left(point["at"])


def turn_string_ends(data: dict[str, Any]) -> None:
    """Strings whose ends move along x and y of the world."""
    data["pose"] |= {"torso.rotation": QUARTER}
    for string in data["strings"]:
        string["path"][1]["at"] = turn_left(string["path"][1]["at"])


@pytest.fixture(scope="module", params=[turn_with_bar, turn_without_bar])
def turned_airplane(request) -> fan.Marionette:
    return puppet_with_change("airplane", request.param)


@pytest.fixture(scope="module")
def airplane() -> fan.Marionette:
    return fan.puppets.airplane()


def places(puppet: fan.Marionette, q_D: np.ndarray, q_K: np.ndarray) -> dict[str, np.ndarray]:
    """String -> (T, 2, 3) places of its ends; they show bodies and bars alike [m]."""
    poses, strings = puppet.poses(q_D, q_K), {}
    for string in puppet.tree.strings:
        ends = []
        for point in (string.points[0], string.points[-1]):
            pose = poses[:, point.link]
            at = np.array([puppet.number(x) for x in point.at])
            ends.append(pose[:, :, :3] @ at + pose[:, :, 3])
        strings[string.name] = np.stack(ends, axis=1)
    return strings


def hand_ends(puppet: fan.Marionette, gesture: Gesture) -> dict[str, np.ndarray]:
    """Ends of the strings in the hands during a gesture, with the puppet at its file's pose."""
    x0 = puppet.state()
    inputs = gesture.inputs(x0)
    q_K = np.array([inputs.evaluate(t)[0] for t in np.linspace(0.0, inputs.end, 23)])
    return {name: ends[:, 1] for name, ends in places(puppet, x0.q_D[None], q_K).items()}


def assert_turned(actual: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    assert actual.keys() == expected.keys()
    for name, points in expected.items():
        np.testing.assert_allclose(actual[name], points @ TURN.T, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("name", ["nod", "bow", "jump", "march", "walk", "wave"])
def test_a_control_moves_in_the_direction_of_its_puppet(airplane, turned_airplane, name):
    gestures = [load_gesture(puppet, name) for puppet in (turned_airplane, airplane)]
    assert_turned(
        *(hand_ends(x, y) for x, y in zip((turned_airplane, airplane), gestures, strict=True))
    )


@pytest.mark.parametrize("name", ["march", "walk", "wave"])
def test_the_mirror_image_is_that_in_the_puppets_own_plane(airplane, turned_airplane, name):
    paths = []
    for puppet in (turned_airplane, airplane):
        image, _ = Style(mirrored=True).apply(load_gesture(puppet, name), puppet)
        paths.append(hand_ends(puppet, image))
    assert_turned(*paths)


def test_ends_of_strings_have_their_mirror_image_in_the_puppets_own_plane(marionette):
    left = puppet_with_change("marionette", turn_string_ends)
    for name in ("wave", "shake"):
        paths = []
        for puppet in (left, marionette):
            image, _ = Style(mirrored=True).apply(load_gesture(puppet, name), puppet)
            paths.append(hand_ends(puppet, image))
        assert_turned(*paths)


def test_a_whole_run_of_a_walk_on_a_control_is_turned(airplane):
    left = puppet_with_change("airplane", turn_with_bar)
    x0 = airplane.rest()
    values = {name: float(x0[name]) for name in coordinate_names(airplane)}
    for owner in ("torso", "bar"):
        w, x, y, z = (values[f"{owner}.q{part}"] for part in "wxyz")
        c = s = QUARTER[0]
        quaternion = (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)
        values |= {f"{owner}.q{p}": v for p, v in zip("wxyz", quaternion, strict=True)}
        values |= {f"{owner}.x": -values[f"{owner}.y"], f"{owner}.y": values[f"{owner}.x"]}
    table = left.coordinates
    y0 = left.state().replace(
        q_D=np.array([values[name] for name in table.q_D]),
        q_K=np.array([values[name] for name in table.q_K]),
    )
    runs = []
    for puppet, start in ((left, y0), (airplane, x0)):
        inputs = load_gesture(puppet, "walk", steps=2, step=0.06).inputs(start)
        run = fan.simulate(puppet, start, inputs, method=fan.TimeStepping(dt=2e-3))
        assert run.status is fan.Status.DONE
        runs.append(places(puppet, run.q_D, run.q_K))
    assert_turned(*runs)


def coordinate_names(puppet: fan.Marionette) -> tuple[str, ...]:
    return (*puppet.coordinates.q_D, *puppet.coordinates.q_K)


def test_a_bar_on_one_axis_cannot_move_along_another(tmp_path):
    """The end of a string moves along x of the file only; the puppet looks between x and y."""
    puppet = fan.loads("""
puppet: askew
bodies:
- {name: trunk, joint: {type: free}, mass: 1.0, com: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
strings:
- {name: left, path: [{body: trunk, at: [0, 0.1, 0]}, {at: [0, 0.1, 1], driven: [x]}], length: 1}
- {name: right, path: [{body: trunk, at: [0, -0.1, 0]}, {at: [0, -0.1, 1], driven: [x]}], length: 1}
rig: {trunk: [trunk], facing: [0.8, 0.6, 0], limbs: [], carrying: [left, right]}
""")
    path = tmp_path / "lean.yaml"
    path.write_text("gesture: lean\nparts: {trunk.forward: [[0, 0], [1, 1 cm]]}\n")
    with pytest.raises(FileError, match=r"it moves left\.x, and left\.y is not driven"):
        load_gesture(puppet, path)


def test_an_end_that_moves_along_its_own_forward_axis_alone(tmp_path):
    """The puppet looks along y, and its strings move along y of the file only."""
    puppet = fan.loads("""
puppet: sideways
bodies:
- {name: trunk, joint: {type: free}, mass: 1.0, com: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
strings:
- {name: left, path: [{body: trunk, at: [-0.1, 0, 0]}, {at: [-0.1, 0, 1], driven: [y]}], length: 1}
- {name: right, path: [{body: trunk, at: [0.1, 0, 0]}, {at: [0.1, 0, 1], driven: [y]}], length: 1}
rig: {trunk: [trunk], facing: [0, 1, 0], limbs: [], carrying: [left, right]}
""")
    path = tmp_path / "lean.yaml"
    path.write_text("gesture: lean\nparts: {trunk.forward: [[0, 0], [1, 1 cm]]}\n")
    lean = load_gesture(puppet, path)
    offsets = dict(zip(puppet.coordinates.v_K, lean.offsets(1.0)[0], strict=True))
    assert offsets == pytest.approx({"left.y": 0.01, "right.y": 0.01})
    image = lean.mirrored(puppet)
    np.testing.assert_allclose(image.offsets(1.0)[0], lean.offsets(1.0)[0])
    path.write_text("gesture: lean\nparts: {trunk.left: [[0, 0], [1, 1 cm]]}\n")
    with pytest.raises(FileError, match=r"its move trunk\.left would move left\.y"):
        load_gesture(puppet, path)


def test_a_driven_joint_called_x_is_no_end_of_a_string(tmp_path):
    (tmp_path / "turning.yaml").write_text("""
puppet: turning
bodies:
- {name: trunk, joint: {type: free}, mass: 1.0, com: [0, 0, 0], inertia: [0.01, 0.01, 0.01]}
- name: vane
  parent: trunk
  joint: {name: x, type: revolute, axis: [0, 0, 1], driven: true}
  mass: 0.1
  com: [0, 0, 0]
  inertia: [1e-4, 1e-4, 1e-4]
strings:
- {name: left, path: [{body: trunk, at: [0, 0.1, 0]}, {at: [0, 0.1, 1], driven: [x]}], length: 1}
- {name: right, path: [{body: trunk, at: [0, -0.1, 0]}, {at: [0, -0.1, 1], driven: [x]}], length: 1}
rig: {trunk: [trunk], facing: [1, 0, 0], limbs: [], carrying: [left, right]}
""")
    path = tmp_path / "two.yaml"
    path.write_text(
        "scene: two\npuppets:\n- {name: pierrot, puppet: turning.yaml}\n"
        "- {name: columbine, puppet: turning.yaml, at: [1, 0, 0]}\n"
    )
    puppet = fan.load(path)
    turn = Gesture.from_points(puppet, {"pierrot.x": [(0, 0), (1, "20 deg")]})
    np.testing.assert_allclose(turn.mirrored(puppet).offsets(1.0)[0], -turn.offsets(1.0)[0])
    np.testing.assert_allclose(turn.turned(0.3).offsets(1.0)[0], turn.offsets(1.0)[0])
