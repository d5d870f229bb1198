"""All uses of viser beyond its public interface.

viser may change these parts in any release. :func:`start` checks that they exist, and refuses a
version of viser that lacks one.
"""

from __future__ import annotations

import contextlib
import io
import logging
import threading
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection

from fantoccini.base import FantocciniError

CHECKED_VERSIONS = ("1.1.1",)
"""Versions of viser with which the tests have passed."""

UNUSED_MESSAGES = (
    "GuiButtonHoldMessage",
    "GuiFormSubmitMessage",
    "GuiFormDirtyMessage",
    "FileTransferStartUpload",
    "FileTransferPart",
    # These would open a tunnel through a server of viser's authors.
    "ShareUrlRequest",
    "ShareUrlDisconnect",
)
"""Messages from the browser that none of our controls sends; they are refused."""

USED_MESSAGES = (
    *UNUSED_MESSAGES,
    "GuiUpdateMessage",
    "SetPositionMessage",
    "SetOrientationMessage",
)
"""All messages used here."""

USED_MEMBERS = (
    "_websock_server.register_handler",
    "_websock_server.unregister_handler",
    "gui._gui_input_handle_from_uuid",
    "gui._handle_gui_updates",
    "scene.world_axes._impl.name",
    "scene.world_axes._impl.position",
    "scene.world_axes._impl.wxyz",
    "scene.world_axes._impl.api._queue_scene_message",
)
"""Members of a server used here."""

MAX_TEXT = 200
"""Largest length of a text that a viewer can type [characters]."""
MAX_CLOSE_REASON = 100
"""Largest length of the reason for closing a connection [characters]; websockets allow 123 bytes.
"""

Handler = Callable[[Any], Awaitable[None]]
"""Handler of one websocket connection."""
Filter = Callable[[Any, Any], Any]
"""Filter that answers a request, or returns None to let it pass."""

CLIENT_SCRIPT = """
(() => {
  // viser's client moves its camera with these keys; here they are commands of the page. Commands
  // listen on the root element, the camera listens on the document: the event must end there.
  const keys = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
  document.addEventListener("keydown", (event) => {
    if (keys.has(event.code)) event.stopImmediatePropagation();
  });
  // A clicked control keeps the focus: the space bar would press it again, and a box or a list
  // would receive the keys of the page. So it loses the focus, unless it got it by Tab.
  addEventListener("click", (event) => {
    const what = event.target instanceof Element && event.target.closest(
      "button, [role=button], [role=option], [role=tab], input[type=checkbox], label");
    if (event.detail === 0 || !what) return;
    setTimeout(() => {
      const held = document.activeElement;
      if (held instanceof HTMLElement && !held.matches("input[type=text], textarea, "
        + "input:not([type]):not([role=combobox])")) held.blur();
    });
  }, true);
  // On a phone viser's panel covers the picture, so it starts collapsed.
  document.addEventListener("DOMContentLoaded", () => {
    if (!matchMedia("(max-width: 36em)").matches) return;
    const watch = new MutationObserver(() => {
      const panel = document.querySelector('div[style*="fixed"][style*="max-height: 60%"]');
      const bar = panel && panel.querySelector('div[style*="cursor: pointer"]');
      if (!bar) return;
      watch.disconnect();
      bar.click();
    });
    watch.observe(document, {childList: true, subtree: true});
  });
})();
"""
"""Script that changes the behaviour of viser's client in the browser."""

_starting = threading.Lock()

_CONNECTIONS = logging.getLogger("fantoccini.connections")
"""Log of connections that fail. Port scanners and other programs that are no browsers make them
fail, so that nothing is logged above the level of debugging."""
_CONNECTIONS.addFilter(lambda _: _CONNECTIONS.isEnabledFor(logging.DEBUG))


class Connection(ServerConnection):
    """Connection that also takes requests for headers only (HEAD), which websockets refuses.

    Attributes:
        headers_only: whether the request is for the headers only.
    """

    headers_only = False

    def data_received(self, data: bytes) -> None:
        """Reads bytes of the network."""
        if self.request is None and data.startswith(b"HEAD "):
            self.headers_only, data = True, b"GET" + data.removeprefix(b"HEAD")
        super().data_received(data)


class ViserError(FantocciniError):
    """The installed version of viser is not supported."""

    def __init__(self, missing: str):
        super().__init__(
            f"viser {version('viser')} cannot be used: {missing}; "
            f"fantoccini works with viser {', '.join(CHECKED_VERSIONS)}"
        )


def start_server(
    host: str, port: int, title: str, handler: Callable[[Handler], Handler], request_filter: Filter
) -> viser.ViserServer:
    """Starts a server of viser that accepts only values that its controls can have.

    Args:
        host, port: address on which it listens.
        title: title of the page.
        handler: wrapper of viser's own handler of connections.
        request_filter: filter of requests, instead of viser's own.

    Raises:
        ViserError: this version of viser lacks something that is used here.
    """
    module = vars(websockets.asyncio.server)
    original_serve, was_called = module["serve"], threading.Event()

    def serve(default_handler: Handler, *args: Any, process_request: object, **options: Any) -> Any:
        was_called.set()
        return original_serve(
            handler(_refusing_other_clients(default_handler)),
            *args,
            process_request=request_filter,
            create_connection=Connection,
            logger=_CONNECTIONS,
            **options,
        )

    with _starting, contextlib.redirect_stdout(io.StringIO()):
        module["serve"] = serve
        try:
            server = viser.ViserServer(host, port, label=title, verbose=False)
        finally:
            module["serve"] = original_serve
        try:
            if not was_called.is_set():
                raise ViserError("it does not serve through websockets.asyncio.server.serve")
            check_members(server)
        except ViserError:
            server.stop()
            raise
    _refuse_other_values(server)
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stops a server, without viser's messages on stdout."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def check_members(server: viser.ViserServer) -> None:
    """Raises ViserError if a private member that is used here is missing."""
    missing = [f"_messages.{name}" for name in USED_MESSAGES if not hasattr(viser._messages, name)]
    for name in USED_MEMBERS:
        try:
            attrgetter(name)(server)
        except AttributeError:
            missing.append(f"ViserServer.{name}")
    if missing:
        raise ViserError(f"it has no {', '.join(missing)}")


def client_page() -> str:
    """Page of viser's client, a single self-contained file."""
    path = Path(viser.__file__).parent / "client" / "build" / "index.html"
    if not path.is_file():
        raise ViserError(f"it has no {path}")
    return path.read_text("utf-8")


def move_node(node: Any, position: np.ndarray, wxyz: np.ndarray | None = None) -> None:
    """Moves a node like ``node.position = ...; node.wxyz = ...``, at a fifth of the cost.

    viser's own setters spend most time on comparisons with the previous value.

    Args:
        node: handle of the node.
        position: (3,) position [m].
        wxyz: (4,) unit quaternion, or None to keep the orientation.
    """
    state, messages = node._impl, viser._messages
    state.position[:] = position
    queue = state.api._queue_scene_message
    queue(messages.SetPositionMessage(state.name, tuple(position.tolist())))
    if wxyz is not None:
        state.wxyz[:] = wxyz
        queue(messages.SetOrientationMessage(state.name, tuple(wxyz.tolist())))


def _refusing_other_clients(default: Handler) -> Handler:
    """viser's handler, for its own client only; for others it would print a line each."""
    expected = f"viser-v{viser.__version__}"

    async def handle(connection: Any) -> None:
        if connection.subprotocol == expected:
            await default(connection)
            return
        client = (connection.subprotocol or "unknown").removeprefix("viser-v")
        # The client in the browser shows this reason.
        reason = f"Version mismatch. Client: {client}, Server: {viser.__version__}"
        await connection.close(1002, reason[:MAX_CLOSE_REASON])

    return handle


def _refuse_other_values(server: viser.ViserServer) -> None:
    """Restricts browsers to values that the page's controls can have.

    viser itself would set any attribute that a message names, even the list of callbacks.
    """
    socket, gui, messages = server._websock_server, server.gui, viser._messages
    for name in (*UNUSED_MESSAGES, "GuiUpdateMessage"):
        socket.unregister_handler(getattr(messages, name))

    async def handle_update(client: int, message: Any) -> None:
        control = gui._gui_input_handle_from_uuid.get(message.uuid)
        updates = message.updates
        only_value = isinstance(updates, dict) and updates.keys() == {"value"}
        if only_value and is_valid_value(control, updates["value"]):
            await gui._handle_gui_updates(client, message)

    socket.register_handler(messages.GuiUpdateMessage, handle_update)


def is_valid_value(control: Any, value: Any) -> bool:
    """Whether a control can have a value; False for anything except the page's controls."""
    match control:
        case viser.GuiButtonGroupHandle() | viser.GuiDropdownHandle():
            return isinstance(value, str) and value in control.options
        case viser.GuiButtonHandle():
            return isinstance(value, bool | int)
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiSliderHandle():
            # The comparison also excludes NaN, infinity, and an int too large for a float.
            is_number = isinstance(value, int | float)
            return is_number and control.min - control.step <= value <= control.max + control.step
        case viser.GuiMultiSliderHandle():
            low, high = control.min - control.step, control.max + control.step
            return (
                isinstance(value, list | tuple)
                and len(value) == len(control.value)
                and all(isinstance(item, int | float) and low <= item <= high for item in value)
            )
        case viser.GuiTextHandle():
            return isinstance(value, str) and len(value) <= MAX_TEXT
    return False
