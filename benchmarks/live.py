"""Prints the speed of a performed puppet's simulation, its latency, and the cost of a page.

    python -m benchmarks.live

This is not a test: machines and their load differ.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import statistics
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from tests.show.browser import chrome, missing_reason, until
from tests.show.viewer import Viewer

import fantoccini as fan

PUPPETS = ("marionette", "marionette_bar", "arm3d", "promenade", "stroll", "visit")
SECONDS = 2.0
"""Duration of the performance for every figure [s]."""
ROUNDS = 5
MOVES = 40


def drag_handles(
    live: fan.Performance, homes: dict, rng: np.random.Generator, reach: float
) -> None:
    """Moves the target of every handle to a random place up to ``reach`` from its home [m]."""
    for name, (position, _) in homes.items():
        live.move(name, position + reach * rng.uniform(-1.0, 1.0, size=3))


def real_time_factors(name: str, reach: float) -> tuple[float, float]:
    """Speed relative to real time, with new targets 60 times per second; the best.

    By the clock, and by the processor's time, which neighbours disturb less.
    """
    live, rng = fan.Performance(getattr(fan.puppets, name)()), np.random.default_rng(0)
    homes = {h.name: live.place(h.name) for h in live.handles}
    rates = []
    for _ in range(ROUNDS):
        begun = time.perf_counter(), time.process_time()
        for _ in range(round(60 * SECONDS)):
            drag_handles(live, homes, rng, reach)
            live.advance(1 / 60)
        ended = time.perf_counter(), time.process_time()
        rates.append([SECONDS / (b - a) for a, b in zip(begun, ended, strict=True)])
    by_clock, by_processor = np.max(rates, axis=0)
    return by_clock, by_processor


def answer_time(name: str) -> float:
    """Median time from a drag to a changed state, while the puppet is alive [s]."""
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
            requested = time.perf_counter()
            live.move(handle, home + 0.02 * rng.uniform(-1.0, 1.0, size=3))
            while np.array_equal(live.state.q_K, before):
                time.sleep(1e-4)
            waited.append(time.perf_counter() - requested)
    finally:
        stop.set()
        thread.join()
    return statistics.median(waited)


@contextlib.contextmanager
def open_in_browser(url: str) -> Iterator[None]:
    """Opens a page in a headless Chromium meanwhile, if there is one."""
    if missing_reason():
        yield
        return
    with chrome() as browser:
        browser.get(url)
        yield


def puppeteer(url: str, handle: str, orders: Connection) -> None:
    """A viewer in a separate process that drags a handle in circles of one second, or jerks it."""
    with Viewer(url) as viewer:
        until(lambda: handle in viewer.poses, "the handle is there")
        home = np.array(viewer.poses[handle])
        viewer.drag("start", handle, home, home)
        orders.send("ready")
        while True:
            what = orders.recv()
            if what == "end":
                return
            if what == "jerk":
                there = home + 0.02 * np.random.default_rng().uniform(-1.0, 1.0, size=3)
                requested = time.perf_counter()
                viewer.drag("update", handle, home, there)
                orders.send(requested)
                continue
            before, begun = viewer.bundles, time.perf_counter()
            while (t := time.perf_counter() - begun) < what:
                turned = 2.0 * np.pi * t
                there = home + 0.05 * np.array([0.0, np.sin(turned), np.cos(turned)])
                viewer.drag("update", handle, home, there)
                time.sleep(1 / 60)
            orders.send((viewer.bundles - before) / what)


def page_cost(name: str) -> tuple[float, float, float]:
    """Updates sent per second, the server's share of a core, time from a drag to a state.

    One viewer drags the first handle continuously, and a browser shows the page.
    """
    puppet = getattr(fan.puppets, name)()
    with fan.show(puppet, port=0, browser=False, wait=False) as page, open_in_browser(page.url):
        orders, theirs = multiprocessing.Pipe()
        context: Any = multiprocessing.get_context("spawn")
        person = context.Process(target=puppeteer, args=(page.url, "/handles/0", theirs))
        person.start()
        orders.recv()
        rates, shares, waited = [], [], []
        for _ in range(ROUNDS):
            begun = time.perf_counter(), time.process_time()
            orders.send(SECONDS)
            rates.append(orders.recv())
            clock, used = time.perf_counter() - begun[0], time.process_time() - begun[1]
            shares.append(used / clock)
        time.sleep(2.0)
        performance = page.view.performance
        for _ in range(MOVES):
            time.sleep(0.3)
            before = performance.target(performance.handles[0].name)[0]
            orders.send("jerk")
            while np.array_equal(performance.target(performance.handles[0].name)[0], before):
                time.sleep(1e-4)
            at_hand = performance.state.q_K
            while np.array_equal(performance.state.q_K, at_hand):
                time.sleep(1e-4)
            waited.append(time.perf_counter() - orders.recv())
        orders.send("end")
        person.join()
    return statistics.median(rates), statistics.median(shares), statistics.median(waited)


def main() -> None:
    """Measures and prints."""
    print("times real time by the clock (by the processor's time); drag to changed state")
    table = Table("puppet", "dragged 5 cm", "thrown 10 m", "answer")
    for name in PUPPETS:
        factors = (real_time_factors(name, reach) for reach in (0.05, 10.0))
        cells = (f"{clock:.1f} ({processor:.1f})" for clock, processor in factors)
        table.add_row(name, *cells, f"{1000 * answer_time(name):.1f} ms")
    Console().print(table)
    table = Table("page", "updates a second", "of one core", "drag to changed state")
    for name in (*PUPPETS[:2], "visit"):
        rate, share, wait = page_cost(name)
        table.add_row(name, f"{rate:.0f}", f"{100 * share:.0f} %", f"{1000 * wait:.1f} ms")
    Console().print(table)


if __name__ == "__main__":
    main()
