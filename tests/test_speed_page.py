"""docs/benchmarks.md is whole and agrees with the code; peers are given the puppet that we have."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from benchmarks.speed import accuracy, batches, peers, pipeline, real_time, steps, subject
from benchmarks.speed.figures import Chapter, Goal, Samples, goals_table, in_turns, times
from benchmarks.speed.mujoco_peer import MuJoCo, PeerError
from benchmarks.strings import ROOT
from benchmarks.strings.report import Section

from harness import Model, State

PAGE = ROOT / "docs" / "benchmarks.md"


def rows() -> dict[str, list[str]]:
    """The lines of the page's opening tables by their first cell."""
    opening = PAGE.read_text(encoding="utf-8").split("\n## ")[0].splitlines()
    lines = [line.strip("| ").split(" | ") for line in opening if line.startswith("| ")]
    return {line[0]: line[1:] for line in lines}


def test_the_page_has_its_sections_and_names_its_command():
    text = PAGE.read_text(encoding="utf-8")
    assert re.findall(r"^## (\d+)\. ", text, re.MULTILINE) == [str(i) for i in range(1, 9)]
    assert "make bench" in text and "bench:" in (ROOT / "Makefile").read_text(encoding="utf-8")
    assert str(ROOT) not in text and not re.search(r"(?<![\w.])/(home|root|tmp|work)\b", text)


@pytest.mark.parametrize(
    "start, bound",
    [
        *((f"mj_step ({integrator}) / {steps.OURS[work].split(', ')[1]}", bound)
          for integrator, work, bound in steps.MARKS),
        ("trajectories a second, ours / mujoco.rollout", batches.RATE_MARK),
        ("lanes: simulated seconds a second of one core", batches.LANES_MARK),
        ("time to 1e-6 on 2 s with catches", accuracy.MARK),
        ("event-driven run of a gentle 10 s", real_time.MARK),
    ],
)  # fmt: skip
def test_every_ratio_has_its_mark_on_the_page(start, bound):
    found = [cells for name, cells in rows().items() if name.startswith(start)]
    median, _, _, mark, met = found[0]
    assert mark == f"at least {times(bound)}"
    if met != "not measured" and median != times(bound):
        assert met == ("yes" if float(median.rstrip("x")) >= bound else "**no**")


def test_the_earlier_figures_keep_their_rows():
    found = rows()
    for name in ("import fantoccini", "derivation", "compile", "load from cache",
                 "one constrained evaluation", "10 s demo, event-driven"):  # fmt: skip
        assert found[name][-1] in ("yes", "**no**")


def test_the_page_says_what_it_was_made_with():
    made_with = {"processor", "compiler", "compiler's flags", "fantoccini"}
    assert made_with | {"MuJoCo", "MuJoCo 3.17", "Pinocchio", "Drake"} <= set(rows())


def test_ratios_are_taken_turn_by_turn():
    slow, fast = Samples((4.0, 40.0, 6.0)), Samples((1.0, 10.0, 2.0))
    assert slow.over(fast).values == (4.0, 4.0, 3.0)
    order = []
    actions = {"a": lambda: order.append("a") or 1.0, "b": lambda: order.append("b") or 2.0}
    assert in_turns(actions, 2)["b"].values == (2.0, 2.0)
    assert order == ["a", "b", "a", "b"]


def test_marks_that_are_missed_or_not_measured_stand_out():
    goals = [
        Goal("a", Samples((9.0, 7.0, 8.0)), 8.0),
        Goal("b", Samples((3e-6,)), 2e-6, at_least=False),
        Goal("c", "not installed", 30.0),
    ]
    table = goals_table([Chapter(Section("1. One"), goals)])
    assert [row[-1] for row in table.rows] == ["yes", "**no**", "not measured"]
    assert table.rows[0][1:5] == ["8x", "7x", "9x", "at least 8x"]


def test_a_peer_that_is_not_there_is_an_error_with_that_name():
    with pytest.raises(PeerError, match="not installed"):
        MuJoCo.start(str(ROOT / "no such python"))
    with pytest.raises(PeerError, match="not installed"):
        MuJoCo.start("false").load("<mujoco/>")


def test_the_peers_puppet_is_ours():
    """Unconstrained accelerations of the exported puppet, by MuJoCo in its own process."""
    still = Model.of(subject.still_air())
    peer = MuJoCo.start(sys.executable)
    try:
        peer.load(peers.text(strung=False))
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
    assert accuracy.chosen([slow, fast, poor]) is fast
    assert accuracy.chosen([poor, run("RK4", 1.0, 1e-3, 0.1, 1e-2)]) is poor


def test_fresh_programs_print_their_seconds():
    assert pipeline.fresh("print(0.25)", 2).values == (0.25, 0.25)
