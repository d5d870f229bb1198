"""Everything that fantoccini uses of viser beyond its public interface.

viser may change it in any release. :func:`start` checks that it is all there, and refuses a viser
in which it is not.
"""

from __future__ import annotations

import contextlib
import io
import threading
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import viser
import websockets.asyncio.server

from fantoccini.base import FantocciniError

CHECKED_VERSIONS = ("1.1.1",)
"""Versions of viser that the tests have passed with."""

UNUSED_MESSAGES = (
    "GuiButtonHoldMessage",
    "GuiFormSubmitMessage",
    "GuiFormDirtyMessage",
    "FileTransferStartUpload",
    "FileTransferPart",
    # These would open a tunnel through a server of viser's makers.
    "ShareUrlRequest",
    "ShareUrlDisconnect",
)
"""Messages from the browser that no control of ours sends; they are refused."""

MESSAGES = (*UNUSED_MESSAGES, "GuiUpdateMessage", "SetPositionMessage", "SetOrientationMessage")
"""All messages that are used here."""

MEMBERS = (
    "_websock_server.register_handler",
    "_websock_server.unregister_handler",
    "gui._gui_input_handle_from_uuid",
    "gui._handle_gui_updates",
    "scene.world_axes._impl.name",
    "scene.world_axes._impl.position",
    "scene.world_axes._impl.wxyz",
    "scene.world_axes._impl.api._queue_scene_message",
)
"""Members of a server that are used here."""

MAX_TEXT = 200
"""Length of a text that a viewer can type [characters]."""

Handler = Callable[[Any], Awaitable[None]]
"""Serves one websocket connection."""
Filter = Callable[[Any, Any], Any]
"""Answers a request, or returns None to let it pass."""

CLIENT_SCRIPT = """
(() => {
  // viser's client flies its camera with these keys; here they are commands of the page. Commands
  // listen on the root element, the camera on the document: there the event ends.
  const keys = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
  document.addEventListener("keydown", (event) => {
    if (keys.has(event.code)) event.stopImmediatePropagation();
  });
  // What was clicked keeps the keyboard: the space bar would press it again, and keys of the page
  // are not heard while a box or a list has it. Whoever goes there with Tab keeps it there.
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
  // On a phone viser's panel covers the picture: it starts folded.
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
"""Changes what viser's client does in the browser."""

_starting = threading.Lock()


class ViserError(FantocciniError):
    """The installed viser differs from the versions that fantoccini was checked with."""

    def __init__(self, missing: str):
        super().__init__(
            f"viser {version('viser')} cannot be used: {missing}; "
            f"fantoccini works with viser {', '.join(CHECKED_VERSIONS)}"
        )


def start(
    host: str,
    port: int,
    title: str,
    handler: Callable[[Handler], Handler],
    request_filter: Callable[[Filter], Filter],
) -> viser.ViserServer:
    """Starts a viser server that accepts only values its controls can have.

    Args:
        host, port: where it listens.
        title: of the page.
        handler, request_filter: wrap viser's own handler and filter of requests.

    Raises:
        ViserError: this viser lacks something that is used here.
    """
    module = vars(websockets.asyncio.server)
    original, wrapped = module["serve"], threading.Event()

    def serve(own: Handler, *args: Any, process_request: Filter, **options: Any) -> Any:
        wrapped.set()
        own_filter = request_filter(process_request)
        return original(handler(own), *args, process_request=own_filter, **options)

    with _starting, contextlib.redirect_stdout(io.StringIO()):
        module["serve"] = serve
        try:
            server = viser.ViserServer(host, port, label=title, verbose=False)
        finally:
            module["serve"] = original
        try:
            if not wrapped.is_set():
                raise ViserError("it does not serve through websockets.asyncio.server.serve")
            check(server)
        except ViserError:
            server.stop()
            raise
    _refuse_other_values(server)
    return server


def stop(server: viser.ViserServer) -> None:
    """Stops a server, without viser's messages on stdout."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def check(server: viser.ViserServer) -> None:
    """Raises ViserError where a private member that is used here is missing."""
    missing = [f"_messages.{name}" for name in MESSAGES if not hasattr(viser._messages, name)]
    for name in MEMBERS:
        try:
            attrgetter(name)(server)
        except AttributeError:
            missing.append(f"ViserServer.{name}")
    if missing:
        raise ViserError(f"it has no {', '.join(missing)}")


def client_page() -> str:
    """The page of viser's client, one file with everything in it."""
    path = Path(viser.__file__).parent / "client" / "build" / "index.html"
    if not path.is_file():
        raise ViserError(f"it has no {path}")
    return path.read_text("utf-8")


def move(node: Any, position: np.ndarray, wxyz: np.ndarray | None = None) -> None:
    """Moves a scene node like ``node.position = ...; node.wxyz = ...``, at a fifth of the cost.

    viser's own setters spend their time on comparisons with the value before.

    Args:
        node: handle of the node.
        position: (3,) [m].
        wxyz: (4,) unit quaternion, or None to keep the orientation.
    """
    state, messages = node._impl, viser._messages
    state.position[:] = position
    queue = state.api._queue_scene_message
    queue(messages.SetPositionMessage(state.name, tuple(position.tolist())))
    if wxyz is not None:
        state.wxyz[:] = wxyz
        queue(messages.SetOrientationMessage(state.name, tuple(wxyz.tolist())))


def _refuse_other_values(server: viser.ViserServer) -> None:
    """From now on browsers can set only values that the page's controls can have.

    viser itself would set any attribute that a message names, the list of callbacks too.
    """
    socket, gui, messages = server._websock_server, server.gui, viser._messages
    for name in (*UNUSED_MESSAGES, "GuiUpdateMessage"):
        socket.unregister_handler(getattr(messages, name))

    async def update(client: int, message: Any) -> None:
        control = gui._gui_input_handle_from_uuid.get(message.uuid)
        if message.updates.keys() == {"value"} and fits(control, message.updates["value"]):
            await gui._handle_gui_updates(client, message)

    socket.register_handler(messages.GuiUpdateMessage, update)


def fits(control: Any, value: Any) -> bool:
    """Whether a control can have a value; False for anything but the page's controls."""
    match control:
        case viser.GuiButtonGroupHandle() | viser.GuiDropdownHandle():
            return isinstance(value, str) and value in control.options
        case viser.GuiButtonHandle():
            return isinstance(value, bool | int)
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiSliderHandle():
            # The comparison also excludes NaN, infinity, and an int too large for a float.
            number = isinstance(value, int | float)
            return number and control.min - control.step <= value <= control.max + control.step
        case viser.GuiMultiSliderHandle():
            low, high = control.min - control.step, control.max + control.step
            return (
                isinstance(value, list | tuple)
                and len(value) == len(control.value)
                and all(isinstance(one, int | float) and low <= one <= high for one in value)
            )
        case viser.GuiTextHandle():
            return isinstance(value, str) and len(value) <= MAX_TEXT
    return False
