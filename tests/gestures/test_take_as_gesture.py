"""Takes as gestures: files in scores, and their coordinates."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.gestures import gesture_from_take, is_gesture, piecewise


@pytest.fixture(scope="module")
def take():
    """Half a second of a hand that moves out, while the head stays."""
    live = fan.Performance(fan.puppets.marionette())
    there = live.place("hand_left")[0] + [0.05, 0.02, 0.0]
    live.record()
    live.move("hand_left", there)
    live.advance(0.5)
    return live.stop()


def test_a_score_names_a_take_beside_it(take, tmp_path):
    take.save(tmp_path / "reach.npz")
    (tmp_path / "number.yaml").write_text(
        "score: number\nlanes: {arm: [{gesture: reach.npz, at: 1}, {gesture: hang}]}\n"
    )
    puppet = fan.puppets.marionette()
    score = fan.load_score(puppet, tmp_path / "number.yaml")
    assert score.cues[0].gesture == "reach"
    x0 = puppet.rest()
    score_inputs = score.inputs(x0)
    for t in np.linspace(0.0, take.duration, 9):
        score_q_K, take_q_K = score_inputs.evaluate(x0.t + 1.0 + t)[0], take.inputs.evaluate(t)[0]
        np.testing.assert_allclose(score_q_K - x0.q_K, take_q_K - take.start.q_K, atol=1e-12)


def test_coordinates_at_rest_are_not_part_of_the_gesture(take):
    gesture = gesture_from_take(take.inputs, "reach")
    assert gesture.uses == ("hand_left",) and gesture.name == "reach"
    d, _ = piecewise.evaluate(gesture.breaks, gesture.coef, take.duration)
    np.testing.assert_allclose(d, take.trajectory.q_K[-1] - take.start.q_K, atol=1e-12)


def test_files_without_a_gesture_are_refused(take, tmp_path):
    puppet = fan.puppets.marionette()
    live = fan.Performance(puppet)
    live.record()
    live.advance(0.2)
    live.stop().save(tmp_path / "still.npz")
    take.save(tmp_path / "reach.npz")
    for path, performer, reason in (
        ("still.npz", puppet, "nothing moves"),
        ("reach.npz", fan.puppets.arm2d(), "reach.npz"),
        ("none.npz", puppet, "found nothing here"),
    ):
        with pytest.raises(fan.errors.FileError, match=reason):
            fan.theatre.load_gesture(performer, tmp_path / path)
    (tmp_path / "a.yaml").write_text("gesture: a\nmoves: {head.up: [[0, 0], [1, 1 cm]]}\n")
    (tmp_path / "b.yaml").write_text("score: b\n")
    verdicts = [is_gesture(tmp_path / name) for name in ("a.yaml", "b.yaml", "reach.npz", "c.yaml")]
    assert verdicts == [True, False, False, False]
