"""Recordings as inputs, samples per second, and styles of pictures on the command line."""

import imageio_ffmpeg
import numpy as np
import pytest
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.app.cli.simulate import suggest_faster
from fantoccini.app.cli_support.arguments import SimulateArguments

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def take(tmp_path_factory):
    """A recorded performance of the arm on a weak grip, moving at its start."""
    live = fan.Performance(fan.puppets.arm2d(), grip=12.0)
    home, _ = live.place("hand")
    live.move("hand", home + np.array([0.05, 0.0, 0.0]))
    live.advance(0.05)
    live.record()
    live.wind("hand", 0.95 * live.target_length("hand"))
    live.advance(0.6)
    path = tmp_path_factory.mktemp("take") / "take.npz"
    live.stop().save(path)
    return path


def test_a_recording_is_inputs(take):
    """The message was `t: found the shape ()`."""
    recording = fan.theatre.Recording.load(take)
    inputs = fan.Input.load(fan.puppets.arm2d(), take)
    t = np.linspace(inputs.start, inputs.end, 50)
    for actual, expected in zip(inputs.evaluate(t), recording.inputs.evaluate(t), strict=True):
        assert np.array_equal(actual, expected)


def test_a_recording_moves_the_puppet_from_its_start_on_its_winches(take, tmp_path):
    """Hands, winches and start of the run are those of the performance."""
    out = tmp_path / "run.npz"
    result = fantoccini("simulate", "arm2d", "--inputs", take, "--out", out)
    assert result.exit_code == 0, result.stderr
    assert "another puppet" not in result.stderr
    recording, run = fan.theatre.Recording.load(take), fan.Trajectory.load(out)
    assert recording.start.v_K.any()  # a state at rest would have no velocities
    assert np.array_equal(run.q_D[0], recording.start.q_D)
    assert np.array_equal(run.v_K[0], recording.start.v_K)
    repeated = fan.simulate(recording.marionette, recording.start, recording.inputs)
    assert np.array_equal(run.q_D[-1], repeated.q_D[-1])
    assert np.array_equal(run.slip.values[-1], repeated.slip.values[-1])


def test_a_recording_of_another_puppet_is_a_clear_mistake(take, tmp_path):
    """The message names the driven coordinates that differ."""
    result = fantoccini("simulate", "string_pendulum", "--inputs", take)
    assert result.exit_code == 2
    assert "was recorded with another puppet: driven in the recording only: hand.x" in result.stderr
    text = fan.puppets.path("arm2d").read_text().replace("puppet: arm2d", "puppet: heavier")
    other = tmp_path / "other.yaml"
    other.write_text(text)
    result = fantoccini("simulate", other, "--inputs", take, "--duration", "0.1")
    assert result.exit_code == 0, result.stderr
    assert "the recorded hands move the puppet of FILE" in result.stderr


def test_a_file_of_another_kind_is_named(tmp_path):
    """A run is not an input, and a damaged recording is reported."""
    m = fan.puppets.string_pendulum()
    fan.simulate(m, m.rest(), t_end=0.1).save(tmp_path / "run.npz")
    with pytest.raises(
        fan.errors.InputError, match=r"has the format 'fantoccini\.trajectory\.1'; needed"
    ):
        fan.Input.load(m, tmp_path / "run.npz")
    about = np.frombuffer(b'{"format": "fantoccini.recording.3"}', dtype=np.uint8)
    for parts in ({}, {"about": about}, {"about": about, "acc_K": np.zeros(3)}):
        np.savez(tmp_path / "bad.npz", **(parts or {"about": np.zeros(3)}))
        with pytest.raises(fan.errors.InputError, match=r"cannot be read|damaged recording"):
            fan.Input.load(m, tmp_path / "bad.npz")


@pytest.mark.parametrize(
    "arguments, samples",
    [((), 31), (("--method", "timestepping"), 31), (("--method", "variational"), 31)],
)
def test_samples_per_second(arguments, samples, tmp_path):
    """--rate saves this number of samples per second."""
    out = tmp_path / "run.npz"
    result = fantoccini(
        "simulate", "string_pendulum", "--duration", "0.6", "--rate", "50", *arguments, "--out", out
    )
    assert result.exit_code == 0, result.stderr
    run = fan.Trajectory.load(out)
    assert np.diff(run.t) == pytest.approx(0.02)
    assert len(run) == samples


def test_impossible_rates_are_mistakes():
    """A step has one row; impossible rates do not fill the memory."""
    arguments = ("simulate", "string_pendulum", "--method", "timestepping", "--dt", "0.01")
    result = fantoccini(*arguments, "--rate", "200")
    assert result.exit_code == 2 and "at most 100 samples per second" in result.stderr
    result = fantoccini("simulate", "string_pendulum", "--rate", "1e9")
    assert result.exit_code == 2 and "samples exceed the limit" in result.stderr
    assert fantoccini("simulate", "string_pendulum", "--rate", "-1").exit_code == 2


def test_a_run_slower_than_real_time_is_reported(capsys):
    """It names a faster option; a run faster than real time prints nothing."""
    m = fan.puppets.string_pendulum()
    run = fan.simulate(m, m.rest(), t_end=0.5)
    assert run.seconds > 0.0 and run.summary()["seconds"] == run.seconds
    request = SimulateArguments(file="x")
    suggest_faster(request, run, 0.8)
    stderr = capsys.readouterr().err
    assert "slower than real time: 1.6 s per second of motion" in stderr
    assert "--method timestepping" in stderr and "--rate" in stderr
    suggest_faster(request, run, 0.4)
    assert capsys.readouterr().err == ""


def test_pictures_and_films_have_the_requested_style(tmp_path):
    """The command line lacked options of Python."""
    film, strip = tmp_path / "a.mp4", tmp_path / "a.png"
    result = fantoccini(
        "simulate",
        "string_pendulum",
        "--start",
        "bob.x=0.5",
        "--start",
        "bob.z=0.6",
        "--duration",
        "1",
        "--out",
        film,
        "--out",
        strip,
        "--view",
        "40,15",
        "--focus",
        "bodies",
        "--theme",
        "dark",
        "--size",
        "320x240",
        "--fps",
        "10",
    )
    assert result.exit_code == 0, result.stderr
    about = next(imageio_ffmpeg.read_frames(str(film)))
    assert about["source_size"] == (320, 240) and about["fps"] == pytest.approx(10.0)
    from PIL import Image

    picture = np.asarray(Image.open(strip).convert("L"))
    assert picture.shape == (480, 640) and np.median(picture) < 80


@pytest.mark.parametrize(
    "arguments, message",
    [
        (("--view", "behind", "--out", "a.png"), "three-quarter"),
        (("--view", "10,95", "--out", "a.png"), "AZIMUTH,ELEVATION"),
        (("--size", "0x9", "--out", "a.png"), "WIDTHxHEIGHT"),
        (("--size", "99999x9", "--out", "a.png"), "WIDTHxHEIGHT"),
        (("--fps", "0", "--out", "a.mp4"), "--fps"),
        (("--fps", "nan", "--out", "a.mp4"), "--fps"),
        (("--fps", "10", "--out", "a.png"), "applies to a film"),
        (("--theme", "dark"), "but none is written"),
        (("--theme", "green", "--out", "a.png"), "dark"),
        (("--focus", "strings", "--out", "a.png"), "bodies"),
        (("--look", "theatre", "--out", "a.png"), "stage"),
        (("--look", "stage"), "but none is written"),
        (("--look", "stage", "--theme", "dark", "--out", "a.png"), "its own colours"),
        (("--captions", "--out", "a.png"), "applies to a film"),
    ],
)
def test_unknown_styles_are_mistakes(arguments, message, tmp_path, monkeypatch):
    """Every message lists the allowed values."""
    monkeypatch.chdir(tmp_path)
    for command in ("simulate", "plan"):
        result = fantoccini(command, "string_pendulum", *arguments)
        assert result.exit_code == 2
        assert message in result.stderr
    assert not list(tmp_path.iterdir())
