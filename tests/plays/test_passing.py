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
    still = np.repeat(run.q_D[:1], len(run), axis=0)
    k = SAMPLE_STRIDE * (len(run) // (2 * SAMPLE_STRIDE))
    link = next(i for i, a in enumerate(play.marionette.tree.links) if a.name == "one.ball")
    at = play.marionette.poses(run.q_D[0], run.q_K[0])[link, :, 3]
    middle = still[0, [x, y, z]] - at  # middle of the stage, in the ball's coordinates
    for through, place in (("two.ball", (0.0, 0.3, at[2])), ("block", (-0.4, 0.0, 0.1))):
        q_D = still.copy()
        q_D[:, [x, y, z]] = middle + place
        axis = y if through == "two.ball" else x
        q_D[: k + 1, axis] -= 0.6
        q_D[k + 1 :, axis] += 0.6
        q_K = np.repeat(run.q_K[:1], len(run), axis=0)
        passing = dataclasses.replace(run, q_D=q_D, q_K=q_K)
        passages = [touch for touch in find_touches(play.cast, passing) if touch.distance < 0.0]
        assert {"one.ball", through} in [{touch.first, touch.second} for touch in passages]
        times = [
            touch.t for touch in passages if {touch.first, touch.second} == {"one.ball", through}
        ]
        assert run.t[k] < min(times) < run.t[k + SAMPLE_STRIDE]
        assert any(
            {approach.first, approach.second} == {"one.ball", through} and approach.distance < 0.0
            for approach in clearances(play.cast, passing)
        )
