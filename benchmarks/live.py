"""Prints how fast a puppet in somebody's hands is simulated, and how soon it answers.

    python -m benchmarks.live

Nothing here is a test: machines differ, and so do their neighbours.
"""

from __future__ import annotations

import statistics
import threading
import time

import numpy as np
from rich.console import Console
from rich.table import Table

import fantoccini as fan

PUPPETS = ("marionette", "marionette_bar", "arm3d")
SECONDS = 2.0
"""Performed for every figure [s]."""
ROUNDS = 7
MOVES = 60


def dragged(live: fan.Performance, homes: dict, rng: np.random.Generator, far: float) -> None:
    """Every handle is wanted somewhere else about its home, up to ``far`` away [m]."""
    for name, (position, _) in homes.items():
        live.move(name, position + far * rng.uniform(-1.0, 1.0, size=3))


def real_time_factor(name: str, far: float) -> float:
    """Seconds performed in a second, the hands wanted elsewhere 60 times a second; the best."""
    live, rng = fan.Performance(getattr(fan.puppets, name)()), np.random.default_rng(0)
    homes = {h.name: live.place(h.name) for h in live.handles}
    rates = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        for _ in range(round(60 * SECONDS)):
            dragged(live, homes, rng, far)
            live.advance(1 / 60)
        rates.append(SECONDS / (time.perf_counter() - begun))
    return max(rates)


def answer(name: str) -> float:
    """Median time from a drag to a state that it has changed, while the puppet is alive [s]."""
    live, rng = fan.Performance(getattr(fan.puppets, name)()), np.random.default_rng(0)
    stop = threading.Event()

    def alive() -> None:
        begun = time.perf_counter()
        while not stop.is_set():
            live.advance(max(0.0, time.perf_counter() - begun - live.t))
            time.sleep(live.tick / 2)

    thread = threading.Thread(target=alive)
    thread.start()
    handle = live.handles[0].name
    home, waited = live.place(handle)[0], []
    try:
        for _ in range(MOVES):
            time.sleep(rng.uniform(0.0, 2.0 * live.tick) + 0.3)
            before = live.state.q_K
            asked = time.perf_counter()
            live.move(handle, home + 0.02 * rng.uniform(-1.0, 1.0, size=3))
            while np.array_equal(live.state.q_K, before):
                time.sleep(1e-4)
            waited.append(time.perf_counter() - asked)
    finally:
        stop.set()
        thread.join()
    return statistics.median(waited)


def main() -> None:
    """Measures and prints."""
    table = Table("puppet", "x real time, dragged 5 cm", "thrown 10 m", "drag to new state [ms]")
    for name in PUPPETS:
        gentle, rough = (real_time_factor(name, far) for far in (0.05, 10.0))
        table.add_row(name, f"{gentle:.1f}", f"{rough:.1f}", f"{1000 * answer(name):.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
