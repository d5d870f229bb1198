"""Gestures with props and seats take strings, bodies and sizes from the puppet's body map."""

from __future__ import annotations

import ast
import re
from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.base import polynomial
from fantoccini.model import scene
from fantoccini.model.puppet import bundled
from fantoccini.motion import pieces
from fantoccini.theatre import cast
from fantoccini.theatre.cast import ContactBodies, Physique, Walk, prop_gestures
from fantoccini.theatre.gestures import BodyParts, Ends, Step, step_gesture
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.reading import read_play
from fantoccini.theatre.plays.sitting import sit
from fantoccini.theatre.plays.walk_planner import WalkPlanner

SOURCE = Path(fan.__file__).parent / "theatre"
COMMON_WORDS = {"head", "hand", "foot"}
"""Names that are also words for parts of any body."""


@cache
def marionette_names() -> set[str]:
    """Names of bodies and strings of the bundled marionette, without their sides."""
    puppet = scene.load(bundled("marionette"))
    names = {part.name for part in (*puppet.bodies, *puppet.strings)}  # type: ignore[attr-defined]
    return {re.sub("_(left|right)$", "", name) for name in names}


def literals(path: Path) -> list[str]:
    """String constants of a source file, those within f-strings too."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [node.value for node in nodes if isinstance(node.value, str)]


def is_marionette_name(text: str) -> bool:
    """Whether a constant is a name of the bundled marionette, or its beginning before a side."""
    names = "|".join(sorted(marionette_names()))
    match = re.fullmatch(rf"\.?({names})(_(left|right)?)?(\.[a-z]*)?", text)
    return match is not None and (match[1] not in COMMON_WORDS or match[2] is not None)


def test_the_search_finds_names_of_the_bundled_marionette():
    assert {"hand", "shoulder", "knee", "torso", "skull", "forearm", "thigh"} <= marionette_names()
    for text in ("skull", "hand_", ".forearm_", "knee_left.up", "torso", "shoulder_right"):
        assert is_marionette_name(text), text
    for text in ("arm_", "leg_left", "head", "trunk", "a hand"):
        assert not is_marionette_name(text), text


@pytest.mark.parametrize("package", ["cast", "plays"])
def test_no_name_of_the_bundled_marionette_is_hard_coded(package):
    hard_coded = [
        f"{path.name}: {text!r}"
        for path in sorted((SOURCE / package).rglob("*.py"))
        for text in literals(path)
        if is_marionette_name(text)
    ]
    assert not hard_coded


@pytest.fixture(scope="module", name="hans")
def _hans() -> fan.Marionette:
    return fan.puppets.hans()


def moved_strings(gesture: fan.theatre.Gesture) -> set[str]:
    """Names of the strings that a gesture moves."""
    names = pieces.channel_names(gesture.coordinates).items()
    return {name.split(".")[0] for name, (_, v) in names if gesture.named[v].any()}


def test_bodies_that_touch_are_those_of_the_body_map(hans):
    bodies = ContactBodies.of("hans", hans.body_map)
    assert bodies.forearms["left"] == "hans.lower_arm_left"
    assert bodies.feet == ("hans.shin_left", "hans.shin_right")
    seated = {"thigh_left", "thigh_right", "chest", "pelvis", "head"}
    assert set(bodies.seated) == {f"hans.{body}" for body in seated}


def test_a_puppet_of_other_names_and_sizes_has_the_gestures_with_props_and_seats(hans):
    physique = Physique.of(hans)
    # 0.25579 m and 0.25824 m of hans, 0.19 m and 0.26417 m of the bundled marionette
    assert physique.arm_ratio("left") == pytest.approx(0.25579 / 0.19, abs=1e-5)
    assert physique.leg_ratio == pytest.approx(0.25824 / 0.26417, abs=1e-5)
    assert set(physique.trunk_strings) == {"crown", "collar_left", "collar_right", "seat"}
    assert moved_strings(prop_gestures.carry(hans, "", side="left")) == {"wrist_left"}
    assert moved_strings(putting.putting(hans, "", "ball", 0.01).gesture) == set(physique.strings)
    handover = prop_gestures.give(hans, "", "", "ball", side="left")
    assert moved_strings(handover.giver) == {"wrist_left"} and "leg_right" in moved_strings(
        handover.receiver
    )
    assert handover.touching == (("lower_arm_left", "ball"), ("lower_arm_right", "ball"))
    # The elbow is at [0, 0.09, 0.343] in the file's pose.
    place = np.array([1.34626 * 0.061, 0.106, 0.347])
    np.testing.assert_allclose(prop_gestures.handle_place(hans, side="left"), place, atol=1e-5)
    sitting = sit(hans, "", "chair", 0.15, start=hans.state())
    assert (
        moved_strings(sitting.down) == set(physique.strings)
        and ("pelvis", "chair") in sitting.touching
    )


def test_a_missing_part_is_named(hans):
    with pytest.raises(fan.errors.StateError, match="no wing_left; its body map has arm_"):
        Physique.of(hans).limb("wing_left")
    with pytest.raises(fan.errors.StateError, match="somebody has no arm_left"):
        cast.hanging_pair(ContactBodies("somebody"), "left", "ball")


RIG = """
rig:
  trunk: [torso]
  facing: [1, 0, 0]
  head: {body: skull, end: [0, 0, 0.137]}
  carrying: [shoulder_left]
  looking: [head]
  limbs:
    - {kind: arm, side: left, bodies: [upper_arm_left, ARM], end: [END], strings: [hand_left]}
    - {kind: leg, side: left, bodies: [thigh_left, shin_left], end: [0.018, 0, -0.138],
       strings: [knee_left]}
"""
ALONG_X = {
    "capsule, from: [0, 0, 0], to: [0, 0, -0.075]": "capsule, from: [0, 0, 0], to: [0.075, 0, 0]",
    "radii: [0.015, 0.009, 0.021], at: [0, 0, -0.102]": (
        "radii: [0.021, 0.009, 0.015], at: [0.102, 0, 0]"
    ),
    "{lower: -2 deg, upper: 140 deg}": "{lower: -92 deg, upper: 50 deg}",
    "{body: forearm_left, at: [0, 0, -0.09]}": "{body: forearm_left, at: [0.09, 0, 0]}",
    "elbow_left: 70 deg": "elbow_left: -20 deg",
}
"""Changes after which a forearm points along x of its frame, in the same pose of the arm."""
PALM = """\
  - name: palm_left
    parent: forearm_left
    joint: {name: wrist_left, type: revolute, axis: [0, 1, 0], at: [0, 0, -0.09]}
    shapes: [{type: sphere, radius: 0.01, mass: 0.01}]
"""


def changed_marionette(
    changes: dict[str, str], arm: str = "forearm_left", end: str = "0, 0, -0.09"
) -> str:
    """Text of the bundled marionette after changes, with a rig, so that no rest is needed."""
    text = bundled("marionette").read_text(encoding="utf-8") + RIG
    for before, after in changes.items():
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text.replace("ARM", arm).replace("END", end)


def holding(puppet: str, along: float) -> fan.Marionette:
    """A puppet and a prop whose origin is on its left forearm, at a distance from the elbow [m]."""
    elbow = fan.puppets.marionette()
    pose = elbow.pose(elbow.state(), "forearm_left")
    at = pose[:3, 3] - along * pose[:3, 2]
    shape = {"type": "sphere", "radius": 0.01, "mass": 0.01}
    ball = {"name": "ball", "at": at.tolist(), "shapes": [shape]}
    puppets = [{"name": "pierrot", "puppet": scene.loads(puppet)}]
    return fan.Marionette(fan.Scene(scene="holding", puppets=puppets, props=[ball]))


@pytest.mark.medium
@pytest.mark.parametrize(("changes", "end"), [({}, "0, 0, -0.09"), (ALONG_X, "0.09, 0, 0")])
def test_the_distance_from_the_elbow_is_along_any_axis_of_the_forearm(changes, end):
    stage = holding(changed_marionette(changes, end=end), 0.05)
    distance = prop_gestures.handle_distance(stage, stage.state(), "", "ball", 0.0, side="left")
    assert distance == pytest.approx(0.05, abs=1e-6)


@pytest.mark.medium
def test_a_prop_hangs_on_the_forearm_of_an_arm_with_a_hand_of_its_own():
    arm = "forearm_left, palm_left"
    text = changed_marionette(
        {"  - name: thigh_left\n": PALM + "  - name: thigh_left\n"}, arm, "0.02, 0, 0"
    )
    puppet = fan.Marionette(scene.loads(text))
    physique = Physique.of(puppet)
    assert physique.forearm("right") == "forearm_right"
    np.testing.assert_allclose(physique.forearm_direction("right"), [0.0, 0.0, -1.0], atol=1e-12)
    assert ContactBodies.of("she", puppet.body_map).forearms["left"] == "she.forearm_left"


TAIL = """\
  - name: tail
    parent: torso
    joint: {name: rump, type: revolute, axis: [0, 1, 0], at: [-0.03, 0, -0.05]}
    shapes: [{type: capsule, from: [0, 0, 0], to: [-0.1, 0, 0], radius: 0.006, mass: 0.01}]
"""
EXTRA_STRINGS = """\
  - {name: tip, path: [{body: tail, at: [-0.09, 0, 0]}, {driven: [x, y], at: [-0.15, 0, 1.2]}],
     length: driven}
  - {name: sleeve_left, path: [{body: upper_arm_left}, {driven: [x, y], at: [0, 0.2, 1.2]}],
     length: driven}
  - {name: wrist_left, path: [{body: forearm_left, at: [0, 0, -0.05]},
     {driven: [x, y], at: [0.1, 0.14, 1.2]}], length: driven}
  - {name: foot_left, path: [{body: shin_left, at: [0, 0, -0.1]},
     {driven: [x, y], at: [0.1, 0.1, 1.2]}], length: driven}
  - {name: thigh_string_left, path: [{body: thigh_left, at: [0, 0, -0.05]},
     {driven: [x, y], at: [0.05, 0.05, 1.2]}], length: driven}
"""


def offsets_at(gesture: fan.theatre.Gesture, t: float) -> dict[str, float]:
    """Offsets of all driven coordinates at a time [s]."""
    i = min(int(np.searchsorted(gesture.breaks, t, side="right")), len(gesture.coef)) - 1
    d, _, _ = polynomial.evaluate(gesture.coef[i], np.array([t - gesture.breaks[i]]))
    names = pieces.channel_names(gesture.coordinates).items()
    return {name: float(d[v.start]) for name, (_, v) in names}


@pytest.mark.medium
def test_further_strings_move_with_the_part_that_carries_them_when_a_puppet_sits_down():
    changes = {
        "  - name: thigh_left\n": TAIL + "  - name: thigh_left\n",
        "\n# Start: standing": EXTRA_STRINGS + "\n# Start: standing",
        "strings: [hand_left]": "strings: [hand_left, wrist_left, sleeve_left]",
        "strings: [knee_left]}": "strings: [foot_left, knee_left, thigh_string_left]}\n"
        "    - {kind: tail, bodies: [tail], end: [-0.1, 0, 0], strings: [tip]}",
    }
    puppet = fan.Marionette(scene.loads(changed_marionette(changes)))
    physique = Physique.of(puppet)
    assert {"tip", "sleeve_left", "head", "shoulder_left"} < set(physique.trunk_strings)
    assert physique.knee_string("left") == "knee_left"
    down = offsets_at(sit(puppet, "", "chair", 0.14, start=puppet.state()).down, 3.0)
    groups = ("shoulder_left", "tip", "sleeve_left"), ("hand_left", "wrist_left")
    for leader, *followers in (*groups, ("knee_left", "thigh_string_left")):
        for way in ("x", "y", "length"):
            for name in followers:
                assert down[f"{name}.{way}"] == down[f"{leader}.{way}"], (name, way)
        assert down[f"{leader}.length"] > 0.02
    # The foot stands where it stood.
    assert all(down[f"foot_left.{way}"] == 0.0 for way in ("x", "y", "length"))


def test_strings_of_the_pelvis_stay_above_it_while_a_puppet_sits(hans):
    sitting = sit(hans, "", "chair", 0.15, start=hans.state())
    physique, seated = Physique.of(hans), offsets_at(sitting.down, 4.0)
    assert physique.tie_height_ratio("crown") == physique.tie_height_ratio("collar_left") == 1.0
    # It is tied at the height of 0.035 m below the waist's joint, the hips at 0.06 m: [m].
    assert physique.tie_height_ratio("seat") == pytest.approx(0.025 / 0.21, abs=1e-3)
    leans = physique.leg_ratio * 0.075
    assert seated["crown.x"] == pytest.approx(leans - sitting.back)
    # Its trunk bends forward on the way down, over the pelvis, and does not fall back.
    assert physique.holds_pelvis and not Physique.of(fan.puppets.marionette()).holds_pelvis
    assert offsets_at(sitting.down, 2.5)["crown.x"] == pytest.approx(leans - sitting.back)
    assert seated["seat.x"] == pytest.approx(
        physique.tie_height_ratio("seat") * leans - sitting.back
    )


@pytest.mark.parametrize(
    ("name", "string", "step_time", "lift"),
    [
        ("hans", "leg_left", 0.6, 0.06),
        ("hans", "leg_left", 1.0, 0.03),
        ("marionette", "knee_left", 1.0, 0.06),
    ],
)
def test_knees_rise_less_in_slow_steps_of_a_puppet_with_a_waist(name, string, step_time, lift):
    puppet = getattr(fan.puppets, name)()
    step = step_gesture(Ends(BodyParts.for_puppet(puppet), puppet.state()), [Step(0.05)], step_time)
    highest = offsets_at(step, 0.5 * step_time)[f"{string}.length"]
    assert highest == pytest.approx(-Physique.of(puppet).leg_ratio * lift, rel=1e-5)


HOLDS = """\
play: holds
stage: {marks: {west: {at: [0.1, 0.6], facing: right}}}
cast: {she: {puppet: she.yaml, at: west}}
props: {ball: {held by: she, side: left}}
acts: [{act: One, cues: [{who: she, walks to: [0.1, 0.2]}]}]
"""


def looking_left() -> str:
    """Text of the bundled marionette that looks along y in its file."""
    text = scene.loads(changed_marionette({})).expanded().to_yaml()
    data = YAML(typ="safe").load(text)
    for string in data["strings"]:
        x, y, _ = string["path"][1]["at"]
        string["path"][1]["at"][:2] = [-y, x]
    half = float(np.sqrt(0.5))
    data["pose"] |= {"torso.rotation": [half, 0.0, 0.0, half]}
    stream = StringIO()
    YAML(typ="safe").dump(data, stream)
    return stream.getvalue()


@pytest.mark.slow
def test_a_puppet_whose_file_looks_along_y_faces_walks_and_holds_like_one_along_x(tmp_path):
    (tmp_path / "holds.yaml").write_text(HOLDS, encoding="utf-8")
    poses, props, walks, aims = [], [], [], []
    for text in (changed_marionette({}), looking_left()):
        (tmp_path / "she.yaml").write_text(text, encoding="utf-8")
        script = read_play(tmp_path / "holds.yaml", cast.ResultCache())
        she = script.cast.players["she"]
        tree, state = she.marionette.tree, she.x0
        links = she.marionette.poses(state.q_D[None], state.q_K[None])[0]
        poses.append({link.name: links[k] for k, link in enumerate(tree.links)})
        props.append(script.cast.props["ball"])
        steps = she.turned(
            script.gestures.walk(she, Walk(she.start, 0.0, (Step(0.06), Step(0.06, 0.3)), 0.7)), 0.4
        )
        walks.append(offsets_at(steps, 1.0))
        aims.append(
            she.in_own_frame(np.array([0.5, -0.2, 0.3]), she.start)[:2]
            - [she.middle.real, she.middle.imag]
        )
    for body, pose in poses[0].items():
        columns = slice(3, 4) if body.endswith(".end") else slice(None)
        np.testing.assert_allclose(poses[1][body][:, columns], pose[:, columns], atol=1e-6)
    np.testing.assert_allclose(props[1].prop.at, props[0].prop.at, atol=1e-6)
    assert walks[1] == pytest.approx(walks[0], abs=1e-9)
    np.testing.assert_allclose(aims[1][:2], [-aims[0][1], aims[0][0]], atol=1e-9)
    # The audience is along x: she faces right, along -y, as the mark has it.
    ahead = poses[1]["torso"][:, :3] @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(ahead, [0.0, -1.0, 0.0], atol=0.05)


@pytest.mark.slow
def test_steps_and_clearances_are_those_of_the_player(tmp_path):
    path = tmp_path / "holds.yaml"
    path.write_text(HOLDS.replace("puppet: she.yaml", "puppet: hans"), encoding="utf-8")
    script = read_play(path, cast.ResultCache())
    she, planner = script.cast.players["she"], WalkPlanner(script.cast, script.log)
    ratio = 0.25824 / 0.26417
    assert she.leg_ratio == pytest.approx(ratio)
    assert planner.clearance(she) == pytest.approx(she.radius + ratio * 0.026)
    # Chest, neck and crown of the file, lifted by 2.5 cm; the head leans a little at rest.
    assert she.height == pytest.approx(0.388 + 0.122 + 0.181 + 0.025, abs=0.01)
    goal = cast.Footing(0.1, 0.2, she.start.heading)
    free = dict(
        begin=0.0, max_wait=0.0, tracks=(), max_goal_distance=0.0, arrival_time=None, free_time=0.0
    )
    walk, _ = planner.plan(she, she.start, [goal], act_start=0.0, **free)
    assert max(step.length for step in walk.steps) == pytest.approx(0.4 / 5)
