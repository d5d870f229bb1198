"""Set points sent over a network in real time: one packet after the other, each when it is due.

A controller that takes packets has no buffer, so the sender keeps the time: it goes along the path
p(s) with ds/dt = 1. A hold lets ds/dt fall evenly to 0, and going on lets it rise again, so the
axes stay on their path: velocity p' ds/dt, acceleration p'' (ds/dt)^2 + p' d2s/dt2.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fantoccini.base import (
    AddressError,
    Array,
    ManyHearersError,
    PacketError,
    StandError,
    socket_to,
)
from fantoccini.stand.packets import packets_of
from fantoccini.stand.points import SetPoints
from fantoccini.stand.streaming import STOPPED

REPEATED = 0.25
"""For so long the first position is sent before the motion, and the last one after it [s]."""
LATEST = 0.1
"""How late a packet may be [s]; after a longer pause the axes would jump."""
SOFT = 2.0
"""How much longer a hold takes than the axes need to stop from their largest speed."""

Send = Callable[[bytes], object]
"""Sends a packet."""


@dataclass
class Sending:
    """How far the set points are, and how well they kept the time.

    Attributes:
        sent: packets that were sent.
        dropped: set points that were too late, and were left out.
        times: of the set points that were sent, in order [s].
        late: by how much each of them was late [s].
        lost: set when nobody listens any more while the motion is held.
    """

    sent: int = 0
    dropped: int = 0
    times: list[float] = field(default_factory=list)
    late: list[float] = field(default_factory=list)
    lost: threading.Event = field(default_factory=threading.Event)

    @property
    def t(self) -> float:
        """Time of the last set point [s]."""
        return self.times[-1] if self.times else 0.0

    @property
    def latest(self) -> float:
        """The largest lateness [s]."""
        return max(self.late, default=0.0)

    @property
    def jitter(self) -> float:
        """Standard deviation of the lateness [s]."""
        return float(np.std(self.late)) if self.late else 0.0


def send_points(
    points: SetPoints,
    send: Send,
    *,
    first: float = 0.0,
    hold: threading.Event | None = None,
    go_on: Callable[[Sending], bool] | None = None,
    counts: Sending | None = None,
    latest: float | None = None,
) -> Sending:
    """Sends set points as packets, and returns when the last one was due.

    A set point whose successor is due already is left out; packets never come in bunches.

    Args:
        points: for a controller that takes packets.
        send: sends one.
        first: time of the set points to begin at [s], from rest. The axes must stand there, as
            after a hold: the first packet sends them there, as fast as they are.
        hold: set from elsewhere to hold all motion, softly.
        go_on: then asked whether to go on or to stop, while the held position is sent on; it may
            return once ``lost`` is set, what it says does not count then.
        counts: to count in, for who catches what interrupts.
        latest: how late a packet may be [s]; ``LATEST`` by default.

    Raises:
        PacketError: nobody listens, the sender is too late, or it was held and stopped.
        StandError, FileError: as of :func:`packets_of`, and there is nothing to go on from.
    """
    sender = _Sender(points, send, counts or Sending(), LATEST if latest is None else latest)
    check_first(first, sender.end)
    sender.stand(first)
    sender.go(first, hold or threading.Event(), go_on, soft=first > 0.0)
    sender.stand(sender.end)
    return sender.counts


def check_first(first: float, end: float) -> None:
    """Raises a StandError unless set points that last so long have a time to go on from [s]."""
    if not 0.0 <= first < end:
        raise StandError(f"found {first:g} s to go on from; the set points last {end:g} s")


class _Sender:
    def __init__(self, points: SetPoints, send: Send, counts: Sending, latest: float):
        motion = points.whole()
        self.packets = packets_of(points.map.stand, points.controller, points.rate)
        self.path = CubicHermiteSpline(motion.t, motion.position, motion.velocity)
        self.end = float(motion.t[-1])
        self.interval = 1.0 / points.rate
        self.stops = SOFT * max(
            (a.file.speed or 0.0) / (a.file.acceleration or np.inf) for a in points.axes
        )
        self.send, self.counts, self.latest = send, counts, latest
        self.due, self.epoch = time.monotonic(), _epoch()

    def stand(self, t: float) -> None:
        """Sends one position for a while."""
        for _ in range(max(2, round(REPEATED / self.interval))):
            self.due += self.interval
            self._at(t)

    def go(
        self, t: float, hold: threading.Event, go_on: Callable[[Sending], bool] | None, soft: bool
    ) -> None:
        """Goes along the path from a time on."""
        rate, goal, most = (0.0 if soft else 1.0), 1.0, self.interval / self.stops
        self.due += self.interval
        while True:
            self._at(t)
            if hold.is_set():
                hold.clear()
                goal = 0.0
            if rate == goal == 0.0:
                self._held(go_on)
                goal = 1.0
            if t >= self.end:
                return
            behind = time.monotonic() - self.due - self.interval
            if behind > self.latest:
                raise self._too_late(t, behind)
            for left_out in reversed(range(1 + max(0, int(behind / self.interval)))):
                before = rate
                rate += float(np.clip(goal - rate, -most, most))
                step, left = 0.5 * (before + rate) * self.interval, self.end - t
                self.due += self.interval * (min(1.0, left / step) if step else 1.0)
                if left <= step + 1e-6 * self.interval:
                    t = self.end
                    break
                t += step
                self.counts.dropped += bool(left_out)

    def _at(self, t: float) -> None:
        """Sends the position of a time when it is due."""
        time.sleep(max(0.0, self.due - time.monotonic()))
        late = time.monotonic() - self.due
        if late > self.latest:
            raise self._too_late(t, late)
        self.counts.times.append(t)
        self.counts.late.append(late)
        self._send(self.path(t), self.due)

    def _too_late(self, t: float, late: float) -> PacketError:
        return PacketError(t, f"this machine was {late:.3f} s late, and the axes would jump")

    def _send(self, position: Array, due: float) -> None:
        try:
            self.send(self.packets.encode(position, self.epoch + due))
        except OSError as error:
            raise PacketError(self.counts.t, f"not sent: {error.strerror or error}") from None
        self.counts.sent += 1

    def _held(self, go_on: Callable[[Sending], bool] | None) -> None:
        """Asks whether to go on, and sends the position on meanwhile.

        Raises:
            PacketError: no.
        """
        ended = threading.Event()
        wrong: list[PacketError] = []
        position = self.path(self.counts.t)

        def keep() -> None:
            while not ended.wait(self.interval):
                try:
                    self._send(position, time.monotonic())
                except PacketError as error:
                    wrong.append(error)
                    self.counts.lost.set()
                    return

        thread = threading.Thread(target=keep, name="held", daemon=True)
        thread.start()
        try:
            goes = go_on is not None and go_on(self.counts)
        finally:
            ended.set()
            thread.join()
        if wrong:
            raise wrong[0]
        if not goes:
            raise PacketError(self.counts.t, STOPPED)
        self.due = time.monotonic()


def _epoch() -> float:
    """Where the clock that nobody sets is 0 [s of the epoch]: the closest of a few looks."""
    looks = []
    for _ in range(5):
        before = time.monotonic()
        now = time.time()
        looks.append((time.monotonic() - before, now - before))
    return min(looks)[1]


@contextmanager
def udp_sender(host: str, port: int, broadcast: bool = False) -> Iterator[Send]:
    """What sends packets to a port of a host. It raises an OSError once nobody listens there.

    Args:
        host, port: where they go.
        broadcast: whether the host may be a broadcast or multicast address, which many hear.

    Raises:
        StandError: there is no such host, no way there, or many would hear it.
    """
    try:
        out, there = socket_to(host, port, many=broadcast)
    except ManyHearersError as error:
        artnet = "or `broadcast: true` in the file of a stand on artnet"
        raise StandError(f"{error}, {artnet}") from None
    except AddressError as error:
        raise StandError(str(error)) from None
    with out:
        try:
            out.connect(there)
        except OSError as error:
            raise StandError(f"cannot send to {host}:{port}: {error.strerror or error}") from None
        yield out.send
