"""Section 3: many trajectories with contact at once."""

from __future__ import annotations

import time
from collections.abc import Callable

import fantoccini as fan
from fantoccini.motion import Input

from ..speed.figures import Chapter, Goal, in_turns, ratio_text, spread_text, time_text
from ..strings.report import Section, Table
from .steps import Pair
from .subject import DT, Subject

THREADS = 2
STEPS = 100
FASTER = 20.0


def chapter(pairs: list[Pair], turns: int, trajectories: int) -> Chapter:
    """Rates and their ratios, for the standing subjects."""
    rows, goals = [], []
    for pair in pairs[:2]:
        subject, n = pair.subject, trajectories // len(pair.subject.members)
        states = [subject.pushed(seed) for seed in range(n)]
        _rate(subject, states[:8])  # compiles the lanes
        actions: dict[str, Callable[[], float]] = {
            "ours": lambda subject=subject, states=states: _rate(subject, states),
            "theirs": lambda pair=pair, states=states, n=n: (
                n / pair.peer.trajectories(states, STEPS, THREADS)
            ),
        }
        taken = in_turns(actions, turns)
        ratio = taken["ours"].over(taken["theirs"])
        for who, name in (("ours", "fantoccini, batch"), ("theirs", "MuJoCo, rollout")):
            rows.append([f"{name}, {subject.name}", *spread_text(taken[who], lambda x: f"{x:.0f}")])
        goals.append(Goal(f"trajectories a second, ours / rollout, {subject.name}", ratio, FASTER))
    text = (
        f"Trajectories of {STEPS} steps of {time_text(DT)}, {trajectories} of one marionette and "
        "half "
        f"as many of two, each with different small velocities, on {THREADS} threads, in turn, "
        f"{turns} times, in wall-clock time. Ours: one call of `fan.simulate_batch` in Python; "
        "MuJoCo: `mujoco.rollout` with the fastest setting and a pool of threads. Lanes share "
        "the evaluation of the equations, and standing lanes also the solution of the law; lanes "
        "in which feet slide or other parts touch make their steps alone."
    )
    ratios = [[goal.what, *spread_text(goal.measured, ratio_text)] for goal in goals]
    table = Table(["trajectories a second", "median", "min", "max"], rows)
    ratio_table = Table(["ratio", "median", "min", "max"], ratios)
    return Chapter(Section("3. Many trajectories", [text, table, ratio_table]), goals)


def _rate(subject: Subject, states: list) -> float:
    """Trajectories per second, with constant inputs."""
    start = time.perf_counter()
    fan.simulate_batch(
        subject.marionette,
        states,
        Input.hold(subject.marionette, duration=STEPS * DT),
        t_end=STEPS * DT,
        method=fan.TimeStepping(dt=DT),
        threads=THREADS,
        save_every=STEPS,
    )
    return len(states) / (time.perf_counter() - start)
