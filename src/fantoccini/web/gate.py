"""What viewers may set on the page: the values of its controls, each of its own kind.

viser sets any attribute of a control that a viewer's message names, the list of its callbacks too,
and makes a file that is sent to a control its value. Here a message sets a value that the control
can have, or nothing.
"""

from __future__ import annotations

from typing import Any

import viser
from viser import _messages

_UNUSED = (
    _messages.GuiButtonHoldMessage, _messages.GuiFormSubmitMessage, _messages.GuiFormDirtyMessage,
    _messages.FileTransferStartUpload, _messages.FileTransferPart,
    # viser could open a tunnel through a server of its makers: not from here.
    _messages.ShareUrlRequest, _messages.ShareUrlDisconnect,
)  # fmt: skip
"""Messages that no control of ours sends."""


def guard(server: viser.ViserServer) -> None:
    """From now on viewers set values of controls that the controls can have, and nothing else."""
    socket, gui = server._websock_server, server.gui
    for message in (*_UNUSED, _messages.GuiUpdateMessage):
        socket.unregister_handler(message)

    async def update(viewer: int, message: _messages.GuiUpdateMessage) -> None:
        control = gui._gui_input_handle_from_uuid.get(message.uuid)
        if message.updates.keys() == {"value"} and fits(control, message.updates["value"]):
            await gui._handle_gui_updates(viewer, message)

    socket.register_handler(_messages.GuiUpdateMessage, update)


def fits(control: Any, value: Any) -> bool:
    """Whether a control of the page can have a value; False for what is no control of ours."""
    match control:
        case viser.GuiButtonGroupHandle() | viser.GuiDropdownHandle():
            return isinstance(value, str) and value in control.options
        case viser.GuiButtonHandle():
            return isinstance(value, bool | int)
        case viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiSliderHandle():
            # Nothing beyond the range fits: no NaN, no infinity, no int too large for a float.
            number = isinstance(value, int | float)
            return number and control.min - control.step <= value <= control.max + control.step
    return False
