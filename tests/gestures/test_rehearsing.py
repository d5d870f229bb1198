"""The motion of a rehearsed score is on its beats in the event-driven simulation."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import StateError
from fantoccini.theatre.gestures import measure_lateness

pytestmark = pytest.mark.slow

HAND = ("forearm_right", (0.0, 0.0, -0.09))
SCORE = """\
score: number
tempo: 100
speed: 1.5
acceleration: 15
lanes:
  legs:
    - {gesture: march, at: 1, lasts: 4, repeat: 2}
  arm:
    - {gesture: wave, on: {first: 13}}
  body:
    - {gesture: bow, on: {low: wave.end + 3}}
captions:
  - {at: 1, until: march.end, text: "Left, right"}
  - {at: wave.up, until: wave.end, text: Good evening!}
"""


def hand_positions(puppet: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    """(T, 3) places of the right hand in a run."""
    pose = puppet.poses(run.q_D, run.q_K)[:, puppet.link_index(HAND[0])]
    return pose[:, :, 3] + pose[:, :, :3] @ HAND[1]


def outermost(t: np.ndarray, y: np.ndarray, mark: float) -> float:
    """Time, within 0.3 s of a mark, at which the right hand is farthest to the right."""
    nearby = np.flatnonzero(np.abs(t - mark) < 0.3)
    return float(t[nearby[np.argmin(y[nearby])]])


def load_number(marionette, folder, text: str) -> fan.theatre.Score:
    path = folder / "number.yaml"
    path.write_text(text, encoding="utf-8")
    return fan.load_score(marionette, path)


@pytest.fixture(scope="module")
def rehearsal(marionette, tmp_path_factory):
    return fan.theatre.rehearse(load_number(marionette, tmp_path_factory.mktemp("scores"), SCORE))


def test_walk_in_place_wave_and_bow_are_on_the_beat(rehearsal):
    """The waving hand is within 20 ms of its beats in a score of 14 lines."""
    assert len(SCORE.splitlines()) <= 20
    score = rehearsal.score
    assert score, score.changes
    wave = next(cue for cue in score.cues if cue.gesture == "wave")
    t = np.arange(0.0, score.duration, 0.002)
    x0 = score.marionette.rest()
    unrehearsed_run = fan.simulate(score.marionette, x0, score.inputs(x0))
    delays = {}
    for name, run in (("plain", unrehearsed_run), ("rehearsed", rehearsal.run)):
        assert run.method == "event"
        y = hand_positions(score.marionette, run.resample(np.minimum(t, run.t[-1])))[:, 1]
        marks = [wave.marks[mark] for mark in ("first", "second", "third")]
        delays[name] = [outermost(t, y, mark) - mark for mark in marks]
    assert np.max(np.abs(delays["plain"])) > 0.1
    assert np.max(np.abs(delays["rehearsed"])) <= 0.02


def test_lateness_agrees_with_the_path(rehearsal):
    assert rehearsal.final_lateness == measure_lateness(rehearsal.score, rehearsal.run)
    assert max(abs(limb.seconds) for limb in rehearsal.final_lateness) <= 0.02
    assert max(abs(limb.seconds) for limb in rehearsal.initial_lateness) > 0.1
    strings = {(limb.cue.gesture, limb.string) for limb in rehearsal.final_lateness}
    assert strings == {("march", "knee_left"), ("march", "knee_right"), ("wave", "hand_right")}


def test_the_bounds_hold_and_the_inputs_are_those_of_the_run(rehearsal):
    t = np.linspace(0.0, rehearsal.inputs.end, 20001)
    q_K, speed, acceleration = rehearsal.inputs.evaluate(t)
    assert np.abs(speed).max() <= 1.5 * 1.003 and np.abs(acceleration).max() <= 15.0 * 1.003
    assert np.all(np.abs(speed[[0, -1]]) < 1e-9)
    x0 = rehearsal.score.marionette.rest()
    np.testing.assert_allclose(q_K[-1], x0.q_K, atol=1e-9)
    again = fan.simulate(rehearsal.score.marionette, x0, rehearsal.inputs, rehearsal.run.t[-1])
    assert np.array_equal(again.q_D[-1], rehearsal.run.q_D[-1])


def test_scores_that_cannot_be_rehearsed_are_refused(marionette, tmp_path):
    with pytest.raises(StateError, match="contact"):
        fan.theatre.rehearse(load_number(fan.puppets.promenade(), tmp_path, SCORE))
