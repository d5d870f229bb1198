"""The viewer that holds the strings, one at a time, and the line that shows it.

Viewers are the browsers that show the page.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING

from fantoccini.app.pages import note_html

if TYPE_CHECKING:
    import viser

MAX_IDLE_TIME = 3.0
"""Time without a move after which a viewer no longer holds the strings [s]."""

Viewer = int | str
"""Client of viser by its number, or gamepad by its name."""


class Holder:
    """Assignment of the strings to one viewer at a time.

    Attributes:
        max_idle_time: time without a move after which the strings are free [s].

    Args:
        max_idle_time: see above.
        clock: function that returns the time [s].
    """

    def __init__(
        self, max_idle_time: float = MAX_IDLE_TIME, clock: Callable[[], float] = time.monotonic
    ):
        self.max_idle_time, self._clock = max_idle_time, clock
        self._viewer: Viewer | None = None
        self._last_move_time = 0.0
        self._lock = Lock()

    @property
    def viewer(self) -> Viewer | None:
        """Viewer that holds the strings now, or None."""
        with self._lock:
            self._release_when_idle()
            return self._viewer

    def claim(self, viewer: Viewer) -> bool:
        """Assigns the strings to a viewer, unless another one holds them; returns the success."""
        with self._lock:
            self._release_when_idle()
            if self._viewer not in (None, viewer):
                return False
            self._viewer, self._last_move_time = viewer, self._clock()
            return True

    def release(self, viewer: Viewer) -> None:
        """Frees the strings, if this viewer holds them."""
        with self._lock:
            if self._viewer == viewer:
                self._viewer = None

    def _release_when_idle(self) -> None:
        if self._viewer is not None and self._clock() - self._last_move_time > self.max_idle_time:
            self._viewer = None


def holder_text(holder: Viewer | None, viewer: Viewer | None = None) -> str:
    """Text about the holder of the strings, as shown to a viewer."""
    if holder is None:
        return "The strings are free"
    if holder == viewer:
        return "You hold the strings"
    name = f"Viewer {holder + 1}" if isinstance(holder, int) else holder
    return f"{name[:1].upper()}{name[1:]} holds the strings"


class HolderLine:
    """Line of the panel with the holder of the strings, different for each viewer.

    ``order`` is its position in the panel.
    """

    def __init__(self, server: viser.ViserServer, order: float):
        self._order = order
        self._holder: Viewer | None = None
        self._lines: dict[int, viser.GuiHtmlHandle] = {}
        server.on_client_connect(self._add)
        server.on_client_disconnect(lambda client: self._lines.pop(client.client_id, None))

    def update(self, holder: Viewer | None) -> None:
        """Shows the current holder."""
        if holder == self._holder:
            return
        self._holder = holder
        for viewer, line in list(self._lines.items()):
            line.content = note_html(holder_text(holder, viewer))

    def _add(self, client: viser.ClientHandle) -> None:
        content = note_html(holder_text(self._holder, client.client_id))
        self._lines[client.client_id] = client.gui.add_html(content, order=self._order)
