"""Recordings: equal bits in memory and in files, agreement with fan.simulate, edits."""

from __future__ import annotations

import dataclasses
import shutil

import numpy as np
import pytest
import trimesh
from tests.perform.previous_format import previous_format_arrays

import fantoccini as fan
from fantoccini.base import rotation

pytestmark = pytest.mark.medium

ARRAYS = ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K")
TABLES = ("tension", "limit_force", "taut", "ledger", "effort", "violation", "slip")


def assert_equal_runs(first: fan.Trajectory, second: fan.Trajectory) -> None:
    """Equality to the last bit, events included."""
    for name in ARRAYS:
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    for name in TABLES:
        assert np.array_equal(getattr(first, name).values, getattr(second, name).values), name
    assert first.events == second.events and first.status == second.status


@pytest.fixture(scope="module")
def gentle():
    """The control bar moved and tilted gently for 2 s, after another motion."""
    live = fan.Performance(fan.puppets.marionette_bar(), speed=0.3, acceleration=1.5)
    home, orientation = live.place("bar")
    live.move("bar", home + np.array([0.0, 0.05, 0.0]))
    live.advance(0.7)
    live.record()
    assert live.recording
    live.move("bar", home + np.array([0.1, 0.0, 0.05]), rotation.exp(np.array([0.1, 0.2, 0.3])))
    live.advance(1.0)
    live.move("bar", home, orientation)
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
        assert_equal_runs(recording.trajectory, recording.replay())
    assert np.max(rough.trajectory.slip["hand_left"]) > 0.01


def test_a_file_gives_the_same_recording_back(rough, tmp_path):
    rough.save(tmp_path / "rough.npz")
    assert [p.name for p in tmp_path.iterdir()] == ["rough.npz"]
    read = fan.theatre.Recording.load(tmp_path / "rough.npz")
    assert_equal_runs(read.trajectory, rough.trajectory)
    assert_equal_runs(read.replay(), rough.trajectory)
    assert (read.tick, read.steps, read.end_reason) == (rough.tick, rough.steps, rough.end_reason)
    assert np.array_equal(read.marionette.winches, rough.marionette.winches)
    # Its trajectory can be saved like any other.
    rough.trajectory.save(tmp_path / "run.npz")
    assert_equal_runs(fan.Trajectory.load(tmp_path / "run.npz"), rough.trajectory)


def test_a_file_of_another_machine_keeps_its_samples(gentle, rough, tmp_path):
    """If the simulation gives other bits, each second begins at the saved sample."""
    for name, recording in (("gentle", gentle), ("rough", rough)):
        path, changed_path = tmp_path / f"{name}.npz", tmp_path / f"{name}_there.npz"
        recording.save(path)
        with np.load(path) as file:
            arrays = dict(file)
        layout = recording.marionette.sample_layout
        column = layout.columns["v_D"]
        arrays["checks"][1:, column] *= 1.0 + 1e-9
        np.savez(changed_path, **arrays)
        loaded_run, recorded_run = (
            fan.theatre.Recording.load(changed_path).trajectory,
            recording.trajectory,
        )
        assert len(loaded_run) == len(recorded_run) and loaded_run.status == recorded_run.status
        assert np.array_equal(loaded_run.t, recorded_run.t)
        # The first second is the same; then it begins at the saved sample, without the
        # time-stepper's memory of earlier steps.
        n_ticks = round(1.0 / recording.tick)
        assert np.array_equal(loaded_run.q_D[: n_ticks + 1], recorded_run.q_D[: n_ticks + 1])
        assert np.array_equal(loaded_run.q_D[-1], recorded_run.q_D[-1])
        assert np.max(np.abs(loaded_run.q_D - recorded_run.q_D)) < 0.02
        np.testing.assert_array_equal(loaded_run.ledger.values[-1], recorded_run.ledger.values[-1])
        assert np.max(np.abs(np.diff(loaded_run.ledger["work"]))) < 2 * np.max(
            np.abs(np.diff(recorded_run.ledger["work"]))
        )


def test_a_file_of_the_previous_format_is_read(rough, tmp_path):
    """It has every sample, and events."""
    np.savez(tmp_path / "old.npz", **previous_format_arrays(rough, tmp_path / "new.npz"))
    read = fan.theatre.Recording.load(tmp_path / "old.npz")
    assert read.output is not None
    assert_equal_runs(read.trajectory, rough.trajectory)
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
    assert_equal_runs(read.replay(), recording.trajectory)


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
    assert_equal_runs(
        fan.theatre.Recording.load(tmp_path / "stone.npz").replay(), recording.trajectory
    )


def test_damaged_and_foreign_files_are_named(gentle, tmp_path):
    complete_path = tmp_path / "whole.npz"
    gentle.save(complete_path)
    content = complete_path.read_bytes()
    foreign_path = tmp_path / "run.npz"
    gentle.trajectory.save(foreign_path)
    damaged = {f"cut{n}.npz": content[:n] for n in (0, 10, len(content) // 2, len(content) - 5)}
    damaged["text.npz"] = b"puppet: none"
    for name, damaged_content in damaged.items():
        (tmp_path / name).write_bytes(damaged_content)
    with np.load(complete_path) as file:
        arrays = dict(file)
    for name in arrays:
        np.savez(tmp_path / "less.npz", **{n: x for n, x in arrays.items() if n != name})
        with pytest.raises(fan.FantocciniError, match=r"less\.npz"):
            fan.theatre.Recording.load(tmp_path / "less.npz")
    changed_arrays = {"checks": arrays["checks"][:, 1:], "start_q_D": np.zeros(3)}
    changed_arrays["ticks"] = arrays["ticks"][::-1]
    changed_arrays["acc_K"] = np.where(
        np.arange(len(arrays["acc_K"])) == 7, np.nan, arrays["acc_K"].T
    ).T
    for name, array in changed_arrays.items():
        np.savez(tmp_path / "wrong.npz", **{**arrays, name: array})
        with pytest.raises(fan.FantocciniError, match=r"wrong\.npz"):
            fan.theatre.Recording.load(tmp_path / "wrong.npz")
    for path in (foreign_path, tmp_path / "none.npz", *(tmp_path / name for name in damaged)):
        with pytest.raises(fan.FantocciniError, match=path.name):
            fan.theatre.Recording.load(path)


def test_the_motion_of_the_hands_is_an_input(gentle):
    """The time-stepper at the same dt agrees to rounding, event-driven to the stepper's error."""
    recorded = gentle.trajectory
    arguments = gentle.marionette, gentle.start, gentle.inputs, gentle.duration
    stepped_run = fan.simulate(
        *arguments, method=fan.TimeStepping(dt=gentle.dt), save_every=gentle.steps
    )
    assert np.max(np.abs(stepped_run.q_D[-1] - recorded.q_D[-1])) < 1e-9
    assert np.max(np.abs(stepped_run.v_D[-1] - recorded.v_D[-1])) < 1e-7
    event_run = fan.simulate(*arguments)
    assert np.max(np.abs(event_run.q_K[-1] - recorded.q_K[-1])) < 1e-11
    difference = event_run.resample(recorded.t).q_D - recorded.q_D
    assert np.max(np.abs(difference)) < 0.02
    # The error is the stepper's: it shrinks with its step.
    finer_run = dataclasses.replace(gentle, steps=8 * gentle.steps, output=None).trajectory
    finer_difference = event_run.resample(finer_run.t).q_D - finer_run.q_D
    assert np.max(np.abs(finer_difference)) < 0.4 * np.max(np.abs(difference))


def test_a_recording_ends_at_changes_other_than_those_of_the_hands(gentle):
    arm = fan.puppets.arm2d()
    for change, reason in (
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
        assert reason in recording.end_reason and len(recording) == 36
        assert_equal_runs(recording.replay(), recording.trajectory)
        with pytest.raises(fan.errors.StateError, match="recorded"):
            live.stop()


def test_a_trimmed_recording_starts_with_the_state_there(gentle):
    part = gentle.trimmed(0.5, 1.5)
    assert part.duration == pytest.approx(1.0)
    run, full_run = part.trajectory, gentle.trajectory
    assert run.status is fan.Status.DONE
    assert np.max(np.abs(run.q_D[0] - full_run.q_D[60])) < 1e-4
    assert np.max(np.abs(run.q_K - full_run.q_K[60:181])) < 1e-12
    assert np.max(np.abs(run.q_D[-1] - full_run.q_D[180])) < 0.02
    fan.simulate(part.marionette, part.start, part.inputs)
    from_start = gentle.trimmed(0.0, 0.5)
    first_half = from_start.trajectory
    assert np.array_equal(first_half.q_D, full_run.q_D[:61])
    for begin, end in ((-1.0, 1.0), (1.0, 0.5), (0.0, 3.0), (0.5, 0.5001)):
        with pytest.raises(ValueError, match="s"):
            gentle.trimmed(begin, end)


def test_a_stretched_recording_goes_the_same_way_slower(gentle):
    for factor in (2.0, 0.8):
        stretched = gentle.stretched(factor)
        assert stretched.duration == pytest.approx(factor * gentle.duration)
        assert stretched.dt <= gentle.dt * (1 + 1e-12)
        s = np.linspace(0.0, gentle.duration, 77)[:-1]
        q, v, _ = gentle.inputs.evaluate(s)
        q_slow, v_slow, _ = stretched.inputs.evaluate(factor * s)
        assert np.max(np.abs(q_slow - q)) < 1e-11
        assert np.max(np.abs(v_slow * factor - v)) < 1e-11
        assert stretched.trajectory.status is fan.Status.DONE
    with pytest.raises(ValueError, match="factor"):
        gentle.stretched(0.0)


def test_a_smoothed_recording_has_gentler_hands_and_the_same_ends(gentle):
    smoothed = gentle.smoothed(0.2)
    q, v, _ = gentle.inputs.evaluate(gentle.times)
    q_s, v_s, _ = smoothed.inputs.evaluate(smoothed.times)
    assert np.max(np.abs(q_s[0] - q[0])) == 0.0
    assert np.max(np.abs(v_s[0] - v[0])) == 0.0
    assert np.max(np.abs(q_s[-1] - q[-1])) < 1e-3
    assert np.max(np.abs(q_s - q)) < 0.02
    # The steps of the acceleration are smoothed.
    jerk = [np.max(np.abs(np.diff(r.acc_K, axis=0)[12:-12])) for r in (gentle, smoothed)]
    assert jerk[1] < 0.2 * jerk[0]
    assert smoothed.trajectory.status is fan.Status.DONE
    fan.simulate(smoothed.marionette, smoothed.start, smoothed.inputs, method="timestepping")
    with pytest.raises(ValueError, match="seconds"):
        gentle.smoothed(-1.0)


def test_an_edited_recording_is_saved_with_its_trajectory(gentle, tmp_path):
    edited = gentle.smoothed(0.1).stretched(1.5).trimmed(0.2, 2.0)
    edited.save(tmp_path / "edited.npz")
    assert_equal_runs(
        fan.theatre.Recording.load(tmp_path / "edited.npz").trajectory, edited.replay()
    )


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
    assert_equal_runs(again.trajectory, recording.trajectory)
