"""Gesture files: gestures in YAML. Every mistake is reported with its location."""

from __future__ import annotations

import dataclasses
import os
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, WithJsonSchema, model_validator

from fantoccini.base import FileError, Mistake, StateError, UnknownNameError, nearest
from fantoccini.base.documents import (
    ANGLES,
    LENGTHS,
    Document,
    Finding,
    Kind,
    Mistakes,
    Model,
    Name,
    NotNegative,
    Place,
    document_schema,
    has_key,
    mistake,
    quantity_schema,
    read_document,
    refuse,
    unknown_names,
)
from fantoccini.control.optimal import What, reach
from fantoccini.control.tasks import Bounds
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import SAME_TIME, Input, Points, State, Table, reading
from fantoccini.theatre.gestures import moves
from fantoccini.theatre.gestures.aiming import To
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.parameters import MADE, Parameters, made_gesture, member_prefix

_FOLDER = Path(__file__).parent / "marionette"
_STILL = 1e-9
"""Largest speed and acceleration of what does not move [m/s, m/s^2 or rad]."""
_VALUE = quantity_schema(LENGTHS, ANGLES)
_POINTS = {
    "type": "array",
    "items": {
        "type": "array",
        "prefixItems": [{"type": "number"}, _VALUE],
        "minItems": 2,
        "maxItems": 2,
    },
    "minItems": 1,
}


class KeyPoses(Model):
    """Places of points of bodies, for which lengths and ends of strings are found."""

    strings: Annotated[tuple[str, ...], Field(min_length=1)]
    """The strings that move."""
    at: Annotated[tuple[NotNegative, ...], Field(min_length=1)]
    """Times of the poses, increasing [s]."""
    points: Annotated[dict[str, tuple[Place, ...]], Field(min_length=1)]
    """Body -> how far its point is from where it hangs, at every time: forward, left, up [m]."""
    of: dict[str, Place] = Field(default_factory=dict)
    """Body -> the point in its frame; its origin where not given [m]."""

    @model_validator(mode="after")
    def _match(self) -> KeyPoses:
        found: list[Finding] = [
            (("at", i + 1), f"found {b:g} s after {a:g} s; times must increase")
            for i, (a, b) in enumerate(pairwise(self.at))
            if not b > a
        ]
        for body, places in self.points.items():
            if len(places) != len(self.at):
                text = f"found {len(places)} places at {len(self.at)} times; needed: one at each"
                found.append((("points", body), text))
        refuse(
            [*found, *unknown_names(self.of, self.points, "{} is not among the points", ("of",))]
        )
        return self


class GestureFile(Document):
    """A gesture: offsets from where the puppet hangs."""

    kind: ClassVar = Kind(
        "gesture", "a gesture has the keys `gesture`, and `moves` or `poses`", _FOLDER
    )

    gesture: Name
    """The gesture's name."""
    about: str = ""
    """Description of what an audience sees."""
    moves: dict[str, Annotated[Any, WithJsonSchema(_POINTS)]] = Field(default_factory=dict)
    """Moved name -> list of [time s, offset]: a driven coordinate, or a string and a direction
    (`hand_right.up`); offsets in m or rad, or with a unit (`12 cm`, `30 deg`)."""
    poses: KeyPoses | None = None
    """Key poses, beside the moves."""
    marks: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> time within the gesture [s]."""
    travels: bool = False
    """Whether the puppet is at its new place afterwards."""

    @model_validator(mode="after")
    def _moves_something(self) -> GestureFile:
        if not self.moves and self.poses is None:
            raise mistake("found neither moves nor poses; needed: one of them")
        return self


def gesture_schema() -> dict[str, Any]:
    """JSON Schema of a gesture file, for editors."""
    return document_schema(GestureFile)


def gesture_names() -> tuple[str, ...]:
    """Names of the bundled gestures, of the bundled marionette."""
    return tuple(sorted({*GestureFile.kind.bundled, *MADE}))


def bundled(name: str) -> Path:
    """The file of a bundled gesture."""
    return _FOLDER / f"{name}.yaml"


def load_gesture(
    puppet: Table,
    path: str | os.PathLike[str],
    start: State | None = None,
    *,
    of: str = "",
    steps: int | None = None,
    step: float | None = None,
    turn: float | None = None,
    to: To | None = None,
) -> Gesture:
    """Reads a gesture file, or a take; or makes a bundled gesture.

    A take (``.npz``) is a gesture from its start on, of what moves in it.

    Args:
        puppet: whose gesture it is; a marionette where the file has key poses, and for walks and
            places.
        path: of the file, or the name of a bundled gesture (``wave``).
        start: where the puppet hangs, for key poses, walks and places; ``puppet.rest()`` when not
            given.
        of: the member of a scene that does it: ``hand_right`` is then ``pierrot.hand_right``.
        steps, step, turn: of ``walk``: how many, the length of each [m], and the angle by which
            they turn to the left in all [rad]; 4, 6 cm and 0 when not given.
        to: the place that ``point`` or ``look`` is for [m], or a body that is there at the start.

    Raises:
        FileError: with every mistake found and its location.
        InputError: likewise, of the arguments.
        UnknownNameError: the scene has no such member.
    """
    name = os.fspath(path)
    given = Parameters(steps, step, turn, to)
    prefix = member_prefix(reading.table_of(puppet), of)
    if not os.path.isfile(name):
        if name not in gesture_names():
            raise GestureFile.kind.missing(name, gesture_names())
        if given.makes(name):
            return made_gesture(puppet, name, given, prefix, start)
    given.refuse(Path(name).stem)
    if name.lower().endswith(".npz"):
        if of:
            text = "a take has the names of the scene; leave `of` out"
            raise FileError([Mistake(name, None, "", text)])
        return gesture_of_take(Input.load(puppet, name), Path(name).stem, name)
    return _read(puppet, path, start, prefix)


def _read(puppet: Table, path: str | os.PathLike[str], start: State | None, prefix: str) -> Gesture:
    """The gesture of a file."""
    file = read_document(path, GestureFile)
    table, mistakes = reading.table_of(puppet), Mistakes(file.located, file.kind.error)
    given = {prefix + name: points for name, points in file.moves.items()}
    offsets: dict[str, Points] = moves.read(table, given, mistakes, ("moves",))
    mistakes.found = [
        (tuple(x.removeprefix(prefix) if isinstance(x, str) else x for x in spot), text)
        for spot, text in mistakes.found
    ]
    if file.poses is not None and not mistakes:
        found = _of_poses(puppet, file, file.poses, start, offsets, prefix)
        for channel, points in found.items():
            if channel in offsets:
                mistakes.add(("moves",), f"move {channel}, as the string of the poses does")
            offsets[channel] = points
    if not mistakes:
        made = Gesture.of_offsets(table, offsets, travels=file.travels, name=file.gesture)
        for mark, t in file.marks.items():
            if t > made.duration + SAME_TIME:
                text = f"found {t:g} s; the gesture ends at {made.duration:g} s"
                mistakes.add(("marks", mark), text)
    mistakes.refuse()
    return dataclasses.replace(made, marks=dict(file.marks))


def gesture_of_take(inputs: Input, name: str, file: str = "") -> Gesture:
    """The motion of a take, as a gesture.

    Args:
        inputs: of the take.
        name: of the gesture.
        file: of the take, for messages.

    Raises:
        FileError: nothing moves, or a driven body turns by nearly 180 degrees or more.
    """
    try:
        made = Gesture.of_input(inputs, name=name)
    except StateError as error:
        raise FileError([Mistake(file or name, None, "", str(error))]) from None
    moves_at_all = made.named & np.any(np.abs(made.peaks) > _STILL, axis=0)
    if not moves_at_all.any():
        raise FileError([Mistake(file or name, None, "", "nothing moves in this take")])
    return dataclasses.replace(made, named=moves_at_all, coef=made.coef * moves_at_all[:, None])


def is_gesture(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a gesture: YAML with the key `gesture`."""
    return has_key(path, "gesture")


def _of_poses(
    puppet: Table,
    file: GestureFile,
    poses: KeyPoses,
    start: State | None,
    moved: dict[str, Points],
    prefix: str,
) -> dict[str, Points]:
    """Offsets of strings with which the puppet hangs at key poses, moved as it is then."""
    mistakes = Mistakes(file.located, file.kind.error)
    if not isinstance(puppet, Marionette):
        raise TypeError(f"{file.located.file} has key poses; it takes a Marionette")
    x0, table = puppet.rest() if start is None else start, puppet.coordinates
    owners = {name: name.rsplit(".", 1)[0] for name in table.q_K}
    for i, string in enumerate(poses.strings):
        if prefix + string not in owners.values():
            text = f"no string with driven coordinates is called {string!r}"
            mistakes.add(("poses", "strings", i), text + nearest(string, set(owners.values())))
    mistakes.refuse()
    strings = {prefix + string for string in poses.strings}
    held = tuple(name for name, owner in owners.items() if owner not in strings)
    targets: dict[What, Any] = {}
    for body, places in poses.points.items():
        at = poses.of.get(body, (0.0, 0.0, 0.0))
        try:
            pose = puppet.pose(x0, prefix + body)
        except UnknownNameError as error:
            mistakes.add(("poses", "points", body), str(error))
            continue
        home = pose[:3, 3] + pose[:3, :3] @ np.array(at)
        targets[prefix + body, at] = home + np.array(places)
    mistakes.refuse()
    made = {
        table.q_K[q]: (np.array(poses.at), np.empty(len(poses.at)))
        for q, _ in table.scalars_K
        if table.q_K[q] not in held
    }
    hung = None
    if moved:
        hung = Gesture.of_offsets(table, moved).inputs(x0).evaluate(x0.t + np.array(poses.at))[0]
    for i in range(len(poses.at)):
        here = x0
        if hung is not None:
            here = puppet.rest({table.q_K[q]: float(hung[i, q]) for q, _ in table.scalars_K})
        one = {what: places[i] for what, places in targets.items()}
        try:
            reached = reach(puppet, one, here, bounds=Bounds(held=held))[0]
        except StateError as error:
            raise file.located.error([(("poses", "at", i), str(error))], FileError) from None
        if not reached:
            mistakes.add(("poses", "at", i), f"at {poses.at[i]:g} s: {reached.summary()}")
        for q, _ in table.scalars_K:
            if table.q_K[q] in made:
                made[table.q_K[q]][1][i] = reached.state.q_K[q] - x0.q_K[q]
    mistakes.refuse()
    return made
