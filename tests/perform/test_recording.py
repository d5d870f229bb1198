"""Recordings: equal bits in memory and in files, agreement with fan.simulate, edits."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
import trimesh
from tests.perform.before import previous_format_arrays

import fantoccini as fan
from fantoccini.base import rotation

pytestmark = pytest.mark.medium

PARTS = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
TABLES = ("tension", "limit_force", "taut", "ledger", "effort", "violation", "slip")


def same(first: fan.Trajectory, other: fan.Trajectory) -> None:
    """Equality to the last bit, events included."""
    for name in PARTS:
        assert np.array_equal(getattr(first, name), getattr(other, name)), name
    for name in TABLES:
        assert np.array_equal(getattr(first, name).values, getattr(other, name).values), name
    assert first.events == other.events and first.status == other.status


@pytest.fixture(scope="module")
def gentle():
    """The control bar moved and tilted gently for 2 s, after another motion."""
    live = fan.Performance(fan.puppets.marionette_bar(), speed=0.3, acceleration=1.5)
    there, level = live.place("bar")
    live.move("bar", there + np.array([0.0, 0.05, 0.0]))
    live.advance(0.7)
    live.record()
    assert live.recording
    live.move("bar", there + np.array([0.1, 0.0, 0.05]), rotation.exp(np.array([0.1, 0.2, 0.3])))
    live.advance(1.0)
    live.move("bar", there, level)
    live.advance(1.0)
    recording = live.stop()
    assert not live.recording
    assert np.allclose(recording.trajectory.q_D[-1], live.state.q_D, atol=0, rtol=0)
    return recording


@pytest.fixture(scope="module")
def rough():
    """The marionette pulled beyond its reach."""
    live = fan.Performance(fan.puppets.marionette())
    home, _ = live.place("hand_left")
    live.record()
    live.move("hand_left", home + np.array([10.0, 0.0, 0.0]))
    live.wind("head", 0.3)
    live.advance(1.5)
    live.move("hand_left", home)
    live.advance(0.5)
    return live.stop()


def test_a_replay_is_the_recording_to_the_last_bit(gentle, rough):
    for recording in (gentle, rough):
        assert recording.trajectory.t[0] == 0.0
        assert len(recording.trajectory) == len(recording) + 1 == 240 + 1
        same(recording.trajectory, recording.replay())
    assert np.max(rough.trajectory.slip["hand_left"]) > 0.01


def test_a_file_gives_the_same_recording_back(rough, tmp_path):
    rough.save(tmp_path / "rough.npz")
    assert [p.name for p in tmp_path.iterdir()] == ["rough.npz"]
    read = fan.theatre.Recording.load(tmp_path / "rough.npz")
    same(read.trajectory, rough.trajectory)
    same(read.replay(), rough.trajectory)
    assert (read.tick, read.steps, read.ended) == (rough.tick, rough.steps, rough.ended)
    assert np.array_equal(read.marionette.winches, rough.marionette.winches)
    # Its trajectory can be saved like any other.
    rough.trajectory.save(tmp_path / "run.npz")
    same(fan.Trajectory.load(tmp_path / "run.npz"), rough.trajectory)


def test_a_file_of_another_machine_keeps_its_samples(gentle, rough, tmp_path):
    """If the simulation gives other bits, each second begins at the saved sample."""
    for name, recording in (("gentle", gentle), ("rough", rough)):
        path, other = tmp_path / f"{name}.npz", tmp_path / f"{name}_there.npz"
        recording.save(path)
        with np.load(path) as file:
            arrays = dict(file)
        layout = recording.marionette.sample_layout
        place = layout.columns["v_D"]
        arrays["checks"][1:, place] *= 1.0 + 1e-9
        np.savez(other, **arrays)
        there, here = fan.theatre.Recording.load(other).trajectory, recording.trajectory
        assert len(there) == len(here) and there.status == here.status
        assert np.array_equal(there.t, here.t)
        # The first second is the same; then it begins at the saved sample, without the
        # time-stepper's memory of earlier steps.
        second = round(1.0 / recording.tick)
        assert np.array_equal(there.q_D[: second + 1], here.q_D[: second + 1])
        assert np.array_equal(there.q_D[-1], here.q_D[-1])
        assert np.max(np.abs(there.q_D - here.q_D)) < 0.02
        np.testing.assert_array_equal(there.ledger.values[-1], here.ledger.values[-1])
        assert np.max(np.abs(np.diff(there.ledger["work"]))) < 2 * np.max(
            np.abs(np.diff(here.ledger["work"]))
        )


def test_a_file_of_the_previous_format_is_read(rough, tmp_path):
    """It has every sample, and events."""
    np.savez(tmp_path / "old.npz", **previous_format_arrays(rough, tmp_path / "new.npz"))
    read = fan.theatre.Recording.load(tmp_path / "old.npz")
    assert read.written is not None
    same(read.trajectory, rough.trajectory)
    fan.Input.load(rough.marionette, tmp_path / "old.npz")


def test_a_minute_takes_less_than_two_megabytes(tmp_path):
    live, rng = fan.Performance(fan.puppets.marionette()), np.random.default_rng(0)
    homes = {handle.name: live.place(handle.name)[0] for handle in live.handles}
    live.record()
    for _ in range(100):
        for name, home in homes.items():
            live.move(name, home + rng.uniform(-0.05, 0.05, size=3))
        live.advance(0.1)
    live.stop().save(tmp_path / "take.npz")
    assert 6 * (tmp_path / "take.npz").stat().st_size < 2e6


def test_parameters_and_scenes_are_kept(tmp_path):
    arm, two = fan.puppets.arm2d().puppet, fan.puppets.string_pendulum().puppet
    world = fan.Marionette(fan.Scene.of(arm, two)).with_parameters({"arm2d.m1": 0.3})
    live = fan.Performance(world)
    live.record()
    live.move("arm2d.hand", [0.7, 0.0, 0.0])
    live.advance(0.5)
    recording = live.stop()
    recording.save(tmp_path / "two.npz")
    read = fan.theatre.Recording.load(tmp_path / "two.npz")
    assert np.array_equal(read.marionette.p, world.p)
    same(read.replay(), recording.trajectory)


def test_meshes_are_saved_with_a_recording(tmp_path):
    folder = tmp_path / "there"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "meshes" / "box.stl")
    (folder / "stone.yaml").write_text(
        "puppet: stone\nbodies:\n  - name: stone\n    joint: {type: free}\n"
        "    shapes: [{type: mesh, file: meshes/box.stl, density: 1000}]\n"
        "strings:\n  - {name: line, path: [{body: stone, at: [0, 0, 0.15]}, "
        "{driven: [x, y], at: [0, 0, 1]}], length: driven}\n"
    )
    live = fan.Performance(fan.load(folder / "stone.yaml"))
    live.record()
    live.move("line", [0.2, 0.0, 1.0])
    live.advance(0.4)
    recording = live.stop()
    recording.save(tmp_path / "stone.npz")
    shutil.rmtree(folder)
    same(fan.theatre.Recording.load(tmp_path / "stone.npz").replay(), recording.trajectory)


def test_damaged_and_foreign_files_are_named(gentle, tmp_path):
    whole = tmp_path / "whole.npz"
    gentle.save(whole)
    content = whole.read_bytes()
    foreign = tmp_path / "run.npz"
    gentle.trajectory.save(foreign)
    cut = {f"cut{n}.npz": content[:n] for n in (0, 10, len(content) // 2, len(content) - 5)}
    cut["text.npz"] = b"puppet: none"
    for name, part in cut.items():
        (tmp_path / name).write_bytes(part)
    with np.load(whole) as file:
        arrays = dict(file)
    for name in arrays:
        np.savez(tmp_path / "less.npz", **{n: x for n, x in arrays.items() if n != name})
        with pytest.raises(fan.FantocciniError, match=r"less\.npz"):
            fan.theatre.Recording.load(tmp_path / "less.npz")
    wrongs = {"checks": arrays["checks"][:, 1:], "start_q_D": np.zeros(3)}
    wrongs["ticks"] = arrays["ticks"][::-1]
    wrongs["acc_K"] = np.where(np.arange(len(arrays["acc_K"])) == 7, np.nan, arrays["acc_K"].T).T
    for name, wrong in wrongs.items():
        np.savez(tmp_path / "wrong.npz", **{**arrays, name: wrong})
        with pytest.raises(fan.FantocciniError, match=r"wrong\.npz"):
            fan.theatre.Recording.load(tmp_path / "wrong.npz")
    for path in (foreign, tmp_path / "none.npz", *(tmp_path / name for name in cut)):
        with pytest.raises(fan.FantocciniError, match=path.name):
            fan.theatre.Recording.load(path)


def test_the_motion_of_the_hands_is_an_input(gentle):
    """The time-stepper at the same dt agrees to rounding, event-driven to the stepper's error."""
    recorded = gentle.trajectory
    asked = gentle.marionette, gentle.start, gentle.inputs, gentle.duration
    stepped = fan.simulate(*asked, method=fan.TimeStepping(dt=gentle.dt), save_every=gentle.steps)
    assert np.max(np.abs(stepped.q_D[-1] - recorded.q_D[-1])) < 1e-9
    assert np.max(np.abs(stepped.v_D[-1] - recorded.v_D[-1])) < 1e-7
    event = fan.simulate(*asked)
    assert np.max(np.abs(event.q_K[-1] - recorded.q_K[-1])) < 1e-11
    apart = event.resample(recorded.t).q_D - recorded.q_D
    assert np.max(np.abs(apart)) < 0.02
    # The error is the stepper's: it shrinks with its step.
    finer = dataclasses.replace(gentle, steps=8 * gentle.steps, written=None).trajectory
    less = event.resample(finer.t).q_D - finer.q_D
    assert np.max(np.abs(less)) < 0.4 * np.max(np.abs(apart))


def test_a_recording_ends_at_changes_other_than_those_of_the_hands(gentle):
    arm = fan.puppets.arm2d()
    for change, why in (
        (lambda live: live.set_parameters({"m1": 0.2}), "parameters"),
        (lambda live: live.replace(fan.puppets.arm2d()), "puppet"),
        (lambda live: live.reset(), "start"),
    ):
        live = fan.Performance(arm)
        live.record()
        live.move("hand", [0.6, 0.0, 0.0])
        live.advance(0.3)
        change(live)
        assert not live.recording
        live.advance(0.3)
        recording = live.stop()
        assert why in recording.ended and len(recording) == 36
        same(recording.replay(), recording.trajectory)
        with pytest.raises(fan.errors.StateError, match="recorded"):
            live.stop()


def test_a_trimmed_recording_starts_with_the_state_there(gentle):
    part = gentle.trimmed(0.5, 1.5)
    assert part.duration == pytest.approx(1.0)
    run, whole = part.trajectory, gentle.trajectory
    assert run.status is fan.Status.DONE
    assert np.max(np.abs(run.q_D[0] - whole.q_D[60])) < 1e-4
    assert np.max(np.abs(run.q_K - whole.q_K[60:181])) < 1e-12
    assert np.max(np.abs(run.q_D[-1] - whole.q_D[180])) < 0.02
    fan.simulate(part.marionette, part.start, part.inputs)
    from_start = gentle.trimmed(0.0, 0.5)
    same_rows = from_start.trajectory
    assert np.array_equal(same_rows.q_D, whole.q_D[:61])
    for a, b in ((-1.0, 1.0), (1.0, 0.5), (0.0, 3.0), (0.5, 0.5001)):
        with pytest.raises(ValueError, match="s"):
            gentle.trimmed(a, b)


def test_a_stretched_recording_goes_the_same_way_slower(gentle):
    for factor in (2.0, 0.8):
        slow = gentle.stretched(factor)
        assert slow.duration == pytest.approx(factor * gentle.duration)
        assert slow.dt <= gentle.dt * (1 + 1e-12)
        s = np.linspace(0.0, gentle.duration, 77)[:-1]
        q, v, _ = gentle.inputs.evaluate(s)
        q_slow, v_slow, _ = slow.inputs.evaluate(factor * s)
        assert np.max(np.abs(q_slow - q)) < 1e-11
        assert np.max(np.abs(v_slow * factor - v)) < 1e-11
        assert slow.trajectory.status is fan.Status.DONE
    with pytest.raises(ValueError, match="factor"):
        gentle.stretched(0.0)


def test_a_smoothed_recording_has_gentler_hands_and_the_same_ends(gentle):
    smooth = gentle.smoothed(0.2)
    q, v, _ = gentle.inputs.evaluate(gentle.times)
    q_s, v_s, _ = smooth.inputs.evaluate(smooth.times)
    assert np.max(np.abs(q_s[0] - q[0])) == 0.0
    assert np.max(np.abs(v_s[0] - v[0])) == 0.0
    assert np.max(np.abs(q_s[-1] - q[-1])) < 1e-3
    assert np.max(np.abs(q_s - q)) < 0.02
    # The steps of the acceleration are smoothed.
    jerk = [np.max(np.abs(np.diff(r.acc_K, axis=0)[12:-12])) for r in (gentle, smooth)]
    assert jerk[1] < 0.2 * jerk[0]
    assert smooth.trajectory.status is fan.Status.DONE
    fan.simulate(smooth.marionette, smooth.start, smooth.inputs, method="timestepping")
    with pytest.raises(ValueError, match="seconds"):
        gentle.smoothed(-1.0)


def test_an_edited_recording_is_saved_with_its_trajectory(gentle, tmp_path):
    edited = gentle.smoothed(0.1).stretched(1.5).trimmed(0.2, 2.0)
    edited.save(tmp_path / "edited.npz")
    same(fan.theatre.Recording.load(tmp_path / "edited.npz").trajectory, edited.replay())


@pytest.mark.parametrize(("spin", "status"), [(10.0, "DONE"), (170.0, "UNBALANCED")])
def test_a_performance_and_its_recording_say_when_energy_is_lost(spin, status, tmp_path):
    """A capsule turns by 0.28 rad a step: its energy was wrong by a fifth without a word."""
    capsule = fan.loads("""
puppet: free
gravity: [0, 0, 0]
bodies:
  - name: D
    joint: {type: free}
    shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.2], radius: 0.015, mass: 0.1}]
""")
    x0 = capsule.state().replace(v_D=np.array([0, 0, 0, spin, 0.1 * spin, spin]))
    live = fan.Performance(capsule, x0, dt=0.002)
    live.advance(0.2)
    assert live.status.name == status
    live.reset()
    live.record()
    live.advance(0.5)
    recording = live.stop()
    assert live.status.name == recording.trajectory.status.name == status
    assert live.t == pytest.approx(0.5)
    recording.save(tmp_path / "take.npz")
    again = fan.theatre.Recording.load(tmp_path / "take.npz")
    assert again.trajectory.status.name == status
    same(again.trajectory, recording.trajectory)
