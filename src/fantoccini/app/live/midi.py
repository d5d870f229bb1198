"""MIDI in the browser: a note or a program change triggers GO.

A script on the page listens to the browser's MIDI inputs and sends GO to a websocket of the same
server, which accepts connections from its own page only.

GO is the command that starts the next cue, a line of the play or score.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

PATH = "/midi"

MIDI_SCRIPT = """
(() => {
  if (!navigator.requestMIDIAccess) return;
  let socket = null;
  const open = () => {
    socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/midi");
  };
  const on_message = (event) => {
    const [status, , velocity] = event.data, kind = status & 0xf0;
    if (!(kind === 0xc0 || (kind === 0x90 && velocity > 0))) return;
    if (socket === null || socket.readyState > 1) open();
    if (socket.readyState === 1) socket.send("go");
    else socket.addEventListener("open", () => socket.send("go"), { once: true });
  };
  navigator.requestMIDIAccess().then((access) => {
    open();
    const listen = () => access.inputs.forEach((input) => { input.onmidimessage = on_message; });
    access.onstatechange = listen;
    listen();
  }, () => {});
})();
"""


class Midi:
    """Receiver of GO from MIDI devices of viewers.

    Args:
        on_go: called on GO.
    """

    def __init__(self, on_go: Callable[[], object]):
        self._on_go = on_go

    async def serve(self, connection: Any) -> None:
        """Serves a websocket to :data:`MIDI_SCRIPT`."""
        async for message in connection:
            if message == "go":
                self._on_go()
