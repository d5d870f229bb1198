"""Ratios of benchmarks/speed and their reports; peers simulate the same puppet."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from benchmarks.speed import accuracy, peers, pipeline, subject
from benchmarks.speed.figures import Chapter, Goal, Samples, goals_table, in_turns
from benchmarks.speed.mujoco_peer import MuJoCo, PeerError
from benchmarks.strings import ROOT
from benchmarks.strings.report import Section

from harness import Model, State


def test_ratios_are_taken_turn_by_turn():
    slow, fast = Samples((4.0, 40.0, 6.0)), Samples((1.0, 10.0, 2.0))
    assert slow.over(fast).values == (4.0, 4.0, 3.0)
    order = []
    actions = {"a": lambda: order.append("a") or 1.0, "b": lambda: order.append("b") or 2.0}
    assert in_turns(actions, 2)["b"].values == (2.0, 2.0)
    assert order == ["a", "b", "a", "b"]


def test_missed_and_unmeasured_goals_are_marked():
    goals = [
        Goal("a", Samples((9.0, 7.0, 8.0)), 8.0),
        Goal("b", Samples((3e-6,)), 2e-6, at_least=False),
        Goal("c", "not installed", 30.0),
    ]
    table = goals_table([Chapter(Section("1. One"), goals)])
    assert [row[-1] for row in table.rows] == ["yes", "**no**", "not measured"]
    assert table.rows[0][1:5] == ["8x", "7x", "9x", "at least 8x"]


def test_a_missing_peer_is_an_error_with_its_name():
    with pytest.raises(PeerError, match="not installed"):
        MuJoCo.start(str(ROOT / "no such python"))
    with pytest.raises(PeerError, match="not installed"):
        MuJoCo.start("false").load("<mujoco/>")


def test_the_peers_puppet_is_ours():
    """Unconstrained accelerations of the exported puppet, by MuJoCo in its own process."""
    still = Model.of(subject.still_air())
    peer = MuJoCo.start(sys.executable)
    try:
        peer.load(peers.peers_mjcf(strung=False))
        for seed in range(3):
            state = still.random(seed, moving_inputs=False)
            x = State(state.q_D, state.v_D, np.array(still.table.start_K), state.v_K, state.acc_K)
            ours, theirs = still.acceleration(x), peer.acceleration(x.q_D, x.v_D)
            assert np.abs(theirs - ours).max() <= peers.SAME * np.abs(ours).max()
    finally:
        peer.stop()


def test_the_cheapest_run_that_is_exact_enough_is_chosen():
    run = accuracy.Run
    slow, fast = run("RK4", 5.0, 1e-6, 9.0, 1e-7), run("Euler", 5.0, 1e-6, 3.0, 9e-7)
    poor = run("Euler", 1.0, 1e-3, 1.0, 1e-3)
    assert accuracy.best_run([slow, fast, poor]) is fast
    assert accuracy.best_run([poor, run("RK4", 1.0, 1e-3, 0.1, 1e-2)]) is poor


def test_fresh_programs_print_their_seconds():
    assert pipeline.run_fresh("print(0.25)", 2).values == (0.25, 0.25)
