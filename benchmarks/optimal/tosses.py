"""A take of ten seconds with ten tosses, followed smoothly.

A hand jerks the string of a two-link arm up and lowers it, ten times: the string goes slack and
snaps taut each time. The search then finds smooth inputs with which the tip follows the same path,
every catch included (``exact=True``), until the residual of the conditions of optimality is below
1e-6. The arm's joints have damping like wooden ones: without it (``--damping 0``) the
motion is chaotic, and searches stall.

    python -m benchmarks.optimal.tosses [--turns 3] [--damping 5e-3]
"""

from __future__ import annotations

import argparse
import time

import fantoccini as fan

ARM = """
puppet: beater
bodies:
- name: upper
  joint: {name: shoulder, type: revolute, axis: [0, -1, 0], damping: 5e-3}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0.3, 0, 0], radius: 0.014, mass: 0.12}]
- name: lower
  parent: upper
  joint: {name: elbow, type: revolute, axis: [0, -1, 0], at: [0.3, 0, 0], damping: 5e-3}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0.3, 0, 0], radius: 0.012, mass: 0.08}]
strings:
- name: hand
  path: [{body: lower, at: [0.3, 0, 0]}, {driven: [x], at: [0.45, 0, 0.9]}]
  length: driven
pose: {shoulder: -20 deg, elbow: 50 deg, hand.length: 0.858}
"""
TIP = (0.3, 0.0, 0.0)
DURATION, INTERVAL = 10.0, 0.05
TOSSES, EVERY, HEIGHT = 10, 0.95, 0.28
"""Number of tosses, their interval [s], and the hand's pull [m]."""
KKT, TIME = 1e-6, 5.0
"""Targets: residual, and time to solve [s]."""


def toss_take(arm: fan.Marionette) -> tuple[fan.State, fan.Input, fan.Trajectory]:
    """The start, the hand's jerks, as accelerations between nodes, and their run."""
    x0 = arm.rest()
    length, points = x0["hand.length"], [(0.0, x0["hand.length"])]
    for toss in range(TOSSES):
        t = 0.3 + EVERY * toss
        points += [(t, length), (t + 0.3, length - HEIGHT), (t + 0.8, length)]
    rough = fan.Input.waypoints(arm, {"hand.length": points})
    return x0, rough, fan.simulate(arm, x0, rough, DURATION)


def following_task(arm: fan.Marionette, weight: float = 1e4) -> fan.Task:
    """The task of following the take with smooth inputs."""
    x0, rough, run = toss_take(arm)
    track = fan.control.Track.point(
        "lower", fan.control.Clip(run), at=TIP, weight=weight, end_weight=100.0
    )
    return fan.Task(
        arm,
        x0,
        DURATION,
        [track],
        fan.control.Smooth(1e-3, 1e-5),
        fan.control.Bounds(position={"hand.length": (0.3, 1.2)}),
        interval=INTERVAL,
        guess=rough,
    )


def count_catches(run: fan.Trajectory) -> int:
    """Number of catches of the string."""
    return sum(event.kind is fan.motion.EventKind.CATCH for event in run.events)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--damping", type=float, default=5e-3, help="damping of the joints [N m s]")
    options = parser.parse_args()
    turns, arm = options.turns, fan.loads(ARM.replace("5e-3", f"{options.damping:g}"))
    asked = following_task(arm)
    print(f"the take: {count_catches(toss_take(arm)[2])} catches")
    for _ in range(turns):
        began = time.perf_counter()
        best = fan.optimise(asked, exact=True, cost_tolerance=0.0, tolerance=KKT)
        took = time.perf_counter() - began
        print(
            f"{best.status.name}: residual {best.kkt:.1e} (at most {KKT:g}), "
            f"{count_catches(best.run)} catches, {best.iterations} iterations in {took:.2f} s "
            f"(at most {TIME:g}); {best.summary().splitlines()[-1]}"
        )


if __name__ == "__main__":
    main()
