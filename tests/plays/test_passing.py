"""Passages through a player or an obstacle between two measured samples are detected."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.plays import clearances
from fantoccini.theatre.plays.touching import SAMPLE_STRIDE, find_touches
from plays.tiny import write_play


@pytest.mark.slow
def test_a_ball_thrown_through_another_or_through_a_block_is_detected(tmp_path):
    play = fan.load_play(write_play(tmp_path))
    run = fan.theatre.verify_play(play).run
    names = run.coordinates.q_D
    x, y, z = (names.index(f"one.ball.{axis}") for axis in "xyz")
    still_q_D = np.repeat(run.q_D[:1], len(run), axis=0)
    sample = SAMPLE_STRIDE * (len(run) // (2 * SAMPLE_STRIDE))
    link = next(i for i, a in enumerate(play.marionette.tree.links) if a.name == "one.ball")
    position = play.marionette.poses(run.q_D[0], run.q_K[0])[link, :, 3]
    middle = still_q_D[0, [x, y, z]] - position  # middle of the stage, in the ball's coordinates
    for obstacle, obstacle_place in (
        ("two.ball", (0.0, 0.3, position[2])),
        ("block", (-0.4, 0.0, 0.1)),
    ):
        q_D = still_q_D.copy()
        q_D[:, [x, y, z]] = middle + obstacle_place
        axis = y if obstacle == "two.ball" else x
        q_D[: sample + 1, axis] -= 0.6
        q_D[sample + 1 :, axis] += 0.6
        q_K = np.repeat(run.q_K[:1], len(run), axis=0)
        passing_run = dataclasses.replace(run, q_D=q_D, q_K=q_K)
        touches_inside = [
            touch for touch in find_touches(play.cast, passing_run) if touch.distance < 0.0
        ]
        assert {"one.ball", obstacle} in [{touch.first, touch.second} for touch in touches_inside]
        touch_times = [
            touch.t
            for touch in touches_inside
            if {touch.first, touch.second} == {"one.ball", obstacle}
        ]
        assert run.t[sample] < min(touch_times) < run.t[sample + SAMPLE_STRIDE]
        assert any(
            {approach.first, approach.second} == {"one.ball", obstacle} and approach.distance < 0.0
            for approach in clearances(play.cast, passing_run)
        )
