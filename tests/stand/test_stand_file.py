"""Stand files: their meaning, and mistakes with their lines."""

from __future__ import annotations

import jsonschema
import numpy as np
import pytest
from tests.stand.hoist import HOIST, STAND, stand

import fantoccini as fan
from fantoccini.base.documents.located import read_file
from fantoccini.base.errors import FileError
from fantoccini.stand import AxisMap, axes_of, load_stand, loads_stand, stand_names, stand_schema
from fantoccini.stand.stand_file import BUNDLED_STANDS_FOLDER


@pytest.mark.parametrize("name", stand_names())
def test_bundled_stands_move_their_puppets(name):
    loaded = load_stand(name)
    marionette = fan.load(loaded.puppet_path)
    axis_map = AxisMap.from_stand(loaded, marionette.coordinates)
    assert len(axis_map.axes) in (6, 21) and all(a.kind == "stepper" for a in axis_map.axes)
    p = np.random.default_rng(1).normal(size=(5, len(axis_map.axes)))
    q = axis_map.coordinates_of(p)
    assert np.allclose((q - axis_map.zero) @ axis_map.inverse.T, p, atol=1e-12)
    for axis in axis_map.axes:
        low, high = axis.travel
        assert axis.file.home is not None and low <= axis.file.home.at <= high


def test_the_schema_accepts_the_bundled_stands():
    schema = stand_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for name in stand_names():
        jsonschema.validate(read_file(BUNDLED_STANDS_FOLDER / f"{name}.yaml").data, schema)
    wrong = {"stand": "a", "axes": {"x": {"moves": {"q": 1}, "motor": {"type": "steper"}}}}
    with pytest.raises(jsonschema.ValidationError, match="steper"):
        jsonschema.validate(wrong, schema)
    assert schema["title"] == "fantoccini stand"


def test_transmissions_and_counts():
    """Closed forms: a turn moves 2 pi r, pi d, pitch teeth, lead, 2 pi."""
    travels = {
        "{type: drum, radius: 0.02}": 2 * np.pi * 0.02,
        "{type: drum, diameter: 0.02}": np.pi * 0.02,
        "{type: belt, pitch: 0.002, teeth: 20}": 0.04,
        "{type: screw, lead: 0.008}": 0.008,
        "{type: shaft}": 2 * np.pi,
    }
    for text, travel in travels.items():
        text_of_stand = STAND.replace(
            "{type: drum, radius: 0.01}", text + "\n    gear: 3\n    mass: 0.2"
        )
        (axis,) = axes_of(loads_stand(text_of_stand.replace("TORQUE", "1")))
        assert axis.ratio == pytest.approx(3 * 2 * np.pi / travel)
        assert axis.counts_per_unit == pytest.approx(3 * 3200 / travel)
        assert axis.inertia == pytest.approx(1e-5 + 0.2 / axis.ratio**2)
        assert axis.counts_at(np.array([travel])) == 9600
    (axis,) = axes_of(stand(acceleration="reversed: true\n    acceleration"))
    assert axis.counts_at(np.array([0.5])) == -np.rint(0.5 * axis.counts_per_unit)


def test_torques_of_motors():
    (axis,) = axes_of(stand("[[0, 0.4], [10, 0.2]]"))
    w = 2 * np.pi * np.array([0.0, 5.0, -5.0, 10.0, 10.1])
    assert np.allclose(axis.motor.max_torque(w, np.ones(5)), [0.4, 0.3, 0.3, 0.2, 0.0])
    dc = "{type: dc, constant: 0.05, current: 2, resistance: 4, voltage: 12, inertia: 1.0e-5}"
    text = STAND.replace("{type: stepper, torque: TORQUE, inertia: 1.0e-5}", dc)
    (axis,) = axes_of(loads_stand(text))
    # By the current at rest; at 200 rad/s (12 - 10) / 4 A; the back-EMF helps braking; no-load 240.
    speed, torque = np.array([0.0, 200.0, 200.0, 240.0]), np.array([1.0, 1.0, -1.0, 1.0])
    assert np.allclose(axis.motor.max_torque(speed, torque), [0.1, 0.025, 0.1, 0.0])


WRONG = {
    "an unknown kind of motor": ("type: stepper", "type: steper", 5, "did you mean 'stepper'"),
    "a torque of 0": ("TORQUE", "0", 5, "needed: a positive number"),
    "speeds that fall": ("TORQUE", "[[0, 1], [5, 1], [4, 1]]", 5, "needed: speeds that increase"),
    "a curve that begins late": ("TORQUE", "[[1, 1], [5, 1]]", 5, "needed: one at 0"),
    "radius and diameter": (
        "radius: 0.01",
        "radius: 0.01, diameter: 0.02",
        6,
        "either radius or diameter",
    ),
    "no travel": ("    travel: [0.2, 0.9]\n", "", 4, "travel: this key is missing"),
    "a travel backwards": ("[0.2, 0.9]", "[0.9, 0.2]", 8, "the lower one first"),
    "a factor of 0": ("line.length: 1", "line.length: 0", 7, "a factor that is not 0"),
    "no coordinate to move": ("{line.length: 1}", "{}", 7, "found nothing"),
    "home outside": (
        "    speed: 1\n",
        "    speed: 1\n    home: {towards: min, at: 0.1, speed: 1}\n",
        10,
        "within travel",
    ),
    "an unknown key": ("    speed: 1\n", "    sped: 1\n    speed: 1\n", 9, "did you mean 'speed'"),
    "like an unknown axis": ("    speed: 1\n", "    like: wich\n", 9, "there is no axis 'wich'"),
    "like itself": ("    speed: 1\n", "    like: winch\n", 9, "would inherit from itself"),
    "zero of a coordinate without an axis": (
        "axes:",
        "zero: {line.lenght: 1}\naxes:",
        3,
        "did you mean 'line.length'",
    ),
    "a controller with an unknown axis": (
        "axes:",
        "controller: {type: grbl, names: {wnch: X}}\naxes:",
        3,
        "did you mean 'winch'",
    ),
    "an unknown kind of controller": ("axes:", "controller: {type: grb}\naxes:", 3, "allowed: "),
    "two axes for one coordinate": (
        "axes:",
        "axes:\n  other: {like: winch, moves: {line.length: 2}}",
        8,
        "moving other by 1 with winch by -2 changes nothing; 2 axes move 1 coordinates",
    ),
}


@pytest.mark.parametrize("old, new, line, words", WRONG.values(), ids=WRONG)
def test_mistakes_have_their_line(old, new, line, words):
    assert old in STAND
    with pytest.raises(FileError) as caught:
        loads_stand(STAND.replace(old, new).replace("TORQUE", "0.5").lstrip("\n"), "s.yaml")
    assert words in str(caught.value)
    if line:
        assert any(m.line == line - 1 for m in caught.value.mistakes), str(caught.value)


def test_axes_are_bound_to_driven_coordinates():
    hoist = fan.loads(HOIST)
    with pytest.raises(FileError, match=r"did you mean 'line\.length'"):
        AxisMap.from_stand(stand(**{"line.length": "lines.length"}), hoist.coordinates)
    driven = fan.loads(HOIST + "drives: [{on: line.length, inertia: 1.0e-5, drum: 0.01}]")
    with pytest.raises(FileError, match="has a drive of its own"):
        AxisMap.from_stand(stand(), driven.coordinates)
    bar = fan.puppets.marionette_bar()
    with pytest.raises(FileError, match="part of an orientation"):
        AxisMap.from_stand(stand(**{"line.length": "bar.qx"}), bar.coordinates)


def test_a_missing_puppet_is_named(tmp_path):
    (tmp_path / "s.yaml").write_text(STAND.replace("TORQUE", "1") + "puppet: nobody\n")
    with pytest.raises(
        FileError, match="'nobody': no file in this one's folder and no bundled pup"
    ):
        _ = load_stand(tmp_path / "s.yaml").puppet_path
    with pytest.raises(FileError, match="did you mean 'six_winches'"):
        load_stand("six_winch")


def test_a_stand_has_a_repr_of_one_line_and_a_hash():
    stand = fan.stand.load_stand("desktop6")
    assert str(stand) == repr(stand) and len(str(stand)) < 100
    assert stand in {stand}
