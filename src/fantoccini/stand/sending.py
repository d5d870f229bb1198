"""Set points sent over a network in real time, one packet at a time, each when it is due.

A controller that receives packets has no buffer, so the sender keeps the time: it follows the path
p(s) with ds/dt = 1. A hold lowers ds/dt linearly to 0, and resuming raises it again, so the axes
stay on their path: velocity p' ds/dt, acceleration p'' (ds/dt)^2 + p' d2s/dt2.

A set point is the position p of every axis, a motor of the stand, at one time; s is the time on the
path. A hold is a stop that can be resumed.
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
from fantoccini.stand.packets import packet_encoder
from fantoccini.stand.points import SetPoints
from fantoccini.stand.streaming import STOPPED

REPEAT_TIME = 0.25
"""Time for which the first position is repeated before the motion, and the last after it [s]."""
MAX_DELAY = 0.1
"""Largest delay of a packet [s]; after a longer pause the axes would jump."""

Send = Callable[[bytes], object]
"""Function that sends a packet."""


@dataclass
class SendCounts:
    """Progress and delays of set points sent over a network.

    Attributes:
        sent: number of packets sent.
        dropped: number of set points left out because they were too late.
        times: times of the set points sent, in order [s].
        delays: their delays [s].
        connection_lost: set if the receiver disappears while the motion is held.
    """

    sent: int = 0
    dropped: int = 0
    times: list[float] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    connection_lost: threading.Event = field(default_factory=threading.Event)

    @property
    def t(self) -> float:
        """Time of the last set point [s]."""
        return self.times[-1] if self.times else 0.0

    @property
    def max_delay(self) -> float:
        """The largest delay [s]."""
        return max(self.delays, default=0.0)

    @property
    def jitter(self) -> float:
        """Standard deviation of the delays [s]."""
        return float(np.std(self.delays)) if self.delays else 0.0


def send_points(
    points: SetPoints,
    send: Send,
    *,
    first: float = 0.0,
    hold: threading.Event | None = None,
    should_resume: Callable[[SendCounts], bool] | None = None,
    counts: SendCounts | None = None,
    max_delay: float | None = None,
) -> SendCounts:
    """Sends set points as packets, and returns when the last one was due.

    A set point is left out if its successor is due already; packets are never sent in bunches.

    Args:
        points: set points for a controller that receives packets.
        send: sends a packet.
        first: time in the set points at which to begin, from rest [s]. The axes must be there, as
            after a hold: the first packet sends them there at their full speed.
        hold: event that another thread sets to hold all motion, smoothly.
        should_resume: callback that decides, during a hold, whether to resume; meanwhile the held
            position is repeated. It should return when ``connection_lost`` is set; its answer is
            then ignored.
        counts: object that is updated, so that it is available after an exception.
        max_delay: largest delay of a packet [s]; ``MAX_DELAY`` by default.

    Raises:
        PacketError: there is no receiver, the sender is too late, or it was held and stopped.
        StandError, FileError: see :func:`packets_of`; or ``first`` is not within the motion.
    """
    sender = Sender(
        points, send, counts or SendCounts(), MAX_DELAY if max_delay is None else max_delay
    )
    check_start_time(first, sender.end)
    sender.repeat(first)
    sender.follow(first, hold or threading.Event(), should_resume, from_rest=first > 0.0)
    sender.repeat(sender.end)
    return sender.counts


def check_start_time(first: float, end: float) -> None:
    """Raises a StandError unless 0 <= first < end [s]."""
    if not 0.0 <= first < end:
        raise StandError(f"found {first:g} s to continue from; the set points last {end:g} s")


class Sender:
    """Sender of one stream of set points."""

    def __init__(self, points: SetPoints, send: Send, counts: SendCounts, max_delay: float):
        motion = points.complete_motion()
        self.packets = packet_encoder(points.map.stand, points.controller, points.rate)
        self.path = CubicHermiteSpline(motion.t, motion.position, motion.velocity)
        self.end = float(motion.t[-1])
        self.interval = 1.0 / points.rate
        self.stop_time = points.ramp_time
        self.send, self.counts, self.max_delay = send, counts, max_delay
        self.due, self.epoch = time.monotonic(), _monotonic_epoch()

    def repeat(self, t: float) -> None:
        """Repeats the position of a time for ``REPEAT_TIME``."""
        for _ in range(max(2, round(REPEAT_TIME / self.interval))):
            self.due += self.interval
            self._send_when_due(t)

    def follow(
        self,
        t: float,
        hold: threading.Event,
        should_resume: Callable[[SendCounts], bool] | None,
        from_rest: bool,
    ) -> None:
        """Follows the path from a time on, to its end."""
        rate, target_rate, max_change = (
            (0.0 if from_rest else 1.0),
            1.0,
            self.interval / self.stop_time,
        )
        self.due += self.interval
        while True:
            self._send_when_due(t)
            if hold.is_set():
                hold.clear()
                target_rate = 0.0
            if rate == target_rate == 0.0:
                self._wait_in_hold(should_resume)
                target_rate = 1.0
            if t >= self.end:
                return
            delay = time.monotonic() - self.due - self.interval
            if delay > self.max_delay:
                raise self._too_late(t, delay)
            for remaining in reversed(range(1 + max(0, int(delay / self.interval)))):
                previous_rate = rate
                rate += float(np.clip(target_rate - rate, -max_change, max_change))
                step, remaining_time = 0.5 * (previous_rate + rate) * self.interval, self.end - t
                self.due += self.interval * (min(1.0, remaining_time / step) if step else 1.0)
                if remaining_time <= step + 1e-6 * self.interval:
                    t = self.end
                    break
                t += step
                self.counts.dropped += bool(remaining)

    def _send_when_due(self, t: float) -> None:
        """Waits until the next packet is due, and sends the position of time t."""
        time.sleep(max(0.0, self.due - time.monotonic()))
        delay = time.monotonic() - self.due
        if delay > self.max_delay:
            raise self._too_late(t, delay)
        self.counts.times.append(t)
        self.counts.delays.append(delay)
        self._send(self.path(t), self.due)

    def _too_late(self, t: float, delay: float) -> PacketError:
        return PacketError(t, f"this machine was {delay:.3f} s late, and the axes would jump")

    def _send(self, position: Array, due: float) -> None:
        try:
            self.send(self.packets.encode(position, self.epoch + due))
        except OSError as error:
            raise PacketError(self.counts.t, f"not sent: {error.strerror or error}") from None
        self.counts.sent += 1

    def _wait_in_hold(self, should_resume: Callable[[SendCounts], bool] | None) -> None:
        """Calls ``should_resume``, and repeats the held position meanwhile.

        Raises:
            PacketError: the stream is not to resume, or the receiver has disappeared.
        """
        hold_ended = threading.Event()
        errors: list[PacketError] = []
        position = self.path(self.counts.t)

        def repeat_position() -> None:
            while not hold_ended.wait(self.interval):
                try:
                    self._send(position, time.monotonic())
                except PacketError as error:
                    errors.append(error)
                    self.counts.connection_lost.set()
                    return

        thread = threading.Thread(target=repeat_position, name="held", daemon=True)
        thread.start()
        try:
            is_resumed = should_resume is not None and should_resume(self.counts)
        finally:
            hold_ended.set()
            thread.join()
        if errors:
            raise errors[0]
        if not is_resumed:
            raise PacketError(self.counts.t, STOPPED)
        self.due = time.monotonic()


def _monotonic_epoch() -> float:
    """Unix time at which the monotonic clock is 0 [s]: the most precise of a few readings."""
    readings = []
    for _ in range(5):
        before = time.monotonic()
        now = time.time()
        readings.append((time.monotonic() - before, now - before))
    return min(readings)[1]


@contextmanager
def udp_sender(host: str, port: int, broadcast: bool = False) -> Iterator[Send]:
    """A function that sends packets to a host and port; it raises an OSError without a receiver.

    Args:
        host, port: address of the receiver.
        broadcast: whether the host may be a broadcast or multicast address.

    Raises:
        StandError: the host is unknown or unreachable, or many would receive the packets.
    """
    try:
        udp_socket, address = socket_to(host, port, many=broadcast)
    except ManyHearersError as error:
        artnet = "or `broadcast: true` in the file of a stand on artnet"
        raise StandError(f"{error}, {artnet}") from None
    except AddressError as error:
        raise StandError(str(error)) from None
    with udp_socket:
        try:
            udp_socket.connect(address)
        except OSError as error:
            raise StandError(f"cannot send to {host}:{port}: {error.strerror or error}") from None
        yield udp_socket.send
