"""Scores on their beats in the physics."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.errors import StateError
from fantoccini.marionette import link_index

HAND = ("forearm_right", (0.0, 0.0, -0.09))
WAVE = """\
score: wave
tempo: 100
speed: 1.2
acceleration: 12
lanes: {arm: [{gesture: wave, on: {first: 4}}]}
"""


@pytest.fixture(scope="module")
def score(tmp_path_factory) -> fan.Score:
    path = tmp_path_factory.mktemp("scores") / "wave.yaml"
    path.write_text(WAVE, encoding="utf-8")
    return fan.load_score(fan.puppets.marionette(), path)


def hand(puppet: fan.Marionette, run: fan.Trajectory) -> np.ndarray:
    pose = puppet.poses(run.q_D, run.q_K)[:, link_index(puppet.model, HAND[0])]
    return pose[:, :, 3] + pose[:, :, :3] @ HAND[1]


def outermost(t: np.ndarray, y: np.ndarray, mark: float) -> float:
    """When the right hand is farthest out near a mark."""
    near = np.flatnonzero(np.abs(t - mark) < 0.3)
    return float(t[near[np.argmin(y[near])]])


def test_the_hand_is_outermost_on_the_beat(score):
    puppet, x0 = score.marionette, score.marionette.rest()
    found = fan.on_beat(score, x0)
    assert found.violation < 1e-9
    t = np.arange(0.0, score.duration, 0.002)
    (cue,) = score.cues
    plain = fan.simulate(puppet, x0, score.inputs(x0), score.duration)
    late = {}
    for name, run in (("plain", plain), ("on beat", found.run)):
        y = hand(puppet, run.resample(t))[:, 1]
        late[name] = [outermost(t, y, cue.marks[m]) - cue.marks[m] for m in ("first", "second")]
    assert min(late["plain"]) > 0.1
    assert np.max(np.abs(late["on beat"])) < 0.02
    # It hangs still afterwards.
    end = found.run.t[-1]
    last = hand(puppet, found.run.resample(np.linspace(end - 0.3, end, 50)))
    assert np.ptp(last, axis=0).max() < 5e-3


def test_what_cannot_be_followed_is_told(score, tmp_path):
    stage = fan.puppets.promenade()
    path = tmp_path / "wave.yaml"
    path.write_text(WAVE, encoding="utf-8")
    with pytest.raises(StateError, match="contact"):
        fan.on_beat(fan.load_score(stage, path))
