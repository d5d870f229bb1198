"""Captured motion on the marionette: mappings, closed forms, hanging poses, runs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks.capture.clips import write
from scipy.spatial.transform import Rotation
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.base.errors import FileError, StateError
from fantoccini.theatre.capture import Capture, Skeleton
from fantoccini.theatre.retarget import (
    figure_of,
    find_mapping,
    load_mapping,
    mapping_names,
    retargeting,
)
from fantoccini.theatre.retarget.deviations import PART_GROUPS, find_losses, limb_bends, lost_share
from fantoccini.theatre.retarget.following import (
    MAX_ACCELERATION,
    MAX_SPEED,
    FollowStatus,
    eased_times,
)
from fantoccini.theatre.retarget.mapping import PARTS, joints_of
from fantoccini.theatre.retarget.placing import part_targets

pytestmark = [pytest.mark.medium, pytest.mark.long]

NAMES = (
    "Hips",
    "LeftUpLeg",
    "LeftLeg",
    "LeftFoot",
    "RightUpLeg",
    "RightLeg",
    "RightFoot",
    "LeftArm",
    "LeftForeArm",
    "LeftHand",
    "RightArm",
    "RightForeArm",
    "RightHand",
    "Head",
)
STANDS = np.array(
    [
        [0, 0, 0.95],
        [0, 0.1, 0.95],
        [0, 0.1, 0.5],
        [0, 0.1, 0.05],
        [0, -0.1, 0.95],
        [0, -0.1, 0.5],
        [0, -0.1, 0.05],
        [0, 0.2, 1.45],
        [0, 0.2, 1.15],
        [0, 0.2, 0.9],
        [0, -0.2, 1.45],
        [0, -0.2, 1.15],
        [0, -0.2, 0.9],
        [0, 0, 1.6],
    ]
)


def write_clip(folder: Path, convention: str, name: str) -> Path:
    """Path of one of the project's own clips."""
    (folder / convention).mkdir()
    return next(path for path in write(folder / convention, convention) if path.stem == name)


def capture_of(positions: np.ndarray, head: np.ndarray | None = None) -> Capture:
    """A clip of joints at places (T, 14, 3), with the head's orientations (T, 3, 3)."""
    n = len(positions)
    rotations = np.broadcast_to(np.eye(3), (n, len(NAMES), 3, 3)).copy()
    if head is not None:
        rotations[:, -1] = head
    skeleton = Skeleton(NAMES, (-1,) * len(NAMES), np.zeros((len(NAMES), 3)))
    return Capture(skeleton, np.arange(n) / 30.0, positions, rotations, "made")


def place_on_puppet(marionette: fan.Marionette, clip: Capture, travel: float = 1.0):
    figure = figure_of(marionette, marionette.rest())
    joints = joints_of(find_mapping(clip.skeleton), clip.skeleton)
    return figure, part_targets(figure, clip, joints, travel)


def test_the_bundled_mappings_name_all_parts_of_the_three_conventions(tmp_path):
    assert mapping_names() == ("biovision", "makehuman", "motionbuilder", "poser")
    for convention in ("cmu", "mixamo", "lafan1"):
        path = write_clip(tmp_path, convention, "wave")
        skeleton = fan.theatre.load_bvh(path).skeleton
        joints = joints_of(find_mapping(skeleton), skeleton)
        assert set(joints) == set(PARTS)
        assert skeleton.names[joints["elbow_left"]].endswith("LeftForeArm")


def test_a_mapping_file_of_twenty_lines_is_enough(tmp_path):
    for name in mapping_names():
        lines = load_mapping(name).model_dump()
        assert len(lines["joints"]) + 3 <= 20
    names = tuple(f"b{i}" for i in range(len(NAMES)))
    skeleton = Skeleton(names, (-1,) * len(names), np.zeros((len(names), 3)))
    with pytest.raises(FileError, match=r"no bundled mapping.*the joints are b0, b1"):
        find_mapping(skeleton)
    usual = load_mapping("motionbuilder").joints
    text = "mapping: mine\njoints:\n" + "".join(
        f"  {part}: b{NAMES.index(joint)}\n" for part, joint in usual.items()
    )
    (tmp_path / "mine.yaml").write_text(text)
    joints = joints_of(load_mapping(tmp_path / "mine.yaml"), skeleton)
    assert joints["hand_right"] == NAMES.index("RightHand")


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("  head: Head\n", ""), 2, "found no head"),
        (("head: Head", "hed: Head"), 3, "'hed' is no part; did you mean 'head'?"),
        (("mapping: m", "mapping: 1 2"), 1, "mapping"),
        (("joints:", "joint:"), 2, "did you mean 'joints'"),
        (("RightHand", "LeftHand"), 2, "found 'LeftHand' twice"),
        (("joints:", "puppet: {trunk: {body: t, ends: [0, 0, 0]}}\njoints:"), 2, "ends"),
    ],
)
def test_mistakes_in_a_mapping_have_their_lines(tmp_path, change, line, message):
    joints = load_mapping("motionbuilder").joints
    text = "mapping: m\njoints:\n" + "".join(f"  {a}: {b}\n" for a, b in joints.items())
    (tmp_path / "m.yaml").write_text(text.replace(*change))
    with pytest.raises(FileError, match=rf"m\.yaml:{line}: .*{message}"):
        load_mapping(tmp_path / "m.yaml")


def test_joints_that_a_skeleton_does_not_have_are_named(tmp_path):
    mapping = load_mapping("poser")
    skeleton = Skeleton(NAMES, (-1,) * len(NAMES), np.zeros((len(NAMES), 3)))
    with pytest.raises(FileError, match=r"joints\.elbow_left: the skeleton has no joint"):
        joints_of(mapping, skeleton, "clip.bvh")


def test_a_person_who_stands_straight_is_a_puppet_that_stands_straight(marionette):
    """Every part hangs below its parent at the puppet's own lengths, in closed form."""
    figure, places = place_on_puppet(marionette, capture_of(STANDS[None]))
    positions = {part: value[0] for part, value in places.parts.items()}
    np.testing.assert_allclose(places.scale, figure.leg_length / 0.9, rtol=1e-12)
    for side, y in (("left", 1.0), ("right", -1.0)):
        np.testing.assert_allclose(
            positions[f"hip_{side}"] - positions["trunk"], [0, 0.033 * y, 0], atol=1e-12
        )
        down = positions[f"knee_{side}"] - positions[f"hip_{side}"]
        np.testing.assert_allclose(down, [0, 0, -0.125], atol=1e-12)
        arm = positions[f"elbow_{side}"] - positions[f"shoulder_{side}"]
        np.testing.assert_allclose(arm, [0, 0, -0.1], atol=1e-12)
    np.testing.assert_allclose(positions["head"] - positions["neck"], [0, 0, 0.137], atol=1e-12)
    feet = min(figure.positions[f"foot_{side}"][2] for side in ("left", "right"))
    straight = 0.03 * (0.125 + 0.126)  # limbs are stretched to 97 per cent
    np.testing.assert_allclose(positions["foot_left"][2], feet + straight, atol=1e-9)


def test_a_clip_turned_and_moved_is_the_same_clip(marionette):
    """The clip begins at the puppet's place and in its direction."""
    rng = np.random.default_rng(0)
    moving = STANDS + 0.05 * np.cumsum(rng.normal(size=(20, 1, 3)), axis=0)
    moving = moving + 0.02 * rng.normal(size=(20, len(NAMES), 3))
    turn = Rotation.from_euler("z", 100, degrees=True).as_matrix()
    head = Rotation.random(20, random_state=0).as_matrix()
    _, places = place_on_puppet(marionette, capture_of(moving, head))
    shifted = moving @ turn.T + [3.0, -2.0, 0.4]
    _, shifted_targets = place_on_puppet(marionette, capture_of(shifted, turn @ head))
    for part, path in places.parts.items():
        np.testing.assert_allclose(shifted_targets.parts[part], path, atol=1e-9)
    _, targets_on_spot = place_on_puppet(marionette, capture_of(moving, head), travel=0.0)
    start = places.parts["trunk"][:1, :2].repeat(20, axis=0)
    np.testing.assert_allclose(targets_on_spot.parts["trunk"][:, :2], start, atol=1e-12)


def test_lengths_are_the_puppets_and_directions_the_persons(marionette):
    bent = np.repeat(STANDS[None], 2, axis=0)
    bent[1, NAMES.index("LeftForeArm")] = [0.3, 0.2, 1.45]  # the upper arm points forward
    bent[1, NAMES.index("LeftHand")] = [0.3, 0.2, 1.7]  # and the forearm up
    _, places = place_on_puppet(marionette, capture_of(bent))
    positions = {part: value[1] for part, value in places.parts.items()}
    np.testing.assert_allclose(
        positions["elbow_left"] - positions["shoulder_left"], [0.1, 0, 0], atol=1e-12
    )
    hand = positions["hand_left"] - positions["elbow_left"]
    np.testing.assert_allclose(hand, [0, 0, 0.09], atol=1e-12)


def test_hanging_poses_hang_and_miss_the_clip_by_no_more_than_stated(marionette, tmp_path):
    path = write_clip(tmp_path, "lafan1", "wave")
    retargeted = fan.theatre.retarget_clip(marionette, path)
    assert (
        len(retargeted.t)
        == len(retargeted.hanging_poses)
        == fan.theatre.load_bvh(path).positions.shape[0]
    )
    for i in range(0, len(retargeted.t), 30):
        state = retargeted.hanging_poses[i].state
        force = marionette.forward_dynamics(state)
        assert np.max(np.abs(force.acc_D)) < 1e-3
    # Place of the point according to the body's pose.
    pose = marionette.pose(retargeted.hanging_poses[40].state, "forearm_right")
    hand = pose[:3, 3] + pose[:3, :3] @ [0.0, 0.0, -0.09]
    np.testing.assert_allclose(retargeted.hanging_positions["hand_right"][40], hand, atol=1e-9)
    distance = np.linalg.norm(hand - retargeted.targets.parts["hand_right"][40])
    assert retargeted.errors["hand_right"][40] == pytest.approx(distance, abs=1e-9)
    # Up to 8 cm of 56 are beyond the strings' reach where an arm points to the side; the head is
    # not.
    assert np.max(retargeted.errors["head"]) < 0.02 * retargeted.figure.height
    assert retargeted.settled > 0.25 * len(retargeted.t)


def test_more_steps_do_not_worsen_a_path(marionette, monkeypatch):
    """Steps along a path alone may diverge: they are undone where they do."""
    costs = []
    for iterations in (10, 100):
        monkeypatch.setattr(retargeting, "MAX_ITERATIONS", iterations)
        retargeted = fan.theatre.retarget_clip(marionette, "walk_up")
        costs.append(sum(np.mean(np.square(e)) for e in retargeted.errors.values()))
        for i in range(0, len(retargeted.t), 7):
            force = marionette.forward_dynamics(retargeted.hanging_poses[i].state)
            assert np.max(np.abs(force.acc_D)) < 1e-3
    assert costs[1] < 1.2 * costs[0]


@pytest.mark.slow
def test_a_waving_person_is_followed_within_the_bounds(marionette, tmp_path):
    path = write_clip(tmp_path, "cmu", "wave")
    shares = []
    followed = fan.theatre.follow_clip(
        marionette, path, progress=lambda step: shares.append(step.share)
    )
    assert followed and followed.run.t[-1] > followed.t[-1]
    assert np.max(np.abs(followed.run.v_K)) <= MAX_SPEED * (1 + 1e-9)
    assert np.max(np.abs(followed.acc_K)) <= MAX_ACCELERATION * (1 + 1e-9)
    assert shares[-1] == 1.0 and shares == sorted(shares)
    errors = {part.name: part for part in followed.report}
    assert set(errors) == set(PART_GROUPS)
    assert errors["hands"].excess < 0.02 and errors["head"].excess < 0.02
    lines = followed.guides(np.array([0.0, 1.0]))
    assert [line.shape for line in lines] == [(2, 3, 3), (2, 4, 3), (2, 4, 3), (2, 4, 3), (2, 4, 3)]
    replay = fan.simulate(marionette, followed.run.state(0), followed.inputs, effort=False)
    np.testing.assert_array_equal(replay.q_D[-1], followed.run.q_D[-1])


@pytest.mark.slow
def test_slow_hands_follow_worse_and_keep_their_bounds(marionette, tmp_path):
    path = write_clip(tmp_path, "mixamo", "wave")
    followed = fan.theatre.follow_clip(marionette, path, speed=0.2, acceleration=2.0)
    assert np.max(np.abs(followed.run.v_K)) <= 0.2 * (1 + 1e-9)
    assert np.max(np.abs(followed.acc_K)) <= 2.0 * (1 + 1e-9)
    assert {part.name: part.excess for part in followed.report}["hands"] > 0.02


@pytest.mark.slow
def test_a_run_that_begins_later_follows_as_well(marionette, tmp_path):
    path = write_clip(tmp_path, "lafan1", "wave")
    retargeted = fan.theatre.retarget_clip(marionette, path, start=marionette.rest().replace(t=5.0))
    followed = fan.theatre.follow_clip(marionette, retargeted)
    assert followed.run.t[0] == 5.0 == followed.t[0]
    assert all(part.excess < 0.02 for part in followed.report)
    speeds = np.abs(followed.run.v_K[-1])
    assert np.max(speeds) < 1e-9, "the hands are at rest in the end"
    with pytest.raises(StateError, match="has its mapping, start, travel, up and of already"):
        fan.theatre.follow_clip(marionette, retargeted, travel=0.5)


def test_an_interrupted_run_is_reported(marionette, tmp_path, monkeypatch):
    """A loop ends where a string stops it, and fails even if its inputs continue."""
    path = write_clip(tmp_path, "lafan1", "wave")
    from fantoccini.dynamics.steppers import Stepper

    advance = Stepper.advance

    def advance_until_one_second(self, *arguments, **options):
        advanced = advance(self, *arguments, **options)
        if self.state.t > 1.0:
            monkeypatch.setattr(Stepper, "arrived", property(lambda self: False))
        return advanced

    monkeypatch.setattr(Stepper, "advance", advance_until_one_second)
    followed = fan.theatre.follow_clip(marionette, path)
    assert followed.status is FollowStatus.STOPPED and not followed
    assert len(followed.acc_K) in (20, 21) and followed.run.t[-1] < 1.1


def test_a_run_far_from_its_clip_does_not_follow(marionette, monkeypatch):
    """Hands at rest leave the puppet behind; smaller shares of the bounds are tried."""
    bounds = []

    def resting_hands(puppet, x0, until, tracks, speed, acceleration, progress):
        bounds.append((speed["hand_left.x"], acceleration["head.length"]))
        return np.zeros((int(np.ceil(until / 0.05)) + 1, puppet.coordinates.n_vK)), True

    monkeypatch.setattr("fantoccini.theatre.retarget.following.follow_tracks", resting_hands)
    retargeted = fan.theatre.retarget_clip(marionette, "walk_up")
    followed = fan.theatre.follow_clip(
        marionette, retargeted, speed=1.0, acceleration={"head.length": 4.0}
    )
    assert followed.status is FollowStatus.DIVERGED and not followed
    assert followed.error > 0.15 > followed.pose_error
    assert bounds == [(1.0, 4.0), (0.5, 2.0), (0.25, 1.0)]
    result = fantoccini("follow", "walk_up", "marionette", "--quiet")
    assert result.exit_code == 1
    assert "does not follow: the error of its" in result.stderr and "slower hands" in result.stderr


def test_the_report_tells_of_legs_that_do_not_bend():
    """Knees of the clip bend to 60 degrees and back, those of the run hang straight."""
    angles = np.radians(60.0) * np.sin(np.linspace(0.0, np.pi, 31))
    shin = np.stack([np.zeros(31), np.sin(angles), -np.cos(angles)], axis=1)
    clip, run = {}, {}
    for side in ("left", "right"):
        for upper, middle, end in (("hip", "knee", "foot"), ("shoulder", "elbow", "hand")):
            for paths in (clip, run):
                paths[f"{upper}_{side}"] = np.zeros((31, 3))
                paths[f"{middle}_{side}"] = np.tile([0.0, 0.0, -1.0], (31, 1))
                paths[f"{end}_{side}"] = np.tile([0.0, 0.0, -2.0], (31, 1))
        clip[f"foot_{side}"] = clip[f"knee_{side}"] + shin
    elbows, knees = limb_bends(clip, run)
    assert (elbows.clip, elbows.run, elbows.error) == (0.0, 0.0, 0.0)
    assert knees.run == 0.0 and knees.clip == pytest.approx(np.radians(60.0))
    assert knees.error == pytest.approx(np.sqrt(np.mean(angles**2)))


def test_a_part_that_is_lost_for_a_while_is_reported_with_its_time():
    """A hand that swings over its string is off for a second, which a mean over the clip hides."""
    t = np.linspace(0.0, 10.0, 301)
    hanging = {"head": np.full(301, 0.01), "hand_left": np.full(301, 0.05)}
    run = {part: error + 0.01 for part, error in hanging.items()}
    run["hand_left"] = np.where((t > 4.0) & (t < 5.5), 0.3, run["hand_left"])
    run["head"] = np.where((t > 7.0) & (t < 7.2), 0.3, run["head"])  # too short
    (loss,) = find_losses(t, run, hanging, 0.08)
    assert loss.part == "hand_left" and loss.distance == 0.3
    assert (loss.begin, loss.end) == pytest.approx((4.0, 5.5), abs=0.05)
    assert str(loss) == "hand_left is lost from t = 4.03 to 5.47 s, up to 300 mm from the clip"
    assert lost_share((loss,), 10.0) == pytest.approx(0.144, abs=0.01)
    run["hand_left"] = np.where(t > 4.0, 0.3, 0.05)  # until the end
    assert lost_share(find_losses(t, run, hanging, 0.08), 10.0) == pytest.approx(0.6, abs=0.01)


@pytest.mark.slow
def test_a_limb_that_is_lost_for_a_third_of_the_clip_does_not_follow(marionette, monkeypatch):
    """One hand off by 20 % of the height for a third of the time is 8 % of both hands' mean."""
    from fantoccini.theatre.retarget import following

    measured = following.part_errors

    def one_hand_off(retargeted, run, t):
        errors = measured(retargeted, run, t)
        third = np.arange(len(t)) < len(t) // 3
        distant = retargeted.errors["hand_left"] + 0.2 * retargeted.figure.height
        return errors | {"hand_left": np.where(third, distant, errors["hand_left"])}

    hung = fan.theatre.retarget_clip(marionette, "walk_up")
    monkeypatch.setattr(following, "part_errors", one_hand_off)
    monkeypatch.setattr(following, "REDUCED_BOUND_FACTORS", ())
    lost = fan.theatre.follow_clip(marionette, hung)
    assert lost.status is FollowStatus.DIVERGED and lost.error < 0.15
    assert [loss.part for loss in lost.losses] == ["hand_left"]


@pytest.mark.slow
def test_strings_that_pass_through_one_another_are_counted_and_avoided_where_leaning_helps(
    marionette,
):
    vertical = fan.theatre.follow_clip(marionette, fan.theatre.retarget_clip(marionette, "walk_up"))
    followed = fan.theatre.follow_clip(marionette, "walk_up")
    assert followed and len(followed.crossings) < len(vertical.crossings)


def test_a_clip_of_a_crawling_person_has_a_remark(marionette):
    """A clip of a person lying down cannot be told from one with the wrong vertical axis."""
    stands = np.repeat(STANDS[None], 3, axis=0)
    assert fan.theatre.retarget_clip(marionette, capture_of(stands)).remarks == ()
    lies = fan.theatre.retarget_clip(
        marionette, capture_of(stands[..., [0, 2, 1]] * [1, 1, -1]), up="z"
    )
    (remark,) = lies.remarks
    assert "the trunk is 90 degrees off the vertical" in remark


def test_a_single_pose_is_held(marionette):
    retargeted = fan.theatre.retarget_clip(marionette, capture_of(STANDS[None]))
    assert retargeted.t == pytest.approx([0.0, 1.0])
    np.testing.assert_allclose(*retargeted.hanging_poses.q_K, atol=1e-3)


SCENE = """scene: s
puppets:
  - {name: anna, puppet: marionette}
  - {name: otto, puppet: string_pendulum, at: [2, 0, 0]}
"""


@pytest.mark.slow
def test_a_member_of_a_scene_follows(marionette):
    scene = fan.loads(SCENE)
    for of in ("", "anna"):
        retargeted = fan.theatre.retarget_clip(
            scene, capture_of(np.repeat(STANDS[None], 2, axis=0)), of=of
        )
        assert retargeted.figure.points["trunk"][0] == "anna.torso"
        alone = fan.theatre.retarget_clip(
            marionette, capture_of(np.repeat(STANDS[None], 2, axis=0))
        )
        for part, places in alone.hanging_positions.items():
            np.testing.assert_allclose(retargeted.hanging_positions[part], places, atol=2e-3)
    with pytest.raises(fan.errors.UnknownNameError, match="no member of a scene is called 'otta'"):
        fan.theatre.retarget_clip(scene, capture_of(STANDS[None]), of="otta")
    with pytest.raises(StateError, match=r"has no body 'otto\.torso'"):
        fan.theatre.retarget_clip(scene, capture_of(STANDS[None]), of="otto")


def test_clips_that_show_no_person_are_refused(marionette):
    standing = np.repeat(STANDS[None], 3, axis=0)
    with_nan = standing.copy()
    with_nan[2, NAMES.index("LeftHand")] = np.nan
    with pytest.raises(StateError, match="hand_left is nowhere in frame 2"):
        fan.theatre.retarget_clip(marionette, capture_of(with_nan))
    without_forearm = standing.copy()
    without_forearm[:, NAMES.index("LeftHand")] = without_forearm[:, NAMES.index("LeftForeArm")]
    with pytest.raises(StateError, match="no length from elbow_left to hand_left"):
        fan.theatre.retarget_clip(marionette, capture_of(without_forearm))
    lying = standing[..., [2, 1, 0]]
    with pytest.raises(StateError, match="trunks point along x"):
        fan.theatre.retarget_clip(marionette, capture_of(lying))
    with pytest.raises(StateError, match="up is 'x'"):
        fan.theatre.retarget_clip(marionette, capture_of(standing), up="x")
    with pytest.raises(StateError, match="follow"):
        fan.theatre.retarget_clip(fan.puppets.promenade(), capture_of(standing))


def test_two_people_in_one_file_are_distinguished():
    names = tuple(f"{who}:{name}" for who in ("a", "b") for name in NAMES)
    skeleton = Skeleton(names, (-1,) * len(names), np.zeros((len(names), 3)))
    with pytest.raises(FileError, match="no bundled mapping"):
        find_mapping(skeleton)
    usual = load_mapping("motionbuilder")
    second = usual.model_copy(update={"joints": {p: f"b:{j}" for p, j in usual.joints.items()}})
    assert joints_of(second, skeleton)["head"] == len(NAMES) + NAMES.index("Head")


def test_clip_time_begins_and_ends_at_rest():
    t = np.linspace(0.0, 3.0, 3001)
    clip_time = eased_times(t)
    speed = np.gradient(t, clip_time)
    assert clip_time[0] == 0.0 and clip_time[-1] == pytest.approx(3.5)
    assert np.all(np.diff(clip_time) > 0.0) and np.max(speed) < 1.0 + 1e-6
    inside = (clip_time > 0.6) & (clip_time < 2.9)
    np.testing.assert_allclose(speed[inside], 1.0, atol=1e-6)
    accelerating = (clip_time > 0.1) & (clip_time < 0.4)
    np.testing.assert_allclose(np.gradient(speed, clip_time)[accelerating], 2.0, atol=1e-2)
    short = eased_times(np.linspace(0.0, 0.1, 11))
    assert short[-1] == pytest.approx(0.2) and np.all(np.diff(short) > 0.0)


def test_a_calibration_pose_is_left_out():
    moving = STANDS + np.linspace(0.0, 0.1, 30)[:, None, None]
    with_pose = np.concatenate([STANDS[None] + [0.0, 0.0, 5.0], moving])
    assert len(capture_of(with_pose).without_calibration().t) == 30
    assert len(capture_of(moving).without_calibration().t) == 30


def test_puppets_without_a_persons_bodies_are_refused(marionette):
    with pytest.raises(StateError, match="arm2d has no body 'torso', the trunk of a person"):
        fan.theatre.retarget_clip(fan.puppets.arm2d(), "jumps")


def test_bundled_clips_come_with_their_notice():
    folder = Path(fan.theatre.capture.__file__).parent / "clips"
    assert "NSF EIA-0196217" in (folder / "NOTICE").read_text()
    for name in fan.theatre.clip_names():
        read = fan.theatre.load_bvh(name)
        assert read.name == name and read.unit[0] == "CMU"
        assert 1.3 < read.upright().height < 1.9


def test_the_command_follows_and_writes(tmp_path):
    path = write_clip(tmp_path, "lafan1", "bow")
    out = ("--out", str(tmp_path / "bow.npz"), "--save", str(tmp_path / "take.npz"))
    result = fantoccini("follow", str(path), "marionette", *out)
    assert result.exit_code == 0, result.stderr
    assert "hands" in result.stdout and "trunk" in result.stdout
    assert "of the height [%]" in result.stdout and "Bending: ranges of the angles" in result.stdout
    assert re.search(r"up to \d+\.\d % of the height from the clip", result.stdout)
    run = fan.Trajectory.load(tmp_path / "bow.npz")
    assert run.t[-1] > 6.0
    assert re.search(rf"duration of the run, .* {run.duration:.4g}\n", result.stdout)
    assert fan.theatre.Recording.load(tmp_path / "take.npz").duration > 6.0
    failed = fantoccini("follow", str(path), "marionette", "--mapping", "posr")
    assert failed.exit_code == 2 and "did you mean 'poser'" in failed.stderr
