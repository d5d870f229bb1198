"""Scores played live: waits, loops and GO."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError, UnknownNameError

NUMBER = """\
score: number
tempo: 60
acceleration: 12
marks: {second: 9}
waits:
  curtain: 1
  marching: {at: 8, loop: 4}
lanes:
  legs:
    - {gesture: march, at: 2, lasts: 2, repeat: 4}
  body:
    - {gesture: bow, at: 10}
"""


def load_number(marionette, folder, text: str = NUMBER) -> fan.theatre.Score:
    path = folder / "number.yaml"
    path.write_text(text, encoding="utf-8")
    return fan.load_score(marionette, path)


@pytest.fixture(scope="module")
def score(marionette, tmp_path_factory) -> fan.theatre.Score:
    return load_number(marionette, tmp_path_factory.mktemp("scores"))


def advance_by(conductor: fan.theatre.Conductor, seconds: float, dt: float = 0.01) -> np.ndarray:
    return np.array([conductor.advance(dt) for _ in range(round(seconds / dt))])


def test_waits_are_in_the_score_and_take_no_time_offline(score):
    assert score, score.changes
    assert [(w.name, w.t, w.loop_start) for w in score.waits] == [
        ("curtain", 1.0, None),
        ("marching", 8.0, 4.0),
    ]
    assert score.inputs(score.marionette.rest()).duration == pytest.approx(score.duration)


def test_the_time_of_the_score_stops_until_go(score):
    conductor = fan.theatre.Conductor(score)
    assert not conductor.go() and conductor.waiting is None
    assert advance_by(conductor, 3.0)[-1] == 1.0
    assert conductor.waiting is score.waits[0] and conductor.standing
    assert conductor.go() and not conductor.go()
    assert advance_by(conductor, 0.5)[-1] == pytest.approx(1.5)
    assert conductor.waiting is None and conductor.upcoming is score.waits[1]


def test_go_shortly_before_a_wait_counts(score):
    conductor = fan.theatre.Conductor(score)
    advance_by(conductor, 0.8)
    assert conductor.go()
    assert advance_by(conductor, 0.6)[-1] == pytest.approx(1.4)


def test_a_loop_goes_round_until_go_and_ends_its_round(score):
    conductor = fan.theatre.Conductor(score)
    conductor.seek(3.0)
    times = advance_by(conductor, 12.0)  # 5 s to its end, a round of 4 s and 3 s of the next
    assert times.max() < 8.0 and times[-1] == pytest.approx(7.0)
    assert conductor.waiting is score.waits[1] and not conductor.standing
    assert conductor.go() and conductor.waiting is None
    assert advance_by(conductor, 2.0)[-1] == pytest.approx(9.0)
    assert not conductor.done and advance_by(conductor, 20.0)[-1] == score.duration
    assert conductor.done and conductor.standing


def test_the_hands_do_not_jump_where_a_loop_closes(score):
    conductor = fan.theatre.Conductor(score)
    conductor.seek("marching")
    conductor.seek(7.9)
    dt = 1e-3
    before = score.offsets(conductor.t)
    for _ in range(300):
        now = score.offsets(conductor.advance(dt))
        assert np.abs(now[0] - before[0]).max() < 1.0 * dt
        assert np.abs(now[1] - before[1]).max() < 12.1 * dt
        before = now
    assert conductor.t < 4.3


def test_a_long_pause_between_two_calls_ends_inside_the_loop(score):
    conductor = fan.theatre.Conductor(score)
    conductor.seek(5.0)
    assert conductor.advance(1003.0) == pytest.approx(4.0 + (1.0 + 1003.0) % 4.0)


def test_seeking_waits_again(score):
    conductor = fan.theatre.Conductor(score)
    assert conductor.seek("second") == 9.0 and conductor.upcoming is None
    assert conductor.seek("curtain") == 1.0
    assert advance_by(conductor, 1.0)[-1] == 1.0 and conductor.waiting is score.waits[0]
    assert conductor.seek(1e9) == score.duration
    with pytest.raises(UnknownNameError, match="did you mean 'curtain'"):
        conductor.seek("curtian")
    for wrong in (-1.0, np.nan):
        with pytest.raises(ValueError, match="at least 0"):
            conductor.seek(wrong)
        with pytest.raises(ValueError, match="at least 0"):
            conductor.advance(wrong)


def test_offsets_are_those_of_the_inputs(score):
    x0 = score.marionette.rest()
    inputs = score.inputs(x0)
    for t in (0.0, 2.3, 11.0, score.duration):
        q_K, v_K, _ = inputs.evaluate(t)
        offsets, rate = score.offsets(t)
        for q, v in score.marionette.coordinates.scalars_K:
            assert offsets[v] == pytest.approx(q_K[q] - x0.q_K[q], abs=1e-12)
        np.testing.assert_allclose(rate, v_K, atol=1e-12)
    np.testing.assert_allclose(score.offsets(1e6)[1], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (("curtain: 1", "curtain: 2.3"), 6, r"march of lane legs \(line 10\)"),
        (
            ("loop: 4", "loop: 4.5"),
            7,
            r"march of lane legs \(line 10\), differs by .*; needed: a loop",
        ),
        (("loop: 4", "loop: 9"), 7, "begins on beat 9.00"),
        (("loop: 4", "loop: 0"), 7, "curtain waits on beat 1.00"),
        (("curtain: 1", "curtain: 8"), 7, "waits on beat 8.00"),
        (("curtain: 1", "second: 1"), 6, "a mark has this name"),
        (("curtain: 1", "curtain: march.edn"), 6, "has no mark 'edn'; did you mean 'end'"),
        (("curtain: 1", "curtain: {at: 1, lop: 0}"), 6, "did you mean 'loop'"),
        (("curtain: 1", "curtain: {loop: 0}"), 6, "at: this key is missing"),
    ],
)
def test_mistakes_have_places(marionette, tmp_path, change, line, message):
    assert change[0] in NUMBER
    with pytest.raises(FileError, match=message) as error:
        load_number(marionette, tmp_path, NUMBER.replace(*change))
    assert f"number.yaml:{line}" in str(error.value)
