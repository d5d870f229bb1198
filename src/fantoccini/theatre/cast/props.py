"""Props of a play, with their holders and places at the start.

A prop is a body that players handle: it stands at a footing, a place with a heading, or it hangs by
its handle on the forearm of a player. A spot is the list of keys that leads to an entry of the
file. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, did_you_mean
from fantoccini.base.documents import read_file, value_of
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.scene import Prop
from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.cast.extents import bounding_box
from fantoccini.theatre.cast.footing import Footing
from fantoccini.theatre.cast.starts import Places
from fantoccini.theatre.script import PlayFile, PropFile, ScriptLog, Spot

PropState = tuple[Array, Array]
"""(7,) place and quaternion of a prop, and (6,) its velocities."""

_BOTTOM_TOLERANCE = 1e-6
"""Largest distance of a prop's bottom from z = 0 [m]."""
_FOLDER = Path(__file__).parent / "prop_files"


@dataclass(frozen=True, eq=False)
class PlayProp:
    """A prop of the play.

    Attributes:
        prop: prop of the scene, at the start.
        handle_height: height above its bottom of the bar by which it hangs on a forearm [m]; None
            without a handle.
        seat_height: height of the seat above its bottom [m]; None without a seat.
        held_by: player that holds it at the start; "" if it stands.
        side: ``left`` or ``right``, the forearm on which it hangs at the start.
        footing: place at the start and direction of its x axis; if it is held, the latter is the
            direction in which the holder looks.
        bottom_height: height of its bottom at the start [m].
        content_key: key in the cache, from its shapes, mass and other properties except its place.
    """

    prop: Prop
    handle_height: float | None
    seat_height: float | None
    held_by: str
    side: str
    footing: Footing
    bottom_height: float
    content_key: str

    @property
    def name(self) -> str:
        """Name in the play."""
        return self.prop.name

    @property
    def bottom_radius(self) -> float:
        """Largest distance from its axis, along x or y, of the shapes at its bottom [m]."""
        boxes = [np.array(bounding_box(shape)) for shape in self.prop.shapes]
        bottom_boxes = [box for box in boxes if box[0, 2] <= _BOTTOM_TOLERANCE]
        return max((float(np.abs(box[:, :2]).max()) for box in bottom_boxes), default=0.0)

    @property
    def start(self) -> PropState:
        """Pose at the start, before a held prop has settled on the arm."""
        x, y, z = (float(coordinate) for coordinate in self.prop.at)
        half_angle = 0.5 * self.footing.heading
        return np.array([x, y, z, np.cos(half_angle), 0.0, 0.0, np.sin(half_angle)]), np.zeros(6)


def prop_names() -> tuple[str, ...]:
    """Names of the bundled props."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


def obstacle_top(file: PlayFile, name: str) -> float | None:
    """Height of an obstacle's top [m]; None if no obstacle has this name."""
    for obstacle in file.stage.obstacles:
        if obstacle.name == name:
            return float(bounding_box(obstacle)[1][2])
    return None


def read_props(
    file: PlayFile,
    start_footings: Mapping[str, Footing],
    marionettes: Mapping[str, Marionette],
    places: Places,
    log: ScriptLog,
) -> dict[str, PlayProp]:
    """The props of a play; mistakes of the file are recorded in the log.

    Args:
        file: the play.
        start_footings: footings of the players at the start.
        marionettes: puppets of the players, each in a scene of its own.
        places: converter of names of places to positions.
        log: collects mistakes.
    """
    play_props: dict[str, PlayProp] = {}
    prop_on_arm: dict[tuple[str, str], str] = {}
    for name, entry in file.props.items():
        if entry.held_by is not None:
            earlier_prop = prop_on_arm.setdefault((entry.held_by, entry.side), name)
            if earlier_prop != name:
                text = (
                    f"{earlier_prop} hangs on the {entry.side} forearm of {entry.held_by} already"
                )
                log.mistakes.add(("props", name, "held by"), text)
        prop = _prop(file, name, entry, start_footings, marionettes, places, log)
        if prop is not None:
            play_props[name] = prop
    return play_props


def _prop(
    file: PlayFile,
    name: str,
    entry: PropFile,
    start_footings: Mapping[str, Footing],
    marionettes: Mapping[str, Marionette],
    places: Places,
    log: ScriptLog,
) -> PlayProp | None:
    spot: Spot = ("props", name)
    data = _description(name, entry, spot, log)
    if data is None:
        return None
    handle_height, seat_height = data.pop("handle", None), data.pop("seat", None)
    if entry.held_by is not None:
        if entry.held_by not in start_footings:
            hint = did_you_mean(entry.held_by, start_footings)
            text = f"no player is called {entry.held_by!r}{hint}"
            log.mistakes.add((*spot, "held by"), text)
            return None
        if handle_height is None:
            log.mistakes.add((*spot, "held by"), f"{name} has no handle; needed: `handle:`")
            return None
        footing = start_footings[entry.held_by]
        prop_forward, prop_left, handle_rise = prop_gestures.handle_place(
            marionettes[entry.held_by], side=entry.side
        )
        xy = footing.place + np.exp(1j * footing.heading) * complex(prop_forward, prop_left)
        bottom_height = handle_rise - handle_height
    else:
        floor_place = _place(file, entry, spot, places, log)
        if floor_place is None:
            return None
        (x, y, bottom_height), heading = (
            floor_place,
            places.direction(entry.facing, (*spot, "facing")),
        )
        if isinstance(heading, str):
            middle = places.midpoint(heading)
            if middle is None:
                text = f"found {heading!r}; needed: an angle, a direction or an obstacle"
                log.mistakes.add((*spot, "facing"), text)
                return None
            heading = Footing(x, y).towards(complex(middle[0], middle[1]))
        xy, footing = complex(x, y), Footing(x, y, heading)
    lowest_z = min(float(bounding_box(shape)[0][2]) for shape in prop_shapes(name, data))
    if abs(lowest_z) > _BOTTOM_TOLERANCE and not entry.held_by:
        text = f"its bottom is at z = {lowest_z:.3g}; needed: 0, so that it stands where it is put"
        log.mistakes.add((*spot, "shapes"), text)
        return None
    orientation = {"axis": [0.0, 0.0, 1.0], "angle": footing.heading}
    position = [xy.real, xy.imag, bottom_height]
    prop = Prop.model_validate({"name": name, "at": position, "orientation": orientation, **data})
    return PlayProp(
        prop,
        handle_height,
        seat_height,
        entry.held_by or "",
        entry.side,
        footing,
        bottom_height,
        repr(data),
    )


def prop_shapes(name: str, data: dict[str, Any]) -> tuple[Any, ...]:
    """Validated shapes of a prop."""
    return Prop.model_validate({"name": name, **data}).shapes


def _description(name: str, entry: PropFile, spot: Spot, log: ScriptLog) -> dict[str, Any] | None:
    """Shapes, mass, drag, handle and seat of a prop; None after a mistake."""
    if entry.shapes:
        data: dict[str, Any] = {"shapes": entry.shapes, "mass": entry.mass}
    else:
        kind = entry.like or name
        if kind not in prop_names():
            text = f"no bundled prop is called {kind!r}{did_you_mean(kind, prop_names())}"
            log.mistakes.add(spot, f"{text}; needed: `like:` or `shapes:`")
            return None
        data = read_file(_FOLDER / f"{kind}.yaml").data
        if entry.mass is not None:
            data["mass"] = entry.mass
    for key in ("handle", "seat"):
        value = getattr(entry, key)
        if value is not None:
            data[key] = value_of(value)
    return data


def _place(
    file: PlayFile, entry: PropFile, spot: Spot, places: Places, log: ScriptLog
) -> tuple[float, float, float] | None:
    """Place of a standing prop [m]; None after a mistake."""
    height = file.stage.floor
    middle: Array | None = None
    if entry.on is not None:
        top_height, middle = obstacle_top(file, entry.on), places.midpoint(entry.on)
        if top_height is None:
            obstacle_names = [obstacle.name for obstacle in file.stage.obstacles]
            text = (
                f"found {entry.on!r}; needed: an obstacle{did_you_mean(entry.on, obstacle_names)}"
            )
            log.mistakes.add((*spot, "on"), text)
            return None
        height = top_height
    if entry.at is None:
        assert middle is not None
        return float(middle[0]), float(middle[1]), height
    if isinstance(entry.at, str):
        mark = file.stage.marks.get(entry.at)
        if mark is None:
            text = f"no mark is called {entry.at!r}{did_you_mean(entry.at, file.stage.marks)}"
            log.mistakes.add((*spot, "at"), text)
            return None
        x, y = mark.at
    else:
        x, y = entry.at[:2]
    if entry.on is not None:
        (lower, upper) = next(bounding_box(o) for o in file.stage.obstacles if o.name == entry.on)
        if not (lower[0] <= x <= upper[0] and lower[1] <= y <= upper[1]):
            text = f"[{x:g}, {y:g}] is not on {entry.on}, which is from [{lower[0]:.3g}, "
            text += f"{lower[1]:.3g}] to [{upper[0]:.3g}, {upper[1]:.3g}]"
            log.mistakes.add((*spot, "at"), text)
            return None
    return x, y, height
