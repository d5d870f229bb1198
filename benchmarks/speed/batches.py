"""Section 4: many trajectories at once, on all threads and on one core."""

from __future__ import annotations

import time
from collections.abc import Callable

import fantoccini as fan
from fantoccini.motion import Input

from ..strings.report import Section, Table, number
from .figures import Chapter, Goal, Samples, in_turns, ratio_text
from .peers import Peers
from .subject import DT, marionette, swinging_state

THREADS = 2
STEPS = 100
RATE_MARK, LANES_MARK = 30.0, 4000.0


def batch_rate(states: list, steps: int, threads: int) -> float:
    """Trajectories per second of time-stepping from several states, with constant inputs."""
    start = time.perf_counter()
    fan.simulate_batch(
        marionette(),
        states,
        Input.hold(marionette(), duration=steps * DT),
        t_end=steps * DT,
        method=fan.TimeStepping(dt=DT),
        threads=threads,
        save_every=steps,
    )
    return len(states) / (time.perf_counter() - start)


def chapter(peers: Peers, turns: int, trajectories: int) -> Chapter:
    """Rates and their ratios."""
    states = [swinging_state(seed) for seed in range(trajectories)]
    starts = [(x.q_D, x.v_D) for x in states]
    actions: dict[str, Callable[[], float]] = {}
    ours = {n: f"fantoccini, {n} {'threads' if n > 1 else 'thread'}" for n in (THREADS, 1)}

    def own(threads: int) -> Callable[[], float]:
        return lambda: batch_rate(states, STEPS, threads)

    def theirs(peer) -> Callable[[], float]:
        settings = peer.fastest["Euler"]
        return lambda: trajectories / peer.trajectories(settings, starts, STEPS, THREADS)

    batch_rate(states[:8], STEPS, THREADS)  # compiles the lanes
    actions |= {name: own(threads) for threads, name in ours.items()}
    for peer in peers.mujoco.values():
        actions[f"MuJoCo {peer.version}, rollout, {THREADS} threads"] = theirs(peer)
    taken = in_turns(actions, turns)
    rivals = [s for name, s in taken.items() if name.startswith("MuJoCo")]
    ratios = [taken[ours[THREADS]].over(rival) for rival in rivals]
    ratio = min(ratios, key=lambda s: s.median) if ratios else peers.no_mujoco
    lanes = Samples(tuple(rate * STEPS * DT for rate in taken[ours[1]].values))
    rows = [
        [name, *(f"{x:.0f}" for x in (s.median, min(s.values), max(s.values)))]
        for name, s in taken.items()
    ]
    rows += [
        [f"{name}, rollout", peers.missing[name], "-", "-"]
        for name in peers.missing
        if name.startswith("MuJoCo")
    ]
    text = (
        f"{trajectories} trajectories of {STEPS} steps of {number(DT * 1e3)} ms, each with a "
        f"different swing, in turn, {turns} times, in wall-clock time. Ours come from one call of "
        "`fan.simulate` in Python, with all its checks, and keep the last state of every "
        "trajectory; `mujoco.rollout` runs the fastest setting of Euler with an existing pool of "
        "threads, and always keeps every state. Simulated seconds a second on one core are those "
        "of the row with one thread."
    )
    table = Table(["trajectories a second", "median", "min", "max"], rows)
    goals = [
        Goal(f"trajectories a second, ours / mujoco.rollout, {THREADS} threads", ratio, RATE_MARK),
        Goal(
            f"lanes: simulated seconds a second of one core, steps of {number(DT * 1e3)} ms",
            lanes,
            LANES_MARK,
        ),
    ]
    parts = [text, table, f"One core simulates {ratio_text(lanes.median)} real time."]
    return Chapter(Section("4. Many trajectories", parts), goals)
