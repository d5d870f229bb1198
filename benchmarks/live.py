"""Prints how fast a puppet in hands is simulated, how soon a page answers, what it takes.

    python -m benchmarks.live

Nothing here is a test: machines differ, and so do their neighbours.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

import numpy as np
import viser
from rich.console import Console
from rich.table import Table

import fantoccini as fan

PUPPETS = ("marionette", "marionette_bar", "arm3d")
SECONDS = 2.0
"""Performed for every figure [s]."""
ROUNDS = 5
MOVES = 40
VIEWER = """
import sys, time
from websockets.sync.client import connect
url, origin, version, seconds = sys.argv[1:]
with connect(url, origin=origin, subprotocols=[version], max_size=None) as page:
    end = time.monotonic() + float(seconds)
    while time.monotonic() < end:
        page.recv(timeout=10)
"""
"""Looks at a page in a process of its own, and draws nothing."""


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


def answer(live: fan.Performance) -> float:
    """Median time from a drag to a state that it has changed, while a page is alive [s]."""
    handle, rng = live.handles[0].name, np.random.default_rng(0)
    home, waited = live.place(handle)[0], []
    for _ in range(MOVES):
        time.sleep(rng.uniform(0.0, 1 / 30) + 0.3)
        before = live.state.q_K
        asked = time.perf_counter()
        live.move(handle, home + 0.02 * rng.uniform(-1.0, 1.0, size=3))
        while np.array_equal(live.state.q_K, before):
            time.sleep(1e-4)
        waited.append(time.perf_counter() - asked)
    return statistics.median(waited)


def page_of(name: str) -> tuple[float, float, float]:
    """Answer [s], updates a second and share of a core of a page that one viewer looks at.

    The simulation of the puppet, whose first handle is moved about, is in that share.
    """
    with fan.show(name, port=0, browser=False, wait=False) as page:
        live = page.show
        shown, show = [0], live.stage.show

        def counted(moment: object) -> None:
            shown[0] += 1
            show(moment)

        live.stage.show = counted
        about = [page.url.replace("http", "ws"), page.url, f"viser-v{viser.__version__}"]
        viewer = subprocess.Popen(
            [sys.executable, "-c", VIEWER, *about, str(2.0 + ROUNDS * SECONDS + 0.4 * MOVES)]
        )
        time.sleep(2.0)
        handle = live.performance.handles[0].name
        home = live.performance.place(handle)[0]
        before, begun, used = shown[0], time.perf_counter(), time.process_time()
        while (lasted := time.perf_counter() - begun) < (ROUNDS - 1) * SECONDS:
            live.performance.move(handle, home + 0.1 * np.sin(3.0 * lasted) * np.eye(3)[0])
            time.sleep(1 / 60)
        lasted, used = time.perf_counter() - begun, time.process_time() - used
        updates = shown[0] - before
        waited = answer(live.performance)
        viewer.wait()
    return waited, updates / lasted, used / lasted


def main() -> None:
    """Measures and prints."""
    print("times real time by the clock (by the processor's time); drag to changed state")
    table = Table("puppet", "dragged 5 cm", "thrown 10 m", "page: answer", "updates/s", "of a core")
    for name in PUPPETS:
        factors = (real_time_factors(name, far) for far in (0.05, 10.0))
        cells = (f"{clock:.1f} ({processor:.1f})" for clock, processor in factors)
        waited, updates, share = page_of(name)
        page = f"{1000 * waited:.1f} ms", f"{updates:.0f}", f"{100 * share:.0f} %"
        table.add_row(name, *cells, *page)
    Console().print(table)


if __name__ == "__main__":
    main()
