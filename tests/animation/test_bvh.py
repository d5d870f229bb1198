"""BVH files, read by pybvh, bvhio and our own reader; angles compared with SciPy's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial.transform import Rotation, Slerp
from tests.animation.test_glb import still_of
from tests.plays.tiny import write_play

import fantoccini as fan
from fantoccini.output.animation.euler import euler_angles, order_and_angles
from fantoccini.theatre.capture import Capture

pytestmark = pytest.mark.slow

UPRIGHT = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""Rotation from z up to y up."""
EXACT = 1e-8
"""Ten decimal places of metres and degrees, along a limb of several joints [m]."""

SIDES = ("upper_arm", "forearm", "thigh", "shin")
BODIES = {"torso", "skull", *(f"{x}_{side}" for x in SIDES for side in ("left", "right"))}
"""Bodies of the marionette."""


def frame_poses(run: fan.Trajectory, fps: float) -> dict[str, np.ndarray]:
    """(T, 3, 4) poses of all links at the frames, turned to y up."""
    t = run.t[0] + np.arange(int(run.duration * fps * (1 + 1e-12)) + 1) / fps
    still, even = still_of(run), run.resample(np.minimum(t, run.t[-1]))
    poses = UPRIGHT @ still.poses(even.q_D, even.q_K)
    return {link.name: poses[:, k] for k, link in enumerate(still.tree.links)}


def check(clip: Capture, run: fan.Trajectory, fps: float) -> set[str]:
    """Joints have the places and orientations of the bodies; returns the names of the bodies."""
    poses, joints = frame_poses(run, fps), set(clip.skeleton.names)
    bodies = joints & {link.name for link in still_of(run).tree.links}
    for name in bodies:
        k = clip.skeleton.index(name)
        assert np.abs(clip.positions[:, k] - poses[name][..., 3]).max() < EXACT, name
        mine = clip.rotations[:, k] @ clip.rotations[0, k].T
        theirs = poses[name][..., :3] @ poses[name][0, :, :3].T
        assert np.abs(mine - theirs).max() < EXACT, name
    return bodies


def channels(path: Path) -> np.ndarray:
    """(T, n) numbers after the header."""
    return np.loadtxt(path.read_text().split("Frame Time:")[1].splitlines()[1:], ndmin=2)


@pytest.mark.filterwarnings("ignore")
def test_pybvh_places_the_bodies_as_the_run_does(greeting: fan.Trajectory, tmp_path: Path) -> None:
    pybvh = pytest.importorskip("pybvh")
    path = fan.export(greeting, tmp_path / "greeting.bvh", fps=24)
    clip = pybvh.read_bvh_file(path, world_up="+y")
    theirs = pybvh.frames_to_node_positions(clip)
    poses, names = frame_poses(greeting, 24), [node.name for node in clip.nodes]
    assert clip.frame_time == pytest.approx(1 / 24, abs=1e-12)
    assert set(names) >= BODIES and clip.root.name == "torso"
    for name in BODIES:
        places = theirs[:, names.index(name)]
        assert np.abs(places - poses[name][..., 3]).max() < EXACT, name


def test_our_reader_returns_metres(greeting: fan.Trajectory, tmp_path: Path) -> None:
    clip = fan.theatre.load_bvh(fan.export(greeting, tmp_path / "greeting.bvh"))
    assert check(clip, greeting, 60) == BODIES
    assert clip.t == pytest.approx(np.arange(601) / 60, abs=1e-8)
    assert (clip.unit, clip.vertical_axis) == (("m", 1.0), 1)
    upright = clip.upright()
    run = greeting.resample(upright.t)
    still = still_of(greeting)
    k = [link.name for link in still.tree.links].index("skull")
    wanted = still.poses(run.q_D, run.q_K)[:, k, :, 3]
    assert np.abs(upright.positions[:, clip.skeleton.index("skull")] - wanted).max() < EXACT


def test_the_skeleton_is_the_puppet_with_joints_at_zero(
    greeting: fan.Trajectory, tmp_path: Path
) -> None:
    clip = fan.theatre.load_bvh(fan.export(greeting, tmp_path / "greeting.bvh", fps=1))
    still = still_of(greeting)
    start = np.zeros_like(greeting.q_D[0])
    names = list(still.coordinates.q_D)
    start[[k for k, name in enumerate(names) if name.endswith(".qw")]] = 1.0
    rest = still.poses(start, greeting.q_K[0])[0, :, :, 3] @ UPRIGHT.T
    links = [link.name for link in still.tree.links]
    for name, place in zip(clip.skeleton.names, clip.skeleton.rest, strict=True):
        if not name.endswith(".end"):
            wanted = rest[links.index(name)] - rest[links.index(clip.skeleton.names[0])]
            assert np.abs(place - wanted).max() < EXACT, name
    # Tips of limbs: beyond a bone's length, and long enough to be visible.
    tips = [k for k, name in enumerate(clip.skeleton.names) if name.endswith(".end")]
    assert np.all(np.linalg.norm(clip.skeleton.offsets[tips], axis=1) > 5e-3)


def test_angles_do_not_jump(greeting: fan.Trajectory, tmp_path: Path) -> None:
    turns = channels(fan.export(greeting, tmp_path / "greeting.bvh", fps=120))[:, 3:]
    assert np.abs(np.diff(turns, axis=0)).max() < 20.0


@pytest.mark.filterwarnings("ignore")
def test_members_and_sliding_bodies_have_places_under_one_root(tmp_path: Path) -> None:
    bvhio = pytest.importorskip("bvhio")
    two = fan.theatre.verify_play(fan.load_play(write_play(tmp_path))).run
    crane = fan.puppets.crane()
    drive = fan.Input.waypoints(crane, {"trolley": [(0, 0), (1.0, 0.6)]})
    carried = fan.simulate(crane, crane.rest(), drive, t_end=1.0)
    for run, bodies in ((two, {"one.ball", "two.ball"}), (carried, {"rail", "trolley", "load"})):
        path = fan.export(run, tmp_path / "run.bvh", fps=10)
        clip, other = fan.theatre.load_bvh(path), bvhio.readAsHierarchy(str(path))
        assert clip.skeleton.names[0] == run.puppet.name
        assert clip.skeleton.parents.count(-1) == 1
        assert check(clip, run, 10) == bodies
        poses = frame_poses(run, 10)
        moved = [np.ptp(poses[name][..., 3], axis=0).max() for name in sorted(bodies)]
        assert max(moved) > 0.05
        other.loadPose(5)
        for joint, _, _ in other.layout():
            if joint.Name in bodies:
                wanted = poses[joint.Name][5, :, 3]
                # bvhio's are single precision.
                assert np.abs(np.array(joint.PositionWorld) - wanted).max() < 1e-5


def test_named_bodies_hang_under_their_nearest_ancestor(
    greeting: fan.Trajectory, tmp_path: Path
) -> None:
    path = fan.export(greeting, tmp_path / "part.bvh", fps=12, bodies=["torso", "shin_left"])
    clip = fan.theatre.load_bvh(path)
    assert clip.skeleton.names[:2] == ("torso", "shin_left")
    assert check(clip, greeting, 12) == {"torso", "shin_left"}


def test_one_sample_is_one_frame(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.5).resample(np.array([0.2]))
    clip = fan.theatre.load_bvh(fan.export(run, tmp_path / "run.bvh"))
    assert len(clip.t) == 1 and check(clip, run, 60) == {"upper", "lower"}


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.permutations("XYZ"))
def test_angles_are_those_of_the_orientation(seed: int, axes: list[str]) -> None:
    order = "".join(axes)
    keys = Rotation.random(4, random_state=seed)
    q = np.roll(Slerp(np.arange(4), keys)(np.linspace(0, 3, 200)).as_quat(), 1, axis=1)
    angles = euler_angles(q, order)
    back = Rotation.from_euler(order, angles).as_matrix()
    assert np.abs(back - Rotation.from_quat(np.roll(q, -1, axis=1)).as_matrix()).max() < 1e-7


@pytest.mark.parametrize("axis", range(3))
def test_a_hinge_turns_repeatedly_about_one_axis(axis: int) -> None:
    about = np.linspace(0.1, 20.0, 500)
    q = np.zeros((500, 4))
    q[:, 0], q[:, 1 + axis] = np.cos(about / 2), np.sin(about / 2)
    order, angles = order_and_angles(q)
    assert order == "ZXY"
    wanted = np.zeros((500, 3))
    wanted[:, "ZXY".index("XYZ"[axis])] = about
    assert angles == pytest.approx(wanted, abs=1e-7)


def test_another_order_is_used_near_gimbal_lock() -> None:
    # The arm is held out at 89.9 deg about x, and swings about the former y.
    swing = np.linspace(-1.0, 1.0, 81)
    turned = Rotation.from_euler("XZ", np.column_stack([np.full(81, np.radians(89.9)), 0 * swing]))
    turned = Rotation.from_rotvec(np.column_stack([0.3 * swing, 0.3 * swing, 0 * swing])) * turned
    q = np.roll(turned.as_quat(), 1, axis=1)
    assert np.abs(np.diff(euler_angles(q, "ZXY"), axis=0)).max() > 0.1
    order, angles = order_and_angles(q)
    assert order != "ZXY"
    assert np.abs(np.diff(angles, axis=0)).max() < 0.03
    back = Rotation.from_euler(order, angles)
    assert (back * turned.inv()).magnitude().max() < 1e-7


@pytest.mark.parametrize("sign", [-1, 1])
def test_at_gimbal_lock_the_last_angle_stays(sign: int) -> None:
    before = Rotation.from_euler("ZXY", [[0.2, 1.4 * sign, 0.5]])
    locked = Rotation.from_euler("ZXY", [[0.3, np.pi / 2 * sign, 0.6]])
    turned = Rotation.concatenate([before, locked])
    angles = euler_angles(np.roll(turned.as_quat(), 1, axis=1), "ZXY")
    assert angles[1, 2] == pytest.approx(0.5, abs=1e-7)
    back = Rotation.from_euler("ZXY", angles)
    assert (back * turned.inv()).magnitude().max() < 1e-7
