"""Bundled gestures move parts of a body: of any names, sizes and directions."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.body_map import zoo

import fantoccini as fan
from fantoccini.base.errors import FileError, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import pieces
from fantoccini.theatre import load_gesture
from fantoccini.theatre.gestures import BodyParts, Ends, Step, step_gesture

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]


def nonzero_offsets(gesture: fan.theatre.Gesture, t: float) -> dict[str, float]:
    """Coordinate -> its offset at a time, without those that stay."""
    offsets, _ = gesture.offsets(t)
    channels = pieces.channel_names(gesture.coordinates)
    return {
        name: offsets[v.start] for name, (_, v) in channels.items() if abs(offsets[v.start]) > 1e-12
    }


@pytest.fixture(scope="module")
def hans() -> Marionette:
    """The bundled marionette with German names, 1.7 times as large."""
    return Marionette(zoo.hans(1.7))


@pytest.fixture(scope="module")
def dachshund() -> Marionette:
    """A dachshund on nine strings that looks along +y."""
    return Marionette(zoo.dachshund())


@pytest.fixture(scope="module")
def heron() -> Marionette:
    """A bird that looks along -x."""
    return Marionette(zoo.heron())


def test_a_larger_puppet_with_other_names_waves_in_proportion(hans):
    wave = load_gesture(hans, "wave")
    assert wave.uses == ("armfaden_rechts",)
    offsets = nonzero_offsets(wave, 1.15)
    assert offsets["armfaden_rechts.length"] == pytest.approx(1.7 * -0.26, rel=1e-4)
    assert offsets["armfaden_rechts.x"] == pytest.approx(1.7 * 0.04, rel=1e-4)
    assert offsets["armfaden_rechts.y"] == pytest.approx(1.7 * -0.10, rel=1e-4)


@pytest.mark.parametrize(
    "name", ["bow", "jump", "sit", "point", "shake", "breathe", "clap", "hang"]
)
def test_it_does_what_the_bundled_marionette_does(hans, name):
    gesture, bundled = load_gesture(hans, name), load_gesture(fan.puppets.marionette(), name)
    assert gesture.marks == bundled.marks
    for t in np.linspace(0.0, bundled.duration, 9):
        offsets = {
            string.replace("links", "left").replace("rechts", "right"): offset
            for string, offset in nonzero_offsets(gesture, t).items()
        }
        for german, word in (
            ("kopf", "head"),
            ("trag", "shoulder"),
            ("arm", "hand"),
            ("bein", "knee"),
        ):
            offsets = {
                string.replace(f"{german}faden", word): offset for string, offset in offsets.items()
            }
        expected = nonzero_offsets(bundled, t)
        assert offsets == pytest.approx(
            {string: 1.7 * offset for string, offset in expected.items()}, rel=1e-4, abs=1e-12
        )


def test_a_dog_nods_along_the_direction_in_which_it_looks(dachshund):
    nod = load_gesture(dachshund, "nod")
    assert nod.uses == ("a",)
    offsets = nonzero_offsets(nod, 0.35)
    assert offsets["a.length"] > 0.01
    assert offsets["a.y"] > 0.01
    assert abs(offsets.get("a.x", 0.0)) < 1e-4
    x0 = dachshund.rest()
    run = fan.simulate(dachshund, x0, nod.inputs(x0)).resample([0.0, 0.35])
    heights = [dachshund.pose(run.state(i), "face")[2, 3] for i in (0, 1)]
    assert heights[1] < heights[0] - 0.005


def test_a_bird_looks_to_its_own_left(heron):
    look = load_gesture(heron, "look")
    offsets = nonzero_offsets(look, 1.0)
    assert offsets["beakstring.y"] < -0.04  # it looks along -x
    assert offsets["beakstring.x"] < -0.01


def test_all_legs_jump(dachshund, heron):
    assert set(load_gesture(dachshund, "jump").uses) == {"a", "b", "c", "d", "e", "f", "g", "h"}
    legs = {"leg_l", "leg_r"}
    assert legs < set(load_gesture(heron, "jump").uses)


def test_a_missing_part_is_named_in_one_sentence(dachshund):
    with pytest.raises(FileError) as error:
        load_gesture(dachshund, "wave")
    assert str(error.value) == (
        "gesture wave: it moves arm_right; dachshund has trunk, trunk_front, trunk_hind, head, "
        "leg_front_left, leg_front_right, leg_hind_left, leg_hind_right, neck, tail"
    )
    with pytest.raises(FileError, match="gesture nod: arm2d has no body map: no two branches"):
        load_gesture(fan.puppets.arm2d(), "nod")


def test_own_gestures_of_parts(dachshund, tmp_path):
    path = tmp_path / "wag.yaml"
    path.write_text(
        "gesture: wag\nsizes: {tail: 5 cm}\n"
        "parts:\n  tail.left: [[0, 0], [0.2, 4 cm], [0.4, 0]]\n  legs.out: [[0, 0], [0.4, 1 cm]]\n",
        encoding="utf-8",
    )
    gesture = load_gesture(dachshund, path)
    tail = dachshund.body_map.parts["tail"].length / 0.05
    assert nonzero_offsets(gesture, 0.2)["i.x"] == pytest.approx(-0.04 * tail, abs=1e-4)
    offsets = nonzero_offsets(gesture, 0.4)
    assert offsets["e.x"] == pytest.approx(0.01, abs=1e-4)  # not scaled: no size is given
    assert offsets["f.x"] == pytest.approx(-0.01, abs=1e-4)


MISTAKES = {
    "parts: {tail.left: [[0, 0], [1, x]]}": "wag.yaml:2: parts.tail.left[1]: the value: found 'x'",
    "parts: {tail.out: [[0, 0], [0.2, 1 cm]]}": "it moves a part in the middle out",
    "parts: {tail.up: [[0, 0], [1, 0.1]]}\nmoves: {i.up: [[0, 0], [1, 0.1]]}": "parts with moves",
    "parts: {tail.up: [[0, 0], [1, 0.1]]}\nsizes: {tail: -1 cm}": "sizes.tail",
    "parts: {tail.up: [[0, 0], [1, 0.1]]}\nsizes: {tale: 1 cm}": "sizes.tale",
    "parts: {tail.around: [[0, 0], [1, 0.1]]}": "tail.around",
}


@pytest.mark.parametrize("entry", MISTAKES)
def test_mistakes_in_parts(entry, dachshund, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wag.yaml").write_text(f"gesture: wag\n{entry}\n", encoding="utf-8")
    with pytest.raises(FileError) as error:
        load_gesture(dachshund, "wag.yaml")
    assert MISTAKES[entry] in str(error.value)


def test_a_larger_puppet_with_other_names_walks_in_proportion(hans):
    walk, bundled = (
        load_gesture(puppet, "walk", steps=2) for puppet in (hans, fan.puppets.marionette())
    )
    expected, offsets = (
        nonzero_offsets(bundled, 0.7 * bundled.duration),
        nonzero_offsets(walk, 0.7 * walk.duration),
    )
    assert walk.marks == bundled.marks
    assert offsets["beinfaden_rechts.length"] == pytest.approx(
        1.7 * expected["knee_right.length"], rel=1e-4
    )
    assert offsets["kopffaden.x"] == pytest.approx(1.7 * expected["head.x"], rel=1e-4)
    assert offsets["kopffaden.y"] == pytest.approx(1.7 * expected["head.y"], rel=1e-4)


def test_a_bird_walks_to_where_it_looks(heron):
    walk = load_gesture(heron, "walk", steps=2, step=0.05)
    offsets = nonzero_offsets(walk, walk.duration)
    assert offsets["front.x"] == pytest.approx(-0.1, abs=1e-9)
    assert abs(offsets.get("front.y", 0.0)) < 1e-9
    left = walk.marks["left"]
    assert nonzero_offsets(walk, left)["leg_r.length"] < -0.01  # its left leg, at y < 0


def test_a_dog_walks_on_diagonal_pairs_of_legs(dachshund):
    walk = load_gesture(dachshund, "walk")
    assert list(walk.marks) == ["left", "right", "left 2", "right 2"]
    channels = pieces.channel_names(dachshund.coordinates)
    parts = dachshund.body_map.parts
    lifted = {}
    for mark in ("left", "right"):
        offsets, _ = walk.offsets(walk.marks[mark])
        lifted[mark] = {
            name
            for name, limb in parts.items()
            if limb.kind == "leg"
            and offsets[channels[f"{limb.strings[0]}.length"][1].start] < -0.1 * limb.length
        }
    assert lifted["left"] == {"leg_front_left", "leg_hind_right"}
    assert lifted["right"] == {"leg_front_right", "leg_hind_left"}


def test_puppets_without_pairs_of_legs_do_not_walk(dachshund):
    ends = Ends(BodyParts.for_puppet(dachshund), dachshund.rest())
    body = ends.body_parts.body_map
    arms = tuple(dataclasses.replace(x, kind="arm") for x in body.limbs if x.kind == "leg")
    body_parts = dataclasses.replace(
        ends.body_parts, body_map=dataclasses.replace(body, limbs=arms)
    )
    with pytest.raises(
        StateError, match="it walks on pairs of legs, left and right; the puppet has arm_front"
    ):
        step_gesture(Ends(body_parts, dachshund.rest()), [Step(0.01)])


def test_a_larger_puppet_points_and_looks(hans):
    x0 = hans.rest()
    arm = hans.body_map.parts["arm_right"]
    place = np.array([0.6, -0.5, 0.8])
    gesture = load_gesture(hans, "point", to=place.tolist())
    assert gesture.uses == ("armfaden_rechts",)
    offsets, _ = gesture.offsets(gesture.marks["points"])
    channels = pieces.channel_names(hans.coordinates)
    pose = hans.rest({n: float(x0[n] + offsets[v.start]) for n, (_, v) in channels.items()})
    shoulder = hans.pose(pose, arm.bodies[0])[:3, 3]
    hand = hans.pose(pose, arm.bodies[-1]) @ [*arm.end, 1.0]
    pointing, place_direction = hand[:3] - shoulder, place - shoulder
    cosine = pointing @ place_direction / np.linalg.norm(pointing) / np.linalg.norm(place_direction)
    assert cosine > np.cos(np.radians(2.0))
    look = load_gesture(hans, "look", to=[0.5, 0.5, 0.6])
    offsets, _ = look.offsets(look.marks["there"])
    pose = hans.rest({n: float(x0[n] + offsets[v.start]) for n, (_, v) in channels.items()})
    face = hans.pose(pose, "kopf")[:3, 0]
    assert np.degrees(np.arctan2(face[1], face[0])) == pytest.approx(45.0, abs=3.0)


def test_a_dog_looks_aside(dachshund):
    x0 = dachshund.rest()
    gesture = load_gesture(dachshund, "look", to=[-0.5, 0.5, 0.15])
    offsets, _ = gesture.offsets(gesture.marks["there"])
    channels = pieces.channel_names(dachshund.coordinates)
    pose = dachshund.rest({n: float(x0[n] + offsets[v.start]) for n, (_, v) in channels.items()})
    face = dachshund.pose(pose, "face")[:3, 1]
    assert np.degrees(np.arctan2(face[1], face[0])) == pytest.approx(135.0, abs=15.0)


def test_a_score_gives_the_line_of_a_missing_part(dachshund, tmp_path):
    path = tmp_path / "number.yaml"
    path.write_text(
        "score: number\nlanes:\n  a:\n  - {gesture: clap}\n  - {gesture: wave}\n", encoding="utf-8"
    )
    with pytest.raises(FileError) as error:
        fan.load_score(dachshund, path)
    first, second = map(str, error.value.mistakes)
    assert "number.yaml:4: lanes.a[0].gesture: gesture clap: it moves arm_" in first
    assert "number.yaml:5: lanes.a[1].gesture: gesture wave: it moves arm_right" in second


def test_a_puppet_that_touches_the_floor_looks_aside():
    puppet = zoo.dachshund()
    floored = Marionette(puppet.model_copy(update={"contact": True}))
    gesture = load_gesture(floored, "look", floored.state(), to=[-0.5, 0.5, 0.15])
    assert "a" in gesture.uses
