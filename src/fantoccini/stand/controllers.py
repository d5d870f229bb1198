"""Controllers of stands: the kinds that receive set points, and their keys in a stand file.

A set point is the position of every axis at one time; an axis is a motor of the stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from fantoccini.base.documents import Model, Name, Size, shown, validation_error

MAX_FRAME_RATE = 44.0
"""Largest frame rate of DMX [1/s]."""
MAX_NAME_LENGTH = 128
"""Largest length of a controller's name of an axis [characters]."""
LETTERS = {"grbl": "XYZABC", "fluidnc": "XYZABC", "marlin": "XYZABCUVW"}
"""Kind of controller -> letters of the axes that it has."""


def _axis_name(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise validation_error(f"found {shown(value)}; needed: a text or a whole number")
    text = str(value)
    if (
        not text.isprintable()
        or not 0 < len(text) <= MAX_NAME_LENGTH
        or any(c.isspace() for c in text)
    ):
        raise validation_error(
            f"found {shown(value)}; needed: up to {MAX_NAME_LENGTH} characters without blanks"
        )
    return value


AxisName = Annotated[
    str | int, BeforeValidator(_axis_name), WithJsonSchema({"type": ["string", "integer"]})
]


def _check_frame_rate(rate: float) -> float:
    if rate > MAX_FRAME_RATE:
        raise validation_error(
            f"found {rate:g}; DMX allows at most {MAX_FRAME_RATE:g} frames per second"
        )
    return rate


Baud = Annotated[int, Field(ge=300, le=50_000_000)]
Uint16 = Annotated[int, Field(ge=1, le=65_535)]
Host = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.:-]{1,253}$")]


class ControllerBase(Model):
    """Keys of every controller."""

    names: dict[Name, AxisName] = Field(default_factory=dict)
    """Axis -> its name in the controller: a letter, a section, a joint, an id or an address."""


class SerialController(ControllerBase):
    """Keys of controllers on a serial port."""

    port: Annotated[str, Field(pattern=r"^[A-Za-z0-9_./:\\-]{1,253}$")] | None = None
    """Serial port, as `/dev/ttyUSB0` or `COM3`."""
    baud: Baud = 115_200
    """Bits per second."""
    step_rate: Size | None = None
    """Largest step rate of an axis [pulses/s]; no bound by default."""


class Grbl(SerialController):
    """GRBL 1.1 or FluidNC: G-code, streamed by counting the characters in its buffer."""

    type: Literal["grbl", "fluidnc"]
    """Kind of controller."""
    buffer: Uint16 = 128
    """Size of its serial buffer [characters]."""
    planner: Uint16 = 16
    """Number of moves that its planner looks ahead."""
    step_rate: Size | None = 30_000.0
    """Largest step rate of an axis [pulses/s]; an 8-bit board with GRBL generates up to 30,000."""


class Klipper(SerialController):
    """Klipper: G-code macros with `MANUAL_STEPPER`, or a printer's own axes."""

    type: Literal["klipper"]
    """Kind of controller."""
    baud: Baud = 250_000
    """Bits per second."""


class Marlin(SerialController):
    """Marlin and similar firmware: G-code, acknowledged by one `ok` for each line."""

    type: Literal["marlin"]
    """Kind of controller."""
    baud: Baud = 250_000
    """Bits per second."""
    buffer: Uint16 = 4
    """Size of its queue [commands]."""
    planner: Uint16 = 16
    """Number of moves that its planner looks ahead."""


class Sampled(ControllerBase):
    """A controller that reads set points from a table, at a fixed rate."""

    type: Literal["csv"]
    """Kind of controller."""
    rate: Size = 100.0
    """Set points per second."""


class ODrive(ControllerBase):
    """ODrive, with set points from a CSV file or a CAN bus; names are node ids."""

    type: Literal["odrive", "can"]
    """Kind of controller."""
    rate: Size = 100.0
    """Set points per second."""
    bitrate: Baud = 250_000
    """Bit rate of the CAN bus [bits per second]."""


class Dynamixel(ControllerBase):
    """Dynamixel servos, protocol 2; names are ids."""

    type: Literal["dynamixel"]
    """Kind of controller."""
    rate: Size = 50.0
    """Set points per second."""
    baud: Baud = 57_600
    """Bits per second."""


class Ros2(ControllerBase):
    """A ROS 2 `JointTrajectory`; names are joints."""

    type: Literal["ros2"]
    """Kind of controller."""
    rate: Size = 50.0
    """Points per second."""
    topic: Annotated[str, Field(pattern=r"^/?[A-Za-z0-9_/~]{1,253}$")] = (
        "/joint_trajectory_controller/joint_trajectory"
    )
    """Topic on which the controller listens."""


class Osc(ControllerBase):
    """Open Sound Control over UDP; names are addresses."""

    type: Literal["osc"]
    """Kind of controller."""
    rate: Size = 50.0
    """Messages per second and axis."""
    host: Host = "127.0.0.1"
    """Host that receives the packets."""
    port: Uint16 = 9000
    """UDP port of the receiver."""


class ArtNet(ControllerBase):
    """Art-Net: DMX over UDP; names are first channels (an axis of 16 bits has two)."""

    type: Literal["artnet"]
    """Kind of controller."""
    rate: Annotated[Size, AfterValidator(_check_frame_rate)] = 40.0
    """Frames per second; DMX allows at most 44."""
    host: Host = "127.0.0.1"
    """Host that receives the packets."""
    port: Uint16 = 6454
    """UDP port of the receiver."""
    universe: Annotated[int, Field(ge=0, le=32_767)] = 0
    """Universe of the channels."""
    broadcast: bool = False
    """Whether `host` may be a broadcast or multicast address, which many machines receive."""
    bits: Literal[8, 16] = 16
    """Bits per axis: 0 is the lower end of its travel, the largest number the upper end."""


Axes = Annotated[tuple[Name, ...], Field(min_length=1)]


class GrblPart(Grbl):
    """A GRBL or FluidNC that moves a part of a stand's axes."""

    axes: Axes
    """Its axes, in its order."""


class MarlinPart(Marlin):
    """A Marlin that moves a part of a stand's axes."""

    axes: Axes
    """Its axes, in its order."""


ControllerPart = Annotated[GrblPart | MarlinPart, Field(discriminator="type")]
"""One of several controllers of a stand; all accept G-code."""
Controller = Annotated[
    Grbl | Klipper | Marlin | Sampled | ODrive | Dynamixel | Ros2 | Osc | ArtNet,
    Field(discriminator="type"),
]


def axis_letters(
    controller: ControllerBase, kind: str, axes: Sequence[str]
) -> tuple[str, dict[str, str]]:
    """Letters of a controller's axes in order, and axis -> mistake in its name.

    Args:
        controller: the controller.
        kind: its kind, one of :data:`LETTERS`.
        axes: names of its axes, not more than it has letters.
    """
    all_letters, names, used_letters = LETTERS[kind], controller.names, list[str]()
    free_letters = [letter for letter in all_letters if letter not in names.values()]
    mistakes = {}
    for axis in axes:
        name = str(names[axis]) if axis in names else free_letters.pop(0)
        if name not in all_letters or name in used_letters:
            mistakes[axis] = (
                f"found {name!r}; needed: a letter of {all_letters}, a different one for each axis"
            )
        used_letters.append(name)
    return "".join(used_letters), mistakes


def too_many_axes(kind: str, n_axes: int) -> str:
    """Reason why a kind of controller cannot move this number of axes; "" if it can."""
    n_letters = len(LETTERS[kind]) if kind in LETTERS else n_axes
    if n_axes <= n_letters:
        return ""
    return (
        f"{kind} moves up to {n_letters} axes, found {n_axes}; needed: several `controllers`, each "
        "with some of the `axes`, or klipper"
    )
