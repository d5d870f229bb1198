"""What each viewer of a page is told for itself: who holds the strings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fantoccini.web.holder import Viewer
from fantoccini.web.panel import note

if TYPE_CHECKING:
    import viser

FREE = "The strings are free"


def holds(holder: Viewer | None, viewer: Viewer | None = None) -> str:
    """Who holds the strings, as it is said to a viewer."""
    if holder is None:
        return FREE
    if holder == viewer:
        return "You hold the strings"
    name = f"Viewer {holder + 1}" if isinstance(holder, int) else str(holder)
    return f"{name[:1].upper()}{name[1:]} holds the strings"


class Audience:
    """A line of the panel that every viewer has for itself.

    Args:
        server: of viser.
        order: the line's place in the panel.
    """

    def __init__(self, server: viser.ViserServer, order: float):
        self._server, self._order = server, order
        self._holder: Viewer | None = None
        self._lines: dict[int, Any] = {}
        server.on_client_connect(self._add)
        server.on_client_disconnect(lambda client: self._lines.pop(client.client_id, None))

    def tell(self, holder: Viewer | None) -> None:
        """Says who holds the strings now."""
        if holder == self._holder:
            return
        self._holder = holder
        for viewer, line in list(self._lines.items()):
            line.content = note(holds(holder, viewer))

    def _add(self, client: viser.ClientHandle) -> None:
        words = note(holds(self._holder, client.client_id))
        self._lines[client.client_id] = client.gui.add_html(words, order=self._order)
