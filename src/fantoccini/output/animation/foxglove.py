"""Writer of MCAP files (.mcap) for Foxglove, and in part for Rerun; z up, metres.

Each frame has the poses of the bodies relative to their parents (``/tf``), the strings
(``/strings``), the coordinates (``/joints``), the tensions [N] (``/tension``), and 1 where the
motion does not determine a tension or effort (``/undetermined``). Shapes are written once,
in the bodies' frames (``/bodies``). Messages are in Protocol Buffers, with their schemas.

q_D and q_K are the dynamic and driven coordinates, v and acc their velocities and accelerations. An
effort is the force of the hand on a driven coordinate. A link is a body on its joint. A solid is a
shape of a body or an obstacle.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointState_pb2 import JointState
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion as QuaternionMessage
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap_protobuf.writer import Writer

from fantoccini.base import Array, Quaternion, Status, rotation
from fantoccini.model.tree import WORLD
from fantoccini.motion import Trajectory
from fantoccini.output.animation.pieces import Piece, floor_piece, named_solids, solid_piece
from fantoccini.output.animation.scene import AnimatedScene, Line
from fantoccini.output.animation.spans import Spans, StringSamples
from fantoccini.output.animation.strands import RINGS_PER_SPAN, STRING_COLOUR, STRING_RADIUS
from fantoccini.output.view import LIGHT

ROOT_FRAME = "world"
"""Name of the fixed frame."""

FrameMessage = Callable[[int, Timestamp], Any]
"""Function that returns the message of a frame, given its number and time."""


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes a scene. Times count from the start of 1970, the zero of such messages.

    A run that begins before 0 is shifted to begin at 0: messages have no times before 1970.
    """
    assert scene.fps is not None
    run = scene.run.resample(scene.frames(scene.fps))
    with path.open("wb") as file, Writer(file) as writer:
        metadata = {"name": scene.tree.name}
        if scene.run.status is not Status.DONE:
            metadata["stopped"] = scene.run.status.message
        writer.add_metadata("fantoccini", metadata)
        topics = dict(_topics(scene, run))
        for k, t in enumerate(run.t - min(0.0, float(run.t[0]))):
            nanoseconds = round(float(t) * 1e9)
            stamp = Timestamp(seconds=nanoseconds // 10**9, nanos=nanoseconds % 10**9)
            if k == 0:
                writer.write_message("/bodies", _bodies(scene, stamp), nanoseconds, nanoseconds)
            for topic, message in topics.items():
                writer.write_message(topic, message(k, stamp), nanoseconds, nanoseconds)


def _topics(scene: AnimatedScene, run: Trajectory) -> Iterator[tuple[str, FrameMessage]]:
    yield "/tf", _transforms(scene, run)
    if scene.lines:
        yield "/strings", _strings(scene, run)
    joints = _joints(run)
    if joints is not None:
        yield "/joints", joints
    names = [line.name for line in scene.lines if line.string is not None]
    if names:
        columns = dict(run.tension.items())
        yield "/tension", _number_message("Tension", {name: columns[name] for name in names})
        flags = run.undetermined
        if flags is not None and np.any(flags.values):
            undetermined_names = [n for n in flags.names if n in names or n not in columns]
            undetermined = {name: flags[name].astype(float) for name in undetermined_names}
            yield "/undetermined", _number_message("Undetermined", undetermined)


def _transforms(scene: AnimatedScene, run: Trajectory) -> FrameMessage:
    """Message with the frames of all links, each relative to its parent's."""
    frames = []
    for k in scene.links:
        motion, parent = scene.motion(k, run), scene.parents[k]
        parent_name = ROOT_FRAME if parent == WORLD else scene.tree.links[parent].name
        frames.append(
            (scene.tree.links[k].name, parent_name, motion.r, rotation.continuous(motion.q))
        )

    def message(i: int, stamp: Timestamp) -> Any:
        return FrameTransforms(
            transforms=[
                FrameTransform(
                    timestamp=stamp,
                    parent_frame_id=parent_name,
                    child_frame_id=name,
                    translation=_vector(r[i]),
                    rotation=_quaternion(q[i]),
                )
                for name, parent_name, r, q in frames
            ]
        )

    return message


def _bodies(scene: AnimatedScene, stamp: Timestamp) -> Any:
    """Message with all shapes, each fixed in a link's frame."""
    shapes: dict[int, list[Any]] = {}
    for _, solid in named_solids(scene):
        shapes.setdefault(solid.link, []).append(_triangles(solid_piece(solid), solid.colour))
    if scene.geometry.ground and scene.complete:
        shapes.setdefault(WORLD, []).append(_triangles(floor_piece(scene), LIGHT.lower_background))
    entities = []
    for link, triangles in shapes.items():
        name = ROOT_FRAME if link == WORLD else scene.tree.links[link].name
        entities.append(
            SceneEntity(
                timestamp=stamp, frame_id=name, id=name, frame_locked=True, triangles=triangles
            )
        )
    return SceneUpdate(entities=entities)


def _triangles(piece: Piece, colour: Array) -> Any:
    return TriangleListPrimitive(
        pose=Pose(position=_vector(piece.r), orientation=_quaternion(piece.q)),
        points=_points(piece.surface.vertices * piece.scale),
        indices=piece.surface.faces.ravel().tolist(),
        color=_colour(colour),
    )


def _strings(scene: AnimatedScene, run: Trajectory) -> FrameMessage:
    """Message with the strings as curves in the world frame."""
    samples = StringSamples.from_run(scene, run, run.t, np.arange(len(run)))
    curves = [(line, _curve(Spans.of_line(scene, line, samples))) for line in scene.lines]
    width = 2.0 * STRING_RADIUS * scene.geometry.size

    def line_strip(line: Line, points: Array) -> Any:
        return LinePrimitive(
            type=LinePrimitive.LINE_STRIP,
            thickness=width,
            points=_points(points),
            color=_colour(STRING_COLOUR if line.colour is None else line.colour),
            pose=Pose(position=_vector(np.zeros(3)), orientation=_quaternion(np.eye(4)[0])),
        )

    def message(i: int, stamp: Timestamp) -> Any:
        return SceneUpdate(
            entities=[
                SceneEntity(
                    timestamp=stamp,
                    frame_id=ROOT_FRAME,
                    id=line.name,
                    lines=[line_strip(line, x[i])],
                )
                for line, x in curves
            ]
        )

    return message


def _curve(spans: Spans) -> Array:
    """(T, n, 3) points along a line, without duplicates where spans meet."""
    points = spans.curves(2 if spans.slack_length is None else RINGS_PER_SPAN)
    first_point, other_points = points[:, 0, :1], points[:, :, 1:]
    return np.concatenate([first_point, other_points.reshape(len(points), -1, 3)], axis=1)


def _joints(run: Trajectory) -> FrameMessage | None:
    """Message with coordinates, velocities and accelerations, and efforts of driven coordinates."""
    coordinates = run.coordinates
    efforts = {} if run.effort is None else dict(run.effort.items())
    columns = [
        *(
            (coordinates.q_D[q], run.q_D[:, q], run.v_D[:, v], run.acc_D[:, v], None)
            for q, v in coordinates.scalars_D
        ),
        *(
            (
                coordinates.q_K[q],
                run.q_K[:, q],
                run.v_K[:, v],
                run.acc_K[:, v],
                efforts.get(coordinates.v_K[v]),
            )
            for q, v in coordinates.scalars_K
        ),
    ]
    if not columns:
        return None

    def message(i: int, stamp: Timestamp) -> Any:
        return JointStates(
            timestamp=stamp,
            joints=[
                JointState(
                    name=name,
                    position=p[i],
                    velocity=v[i],
                    acceleration=a[i],
                    effort=None if effort is None else effort[i],
                )
                for name, p, v, a, effort in columns
            ],
        )

    return message


def _number_message(message_name: str, columns: dict[str, Array]) -> FrameMessage:
    """Message with the time and a field for each column."""
    file_descriptor = descriptor_pb2.FileDescriptorProto(
        name=f"puppet/{message_name}.proto",
        package="puppet",
        syntax="proto3",
        dependency=["google/protobuf/timestamp.proto"],
    )
    field = descriptor_pb2.FieldDescriptorProto
    descriptor = file_descriptor.message_type.add(name=message_name)
    descriptor.field.add(
        name="timestamp",
        number=1,
        type=field.TYPE_MESSAGE,
        label=field.LABEL_OPTIONAL,
        type_name=".google.protobuf.Timestamp",
    )
    fields = dict(zip(identifiers(columns), columns.values(), strict=True))
    for number, name in enumerate(fields, 2):
        descriptor.field.add(
            name=name, number=number, type=field.TYPE_DOUBLE, label=field.LABEL_OPTIONAL
        )
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(Timestamp.DESCRIPTOR.file.serialized_pb)
    pool.Add(file_descriptor)
    message_class = message_factory.GetMessageClass(
        pool.FindMessageTypeByName(f"puppet.{message_name}")
    )

    def message(i: int, stamp: Timestamp) -> Any:
        values = {name: float(x[i]) for name, x in fields.items()}
        numbers = message_class(**values)
        numbers.timestamp.seconds, numbers.timestamp.nanos = stamp.seconds, stamp.nanos
        return numbers

    return message


def identifiers(names: Iterable[str]) -> list[str]:
    """Valid, distinct field names, made of letters, digits and _, for any names."""
    fields: list[str] = []
    for name in names:
        field = re.sub(r"\W", "_", name, flags=re.ASCII)
        field = f"_{field}" if field[:1].isdigit() else field
        while field in ("timestamp", *fields):
            field += "_"
        fields.append(field)
    return fields


def _vector(x: Array) -> Any:
    return Vector3(x=x[0], y=x[1], z=x[2])


def _points(points: Array) -> list[Any]:
    return [Point3(x=x, y=y, z=z) for x, y, z in points.tolist()]


def _quaternion(q: Quaternion) -> Any:
    return QuaternionMessage(w=q[0], x=q[1], y=q[2], z=q[3])


def _colour(colour: Array) -> Any:
    return Color(r=colour[0], g=colour[1], b=colour[2], a=1.0)
