"""Gamepads in the browser.

viser does not support gamepads. A script on the page reads them thirty times a second and sends
their state to a websocket of the same server, which accepts connections from its own page only.

An axis is here a direction of a stick, with a number from -1 to 1.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

PATH = "/pad"

PAD_SCRIPT = """
(() => {
  let socket = null, last = "";
  const send = (text) => {
    if (socket === null || socket.readyState > 1) {
      socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/pad");
    }
    if (socket.readyState === 1) { socket.send(text); return true; }
    return false;
  };
  setInterval(() => {
    const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
    const pad = pads.find((p) => p !== null && p !== undefined);
    if (pad === undefined) return;
    const text = JSON.stringify({
      axes: pad.axes.slice(0, 4).map((x) => Math.round(x * 1000) / 1000),
      buttons: pad.buttons.slice(0, 16).map((b) => (b.pressed ? 1 : 0)),
    });
    const held = /[1-9]/.test(text);
    if ((held || text !== last) && send(text)) last = text;
  }, 33);
})();
"""


class _Limits(NamedTuple):
    """Thresholds of sticks, and limits of messages."""

    dead_zone: float = 0.15
    """Deflection (at most 1) below which a stick counts as at rest: its rest is not exactly 0."""
    max_silence: float = 0.3
    """Time without a message after which sticks count as at rest [s]: the tab may be closed."""
    max_message: int = 2000  # Length of a message [characters]; longer ones are not from our script
    max_count: int = 16  # Number of axes and of buttons that are read


_LIMITS = _Limits()

NEXT, PREVIOUS, PAUSE, RESET, RECORD = 5, 4, 9, 8, 3
"""Buttons of a standard gamepad: right and left shoulder, start, back, upper face button."""


@dataclass(frozen=True)
class Sticks:
    """State of a gamepad.

    Attributes:
        right, away: left stick, to the right and away from the viewer, -1 to 1.
        up: right stick, -1 to 1.
        buttons: numbers of the pressed buttons.
    """

    right: float = 0.0
    away: float = 0.0
    up: float = 0.0
    buttons: frozenset[int] = frozenset()

    @property
    def moved(self) -> bool:
        """Whether a stick is deflected."""
        return bool(self.right or self.away or self.up)


def read_message(message: str | bytes) -> Sticks | None:
    """State of the gamepad in a message; None for an invalid message."""
    if len(message) > _LIMITS.max_message:
        return None
    try:
        data = json.loads(message)
        axes = [float(x) for x in data["axes"][: _LIMITS.max_count]]
        buttons = frozenset(n for n, b in enumerate(data["buttons"][: _LIMITS.max_count]) if b == 1)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
    if not all(map(math.isfinite, axes)):
        return None
    deflections = [_deflection(x) for x in (*axes, 0.0, 0.0, 0.0, 0.0)[:4]]
    # In browsers, down is positive.
    return Sticks(deflections[0], -deflections[1], -deflections[3], buttons)


def _deflection(x: float) -> float:
    """Deflection beyond the dead zone, from -1 to 1."""
    x, dead_zone = min(max(x, -1.0), 1.0), _LIMITS.dead_zone
    if abs(x) <= dead_zone:
        return 0.0
    return math.copysign((abs(x) - dead_zone) / (1.0 - dead_zone), x)


class Pads:
    """Gamepads of all viewers; the one that sent the latest message is used."""

    def __init__(self) -> None:
        self._sticks, self._received, self.name = Sticks(), 0.0, ""
        self._new_presses: set[int] = set()
        self._n_connections = 0

    async def serve(self, connection: Any) -> None:
        """Reads the messages of :data:`PAD_SCRIPT` from a websocket until it closes."""
        self._n_connections += 1
        name = f"gamepad {self._n_connections}"
        previous: frozenset[int] = frozenset()
        async for message in connection:
            sticks = read_message(message)
            if sticks is None:
                continue
            self._new_presses.update(sticks.buttons - previous)
            previous = sticks.buttons
            self._sticks, self._received, self.name = sticks, time.monotonic(), name

    @property
    def sticks(self) -> Sticks:
        """Current state of the gamepad."""
        return self._sticks if time.monotonic() - self._received < _LIMITS.max_silence else Sticks()

    def pressed(self) -> set[int]:
        """Buttons that have been pressed since the last call."""
        presses, self._new_presses = self._new_presses, set()
        return presses
