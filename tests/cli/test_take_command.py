"""`fantoccini take`: descriptions of recordings, edits, and wrong arguments."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cli.command import fantoccini

import fantoccini as fan


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """Two seconds of an arm with a hand that moves to and fro."""
    live = fan.Performance(fan.puppets.arm2d())
    home, _ = live.place("hand")
    live.record()
    live.move("hand", home + np.array([0.1, 0.0, 0.0]))
    live.advance(1.0)
    live.move("hand", home)
    live.advance(1.0)
    path = tmp_path_factory.mktemp("takes") / "take.npz"
    live.stop().save(path)
    return path


def test_a_recording_is_described(take):
    result = fantoccini("take", str(take))
    assert result.exit_code == 0
    assert "arm2d" in result.stdout and " 240" in result.stdout and "done" in result.stdout
    assert not fantoccini("take", str(take), "--quiet").stdout


def test_edits_are_those_of_python(take, tmp_path):
    out = tmp_path / "new.npz"
    words = ("--trim", "0.5:1.5", "--smooth", "0.1", "--stretch", "2", "--out", str(out))
    assert fantoccini("take", str(take), *words).exit_code == 0
    edited = fan.theatre.Recording.load(out)
    same = fan.theatre.Recording.load(take).trimmed(0.5, 1.5).smoothed(0.1).stretched(2.0)
    assert edited.duration == pytest.approx(2.0)
    assert np.array_equal(edited.acc_K, same.acc_K)
    assert np.array_equal(edited.trajectory.q_D, same.trajectory.q_D)
    assert fantoccini("simulate", "arm2d", "--inputs", str(out), "--quiet").exit_code == 0


def test_a_loop_goes_back_to_the_start_each_time(take, tmp_path):
    out = tmp_path / "loop.npz"
    words = ("--trim", "0.2:0.9", "--loop", "3", "--out", str(out))
    assert fantoccini("take", str(take), *words).exit_code == 0
    edited, part = (
        fan.theatre.Recording.load(out),
        fan.theatre.Recording.load(take).trimmed(0.2, 0.9),
    )
    assert np.array_equal(edited.acc_K, part.looped(3).acc_K)
    assert edited.duration > 3 * part.duration


def test_the_ends_of_a_part_may_be_omitted(take, tmp_path):
    for text, duration in ((":0.5", 0.5), ("1.5:", 0.5)):
        out = tmp_path / "part.npz"
        assert fantoccini("take", str(take), "--trim", text, "--out", str(out)).exit_code == 0
        assert fan.theatre.Recording.load(out).duration == pytest.approx(duration)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--trim", "0.5:1"), "needed: a file for the edited recording"),
        (("--trim", "1:0.5", "--out", "new.npz"), "needed: A:B"),
        (("--trim", "half", "--out", "new.npz"), "needed: A:B"),
        (("--trim", "nan:1", "--out", "new.npz"), "needed: A:B"),
        (("--trim", "0:7", "--out", "new.npz"), "must be a part of 0 s to 2 s"),
        (("--stretch", "0", "--out", "new.npz"), "factor is 0"),
        (("--smooth", "-1", "--out", "new.npz"), "seconds"),
        (("--loop", "0", "--out", "new.npz"), "count is 0"),
        (("--loop", "2"), "needed: a file for the edited recording"),
        (("--stretch", "2", "--out", "new.csv"), ".npz"),
    ],
)
def test_wrong_arguments_write_nothing(take, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    done = fantoccini("take", str(take), *words)
    assert done.exit_code == 2 and message in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())


def test_a_file_without_a_recording_is_refused(tmp_path):
    arm = fan.puppets.arm2d()
    fan.simulate(arm, arm.rest(), t_end=0.1).save(tmp_path / "run.npz")
    for name in ("run.npz", "none.npz"):
        done = fantoccini("take", str(tmp_path / name))
        assert done.exit_code == 2 and name in done.stderr
