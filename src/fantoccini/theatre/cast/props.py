"""Props of a play: what they are, who has them and where they stand at the start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, nearest
from fantoccini.base.documents import read_file, value_of
from fantoccini.model.scene import Prop
from fantoccini.theatre.cast import prop_gestures
from fantoccini.theatre.cast.extents import extent
from fantoccini.theatre.cast.footing import Footing
from fantoccini.theatre.cast.starts import Places
from fantoccini.theatre.script import PlayFile, PropFile, ScriptLog, Spot

PropState = tuple[Array, Array]
"""(7,) place and quaternion of a prop, and (6,) its velocities."""

_BOTTOM = 1e-6
"""Largest distance of a prop's bottom from z = 0 [m]."""
_FOLDER = Path(__file__).parent / "prop_files"


@dataclass(frozen=True, eq=False)
class PlayProp:
    """A prop of the play.

    Attributes:
        prop: as in a scene, at the start.
        handle: height of the bar by which it hangs on a forearm [m]; None where it has none.
        seat: height of the seat; None where it has none [m].
        held_by: who has it at the start; "" where it stands.
        side: of the forearm on which it hangs then.
        stands: where it stands at the start, and the direction of its x; where it is held, of who
            holds it.
        height: of its bottom at the start [m].
        content: says all that it is, but for where it is.
    """

    prop: Prop
    handle: float | None
    seat: float | None
    held_by: str
    side: str
    stands: Footing
    height: float
    content: str

    @property
    def name(self) -> str:
        """Its name in the play."""
        return self.prop.name

    @property
    def start(self) -> PropState:
        """Its pose at the start, before a held prop has settled on the arm."""
        x, y, z = (float(one) for one in self.prop.at)
        half = 0.5 * self.stands.heading
        return np.array([x, y, z, np.cos(half), 0.0, 0.0, np.sin(half)]), np.zeros(6)


def prop_names() -> tuple[str, ...]:
    """Names of the bundled props."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


def top_of(file: PlayFile, name: str) -> float | None:
    """Height of what stands on the stage [m]; None where no obstacle is called so."""
    for obstacle in file.stage.obstacles:
        if obstacle.name == name:
            return float(extent(obstacle)[1][2])
    return None


def read_props(
    file: PlayFile,
    starts: Mapping[str, Footing],
    lifts: Mapping[str, float],
    places: Places,
    log: ScriptLog,
) -> dict[str, PlayProp]:
    """The props of a play; records mistakes.

    Args:
        file: the play.
        starts: where the players stand at the start.
        lifts: how much higher they hang than their files have them [m].
        places: what names of places mean.
        log: collects mistakes.
    """
    play_props: dict[str, PlayProp] = {}
    arms: dict[tuple[str, str], str] = {}
    for name, given in file.props.items():
        if given.held_by is not None:
            other = arms.setdefault((given.held_by, given.side), name)
            if other != name:
                text = f"{other} hangs on the {given.side} forearm of {given.held_by} already"
                log.mistakes.add(("props", name, "held by"), text)
        prop = _prop(file, name, given, starts, lifts, places, log)
        if prop is not None:
            play_props[name] = prop
    return play_props


def _prop(
    file: PlayFile,
    name: str,
    given: PropFile,
    starts: Mapping[str, Footing],
    lifts: Mapping[str, float],
    places: Places,
    log: ScriptLog,
) -> PlayProp | None:
    spot: Spot = ("props", name)
    data = _described(name, given, spot, log)
    if data is None:
        return None
    handle, seat = data.pop("handle", None), data.pop("seat", None)
    if given.held_by is not None:
        if given.held_by not in starts:
            text = f"no player is called {given.held_by!r}{nearest(given.held_by, starts)}"
            log.mistakes.add((*spot, "held by"), text)
            return None
        if handle is None:
            log.mistakes.add((*spot, "held by"), f"{name} has no handle; needed: `handle:`")
            return None
        stands = starts[given.held_by]
        forward, left, up = prop_gestures.handle_place(given.side, raised=lifts[given.held_by])
        place = stands.place + np.exp(1j * stands.heading) * complex(forward, left)
        height = up - handle
    else:
        there = _place(file, given, spot, places, log)
        if there is None:
            return None
        (x, y, height), heading = there, places.direction(given.facing, (*spot, "facing"))
        if isinstance(heading, str):
            middle = places.still(heading)
            if middle is None:
                text = f"found {heading!r}; needed: an angle, a direction or an obstacle"
                log.mistakes.add((*spot, "facing"), text)
                return None
            heading = Footing(x, y).towards(complex(middle[0], middle[1]))
        place, stands = complex(x, y), Footing(x, y, heading)
    least = min(float(extent(shape)[0][2]) for shape in prop_shapes(name, data))
    if abs(least) > _BOTTOM and not given.held_by:
        text = f"its bottom is at z = {least:.3g}; needed: 0, so that it stands where it is put"
        log.mistakes.add((*spot, "shapes"), text)
        return None
    turn = {"axis": [0.0, 0.0, 1.0], "angle": stands.heading}
    at = [place.real, place.imag, height]
    prop = Prop.model_validate({"name": name, "at": at, "orientation": turn, **data})
    return PlayProp(prop, handle, seat, given.held_by or "", given.side, stands, height, repr(data))


def prop_shapes(name: str, data: dict[str, Any]) -> tuple[Any, ...]:
    """The shapes of a prop, read."""
    return Prop.model_validate({"name": name, **data}).shapes


def _described(name: str, given: PropFile, spot: Spot, log: ScriptLog) -> dict[str, Any] | None:
    """Shapes, mass, drag, handle and seat of a prop; None after a mistake."""
    if given.shapes:
        data: dict[str, Any] = {"shapes": given.shapes, "mass": given.mass}
    else:
        kind = given.like or name
        if kind not in prop_names():
            text = f"no bundled prop is called {kind!r}{nearest(kind, prop_names())}"
            log.mistakes.add(spot, f"{text}; needed: `like:` or `shapes:`")
            return None
        data = read_file(_FOLDER / f"{kind}.yaml").data
        if given.mass is not None:
            data["mass"] = given.mass
    for key in ("handle", "seat"):
        own = getattr(given, key)
        if own is not None:
            data[key] = value_of(own)
    return data


def _place(
    file: PlayFile, given: PropFile, spot: Spot, places: Places, log: ScriptLog
) -> tuple[float, float, float] | None:
    """Place of a standing prop [m]; None after a mistake."""
    height = file.stage.floor
    middle: Array | None = None
    if given.on is not None:
        top, middle = top_of(file, given.on), places.still(given.on)
        if top is None:
            known = [obstacle.name for obstacle in file.stage.obstacles]
            text = f"found {given.on!r}; needed: an obstacle{nearest(given.on, known)}"
            log.mistakes.add((*spot, "on"), text)
            return None
        height = top
    if given.at is None:
        assert middle is not None
        return float(middle[0]), float(middle[1]), height
    if isinstance(given.at, str):
        mark = file.stage.marks.get(given.at)
        if mark is None:
            text = f"no mark is called {given.at!r}{nearest(given.at, file.stage.marks)}"
            log.mistakes.add((*spot, "at"), text)
            return None
        x, y = mark.at
    else:
        x, y = given.at[:2]
    if given.on is not None:
        (low, high) = next(extent(o) for o in file.stage.obstacles if o.name == given.on)
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            text = f"[{x:g}, {y:g}] is not on {given.on}, which is from [{low[0]:.3g}, "
            text += f"{low[1]:.3g}] to [{high[0]:.3g}, {high[1]:.3g}]"
            log.mistakes.add((*spot, "at"), text)
            return None
    return x, y, height
