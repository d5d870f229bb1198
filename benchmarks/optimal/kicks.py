"""Prints the kicked marionette's errors in drawing a circle: open loop, with gains, and under MPC.

    python -m benchmarks.optimal.kicks [--kicks 20] [--size 2.0]

A kick changes all joint velocities at the start, with this norm. The puppet is simulated by time
steps of 1 ms; a run arrives if its hand is within 5 mm of the circle in the last half second.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.motion import State

AT = np.array([0.0, 0.0, -0.09])
"""The point of the hand that draws, in the forearm's frame [m]."""
ARRIVAL_DISTANCE = 5e-3
"""Largest distance of a run that arrives [m]."""
DT = 0.001
"""Time step of the simulation [s]."""


def distances(
    task: fan.Task, x0: State, interval: float, law: Callable[[State, int], Array]
) -> Array:
    """Distances of the hand from its path after each interval [m]; infinite if a run ends early."""
    puppet, out = task.marionette, []
    stepper = puppet.stepper(x0, fan.TimeStepping(dt=DT))
    n = round(task.durations[1] / interval)
    for i in range(n):
        x = stepper.advance(interval, law(stepper.state, i), throw=False)
        if not stepper.arrived:
            return np.full(n, np.inf)
        pose = puppet.pose(x, "forearm_right")
        out.append(np.linalg.norm(pose[:3, 3] + pose[:3, :3] @ AT - task.tracks[0].path(x.t)))
    return np.array(out)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kicks", type=int, default=20)
    parser.add_argument("--size", type=float, default=2.0, help="[rad/s]")
    arguments = parser.parse_args()
    task = fan.control.load_task("circle")
    free = replace(task, bounds=replace(task.bounds, held=(), speed=1.5))
    best = fan.optimise(task)
    print(best)
    nodes, gains = best.nodes, best.gains

    def with_gains(x: State, i: int) -> Array:
        own = {name: getattr(nodes, name)[i : i + 1] for name in ("q_D", "v_D", "q_K", "v_K")}
        now = (getattr(x, name)[None] for name in own)
        z = replace(nodes, **own).changes_to(*now, first_node=0)[0]
        bound = task.bounds.magnitudes(task.marionette, "acceleration")
        return np.clip(nodes.acc_K[i] + gains[i] @ z, -bound, bound)

    random, results, taken = np.random.default_rng(0), {}, []

    def timed(mpc: fan.MPC, x: State, _: int) -> Array:
        acc_K = mpc.step(x)
        taken.append(mpc.seconds)
        return acc_K

    for _ in range(arguments.kicks):
        kick = random.normal(size=len(task.x0.v_D))
        x0 = task.marionette.project(
            task.x0.replace(v_D=arguments.size * kick / np.linalg.norm(kick))
        )
        mpc = fan.MPC(task.marionette, free)
        ways = {
            "open loop": (nodes.interval, lambda x, i: nodes.acc_K[i]),
            "LQR gains": (nodes.interval, with_gains),
            "MPC": (mpc.interval, partial(timed, mpc)),
        }
        for name, (interval, law) in ways.items():
            away = distances(task, x0, interval, law)
            late = away[-round(0.5 / interval) :]
            results.setdefault(name, []).append((np.max(late), np.sqrt(np.mean(np.square(away)))))
    for name, rows in results.items():
        last, rms = np.array(rows).T
        print(
            f"{name:10} {np.sum(last < ARRIVAL_DISTANCE)} of {len(last)} arrive; "
            f"medians: in the last half second at most {1e3 * np.median(last):.2g} mm away, "
            f"{1e3 * np.median(rms):.2g} mm RMS"
        )
    seconds = np.array(taken)
    print(
        f"an update takes {1e3 * np.median(seconds):.1f} ms (median), "
        f"{1e3 * np.max(seconds):.1f} ms at most; "
        f"{100 * np.mean(seconds > mpc.deadline):.1f} % take longer than the interval"
    )


if __name__ == "__main__":
    main()
