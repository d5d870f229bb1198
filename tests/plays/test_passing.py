"""Who passes through another or through an obstacle between two measured samples is seen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.plays import clearances
from fantoccini.plays.touching import EVERY, touches
from plays.tiny import write_play


@pytest.mark.slow
def test_a_ball_that_is_thrown_through_another_and_through_a_block_is_seen(tmp_path):
    play = fan.load_play(write_play(tmp_path))
    run = fan.verify_play(play).run
    names = run.coordinates.q_D
    x, y, z = (names.index(f"one.ball.{axis}") for axis in "xyz")
    still = np.repeat(run.q_D[:1], len(run), axis=0)
    k = EVERY * (len(run) // (2 * EVERY))
    for far, through in (((0.6, 0.6), "two.ball"), ((-0.6, -0.6), "block")):
        q_D = still.copy()
        if through == "two.ball":
            q_D[: k + 1, y], q_D[k + 1 :, y] = -far[0], 2.0 * far[1]
        else:
            q_D[: k + 1, x], q_D[k + 1 :, x] = 0.0, 2.0 * far[0]
            q_D[:, [y, z]] = 0.0, 0.1
        q_K = np.repeat(run.q_K[:1], len(run), axis=0)
        passing = dataclasses.replace(run, q_D=q_D, q_K=q_K)
        found = [one for one in touches(play.cast, passing) if one.distance < 0.0]
        assert {"one.ball", through} in [{one.what, one.other} for one in found]
        times = [one.t for one in found if {one.what, one.other} == {"one.ball", through}]
        assert run.t[k] < min(times) < run.t[k + EVERY]
        assert any(
            {one.what, one.other} == {"one.ball", through} and one.distance < 0.0
            for one in clearances(play.cast, passing)
        )
