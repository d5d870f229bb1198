"""Joints found by the shape of a skeleton: names of many programs, and none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.capture.skeletons import CONVENTIONS, POSES, skeleton_of
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini.base.errors import FileError, StateError
from fantoccini.theatre.capture import Capture, Skeleton
from fantoccini.theatre.retarget import draft_mapping, load_mapping, place_clip, recognise
from fantoccini.theatre.retarget.finding import guess_joints
from fantoccini.theatre.retarget.mapping import PARTS


def names_of_joints(skeleton: Skeleton, joints: dict[str, int]) -> dict[str, str]:
    return {part: skeleton.names[joint] for part, joint in joints.items()}


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_joints_of_each_convention_are_found_by_shape_without_doubts(convention, pose, up):
    rows = CONVENTIONS[convention]
    skeleton = skeleton_of(rows, pose, up)
    guess = guess_joints(skeleton)
    assert names_of_joints(skeleton, guess.joints) == rows.joints()
    assert guess.doubts == ()
    assert set(guess.joints) == set(PARTS)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_joints_are_recognised_under_any_prefix(convention):
    rows = replace(CONVENTIONS[convention], prefix="Armature1_")
    skeleton = skeleton_of(rows)
    joints = recognise(skeleton).mapping.find(skeleton)
    assert names_of_joints(skeleton, joints) == rows.joints()


def test_a_prefix_is_no_reason_to_search_by_shape():
    for prefix in ("mixamorig_", "mixamorig1:", "Bip01 ", "DEF-"):
        recognised = recognise(skeleton_of(replace(CONVENTIONS["mixamo:"], prefix=prefix)))
        assert recognised.mapping.mapping == "motionbuilder" and not recognised.by_shape
        assert recognised.notes("a") == ()


def anonymous(skeleton: Skeleton) -> Skeleton:
    names = tuple(f"b{i}" for i in range(len(skeleton.names)))
    return Skeleton(names, skeleton.parents, skeleton.offsets)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("convention", ["mixamo:", "smpl", "bandai", "biped", "unity", "asf"])
def test_without_names_the_toes_distinguish_left_and_right(convention, pose):
    named = skeleton_of(CONVENTIONS[convention], pose, "z")
    guess = guess_joints(anonymous(named))
    expected = CONVENTIONS[convention].joints()
    joints = names_of_joints(named, guess.joints)
    joints["head"] = expected["head"]  # any joint of the head turns with it
    assert joints == expected


def without_joints(skeleton: Skeleton, *words: str) -> Skeleton:
    """A skeleton without joints of these words, and those below them."""
    joints, index = [], {-1: -1}
    for i, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True)):
        if parent in index and not any(word in name for word in words):
            index[i] = len(joints)
            joints.append(i)
    return Skeleton(
        tuple(skeleton.names[i] for i in joints),
        tuple(index[skeleton.parents[i]] for i in joints),
        skeleton.offsets[joints],
    )


def test_without_names_and_toes_nothing_distinguishes_left_and_right():
    footless = without_joints(skeleton_of(CONVENTIONS["bandai"]), "Toes")
    with pytest.raises(StateError, match="neither the joints' names nor toes"):
        guess_joints(without_joints(anonymous(footless), ".end"))


def test_a_joint_that_is_called_as_another_part_is_a_doubt():
    skeleton = skeleton_of(CONVENTIONS["smpl"])
    renamed = {"L_Hip": "L_Knee", "L_Knee": "L_Thigh"}
    names = tuple(renamed.get(name, name) for name in skeleton.names)
    guess = guess_joints(Skeleton(names, skeleton.parents, skeleton.offsets))
    assert names[guess.joints["hip_left"]] == "L_Knee"
    assert "hip_left: 'L_Knee' is the name of a knee" in map(str, guess.doubts)
    assert "knee_left: 'L_Thigh' is the name of a hip" in map(str, guess.doubts)


def test_sides_that_contradict_the_toes_are_a_doubt():
    skeleton = skeleton_of(CONVENTIONS["bandai"])
    mirrored = Skeleton(skeleton.names, skeleton.parents, skeleton.offsets * [-1.0, 1.0, 1.0])
    guess = guess_joints(mirrored)
    assert names_of_joints(skeleton, guess.joints) == CONVENTIONS["bandai"].joints()
    assert [str(doubt) for doubt in guess.doubts] == [
        "the toes point backwards if the names of the sides are right"
    ]


@pytest.mark.parametrize("legs", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_joints_of_a_rest_pose_along_the_bones_axes_are_found(legs):
    """LAFAN1 and Bandai-Namco's data are such; the frames of a clip have the directions."""
    named = skeleton_of(CONVENTIONS["bandai"], "down", "y")
    lengths = np.linalg.norm(named.offsets, axis=1)
    folded = lengths[:, None] * np.array([1.0, 0.0, 0.0])
    limbs = [i for i, name in enumerate(named.names) if name.startswith(("Lower", "Foot", "Hand"))]
    folded[limbs] = lengths[limbs, None] * np.array(legs)
    skeleton = Skeleton(anonymous(named).names, named.parents, folded)
    joints = names_of_joints(named, guess_joints(skeleton, named.rest[None]).joints)
    assert joints | {"head": "Head"} == CONVENTIONS["bandai"].joints()


def test_lengths_of_joints_with_position_channels_are_those_of_the_clip():
    named = skeleton_of(CONVENTIONS["bandai"])
    skeleton = Skeleton(named.names, named.parents, np.zeros_like(named.offsets))
    guess = guess_joints(skeleton, named.rest[None])
    assert names_of_joints(named, guess.joints) == CONVENTIONS["bandai"].joints()


DOG = {
    "Hips": ("", (0, 0, 0.6)),
    "Spine": ("Hips", (0.2, 0, 0.62)),
    "Chest": ("Spine", (0.5, 0, 0.6)),
    "Neck": ("Chest", (0.6, 0, 0.7)),
    "Head": ("Neck", (0.7, 0, 0.8)),
    "Tail1": ("Hips", (-0.1, 0, 0.6)),
    "Tail2": ("Tail1", (-0.3, 0, 0.6)),
}
for _side, _y in (("Left", 0.1), ("Right", -0.1)):
    DOG |= {
        f"{_side}UpLeg": ("Hips", (0, _y, 0.58)),
        f"{_side}Leg": (f"{_side}UpLeg", (0.05, _y, 0.35)),
        f"{_side}Foot": (f"{_side}Leg", (-0.05, _y, 0.1)),
        f"{_side}Toe": (f"{_side}Foot", (0, _y, 0)),
        f"{_side}Shoulder": ("Chest", (0.5, _y, 0.55)),
        f"{_side}Arm": (f"{_side}Shoulder", (0.55, _y, 0.4)),
        f"{_side}ForeArm": (f"{_side}Arm", (0.5, _y, 0.2)),
        f"{_side}Hand": (f"{_side}ForeArm", (0.52, _y, 0)),
    }


def dog_skeleton() -> Skeleton:
    names = tuple(DOG)
    parents = tuple(names.index(parent) if parent else -1 for parent, _ in DOG.values())
    places = np.array([place for _, place in DOG.values()], dtype=float)
    return Skeleton(
        names, parents, np.array([p - places[k] for p, k in zip(places, parents, strict=True)])
    )


def test_animals_are_refused():
    with pytest.raises(FileError, match="stands on four legs, as an animal"):
        recognise(anonymous(dog_skeleton()), "dog.bvh")
    assert len(guess_joints(skeleton_of(CONVENTIONS["vrm"], "down")).joints) == len(PARTS)


def test_two_pairs_that_are_called_legs_are_an_animals():
    skeleton = skeleton_of(CONVENTIONS["smpl"])
    words = {"Shoulder": "Thigh2", "Elbow": "Knee2", "Wrist": "Ankle2", "Hand": "Foot2"}
    names = skeleton.names
    for arm, leg in words.items():
        names = tuple(name.replace(arm, leg) for name in names)
    with pytest.raises(FileError, match="both long pairs of limbs are called legs"):
        recognise(Skeleton(names, skeleton.parents, skeleton.offsets))


def test_a_collar_bone_longer_than_a_forearm_is_none():
    """Without names, a collar bone that begins between the shoulders tells itself apart."""
    named = skeleton_of(CONVENTIONS["bandai"])
    offsets = named.offsets.copy()
    index = {name: i for i, name in enumerate(named.names)}
    for side in "LR":
        collar, arm = (index[f"{part}_{side}"] for part in ("Shoulder", "UpperArm"))
        forearm = index[f"Hand_{side}"]
        offsets[arm] += offsets[collar]
        offsets[collar] = 0.0
        offsets[arm] *= 1.5
        offsets[forearm] *= 0.7
        assert np.linalg.norm(offsets[arm]) > np.linalg.norm(offsets[forearm])
    for skeleton in (named, anonymous(named)):
        longer = Skeleton(skeleton.names, skeleton.parents, offsets)
        joints = names_of_joints(named, guess_joints(longer).joints)
        assert joints | {"head": "Head"} == CONVENTIONS["bandai"].joints()


def test_several_people_are_refused():
    person = skeleton_of(CONVENTIONS["bandai"])
    n = len(person.names)
    both = Skeleton(
        ("stage", *(f"{who}.{name}" for who in "ab" for name in person.names)),
        (-1, *(p + at if p >= 0 else 0 for at in (1, 1 + n) for p in person.parents)),
        np.concatenate([np.zeros((1, 3)), person.offsets, person.offsets]),
    )
    with pytest.raises(FileError, match="4 pairs of limbs, of several people"):
        recognise(both)


def test_notes_say_how_joints_were_found_and_what_is_doubtful():
    skeleton = skeleton_of(CONVENTIONS["bandai"])
    (note,) = recognise(skeleton).notes("bow")
    assert note.startswith("bow: Found by shape: head Head, shoulder_left UpperArm_L, ")
    mirrored = Skeleton(skeleton.names, skeleton.parents, skeleton.offsets * [-1.0, 1.0, 1.0])
    _, warning = recognise(mirrored).notes("bow")
    assert warning.startswith("bow: doubtful: the toes point backwards")
    assert "`fantoccini mapping`" in warning


def test_the_error_names_the_reason_and_the_command():
    skeleton = Skeleton(("a", "b"), (-1, 0), np.ones((2, 3)))
    with pytest.raises(FileError, match=r"found no pairs of limbs.*`fantoccini mapping`.*a, b"):
        recognise(skeleton)


def capture_of(skeleton: Skeleton) -> Capture:
    rest = skeleton.rest[None]
    turns = np.tile(np.eye(3), (1, len(skeleton.names), 1, 1))
    return Capture(skeleton, np.zeros(1), rest, turns, "clip")


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_draft_is_a_mapping_file_of_the_joints_that_are_found(convention, tmp_path):
    skeleton = skeleton_of(CONVENTIONS[convention])
    text = draft_mapping(capture_of(skeleton))
    (tmp_path / "mine.yaml").write_text(text)
    joints = load_mapping(tmp_path / "mine.yaml").find(skeleton)
    assert names_of_joints(skeleton, joints) == CONVENTIONS[convention].joints()
    listed = [line.removeprefix("#").strip() for line in text.splitlines() if line[:2] == "# "]
    assert set(skeleton.names) <= set(listed)


def test_a_draft_has_its_doubts_beside_the_joints():
    skeleton = skeleton_of(CONVENTIONS["smpl"])
    names = tuple(
        name.replace("L_Hip", "L_Knie").replace("L_Knee", "L_Thigh") for name in skeleton.names
    )
    text = draft_mapping(
        capture_of(Skeleton(names, skeleton.parents, skeleton.offsets * [-1, 1, 1]))
    )
    assert "# Doubtful: the toes point backwards" in text
    (line,) = [line for line in text.splitlines() if line.startswith("  knee_left:")]
    assert line.startswith("  knee_left: L_Thigh  ") and "# 'L_Thigh' is the name of" in line


def test_a_draft_of_no_person_is_to_be_filled_in(tmp_path):
    text = draft_mapping(capture_of(anonymous(dog_skeleton())))
    assert "  head:" in text and text.count("# which joint?") == len(PARTS)
    assert "#           b4" in text
    (tmp_path / "mine.yaml").write_text(text)
    with pytest.raises(FileError, match=r"mine\.yaml:4: joints\.head"):
        load_mapping(tmp_path / "mine.yaml")


def puppet_with_other_names() -> fan.Marionette:
    text = fan.puppets.path("marionette").read_text()
    for old, new in (
        ("torso", "rumpf"),
        ("skull", "kopf"),
        ("thigh", "schenkel"),
        ("shin", "wade"),
    ):
        text = text.replace(old, new)
    return fan.loads(text)


def test_a_draft_names_the_bodies_of_a_puppet_with_other_names(marionette, tmp_path):
    clip = capture_of(skeleton_of(CONVENTIONS["bandai"]))
    assert "puppet:" not in draft_mapping(clip, marionette)
    (tmp_path / "mine.yaml").write_text(draft_mapping(clip, puppet_with_other_names()))
    bodies = load_mapping(tmp_path / "mine.yaml").puppet
    named = {part: body_file.body for part, body_file in bodies.items()}
    assert named["trunk"] == "rumpf" and named["head"] == "kopf"
    for side in ("left", "right"):
        assert named[f"thigh_{side}"] == f"schenkel_{side}"
        assert named[f"shin_{side}"] == f"wade_{side}"
        assert named[f"upper_arm_{side}"] == f"upper_arm_{side}"
        np.testing.assert_allclose(bodies[f"shin_{side}"].end, [0.02, 0, -0.126], atol=0.02)


@pytest.mark.medium
def test_the_command_writes_a_mapping_file(tmp_path):
    out = tmp_path / "mine.yaml"
    result = fantoccini("mapping", "jumps", "marionette", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert load_mapping(out).joints["elbow_left"] == "LeftForeArm"
    printed = fantoccini("mapping", "jumps", "--quiet")
    assert printed.stdout == out.read_text()
    assert "exists already" in mistake("mapping", "jumps", "--out", out)
    assert "--out" in mistake("mapping", "jumps", "--out", tmp_path / "mine.txt")


@pytest.mark.medium
def test_our_own_bvh_export_comes_back(marionette, tmp_path):
    """The targets are the places that the parts had in the run, relative to the hips.

    The head's are not: its mean over a clip is taken as upright.
    """
    x0 = marionette.rest()
    length = x0["hand_left.length"]
    lift = fan.Input.waypoints(
        marionette, {"hand_left.length": [(0.0, length), (1.0, length - 0.1)]}
    )
    run = fan.simulate(marionette, x0, lift, t_end=1.0, effort=False)
    path = fan.export(run, tmp_path / "run.bvh", fps=20)
    placed = place_clip(marionette, path)
    assert any("Found by shape" in note for note in placed.clip.notes)
    assert not any("doubtful" in note for note in placed.clip.notes)
    targets = placed.targets
    samples = run.resample(placed.clip.t - placed.clip.t[0] + run.t[0])
    poses = marionette.poses(samples.q_D, samples.q_K)
    for part, (body, at) in placed.figure.points.items():
        if part == "head":
            continue
        from_trunk = point_in(marionette, poses, (body, at)) - point_in(
            marionette, poses, placed.figure.points["trunk"]
        )
        errors = targets.parts[part] - targets.parts["trunk"] - from_trunk
        assert np.max(np.linalg.norm(errors, axis=1)) < 0.02, part


def point_in(marionette: fan.Marionette, poses: np.ndarray, point) -> np.ndarray:
    """(T, 3) position of a point of a body."""
    frame = poses[:, marionette.link_index(point[0])]
    return frame[:, :, :3] @ np.array(point[1]) + frame[:, :, 3]
