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


TURNED_SCORE = """\
score: lunges
tempo: 90
speed: 1.5
acceleration: 12
lanes:
  string:
    - {gesture: lunge.yaml, at: 1, heading: 30 deg, larger: 1.7, lasts: 2, repeat: 3,
       mirrored: true}
"""
TURNED_PLAY = """\
play: lunges
tempo: 90
cast: {one: {puppet: bob.yaml, at: [0, 0], facing: 30 deg}}
acts:
  - act: only
    cues:
      - {who: one, does: lunge.yaml, when: 1, larger: 1.7, lasts: 2, repeat: 3, how: mirrored}
"""
LUNGE = """\
gesture: lunge
moves:
  hold.x: [[0, 0], [1, 20 cm]]
  hold.y: [[0, 0], [1, 5 cm]]
"""


@pytest.mark.parametrize(
    ("score_text", "play_text", "changes"),
    [(SCORE, PLAY, 0), (TURNED_SCORE, TURNED_PLAY, 1)],
    ids=["hops", "turned"],
)
def test_a_score_is_performed_as_a_play_with_one_player(score_text, play_text, changes, tmp_path):
    write_play(tmp_path)
    (tmp_path / "lunge.yaml").write_text(LUNGE, encoding="utf-8")
    (tmp_path / "score.yaml").write_text(score_text, encoding="utf-8")
    (tmp_path / "play.yaml").write_text(play_text, encoding="utf-8")
    score = fan.load_score(fan.load(tmp_path / "bob.yaml"), tmp_path / "score.yaml")
    play = fan.load_play(tmp_path / "play.yaml", within=0.0)
    motion = play.motions["one"]
    assert len(score.changes) == changes  # transitions between repetitions, which take time
    assert not any(cue.refused for cue in play.cues)
    assert [cue.start for cue in play.cues] == pytest.approx([cue.start for cue in score.cues])
    assert [cue.end for cue in play.cues] == pytest.approx([cue.end for cue in score.cues])
    names = [motion.coordinates.v_K.index(name) for name in score.gesture.coordinates.v_K]
    for t in np.linspace(0.0, score.duration, 301):
        of_play, of_score = motion.offsets(t), score.offsets(t)
        for play_values, score_values in zip(of_play, of_score, strict=True):
            np.testing.assert_allclose(play_values[names], score_values, rtol=0.0, atol=1e-12)


def test_cues_of_scores_are_named(tmp_path):
    write_play(tmp_path)
    (tmp_path / "score.yaml").write_text(SCORE, encoding="utf-8")
    score = fan.load_score(fan.load(tmp_path / "bob.yaml"), tmp_path / "score.yaml")
    assert [cue.name for cue in score.cues] == ["hop", "hop", "sway", "last"]


def test_a_play_limits_the_pieces_of_a_repeated_gesture_as_a_score_does(tmp_path):
    """`thrice` and `repeat` multiply."""
    write_play(tmp_path)
    waypoints = ", ".join(f"[{0.1 * k:.1f}, {k % 2} cm]" for k in range(40))
    (tmp_path / "lunge.yaml").write_text(f"gesture: lunge\nmoves: {{hold.x: [{waypoints}]}}\n")
    play = PLAY.replace(
        "sway.yaml, when: 11, how: mirrored", "lunge.yaml, how: thrice, repeat: 1000"
    )
    (tmp_path / "play.yaml").write_text(play, encoding="utf-8")
    refused = fan.load_play(tmp_path / "play.yaml", within=0.0).cues[2].refused
    assert "found 3000; lunge would have 117000 pieces, of 100000 at most" in refused
