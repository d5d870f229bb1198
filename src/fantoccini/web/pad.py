"""A gamepad of the browser: a script on the page tells how its sticks are held.

viser knows no gamepads. The page carries a script that looks at them thirty times a second and
sends the numbers to a websocket of the same server, which takes connections from its own page only.
"""

from __future__ import annotations

import json
import math
import time
from dataclasses import dataclass
from typing import Any

PATH = "/pad"

SCRIPT = """
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

_DEAD = 0.15
"""Sticks that are pushed less are at rest."""
_STALE = 0.3
"""Sticks that nobody tells of are at rest after so long [s]."""
_LONGEST = 2000
_MOST = 16

NEXT, BEFORE, PAUSE, RESET, RECORD = 5, 4, 9, 8, 3
"""Buttons of a standard gamepad: right and left shoulder, start, back, upper face button."""


@dataclass(frozen=True)
class Sticks:
    """How a gamepad is held.

    Attributes:
        right, away: left stick, -1 to 1.
        up: right stick, -1 to 1.
        buttons: those that are down.
    """

    right: float = 0.0
    away: float = 0.0
    up: float = 0.0
    buttons: frozenset[int] = frozenset()

    @property
    def moved(self) -> bool:
        """Whether anything is pushed."""
        return bool(self.right or self.away or self.up)


def read(message: str | bytes) -> Sticks | None:
    """How a message says that a gamepad is held; None for one that says nothing."""
    if len(message) > _LONGEST:
        return None
    try:
        data = json.loads(message)
        axes = [float(x) for x in data["axes"][:_MOST]]
        down = frozenset(n for n, b in enumerate(data["buttons"][:_MOST]) if b == 1)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
    if not all(map(math.isfinite, axes)):
        return None
    pushed = [_live(x) for x in (*axes, 0.0, 0.0, 0.0, 0.0)[:4]]
    # Browsers count downwards.
    return Sticks(pushed[0], -pushed[1], -pushed[3], down)


def _live(x: float) -> float:
    x = min(max(x, -1.0), 1.0)
    return math.copysign(max(0.0, abs(x) - _DEAD) / (1.0 - _DEAD), x) if abs(x) > _DEAD else 0.0


class Pads:
    """The gamepads of all viewers: the one that was moved last counts."""

    def __init__(self) -> None:
        self._sticks, self._told, self.name = Sticks(), 0.0, ""
        self._fresh: set[int] = set()
        self._count = 0

    async def visit(self, connection: Any) -> None:
        """Serves a websocket of :data:`SCRIPT`."""
        self._count += 1
        name, before = f"gamepad {self._count}", frozenset()
        async for message in connection:
            sticks = read(message)
            if sticks is None:
                continue
            self._fresh.update(sticks.buttons - before)
            before = sticks.buttons
            self._sticks, self._told, self.name = sticks, time.monotonic(), name

    @property
    def sticks(self) -> Sticks:
        """How the gamepad is held now."""
        return self._sticks if time.monotonic() - self._told < _STALE else Sticks()

    def pressed(self) -> set[int]:
        """Buttons that were pressed since this was last asked."""
        fresh, self._fresh = self._fresh, set()
        return fresh
