"""Controllers of stands: what takes the set points, and how much of them it takes at once."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from fantoccini.base.documents import Model, Name, Size, mistake, shown

MOST_FRAMES = 44.0
"""Frames of DMX per second, at most."""
_MAX_LENGTH = 128
"""Of what a controller calls an axis [characters]."""


def _called(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise mistake(f"found {shown(value)}; needed: a text or a whole number")
    text = str(value)
    if not text.isprintable() or not 0 < len(text) <= _MAX_LENGTH or any(c.isspace() for c in text):
        raise mistake(
            f"found {shown(value)}; needed: up to {_MAX_LENGTH} characters without blanks"
        )
    return value


Called = Annotated[
    str | int, BeforeValidator(_called), WithJsonSchema({"type": ["string", "integer"]})
]


def _frames(rate: float) -> float:
    if rate > MOST_FRAMES:
        raise mistake(f"found {rate:g}; DMX takes at most {MOST_FRAMES:g} frames per second")
    return rate


Baud = Annotated[int, Field(ge=300, le=50_000_000)]
Size16 = Annotated[int, Field(ge=1, le=65_535)]
Host = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.:-]{1,253}$")]


class _Controller(Model):
    """What all have."""

    names: dict[Name, Called] = Field(default_factory=dict)
    """Axis -> what the controller calls it: a letter, a section, a joint, an id, an address."""


class _OnSerialPort(_Controller):
    """What those on a serial port have."""

    port: Annotated[str, Field(pattern=r"^[A-Za-z0-9_./:\\-]{1,253}$")] | None = None
    """Serial port, as `/dev/ttyUSB0` or `COM3`."""
    baud: Baud = 115_200
    """Bits per second."""
    step_rate: Size | None = None
    """Most step pulses per second of an axis; no bound by default."""


class Grbl(_OnSerialPort):
    """GRBL 1.1 or FluidNC: G-code by counting the characters in its buffer."""

    type: Literal["grbl", "fluidnc"]
    """Kind of controller."""
    buffer: Size16 = 128
    """Characters that its serial buffer holds."""
    planner: Size16 = 16
    """Moves that its planner looks ahead."""
    step_rate: Size | None = 30_000.0
    """Most step pulses per second of an axis; GRBL on an 8-bit board makes 30,000."""


class Klipper(_OnSerialPort):
    """Klipper: G-code macros with `MANUAL_STEPPER`, or a printer's own axes."""

    type: Literal["klipper"]
    """Kind of controller."""
    baud: Baud = 250_000
    """Bits per second."""


class Marlin(_OnSerialPort):
    """Marlin and firmware like it: G-code, one `ok` a line."""

    type: Literal["marlin"]
    """Kind of controller."""
    baud: Baud = 250_000
    """Bits per second."""
    buffer: Size16 = 4
    """Commands that its queue holds."""
    planner: Size16 = 16
    """Moves that its planner looks ahead."""


class Sampled(_Controller):
    """One that takes set points at a rate."""

    type: Literal["csv"]
    """Kind of controller."""
    rate: Size = 100.0
    """Set points per second."""


class ODrive(_Controller):
    """ODrive, by a CSV of set points or on a CAN bus; names are node ids."""

    type: Literal["odrive", "can"]
    """Kind of controller."""
    rate: Size = 100.0
    """Set points per second."""
    bitrate: Baud = 250_000
    """Of the CAN bus [bits per second]."""


class Dynamixel(_Controller):
    """Dynamixel servos, protocol 2; names are ids."""

    type: Literal["dynamixel"]
    """Kind of controller."""
    rate: Size = 50.0
    """Set points per second."""
    baud: Baud = 57_600
    """Bits per second."""


class Ros2(_Controller):
    """A ROS 2 `JointTrajectory`; names are joints."""

    type: Literal["ros2"]
    """Kind of controller."""
    rate: Size = 50.0
    """Points per second."""
    topic: Annotated[str, Field(pattern=r"^/?[A-Za-z0-9_/~]{1,253}$")] = (
        "/joint_trajectory_controller/joint_trajectory"
    )
    """Of the controller."""


class Osc(_Controller):
    """Open Sound Control over UDP; names are addresses."""

    type: Literal["osc"]
    """Kind of controller."""
    rate: Size = 50.0
    """Messages per second and axis."""
    host: Host = "127.0.0.1"
    """Where they go."""
    port: Size16 = 9000
    """Where they go."""


class ArtNet(_Controller):
    """Art-Net: DMX over UDP; names are channels, of 16 bits two each."""

    type: Literal["artnet"]
    """Kind of controller."""
    rate: Annotated[Size, AfterValidator(_frames)] = 40.0
    """Frames per second; DMX takes at most 44."""
    host: Host = "127.0.0.1"
    """Where they go."""
    port: Size16 = 6454
    """Where they go."""
    universe: Annotated[int, Field(ge=0, le=32_767)] = 0
    """Of the channels."""
    broadcast: bool = False
    """Whether all machines of a network may be sent to: a broadcast or multicast `host`."""
    bits: Literal[8, 16] = 16
    """Of an axis: its travel goes from 0 to the largest number."""


Controller = Annotated[
    Grbl | Klipper | Marlin | Sampled | ODrive | Dynamixel | Ros2 | Osc | ArtNet,
    Field(discriminator="type"),
]
