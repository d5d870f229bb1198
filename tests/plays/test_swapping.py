"""Two players that change places at the same time pass one another."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.model.tree import WORLD
from fantoccini.theatre import cast
from fantoccini.theatre.plays.placing import place_cues
from fantoccini.theatre.plays.reading import read_play
from fantoccini.theatre.plays.stage_run import combine_runs
from fantoccini.theatre.plays.walk_planner import WalkPlanner

pytestmark = pytest.mark.slow

SWAP = """
    {who: pierrot, walks to: east}
    {who: columbine, walks to: west}
"""
SAMPLE_STRIDE = 25
"""Number of samples of the run between two measured ones."""


def string_points(play: fan.theatre.Play, poses: np.ndarray) -> dict[str, np.ndarray]:
    """Player -> (T, n, 3) points along its strings, 5 cm apart or less [m]."""
    points: dict[str, list[np.ndarray]] = {"pierrot": [], "columbine": []}
    shares = np.linspace(0.0, 1.0, 25)[:, None]
    for string in play.marionette.tree.strings:
        ends = []
        for point in (string.points[0], string.points[-1]):
            assert point.link != WORLD
            pose = poses[:, point.link]
            ends.append(pose[:, :, :3] @ np.array([float(x) for x in point.at]) + pose[:, :, 3])
        first, last = (end[:, None] for end in ends)
        points[string.name.partition(".")[0]].append(first + shares * (last - first))
    return {name: np.concatenate(point_lists, axis=1) for name, point_lists in points.items()}


def test_two_players_change_places_and_keep_their_distance(plays):
    play = plays.compile(SWAP)
    assert not play.changes
    assert [cue.passes for cue in play.cues] == ["columbine gives way", "gives way to pierrot"]
    starts = [cue.start for cue in play.cues]
    assert max(starts) < 0.2 and np.ptp(starts) < 1e-4
    first, second = (play.walks[name][-1] for name in ("pierrot", "columbine"))
    assert first.length == pytest.approx(1.2)
    assert second.length > 1.25
    assert abs(first.end - second.end) < 6.0
    run = combine_runs(play.cast, play.runs())
    poses = play.marionette.poses(run.q_D[::SAMPLE_STRIDE], run.q_K[::SAMPLE_STRIDE])
    strings = string_points(play, poses)
    gaps = [
        np.linalg.norm(a[:, None] - b[None], axis=2).min()
        for a, b in zip(strings["pierrot"], strings["columbine"], strict=True)
    ]
    assert min(gaps) > 0.05
    joints = {
        name: [k for k, link in enumerate(play.marionette.tree.links) if link.name.startswith(name)]
        for name in strings
    }
    joint_offsets = (
        poses[:, joints["pierrot"], None, :, 3] - poses[:, None, joints["columbine"], :, 3]
    )
    assert np.linalg.norm(joint_offsets, axis=-1).min() > 0.05
    for walk, y in ((first, -0.6), (second, 0.6)):
        np.testing.assert_allclose(walk.footing(np.array([walk.end]))[0][0], [0.0, y], atol=1e-9)


def test_a_player_that_stays_is_not_passed(plays):
    play = plays.compile("{who: pierrot, walks to: east}")
    (cue,) = play.refused
    assert "columbine stands there" in cue.refused and not cue.passes


CORRIDOR = """
play: corridor
tempo: 100
stage: {space: {x: [-0.36, 0.36], y: [-2.2, 1.2]}}
cast:
  pierrot: {at: [0, 0.6]}
  columbine: {at: [0, -0.6]}
acts:
  - act: one
    cues:
      - {who: pierrot, walks to: [0, -1.7]}
      - {who: columbine, walks to: [0, 0.1], when: 21}
"""


def test_nobody_is_passed_who_still_stands_in_the_way(plays):
    """Nobody can go around in a corridor; she leaves only when he would have walked through her."""
    script = read_play(plays.write("", CORRIDOR), cast.ResultCache())
    walks = WalkPlanner(script.cast, script.log)
    placement = place_cues(
        script.cast,
        script.timeline,
        script.gestures,
        script.places,
        walks,
        cast.Corrections(),
        script.log,
    )
    first, second = placement.cues
    assert "no way leads round columbine" in first.refused
    assert not placement.pass_notes and not second.refused
