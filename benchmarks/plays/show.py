"""Prints the latencies of a show: messages in, motion of hands, cues, messages out.

    python -m benchmarks.plays.show [PLAY.yaml]

The page's loop runs as in ``fantoccini perform``, without a browser. This is not a test:
machines and their load differ.
"""

from __future__ import annotations

import socket
import statistics
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket
from tests.perform.short_play import PLAY
from tests.show.browser import until

import fantoccini as fan
from fantoccini.app.web.page import open_live_play
from fantoccini.theatre.perform.osc import Address

TRIES = 20


def main() -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "short.yaml"
        path.write_text(PLAY, encoding="utf-8")
        file = Path(sys.argv[1]) if len(sys.argv) > 1 else path
        began = time.perf_counter()
        play = fan.load_play(file)
        print(f"{play}: compiled in {time.perf_counter() - began:.1f} s")
        measure(play, Path(folder))


def measure(play: fan.theatre.Play, folder: Path) -> None:
    """Prints the latencies of a play's first cue."""
    show = fan.theatre.LivePlay(play)
    speed(show)
    show.reset()
    ears = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ears.bind(("127.0.0.1", 0))
    ears.settimeout(5.0)
    number = next(cue.number for cue in play.cues if not cue.refused)
    go = OscMessageBuilder("/go").build().dgram
    begun: list[tuple[float, float]] = []
    show.listen(
        lambda what: (
            begun.append((time.perf_counter(), show.performance.t))
            if what.kind == "start" and what.number == number
            else None
        )
    )
    moved, ticks, latencies, whole = [], [], [], []
    with open_live_play(
        show, "light", "127.0.0.1", 0, folder, Address("127.0.0.1", 0), Address(*ears.getsockname())
    ) as page:
        assert page.osc is not None
        for _ in range(TRIES):
            page.view.later(None, page.view.reset)
            until(lambda: show.voice is None, "it is at the start")
            time.sleep(0.2)
            begun.clear()
            sent, t = time.perf_counter(), show.performance.t
            ears.sendto(go, page.osc.heard_at)
            while not np.any(show.performance.state.v_K):
                time.sleep(0.0002)
            moved.append(time.perf_counter() - sent)
            ticks.append((show.performance.t - t) / show.performance.tick)
            while heard(ears) != f"/cue/{number}/start":
                pass
            now = time.perf_counter()
            latencies.append(now - begun[-1][0])
            whole.append(now - sent)
    line("/go sent -> the hands move [ms]", moved)
    print(
        f"  simulated ticks meanwhile: median {statistics.median(ticks):.0f}, "
        f"most {max(ticks):.0f} of {1e3 * show.performance.tick:.1f} ms"
    )
    line("the cue begins -> its message is heard [ms]", latencies)
    line("/go sent -> /cue/N/start is heard [ms]", whole)


def speed(show: fan.theatre.LivePlay) -> None:
    """Prints the speed of the stage's simulation, relative to real time."""
    show.go()
    began = time.perf_counter()
    show.advance(4.0)
    passed = time.perf_counter() - began
    print(f"simulated {4.0 / passed:.1f} times as fast as real time")
    began = time.perf_counter()
    name = next(iter(show.play.cast.players))
    show.take(name)
    show.give(name)
    print(f"take and give: {1e3 * (time.perf_counter() - began):.1f} ms")


def heard(ears: socket.socket) -> str:
    return str(OscPacket(ears.recv(65536)).messages[0].message.address)


def line(what: str, seconds: list[float]) -> None:
    ms = 1e3 * np.array(seconds)
    print(f"{what}: median {np.median(ms):.2f}, most {ms.max():.2f}")


if __name__ == "__main__":
    main()
