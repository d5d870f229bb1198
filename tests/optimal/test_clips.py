"""Runs as paths of tracks."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base import rotation
from fantoccini.control.tasks.nodes import Nodes
from fantoccini.control.tasks.residuals import NodeKinematics, track_residual

TIP = (0.3, 0.0, 0.0)


@pytest.fixture(scope="module")
def take(arm: fan.Marionette) -> fan.Trajectory:
    """The hand lifts the arm and lowers it."""
    x0 = arm.rest()
    up = fan.Input.waypoints(
        arm, {"hand.length": [(0, x0.q_K[1]), (0.5, x0.q_K[1] - 0.06), (1.0, x0.q_K[1])]}
    )
    return fan.simulate(arm, x0, up, t_end=1.0)


def tip_of(arm: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    pose = arm.poses(run.q_D, run.q_K)[:, 1]
    return pose[..., 3] + pose[..., :3] @ np.array(TIP)


def path(arm: fan.Marionette, track: fan.control.Track, t: np.ndarray) -> np.ndarray:
    return track.path.values(arm, track.kind, track.name, track.at, t)


def test_a_clip_equals_its_run(arm: fan.Marionette, take: fan.Trajectory):
    t = np.linspace(0.0, 1.0, 41)
    run = take.resample(t)
    clip = fan.control.Clip(take)
    assert path(arm, fan.control.Track.point("lower", clip, at=TIP), t) == pytest.approx(
        tip_of(arm, run), abs=1e-14
    )
    assert path(arm, fan.control.Track.coordinate("elbow", clip), t)[:, 0] == pytest.approx(
        run.q_D[:, 1]
    )
    assert path(arm, fan.control.Track.coordinate("hand.length", clip), t)[:, 0] == pytest.approx(
        run.q_K[:, 1]
    )
    assert path(arm, fan.control.Track.velocity("*", clip), t) == pytest.approx(run.v_D)
    assert path(arm, fan.control.Track.tension("hand", clip), t)[:, 0] == pytest.approx(
        run.tension["hand"]
    )
    q = path(arm, fan.control.Track.orientation("lower", clip), t)
    pose = arm.poses(run.q_D, run.q_K)[:, 1]
    assert rotation.matrix(q) == pytest.approx(pose[..., :3], abs=1e-14)


def test_a_clip_begins_later_runs_faster_and_is_moved(arm: fan.Marionette, take: fan.Trajectory):
    clip = fan.control.Clip(take, begin=0.2, speed=2.0, by=(0.0, 0.0, 0.1))
    t = np.array([0.0, 0.2, 0.35, 0.7, 1.0])
    run_times = np.array([0.0, 0.0, 0.3, 1.0, 1.0])  # its ends hold
    run = take.resample(run_times)
    tip_path = path(arm, fan.control.Track.point("lower", clip, at=TIP), t)
    assert tip_path - tip_of(arm, run) == pytest.approx(np.tile([0.0, 0.0, 0.1], (5, 1)))
    speed = path(arm, fan.control.Track.velocity("elbow", clip), t)[:, 0]
    assert speed[2] == pytest.approx(2.0 * run.v_D[2, 1])
    assert speed[0] == speed[4] == 0.0


def test_the_residual_of_a_puppet_on_its_own_clip_is_zero(
    arm: fan.Marionette, take: fan.Trajectory
):
    resting = Nodes.constant(arm, take.state(0), 1.0, 10)
    samples = take.resample(resting.t)
    nodes = Nodes(
        arm.coordinates, 0.0, 0.1, samples.q_D, samples.v_D, samples.q_K, samples.v_K, resting.acc_K
    )
    for track in (
        fan.control.Track.point("lower", fan.control.Clip(take), at=TIP),
        fan.control.Track.velocity("*", fan.control.Clip(take)),
        fan.control.Track.orientation("lower", fan.control.Clip(take)),
        fan.control.Track.coordinate("elbow", fan.control.Clip(take)),
    ):
        r = track_residual(arm, track, nodes).value(NodeKinematics(arm, nodes))
        assert r == pytest.approx(0.0 * r, abs=1e-8)


def test_a_puppet_follows_a_run(arm: fan.Marionette, take: fan.Trajectory):
    """The run's own inputs are admissible, so the result is close."""
    best = fan.follow(arm, {("lower", TIP): fan.control.Clip(take)}, duration=1.0)
    assert best.holds, best.summary()
    deviation = tip_of(arm, best.run.resample(best.t)) - tip_of(arm, take.resample(best.t))
    assert np.max(np.linalg.norm(deviation, axis=1)) < 1e-3
    assert np.ptp(tip_of(arm, take)[:, 2]) > 0.04


def test_the_run_may_be_of_another_puppet(take: fan.Trajectory, arm: fan.Marionette):
    """A ball on a winch follows the arm's tip."""
    ball = fan.loads("""
puppet: yo_yo
bodies:
- {name: ball, joint: {type: translation, axes: [x, y, z]}, mass: 0.1}
strings:
- {name: line, path: [{body: ball, at: [0, 0, 0]}, {world: [0.3, 0, 1]}], length: driven}
pose: {ball.x: 0.3, ball.z: 0.1, line.length: 0.9}
""")
    t = np.linspace(0.0, 1.0, 11)
    clip = fan.control.Clip(take, of="lower", by=(0.0, 0.0, 0.2))
    track = fan.control.Track.point("ball", clip, at=TIP)
    lifted = path(ball, track, t) - tip_of(arm, take.resample(t))
    assert lifted == pytest.approx(np.tile([0.0, 0.0, 0.2], (11, 1)), abs=1e-12)


def test_invalid_clips_are_refused(arm: fan.Marionette, take: fan.Trajectory):
    with pytest.raises(ValueError, match="speed is 0"):
        fan.control.Clip(take, speed=0.0)
    with pytest.raises(fan.errors.StateError, match="3 finite numbers"):
        fan.control.Clip(take, by=(0.0, 1.0))
    t = np.array([0.0])
    for track in (
        fan.control.Track.point("lower", fan.control.Clip(take, of="lowr")),
        fan.control.Track.coordinate("elbow", fan.control.Clip(take, of="elbo")),
        fan.control.Track.velocity("elbow", fan.control.Clip(take, of="elbo")),
        fan.control.Track.tension("hand", fan.control.Clip(take, of="hnd")),
    ):
        with pytest.raises(fan.errors.UnknownNameError):
            path(arm, track, t)
    with pytest.raises(fan.errors.StateError, match="paths must be values"):
        track = fan.control.Track.coordinate("elbow", fan.control.Clip(take))
        fan.optimise(fan.Task(arm, arm.rest(), (1.0, 2.0), [track]))


TASK_YAML = """\
task: again
puppet: arm2d
duration: 1
tracks:
  - {point: lower, at: [0.3, 0, 0], run: {file: take.npz, begin: 0.1, by: [0, 0, 0.01]}}
  - {coordinate: elbow, run: {file: take.npz, speed: 2}}
"""


def test_a_file_follows_a_saved_run(tmp_path, arm: fan.Marionette, take: fan.Trajectory):
    take.save(tmp_path / "take.npz")
    (tmp_path / "t.yaml").write_text(TASK_YAML, encoding="utf-8")
    tip, elbow = fan.control.load_task(tmp_path / "t.yaml").tracks
    clip = fan.control.Clip(take, begin=0.1, by=(0.0, 0.0, 0.01))
    t = np.linspace(0.0, 1.0, 21)
    assert np.array_equal(
        path(arm, tip, t), path(arm, fan.control.Track.point("lower", clip, at=TIP), t)
    )
    assert elbow.path.speed == 2.0


@pytest.mark.parametrize(
    ("change", "line", "key", "words"),
    [
        (("file: take.npz, begin", "file: tke.npz, begin"), 5, "tracks[0].run", "no file in this"),
        (("begin: 0.1", "of: lowr"), 5, "tracks[0].run", "did you mean 'lower'"),
        (("speed: 2", "speed: 0"), 6, "tracks[1].run.speed", "positive"),
        (("run: {file: take.npz, speed: 2}", "run: {file: t.yaml}"), 6, "tracks[1].run", "t.yaml"),
    ],
)
def test_mistakes_have_places(
    tmp_path, take: fan.Trajectory, change, line: int, key: str, words: str
):
    take.save(tmp_path / "take.npz")
    path = tmp_path / "t.yaml"
    path.write_text(TASK_YAML.replace(*change, 1), encoding="utf-8")
    with pytest.raises(fan.errors.FileError) as caught:
        fan.control.load_task(path)
    (message,) = (str(mistake) for mistake in caught.value.mistakes)
    assert f"t.yaml:{line}: {key}" in message and words in message
