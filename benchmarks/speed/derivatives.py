"""Prints the cost of the marionette's derivatives, compared with its runs and steps.

    python -m benchmarks.speed.derivatives [--turns 20] [--duration 1.0] [--nodes 50]

One line is the sensitivity of an event-driven run of the bundled performance by its start and along
a change of each driven coordinate, per simulated second; one is that of a run with many catches;
one is the first run's intervals' derivatives; one is ``linearise_steps`` at many states. Runs
alternate with their derivatives. The minimum over all turns is printed, in processor time of one
thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import fantoccini as fan
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.intervals import interval_derivatives
from fantoccini.motion import InputDerivative, State
from fantoccini.theatre.perform.demo import performance

PER_SECOND = 20.0
"""Target time of a sensitivity for a simulated second [ms]."""
PER_NODE = 15.0
"""Target time of the derivatives of a step [us]."""
INTERVALS = 50
"""Number per second."""


def shortest_times(turns: int, *calls: Callable[[], object]) -> list[float]:
    """The shortest processor time of each call in alternating turns [s]."""
    best = [np.inf] * len(calls)
    for _ in range(turns + 1):
        for i, call in enumerate(calls):
            start = time.thread_time()
            call()
            best[i] = min(best[i], time.thread_time() - start)
    return best


def shaking_inputs(puppet: Marionette, x0: State, duration: float) -> fan.Input:
    """Inputs that shorten every second string by 3 cm, then the others, every 1/8 s in turn."""
    names = [name for name in puppet.coordinates.q_K if name.endswith(".length")]
    times = np.linspace(0.0, duration, round(8 * duration) + 1)
    points = {}
    for i, name in enumerate(names):
        pulled = (np.arange(len(times)) + i) % 2 * 0.03
        pulled[[0, -1]] = 0.0
        points[name] = list(zip(times.tolist(), (x0[name] - pulled).tolist(), strict=True))
    return fan.Input.waypoints(puppet, points)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=20)
    parser.add_argument("--duration", type=float, default=1.0, help="of the run [s]")
    parser.add_argument("--nodes", type=int, default=50)
    arguments = parser.parse_args()
    puppet, duration = fan.puppets.marionette(), arguments.duration
    table = puppet.coordinates
    x0, inputs, _ = performance(puppet)
    ramps = np.zeros((table.n_vK, 1, table.n_vK, 6))
    ramps[:, 0, :, 1] = np.eye(table.n_vK)
    ends = np.array([0.0, duration])
    along = [InputDerivative(table, ends, ramp, "", True) for ramp in ramps]
    run, cost = shortest_times(
        arguments.turns,
        lambda: fan.simulate(puppet, x0, inputs, duration, effort=False),
        lambda: fan.dynamics.sensitivity(puppet, x0, inputs, duration, along=along),
    )
    print(
        f"sensitivity by the start and along {len(along)} inputs: {1e3 * cost / duration:.1f} ms "
        f"for a simulated second (at most {PER_SECOND:g}), {cost / run:.1f} runs of "
        f"{1e3 * run / duration:.2f} ms"
    )
    shakes = shaking_inputs(puppet, x0, duration)
    passages = len(fan.dynamics.sensitivity(puppet, x0, shakes, duration, along=along).passages)
    run, cost = shortest_times(
        min(arguments.turns, 5),
        lambda: fan.simulate(puppet, x0, shakes, duration, effort=False),
        lambda: fan.dynamics.sensitivity(puppet, x0, shakes, duration, along=along),
    )
    print(
        f"the same of a run with {passages} catches: {1e3 * cost / duration:.0f} ms for a "
        f"simulated second, {cost / run:.1f} runs of {1e3 * run / duration:.1f} ms"
    )
    n = round(INTERVALS * duration)
    acc_K = np.gradient(inputs.evaluate(np.linspace(0.0, duration, n))[1], duration / n, axis=0)
    pieces = fan.Input.segments(
        puppet, np.linspace(0.0, duration, n + 1), x0.q_K, np.zeros(table.n_vK), acc_K
    )
    trajectory = fan.simulate(puppet, x0, pieces, duration, effort=False)
    run, cost = shortest_times(
        arguments.turns,
        lambda: fan.simulate(puppet, x0, pieces, duration, effort=False),
        lambda: interval_derivatives(puppet, trajectory, pieces),
    )
    print(
        f"A, B of {n} intervals of such a run, with {len(trajectory.events)} events: "
        f"{1e3 * cost / duration:.1f} ms for a simulated second, {cost / run:.1f} runs"
    )
    chosen = np.linspace(0, len(trajectory.t) - 1, arguments.nodes).astype(int)
    states = [getattr(trajectory, name)[chosen] for name in ("q_D", "v_D", "q_K", "v_K", "acc_K")]
    (cost,) = shortest_times(
        arguments.turns, lambda: puppet.linearise_steps(*states, dt=0.01, threads=1)
    )
    print(
        f"linearise_steps at {arguments.nodes} states: {1e6 * cost / arguments.nodes:.1f} us each "
        f"(at most {PER_NODE:g})"
    )


if __name__ == "__main__":
    main()
