"""A viewer without a browser: it speaks the protocol of viser's page and acts as a page does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import msgspec.msgpack
import numpy as np
import viser
import zstandard
from viser import _messages
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect


class Viewer:
    """A connection to a page, which receives all of its messages.

    Attributes:
        bundles: number of received bundles of messages.
        controls: kind and properties of everything in the panel, by its identifier.
        poses: poses of nodes, by name.
        notices: titles of notices.

    Args:
        url: address of the page.
        on_message: called with every message, if given.
    """

    def __init__(self, url: str, on_message: Callable[[dict], None] | None = None):
        self.bundles, self._on_message = 0, on_message
        self.controls: dict[str, dict] = {}
        self.poses: dict[str, tuple] = {}
        self.notices: list[str] = []
        self._socket = connect(
            url.replace("http", "ws", 1),
            origin=url,
            max_size=None,
            subprotocols=[f"viser-v{viser.__version__}"],
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        # A viewer counts only after it has sent its camera.
        self.look((3.0, 0.0, 1.0), (0.0, 0.0, 1.0))

    def look(self, position: Sequence[float], look_at: Sequence[float]) -> None:
        """Send the camera of a window of 800 by 600 pixels."""
        self.send(
            _messages.ViewerCameraMessage(
                wxyz=(1.0, 0.0, 0.0, 0.0),
                position=tuple(map(float, position)),
                fov=0.5,
                near=0.01,
                far=100.0,
                image_height=600,
                image_width=800,
                look_at=tuple(map(float, look_at)),
                up_direction=(0.0, 0.0, 1.0),
            )
        )

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the tab."""
        self._socket.close()
        self._reader.join()

    def send(self, message: Any) -> None:
        """Send a message of viser's page."""
        self._socket.send(msgspec.msgpack.encode(message.as_serializable_dict()))

    def press(self, label: str) -> None:
        """Press a button."""
        self.send(_messages.GuiUpdateMessage(self._named("GuiButtonMessage", label), {"value": 1}))

    def slide(self, label: str, value: float) -> None:
        """Move a slider; `low` and `high` of `ends` are its range."""
        uuid = self._named("GuiSliderMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": float(value)}))

    def tick(self, label: str, on: bool) -> None:
        """Tick a box, or clear it."""
        uuid = self._named("GuiCheckboxMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": on}))

    def pick(self, label: str, option: str) -> None:
        """Press one of a row of buttons."""
        uuid = self._named("GuiButtonGroupMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": option}))

    def type_in(self, label: str, text: str) -> None:
        """Type into a field."""
        uuid = self._named("GuiTextMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": text}))

    def keep_part(self, label: str, start: float, end: float) -> None:
        """Move both ends of a slider that has two."""
        uuid = self._named("GuiMultiSliderMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": [start, end]}))

    def options(self, label: str) -> tuple[str, ...]:
        """The options of a list."""
        return tuple(self.controls[self._named("GuiDropdownMessage", label)]["options"])

    def choose(self, label: str, option: str) -> None:
        """Choose in a list."""
        uuid = self._named("GuiDropdownMessage", label)
        self.send(_messages.GuiUpdateMessage(uuid, {"value": option}))

    def ends(self, label: str) -> tuple[float, float]:
        """Lowest and highest value of a slider."""
        props = self.controls[self._named("GuiSliderMessage", label)]
        return props["min"], props["max"]

    def value(self, label: str) -> float:
        """Value of a slider."""
        return self.controls[self._named("GuiSliderMessage", label)]["value"]

    def drag(self, phase: str, node: str, start: np.ndarray, end: np.ndarray) -> None:
        """Drag a node from a place to another [m]."""
        self.send(
            _messages.SceneNodeDragMessage(
                phase,
                node,
                None,
                tuple(map(float, start)),
                (0.5, 0.5),
                tuple(map(float, end)),
                (0.5, 0.5),
                "left",
                None,
            )
        )

    def turn(self, phase: str, node: str, position: np.ndarray, wxyz: np.ndarray) -> None:
        """Turn rings as a mouse on them does."""
        if phase == "start":
            self.send(_messages.TransformControlsDragStartMessage(node))
        self.send(
            _messages.TransformControlsUpdateMessage(
                node, tuple(map(float, wxyz)), tuple(map(float, position))
            )
        )
        if phase == "end":
            self.send(_messages.TransformControlsDragEndMessage(node))

    def wait_for_text(self, words: str, patience: float = 20.0) -> None:
        """Waits until the text of the page contains these words."""
        end = time.monotonic() + patience
        while words not in self.text:
            assert time.monotonic() < end, f"waited {patience:g} s for {words!r}: {self.text}"
            time.sleep(0.01)

    @property
    def text(self) -> str:
        """Text of the page, as HTML, and of notices."""
        panels = (str(props.get("content", "")) for props in list(self.controls.values()))
        return "\n".join((*panels, *self.notices))

    # -- incoming messages ----------------------------------------------------------------------

    def _named(self, kind: str, label: str, patience: float = 20.0) -> str:
        end = time.monotonic() + patience
        while time.monotonic() < end:
            for uuid, props in list(self.controls.items()):
                if props["type"] == kind and props["label"] == label:
                    return uuid
            time.sleep(0.01)
        raise AssertionError(f"the page has no {kind} {label!r}")

    def _read(self) -> None:
        try:
            for bundle in self._socket:
                size = int.from_bytes(bundle[8:16], "little")
                inner = zstandard.ZstdDecompressor().decompress(bundle[16 : 16 + size])
                for message in msgspec.msgpack.decode(inner)["messages"]:
                    self._take(message)
                self.bundles += 1
        except ConnectionClosed:
            pass

    def _take(self, message: dict) -> None:
        kind = message["type"]
        if kind == "NotificationShowMessage":
            self.notices.append(message["props"]["title"])
        elif "uuid" in message and "props" in message:
            self.controls[message["uuid"]] = {
                **message["props"],
                "value": message.get("value"),
                "type": kind,
            }
        elif kind == "GuiUpdateMessage" and message["uuid"] in self.controls:
            self.controls[message["uuid"]].update(message["updates"])
        elif kind == "GuiRemoveMessage":
            self.controls.pop(message["uuid"], None)
        elif kind == "SetPositionMessage":
            self.poses[message["name"]] = tuple(message["position"])
        if self._on_message is not None:
            self._on_message(message)
