"""Gesture files: bundled ones, key poses, their schema, and mistakes with their places."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest
from tests.gestures.available import available_gestures

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError
from fantoccini.theatre.gestures import gesture_schema, load_gesture

pytestmark = pytest.mark.medium

MOVES_FILE = """\
gesture: greet
about: The right hand goes up.
moves:
  hand_right.up: [[0, 0], [1, 20 cm], [2, 0]]
  hand_right.out: [[0, 0], [1, 0.03], [2, 0]]
marks: {up: 1}
"""
POSES_FILE = """\
gesture: reach
poses:
  strings: [hand_right]
  at: [0, 1, 2]
  points: {forearm_right: [[0, 0, 0], [0.02, 0, 0.06], [0, 0, 0]]}
  of: {forearm_right: [0, 0, -0.09]}
"""


def write_gesture(tmp_path, text: str):
    path = tmp_path / "gesture.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def check_hand(
    marionette: fan.Marionette, x0: fan.State, gesture: fan.theatre.Gesture
) -> fan.State:
    """State of rest after one second; its hand is at the place of POSED."""
    q_K, _, _ = gesture.inputs(x0).evaluate(1.0)
    hanging_state = marionette.rest(dict(zip(marionette.coordinates.q_K, q_K, strict=True)))
    positions = []
    for x in (x0, hanging_state):
        pose = marionette.pose(x, "forearm_right")
        positions.append(pose[:3, 3] + pose[:3, :3] @ [0.0, 0.0, -0.09])
    np.testing.assert_allclose(positions[1] - positions[0], [0.02, 0.0, 0.06], atol=1e-4)
    return hanging_state


def test_bundled_gestures_move_their_coordinates(marionette):
    assert set(available_gestures(marionette)) == {
        "bow",
        "breathe",
        "clap",
        "hang",
        "jump",
        "kneel",
        "look",
        "march",
        "nod",
        "point",
        "shake",
        "sit",
        "stand",
        "walk",
        "wave",
    }
    for name, gesture in available_gestures(marionette).items():
        assert gesture.name == name and gesture.uses
        assert all(0.0 <= t <= gesture.duration for t in gesture.marks.values())
    assert fan.theatre.load_gesture(marionette, "wave").uses == ("hand_right",)


def test_a_file_equals_a_gesture_in_python(marionette, tmp_path):
    read = fan.theatre.load_gesture(marionette, write_gesture(tmp_path, MOVES_FILE))
    gesture = fan.theatre.Gesture.from_points(
        marionette,
        {
            "hand_right.length": [(0, 0), (1, -0.2), (2, 0)],
            "hand_right.y": [(0, 0), (1, -0.03), (2, 0)],
        },
        name="greet",
        marks={"up": 1.0},
    )
    assert np.allclose(read.coef, gesture.coef, atol=1e-15) and read.marks == gesture.marks


def test_the_puppet_hangs_at_its_key_poses(marionette, tmp_path):
    gesture = fan.theatre.load_gesture(marionette, write_gesture(tmp_path, POSES_FILE))
    assert gesture.uses == ("hand_right",)
    x0 = marionette.rest()
    check_hand(marionette, x0, gesture)


def test_key_poses_include_other_motions(marionette, tmp_path):
    """The hand is at its target while the body is lowered by one centimetre."""
    text = (
        POSES_FILE
        + "moves:\n"
        + "".join(
            f"  {name}.down: [[0, 0], [1, 10 mm], [2, 0]]\n"
            for name in ("head", "shoulder_left", "shoulder_right")
        )
    )
    gesture = fan.theatre.load_gesture(marionette, write_gesture(tmp_path, text))
    x0 = marionette.rest()
    hanging_state = check_hand(marionette, x0, gesture)
    assert marionette.pose(hanging_state, "torso")[2, 3] < marionette.pose(x0, "torso")[2, 3] - 5e-3


def test_a_folder_of_the_same_name_hides_no_bundled_gesture(marionette, tmp_path, monkeypatch):
    (tmp_path / "wave").mkdir()
    monkeypatch.chdir(tmp_path)
    assert fan.theatre.load_gesture(marionette, "wave").uses == ("hand_right",)


def test_the_schema_takes_gestures_and_refuses_others(tmp_path):
    schema = gesture_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for text in (MOVES_FILE, POSES_FILE):
        jsonschema.validate(read_file(write_gesture(tmp_path, text)).data, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"gesture": "x", "move": {}}, schema)


@pytest.mark.parametrize(
    ("text", "change", "line", "message"),
    [
        (MOVES_FILE, ("hand_right.up", "hand_rigt.up"), 4, "did you mean 'hand_right.up'"),
        (MOVES_FILE, ("20 cm", "20 inches"), 4, "needed: a length"),
        (MOVES_FILE, ("[2, 0]]\nmarks", "[1, 0]]\nmarks"), 5, "a step in position"),
        (MOVES_FILE, ("{up: 1}", "{up: 7}"), 6, "the gesture ends at 2 s"),
        (MOVES_FILE, ("about", "abuot"), 2, "did you mean 'about'"),
        (POSES_FILE, ("[hand_right]", "[hand_rigt]"), 3, "did you mean 'hand_right'"),
        (POSES_FILE, ("[0, 1, 2]", "[0, 1]"), 5, "found 3 places at 2 times"),
        (POSES_FILE, ("[0, 1, 2]", "[0, 2, 2]"), 4, "times must increase"),
        (
            POSES_FILE,
            ("of: {forearm_right", "of: {forarm_right"),
            6,
            "did you mean 'forearm_right'",
        ),
        (POSES_FILE.replace("forearm_right", "forarm_right"), ("reach", "grab"), 5, "forarm_right"),
        (POSES_FILE, ("0.06]", "1.5]"), 4, "at 1 s"),
    ],
)
def test_mistakes_have_places(marionette, tmp_path, text, change, line, message):
    assert change[0] in text
    path = write_gesture(tmp_path, text.replace(*change))
    with pytest.raises(FileError, match=message) as error:
        fan.theatre.load_gesture(marionette, path)
    assert f"gesture.yaml:{line}" in str(error.value)


def test_a_missing_file_is_named(marionette):
    with pytest.raises(FileError, match="did you mean 'wave'"):
        fan.theatre.load_gesture(marionette, "wawe")


OTHER_STRINGS = {
    "wave": (
        "gesture wave: its move arm_right.forward would move hand_inner_right.x, which is not a "
        "driven coordinate; needed: strings with driven lengths and with ends driven in x and y, "
        "or a driven control that carries the trunk on strings of fixed length (docs/gestures.md)"
    ),
    "look": (
        "gesture look: its move head.left would move head.y, which is not a driven coordinate; "
        "needed: strings with driven lengths and with ends driven in x and y (docs/gestures.md)"
    ),
}


@pytest.mark.parametrize(("name", "message"), OTHER_STRINGS.items(), ids=OTHER_STRINGS)
def test_a_bundled_gesture_says_in_one_sentence_what_a_puppet_lacks(name, message):
    with pytest.raises(FileError) as error:
        load_gesture(fan.puppets.stand6(), name)
    assert str(error.value) == message


def test_a_bundled_gesture_moves_strings_on_motors():
    names = ("head", "shoulder_left", "shoulder_right")
    end = "{driven: [x, y], at: [0, 0, 1]}"
    strings = [f"{{name: {n}, path: [{{body: bar}}, {end}], length: driven}}" for n in names]
    control_text = "control: {type: pd, stiffness: 9, damping: 1}"
    drives = [f"{{on: {n}.length, mass: 1.5, {control_text}}}" for n in names]
    bar = "{name: bar, joint: {type: free}, mass: 1, inertia: [0.1, 0.1, 0.1]}"
    strings_text = f"strings: [{', '.join(strings)}]\ndrives: [{', '.join(drives)}]"
    rig = "trunk: [bar], facing: [1, 0, 0], limbs: [], head: {body: top, end: [0, 0, 0]}"
    rig += ", carrying: [shoulder_left, shoulder_right], looking: [head]"
    bodies = f"bodies: [{bar}, {{name: top, parent: bar}}]"
    puppet = fan.loads(f"puppet: hung\n{bodies}\n{strings_text}\nrig: {{{rig}}}\n")
    gesture = load_gesture(puppet, "stand")
    assert "head.command" in repr(gesture)
