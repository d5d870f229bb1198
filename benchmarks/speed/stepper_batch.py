"""Prints the rate of pieces of 20 ms of the bundled marionette's batched stepper.

    python -m benchmarks.speed.stepper_batch [--runs 1024] [--calls 50] [--threads 2] [--turns 7]

A call of ``stepper_batch.advance`` makes one piece of every run, as in a control loop: it
gets the accelerations of all driven coordinates (runs, 21) and leaves the states in arrays. Runs
begin at different times of the bundled performance and follow its accelerations. Pieces are made
of time steps of 2 ms, the default, and of one step of 20 ms. Figures are the median and the best of
all turns, by the wall clock.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import fantoccini as fan
from fantoccini.dynamics.steppers import StepperBatch
from fantoccini.theatre.perform.demo import performance

PIECE = 0.02
"""[s]"""
MARK = 400_000
"""Target rate of pieces of one step [1/s]."""


def start_batch(runs: int, dt: float, threads: int) -> tuple[StepperBatch, np.ndarray]:
    """Runs of the performance from different times, and its accelerations from there.

    Args:
        runs: number of runs.
        dt: time step [s].
        threads: number of threads.

    Returns:
        The batch, and (200, runs, n_vK) accelerations of pieces.
    """
    puppet = fan.puppets.marionette()
    x0, inputs, duration = performance(puppet)
    run = fan.simulate(puppet, x0, inputs, duration, method="timestepping", effort=False)
    n = round(duration / PIECE)
    v_K = inputs.evaluate(np.linspace(0.0, duration, n + 1))[1]
    acc_K = np.diff(v_K, axis=0) / PIECE
    first = np.random.default_rng(0).integers(0, n - 200, runs)
    states = [run.at(i * PIECE).replace(t=0.0) for i in first.tolist()]
    batch = puppet.stepper_batch(states, method=fan.TimeStepping(dt=dt), threads=threads)
    return batch, acc_K[first[None] + np.arange(200)[:, None]]


def rates(runs: int, calls: int, dt: float, threads: int, turns: int) -> list[float]:
    """Pieces per second of each turn; every turn restarts."""
    batch, acc_K = start_batch(runs, dt, threads)
    rate_list = []
    for _ in range(turns):
        batch.reset()
        start = time.perf_counter()
        for k in range(calls):
            batch.advance(PIECE, acc_K[k])
        rate_list.append(calls * runs / (time.perf_counter() - start))
        if not np.all(batch.arrived):
            raise RuntimeError("runs of the performance ended early")
    return rate_list


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1024)
    parser.add_argument("--calls", type=int, default=50, help="in a turn, at most 200")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--turns", type=int, default=7)
    a = parser.parse_args()
    for dt in (0.002, PIECE):
        rate_list = rates(a.runs, a.calls, dt, a.threads, a.turns)
        mark = f" (at least {MARK:,})" if dt == PIECE else ""
        print(
            f"{a.runs} runs, {a.threads} threads, steps of {1e3 * dt:g} ms: "
            f"{np.median(rate_list):,.0f} pieces of {1e3 * PIECE:g} ms a second, at best "
            f"{max(rate_list):,.0f}{mark}"
        )


if __name__ == "__main__":
    main()
