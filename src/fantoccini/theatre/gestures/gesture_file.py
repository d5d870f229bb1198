"""Reader of gesture files in YAML, which reports every mistake with its location.

A gesture file gives offsets of strings at times, or key poses: places of points of bodies, from
which the lengths and ends of strings are computed. A take is a recording of a performance for
editing. In names, K stands for driven coordinates: ends and lengths of strings, driven joints. A
member is a puppet of a scene.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, WithJsonSchema, model_validator

from fantoccini.base import Array, FileError, Mistake, StateError, UnknownNameError, did_you_mean
from fantoccini.base.documents import (
    ANGLES,
    LENGTHS,
    Document,
    Finding,
    Kind,
    Length,
    Mistakes,
    Model,
    Name,
    NotNegative,
    Path as Keys,
    Place,
    document_schema,
    has_key,
    quantity_schema,
    raise_if_any,
    read_document,
    unknown_names,
    validation_error,
)
from fantoccini.control.optimal import ReachedPose, TargetKey, reach
from fantoccini.control.tasks import Bounds
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import SAME_TIME, Input, Points, State, Table, reading
from fantoccini.theatre.gestures import moves
from fantoccini.theatre.gestures.aiming import AimTarget
from fantoccini.theatre.gestures.body_parts import BodyParts, SizeKind, string_moves
from fantoccini.theatre.gestures.gesture import Gesture
from fantoccini.theatre.gestures.moves import not_driven
from fantoccini.theatre.gestures.own_axes import OwnAxes
from fantoccini.theatre.gestures.parameters import (
    COMPUTED_GESTURES,
    Parameters,
    computed_gesture,
    member_prefix,
)
from fantoccini.theatre.gestures.reachable import reachable_part
from fantoccini.theatre.gestures.turns import TurnError

_FOLDER = Path(__file__).parent / "marionette"
_MAX_REST_PEAK = 1e-9
"""Largest speed and acceleration that count as rest [m/s, m/s^2; rad/s, rad/s^2]."""
_OFFSET_SCHEMA = quantity_schema(LENGTHS, ANGLES)
_POINTS_SCHEMA = {
    "type": "array",
    "items": {
        "type": "array",
        "prefixItems": [{"type": "number"}, _OFFSET_SCHEMA],
        "minItems": 2,
        "maxItems": 2,
    },
    "minItems": 1,
}


class KeyPoses(Model):
    """Places of points of bodies, which determine lengths and ends of strings."""

    strings: Annotated[tuple[str, ...], Field(min_length=1)]
    """Strings that move."""
    at: Annotated[tuple[NotNegative, ...], Field(min_length=1)]
    """Times of the poses, increasing [s]."""
    points: Annotated[dict[str, tuple[Place, ...]], Field(min_length=1)]
    """Body -> offsets of its point from rest, one for each time: forward, left and up [m]."""
    of: dict[str, Place] = Field(default_factory=dict)
    """Body -> point in its frame; its origin by default [m]."""

    @model_validator(mode="after")
    def _match(self) -> KeyPoses:
        findings: list[Finding] = [
            (("at", i + 1), f"found {b:g} s after {a:g} s; times must increase")
            for i, (a, b) in enumerate(pairwise(self.at))
            if not b > a
        ]
        for body, places in self.points.items():
            if len(places) != len(self.at):
                text = f"found {len(places)} places at {len(self.at)} times; needed: one at each"
                findings.append((("points", body), text))
        raise_if_any(
            [*findings, *unknown_names(self.of, self.points, "{} is not among the points", ("of",))]
        )
        return self


class GestureFile(Document):
    """A gesture: offsets from the puppet's rest."""

    kind: ClassVar = Kind(
        "gesture", "a gesture has the keys `gesture`, and `parts`, `moves` or `poses`", _FOLDER
    )

    gesture: Name
    """Name of the gesture."""
    about: str = ""
    """Description for the audience."""
    parts: dict[str, Annotated[Any, WithJsonSchema(_POINTS_SCHEMA)]] = Field(default_factory=dict)
    """Part of the body and direction (`arm_right.up`, `head.left`, `legs.out`) -> list of
    [time s, offset], for all strings that move the part."""
    on_control: dict[str, Annotated[Any, WithJsonSchema(_POINTS_SCHEMA)]] = Field(
        default_factory=dict
    )
    """Moves instead of `parts` for a puppet on a control with strings of fixed lengths: bar and
    direction (`control.tip_forward`, `leg_bar.roll_left`) -> list of [time s, offset]."""
    sizes: dict[SizeKind, Annotated[Length, Field(gt=0.0)]] = Field(default_factory=dict)
    """Kind of part -> its size for these offsets [m]; for a puppet of another size they are
    multiplied by the ratio. `whole` is for trunk and head."""
    scaled_by: dict[str, SizeKind] = Field(default_factory=dict)
    """Part -> kind of part whose size scales its offsets, in place of its own (`{trunk: leg}`)."""
    moves: dict[str, Annotated[Any, WithJsonSchema(_POINTS_SCHEMA)]] = Field(default_factory=dict)
    """Moved name -> list of [time s, offset]: a driven coordinate, or a string or driven body and
    a direction (`hand_right.up`, `bar.tip_forward`); offsets in m or rad, or with a unit (`12 cm`,
    `30 deg`)."""
    poses: KeyPoses | None = None
    """Key poses, in addition to the moves."""
    marks: dict[Name, NotNegative] = Field(default_factory=dict)
    """Name -> time within the gesture [s]."""
    travels: bool = False
    """Whether the puppet stays at its new place afterwards."""

    @model_validator(mode="after")
    def _moves_something(self) -> GestureFile:
        if not self.parts and not self.moves and self.poses is None:
            raise validation_error("found neither parts, moves nor poses; needed: one of them")
        if self.parts and (self.moves or self.poses is not None):
            raise validation_error(
                "found parts with moves or poses; allowed: parts, which any puppet may have, or "
                "moves and poses, which name strings and bodies"
            )
        if self.on_control and not self.parts:
            raise_if_any([(("on_control",), "found without parts; needed: both, for all puppets")])
        part_names, key = {name.rpartition(".")[0] for name in self.parts}, ("scaled_by",)
        raise_if_any(unknown_names(self.scaled_by, part_names, "{} is not among the parts", key))
        unsized = [part for part, kind in self.scaled_by.items() if kind not in self.sizes]
        raise_if_any(
            ((*key, part), "needed: a kind of part whose size is in `sizes`") for part in unsized
        )
        return self


def gesture_schema() -> dict[str, Any]:
    """JSON Schema of a gesture file, for editors."""
    return document_schema(GestureFile)


def gesture_names() -> tuple[str, ...]:
    """Names of the bundled gestures."""
    return tuple(sorted({*GestureFile.kind.bundled, *COMPUTED_GESTURES}))


def bundled_gesture_path(name: str) -> Path:
    """Path of a bundled gesture."""
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
    to: AimTarget | None = None,
) -> Gesture:
    """Gesture from a file or a take, or a bundled gesture.

    A take (``.npz``) becomes a gesture relative to its start; it uses the coordinates that move.

    Args:
        puppet: puppet that performs it; a Marionette for parts of a body, and so for bundled
            gestures, key poses, walks and targets (``to``).
        path: path of the file, or the name of a bundled gesture (``wave``).
        start: state at rest, for key poses, walks and places; ``puppet.rest()`` by default.
        of: member of a scene that performs it; ``hand_right`` is then ``pierrot.hand_right``.
        steps, step, turn: parameters of ``walk``: number of steps, length of each [m], and total
            turn to the left [rad]; 4, 6 cm and 0 by default.
        to: target of ``point`` or ``look``: a place [m], or the place of a body at the start.

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines. Or the puppet
            lacks a part of the body; the message has its name.
        InputError: the arguments have mistakes.
        UnknownNameError: the scene has no such member.
        TypeError: a table for a gesture that needs a Marionette.
    """
    name = os.fspath(path)
    parameters = Parameters(steps, step, turn, to)
    prefix = member_prefix(reading.table_of(puppet), of)
    if not os.path.isfile(name):
        if name not in gesture_names():
            raise GestureFile.kind.missing(name, gesture_names())
        if parameters.computes(name):
            return computed_gesture(puppet, name, parameters, prefix, start)
    parameters.refuse(Path(name).stem)
    if name.lower().endswith(".npz"):
        if of:
            text = "a take has the names of the scene; leave `of` out"
            raise FileError([Mistake(name, None, "", text)])
        return gesture_from_take(Input.load(puppet, name), Path(name).stem, name)
    return _gesture_of_file(puppet, path, start, prefix)


def _gesture_of_file(
    puppet: Table, path: str | os.PathLike[str], start: State | None, prefix: str
) -> Gesture:
    """Gesture of a file."""
    file = read_document(path, GestureFile)
    if file.parts:
        gesture = _gesture_of_parts(puppet, file, prefix)
    else:
        gesture = _gesture_of_strings(puppet, file, start, prefix)
    mistakes = Mistakes(file.located, file.kind.error)
    for mark, t in file.marks.items():
        if t > gesture.duration + SAME_TIME:
            text = f"found {t:g} s; the gesture ends at {gesture.duration:g} s"
            mistakes.add(("marks", mark), text)
    mistakes.raise_if_any()
    return dataclasses.replace(gesture, marks=dict(file.marks))


def _gesture_of_strings(
    puppet: Table, file: GestureFile, start: State | None, prefix: str
) -> Gesture:
    """Gesture of a file that moves strings of a certain puppet, without marks."""
    table, mistakes = reading.table_of(puppet), Mistakes(file.located, file.kind.error)
    prefixed = {prefix + name: points for name, points in file.moves.items()}
    offsets: dict[str, Points] = moves.read_offsets(table, prefixed, mistakes, ("moves",))
    mistakes.findings = [
        (tuple(key.removeprefix(prefix) if isinstance(key, str) else key for key in keys), text)
        for keys, text in mistakes.findings
    ]
    if file.poses is not None and not mistakes:
        pose_offsets = _pose_offsets(puppet, file, file.poses, start, offsets, prefix)
        for channel, points in pose_offsets.items():
            if channel in offsets:
                mistakes.add(("moves",), f"move {channel}, as the string of the poses does")
            offsets[channel] = points
    mistakes.raise_if_any()
    return _gesture_through(file, table, offsets, _keys_of_moves(file, prefix))


def _keys_of_moves(file: GestureFile, prefix: str) -> dict[str, Keys]:
    """Moved name -> its keys in a file that moves strings of a certain puppet."""
    return {prefix + name: ("moves", name) for name in file.moves}


def _gesture_through(
    file: GestureFile,
    table: CoordinateTable,
    offsets: dict[str, Points],
    keys_by_name: Mapping[str, Keys],
) -> Gesture:
    """Gesture of a file through offsets.

    Args:
        file, table: the file, and names of the coordinates.
        offsets: coordinate -> times and offsets.
        keys_by_name: moved name -> its keys in the file.

    Raises:
        FileError: it turns a body too far, or travels and ends with a body turned.
    """
    try:
        return Gesture.from_offsets(table, offsets, travels=file.travels, name=file.gesture)
    except TurnError as error:
        scalars = moves.scalar_names(error.channel, table)
        mistakes = {
            keys: str(error)
            for name, keys in keys_by_name.items()
            if {*scalars} & {*moves.scalar_names(moves.driven_coordinate(name, table)[0], table)}
        }
        raise file.located.error([*mistakes.items()], FileError) from None
    except StateError as error:
        raise file.located.error([(("travels",), str(error))], FileError) from None


def _gesture_of_parts(puppet: Table, file: GestureFile, prefix: str) -> Gesture:
    """Gesture of a file that moves parts of a body, without marks.

    Raises:
        FileError: the puppet lacks a part, or its strings cannot move in this way.
    """
    if not isinstance(puppet, Marionette):
        raise TypeError(f"{file.gesture} moves parts of a body; it takes a Marionette")
    mistakes = Mistakes(file.located, file.kind.error)
    if puppet.puppet.members and not prefix:
        reason = f"needed: `of`, a member of the scene: {', '.join(puppet.puppet.members)}"
        raise _not_for_this_puppet(file, reason)
    try:
        body_parts = BodyParts.for_puppet(puppet, prefix.removesuffix("."))
        key = "on_control" if file.on_control and body_parts.on_control else "parts"
        points: dict[str, Any] = getattr(file, key)
        zero_parts = {part for part in points if _is_zero(points[part])}
        parts = string_moves(body_parts, points, file.scaled_by, zero_parts)
    except StateError as error:
        raise _not_for_this_puppet(file, str(error)) from None
    axes = OwnAxes.for_members(puppet, [body_parts])
    table, string_mistakes = axes.own_table, Mistakes.of_inputs()
    indices = moves.scalar_indices(table)
    # Parts that stay need no driven coordinate.
    drivable_parts = {
        name: (part, move)
        for name, (part, move) in parts.items()
        if part not in zero_parts or moves.driven_coordinate(name, table)[0] in indices
    }
    parts = drivable_parts or parts
    waypoints = {name: points[part] for name, (part, _) in parts.items()}
    offsets = moves.read_offsets(table, waypoints, string_mistakes, (key,))
    units = moves.names_and_units(table)
    for name, (part, move) in parts.items():
        channel = moves.driven_coordinate(name, table)[0]
        if channel not in indices:
            reason = not_driven(channel, on_control=bool(file.on_control))
            reason = f"its move {part} would move {reason}"
            raise _not_for_this_puppet(file, reason)
        is_length = units[indices[channel]][1] == "m"
        if channel in offsets and move.size_kind in file.sizes and is_length:
            t, values = offsets[channel]
            offsets[channel] = t, move.size / file.sizes[move.size_kind] * values
    for (_, string, *rest), text in string_mistakes.findings:
        mistakes.add((key, parts[str(string)][0], *rest), text)
    mistakes.raise_if_any()
    keys_by_name: dict[str, Keys] = {name: (key, part) for name, (part, _) in parts.items()}
    gesture = _gesture_through(file, table, offsets, keys_by_name)
    try:
        return gesture.in_driven_axes(axes)
    except StateError as error:
        raise _not_for_this_puppet(file, str(error)) from None


def _is_zero(points: Any) -> bool:
    """Whether all offsets of a list are 0."""
    return isinstance(points, list) and all(
        isinstance(point, list) and len(point) == 2 and point[1] == 0 for point in points
    )


def _not_for_this_puppet(file: GestureFile, reason: str) -> FileError:
    """Error of a gesture that a puppet cannot do: a sentence without line numbers."""
    return file.kind.error([Mistake(f"gesture {file.gesture}", None, "", reason)])


def gesture_from_take(inputs: Input, name: str, file: str = "") -> Gesture:
    """Gesture with the motion of a take.

    Args:
        inputs: input of the take.
        name: name of the gesture.
        file: file of the take, for messages.

    Raises:
        FileError: nothing moves, or a driven body turns by nearly 180 degrees or more.
    """
    try:
        gesture = Gesture.from_input(inputs, name=name)
    except StateError as error:
        raise FileError([Mistake(file or name, None, "", str(error))]) from None
    is_moved = gesture.named & np.any(np.abs(gesture.peaks) > _MAX_REST_PEAK, axis=0)
    for _, v in gesture.coordinates.rotations.values():
        is_moved[v : v + 3] = is_moved[v : v + 3].any()
    if not is_moved.any():
        raise FileError([Mistake(file or name, None, "", "nothing moves in this take")])
    return dataclasses.replace(gesture, named=is_moved, coef=gesture.coef * is_moved[:, None])


def is_gesture(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a gesture: YAML with the key `gesture`."""
    return has_key(path, "gesture")


def _pose_offsets(
    puppet: Table,
    file: GestureFile,
    poses: KeyPoses,
    start: State | None,
    move_offsets: dict[str, Points],
    prefix: str,
) -> dict[str, Points]:
    """Offsets of strings that reach the key poses, added to the moves at these times."""
    mistakes = Mistakes(file.located, file.kind.error)
    if not isinstance(puppet, Marionette):
        raise TypeError(f"{file.located.file} has key poses; it takes a Marionette")
    x0, table = puppet.rest() if start is None else start, puppet.coordinates
    owners = {name: name.rsplit(".", 1)[0] for name in table.q_K}
    for i, string in enumerate(poses.strings):
        if prefix + string not in owners.values():
            text = f"no string with driven coordinates is called {string!r}"
            mistakes.add(("poses", "strings", i), text + did_you_mean(string, set(owners.values())))
    mistakes.raise_if_any()
    strings = {prefix + string for string in poses.strings}
    held_names = tuple(name for name in table.v_K if name.rsplit(".", 1)[0] not in strings)
    rest_positions: dict[TargetKey, Array] = {}
    offsets: dict[TargetKey, Array] = {}
    for body, targets in poses.points.items():
        point = poses.of.get(body, (0.0, 0.0, 0.0))
        try:
            pose = puppet.pose(x0, prefix + body)
        except UnknownNameError as error:
            mistakes.add(("poses", "points", body), str(error))
            continue
        rest_positions[prefix + body, point] = pose[:3, 3] + pose[:3, :3] @ np.array(point)
        offsets[prefix + body, point] = np.array(targets)
    mistakes.raise_if_any()
    pose_offsets = {
        name: (np.array(poses.at), np.empty(len(poses.at)))
        for name in moves.scalar_indices(table)
        if name.rpartition(".")[0] in strings or name in strings
    }
    q_K_of_moves = None
    if move_offsets:
        t = x0.t + np.array(poses.at)
        move_gesture = _gesture_through(file, table, move_offsets, _keys_of_moves(file, prefix))
        q_K_of_moves = move_gesture.inputs(x0).evaluate(t)[0]
    for i in range(len(poses.at)):
        start_of_search = x0
        if q_K_of_moves is not None:
            start_of_search = puppet.rest(puppet.state().replace(q_K=q_K_of_moves[i]))

        def pose_at(share: float, i: int = i, start: State = start_of_search) -> ReachedPose:
            targets = {
                key: rest_position + share * offsets[key][i]
                for key, rest_position in rest_positions.items()
            }
            return reach(puppet, targets, start, bounds=Bounds(held=held_names))[0]

        try:
            reached = pose_at(1.0)
            if not reached:
                text = _unreached_text(reached, pose_at)
                mistakes.add(("poses", "at", i), f"at {poses.at[i]:g} s: {text}")
        except StateError as error:
            raise file.located.error([(("poses", "at", i), str(error))], FileError) from None
        difference = puppet.difference(x0.q_K, reached.state.q_K, driven=True)
        for name, v in moves.scalar_indices(table).items():
            if name in pose_offsets:
                pose_offsets[name][1][i] = difference[v]
    mistakes.raise_if_any()
    return pose_offsets


def _unreached_text(reached: ReachedPose, pose_at: Callable[[float], ReachedPose]) -> str:
    """Reason why a key pose cannot be reached, and the part of it that can."""
    point, distance = max(reached.distances.items(), key=lambda item: item[1])
    text = f"{point} comes no nearer to its place than {100.0 * distance:.1f} cm"
    percent = reachable_part(lambda k: bool(pose_at(k / 100.0)), 100)
    return text if percent is None else f"{text}; {percent} % of the way there can be reached"
