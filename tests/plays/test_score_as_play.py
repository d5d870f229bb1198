"""A score is a play with one player: both are performed by the same code."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from plays.tiny import write_play

pytestmark = [pytest.mark.medium, pytest.mark.own_puppets]

SCORE = """\
score: hops
tempo: 90
speed: 1.5
acceleration: 12
lanes:
  string:
    - {gesture: hop.yaml, on: {top: 3}}
    - {gesture: hop.yaml, larger: 0.5, repeat: 2, at: 6}
    - {gesture: sway.yaml, at: 11, mirrored: true}
    - {gesture: hop.yaml, faster: 1.5, name: last}
"""
PLAY = """\
play: hops
tempo: 90
cast: {one: {puppet: bob.yaml, at: [0, 0]}}
acts:
  - act: only
    cues:
      - {who: one, does: hop.yaml, on: {top: 3}}
      - {who: one, does: hop.yaml, larger: 0.5, repeat: 2, when: 6}
      - {who: one, does: sway.yaml, when: 11, how: mirrored}
      - {who: one, does: hop.yaml, faster: 1.5, name: last}
"""


def test_a_score_is_performed_as_a_play_with_one_player(tmp_path):
    write_play(tmp_path)
    (tmp_path / "score.yaml").write_text(SCORE, encoding="utf-8")
    (tmp_path / "play.yaml").write_text(PLAY, encoding="utf-8")
    score = fan.load_score(fan.load(tmp_path / "bob.yaml"), tmp_path / "score.yaml")
    play = fan.load_play(tmp_path / "play.yaml", within=0.0)
    motion = play.motions["one"]
    assert score and not any(cue.refused for cue in play.cues)
    assert [cue.start for cue in play.cues] == pytest.approx([cue.start for cue in score.cues])
    assert [cue.name for cue in score.cues] == ["hop", "hop", "sway", "last"]
    names = [motion.coordinates.v_K.index(name) for name in score.gesture.coordinates.v_K]
    for t in np.linspace(0.0, score.duration, 301):
        of_play, of_score = motion.offsets(t), score.offsets(t)
        for own, other in zip(of_play, of_score, strict=True):
            np.testing.assert_allclose(own[names], other, rtol=0.0, atol=1e-12)
