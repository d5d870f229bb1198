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
ROUNDS = 5
MOVES = 40


def dragged(live: fan.Performance, homes: dict, rng: np.random.Generator, far: float) -> None:
    """Every handle is wanted somewhere else about its home, up to ``far`` away [m]."""
    for name, (position, _) in homes.items():
        live.move(name, position + far * rng.uniform(-1.0, 1.0, size=3))


def real_time_factors(name: str, far: float) -> tuple[float, float]:
    """Seconds performed in a second, the hands wanted elsewhere 60 times a second; the best.

    By the clock, and by the processor's time, which neighbours disturb less.
    """
    live, rng = fan.Performance(getattr(fan.puppets, name)()), np.random.default_rng(0)
    homes = {h.name: live.place(h.name) for h in live.handles}
    rates = []
    for _ in range(ROUNDS):
        begun = time.perf_counter(), time.process_time()
        for _ in range(round(60 * SECONDS)):
            dragged(live, homes, rng, far)
            live.advance(1 / 60)
        ended = time.perf_counter(), time.process_time()
        rates.append([SECONDS / (b - a) for a, b in zip(begun, ended, strict=True)])
    by_clock, by_processor = np.max(rates, axis=0)
    return by_clock, by_processor


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
    print("times real time by the clock (by the processor's time); drag to changed state")
    table = Table("puppet", "dragged 5 cm", "thrown 10 m", "answer")
    for name in PUPPETS:
        factors = (real_time_factors(name, far) for far in (0.05, 10.0))
        cells = (f"{clock:.1f} ({processor:.1f})" for clock, processor in factors)
        table.add_row(name, *cells, f"{1000 * answer(name):.1f} ms")
    Console().print(table)


if __name__ == "__main__":
    main()
