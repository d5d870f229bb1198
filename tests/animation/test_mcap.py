"""MCAP, read by its own library with the schemas in the file, compared with the table."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import trimesh
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from scipy.spatial.transform import Rotation
from tests.animation.test_bvh import BODIES
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.output.animation import formats

pytestmark = pytest.mark.medium

TOPICS = {
    "/tf": "foxglove.FrameTransforms",
    "/bodies": "foxglove.SceneUpdate",
    "/strings": "foxglove.SceneUpdate",
    "/joints": "foxglove.JointStates",
    "/tension": "puppet.Tension",
    "/undetermined": "puppet.Undetermined",
}


def messages(path: Path) -> dict[str, list[tuple[float, Any]]]:
    """Times [s] and messages of every topic; the messages' classes come from the file's schemas."""
    series: dict[str, list[tuple[float, Any]]] = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.encoding == channel.message_encoding == "protobuf"
            assert schema.name == TOPICS[channel.topic]
            assert message.log_time == message.publish_time
            series[channel.topic].append((1e-9 * message.log_time, decoded))
    return series


def xyz(x: Any) -> list[float]:
    return [x.x, x.y, x.z]


def poses(message: Any) -> dict[str, tuple[np.ndarray, Rotation]]:
    """Places and orientations of all frames in the world, composed as a viewer does."""
    own = {
        tf.child_frame_id: (
            tf.parent_frame_id,
            np.array(xyz(tf.translation)),
            Rotation.from_quat([*xyz(tf.rotation), tf.rotation.w]),
        )
        for tf in message.transforms
    }
    out = {}
    for name in own:
        r, turn, above = np.zeros(3), Rotation.identity(), name
        while above != "world":
            above, translation, rotation = own[above]
            r, turn = translation + rotation.apply(r), rotation * turn
        out[name] = (r, turn)
    return out


@pytest.fixture(scope="module")
def files(greeting: fan.Trajectory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mcap")
    fan.export(greeting, folder / "greeting.mcap", fps=30)
    fan.export(greeting, folder / "greeting.csv", fps=30, bodies="all")
    return folder


@pytest.fixture(scope="module")
def read(files: Path) -> dict[str, list[tuple[float, Any]]]:
    return messages(files / "greeting.mcap")


@pytest.fixture(scope="module")
def table(files: Path) -> pd.DataFrame:
    return pd.read_csv(files / "greeting.csv", dtype=str).astype(float)


def test_every_topic_has_a_message_at_every_frame(
    read: dict[str, list[tuple[float, Any]]], table: pd.DataFrame
) -> None:
    assert set(read) == set(TOPICS) - {"/undetermined"}
    assert [t for t, _ in read["/bodies"]] == [0.0]
    for topic in set(TOPICS) - {"/bodies", "/undetermined"}:
        own = read[topic]
        t = np.array([t for t, _ in own])
        assert np.abs(t - table["t"]).max() < 1e-9, topic
    for t, message in [*read["/joints"], *read["/tension"]]:
        assert message.timestamp.seconds + 1e-9 * message.timestamp.nanos == pytest.approx(t)


def test_frames_are_where_the_bodies_are(
    read: dict[str, list[tuple[float, Any]]], table: pd.DataFrame
) -> None:
    for k, (_, message) in enumerate(read["/tf"]):
        frames = poses(message)
        assert set(frames) >= BODIES
        for name in BODIES:
            r, turn = frames[name]
            row = table.iloc[k]
            assert np.abs(r - [row[f"pose:{name}.{x}"] for x in "xyz"]).max() < 1e-12
            q = Rotation.from_quat([row[f"pose:{name}.q{x}"] for x in "xyzw"])
            assert (turn * q.inv()).magnitude() < 1e-12


def test_strings_end_where_they_are_held_and_sag_by_their_slack(
    greeting: fan.Trajectory, read: dict[str, list[tuple[float, Any]]], table: pd.DataFrame
) -> None:
    run = greeting.resample(table["t"].to_numpy())
    sagged = 0
    for k, (_, message) in enumerate(read["/strings"]):
        assert {entity.id for entity in message.entities} == set(run.taut)
        for entity in message.entities:
            (line,) = entity.lines
            points = np.array([xyz(p) for p in line.points])
            for which, point in (("start", points[0]), ("end", points[-1])):
                wanted = [table[f"{which}:{entity.id}.{x}"][k] for x in "xyz"]
                assert np.abs(point - wanted).max() < 1e-9
            taut = bool(run.taut[entity.id][k])
            straight = np.linalg.norm(points[-1] - points[0])
            along = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
            if taut:
                assert along == pytest.approx(straight, abs=1e-9)
            else:
                sagged += along > straight + 1e-3
            assert entity.frame_id == "world" and line.thickness > 0.0
    assert sagged > 10


def test_numbers_are_those_of_the_table(
    read: dict[str, list[tuple[float, Any]]], table: pd.DataFrame
) -> None:
    names = {joint.name for joint in read["/joints"][0][1].joints}
    assert {"elbow_left", "hand_left.length", "torso.x"} <= names
    for k, (_, message) in enumerate(read["/joints"]):
        row = table.iloc[k]
        for joint in message.joints:
            assert joint.position == row[joint.name]
            assert joint.velocity == row[f"v:{joint.name}"]
            assert joint.acceleration == row[f"acc:{joint.name}"]
            effort = f"effort:{joint.name}"
            assert joint.HasField("effort") == (effort in table)
            if effort in table:
                assert joint.effort == row[effort]
    for k, (_, message) in enumerate(read["/tension"]):
        own = {f.name for f in message.DESCRIPTOR.fields} - {"timestamp"}
        assert own == {name[8:] for name in table if name.startswith("tension:")}
        for name in own:
            assert getattr(message, name) == table[f"tension:{name}"][k]


def test_shapes_are_those_of_the_glb(
    greeting: fan.Trajectory, greeting_glb: Path, read: dict[str, list[tuple[float, Any]]]
) -> None:
    """The file is in single precision: 1e-6 m."""
    scene = trimesh.load(greeting_glb)
    ((_, message),) = read["/bodies"]
    frames = {name for _, m in read["/tf"][:1] for name in poses(m)} | {"world"}
    entities = {entity.id: entity for entity in message.entities}
    assert set(entities) <= frames and set(entities) >= BODIES
    compared = 0
    for name, entity in entities.items():
        assert entity.frame_locked and entity.frame_id == name
        for number, piece in enumerate(entity.triangles, 1):
            node = f"{name}_shape{number}"
            if node not in scene.graph.nodes_geometry:
                assert name == "world"
                continue
            # From the body's node, because trimesh uses the root's frame.
            transform, geometry = scene.graph.get(node, frame_from=name)
            mesh = scene.geometry[geometry]
            wanted = trimesh.transform_points(mesh.vertices, transform)
            pose = piece.pose
            turn = Rotation.from_quat([*xyz(pose.orientation), pose.orientation.w])
            points = turn.apply([xyz(p) for p in piece.points]) + xyz(pose.position)
            faces = np.array(piece.indices).reshape(-1, 3)
            own = trimesh.Trimesh(points, faces, process=False)
            assert np.abs(own.bounds - [wanted.min(axis=0), wanted.max(axis=0)]).max() < 1e-6
            assert own.area == pytest.approx(mesh.copy().apply_transform(transform).area, rel=1e-4)
            assert own.volume > 0.0
            compared += 1
    assert compared >= len(BODIES)


def test_tensions_that_the_motion_does_not_determine_are_marked(
    greeting: fan.Trajectory, tmp_path: Path
) -> None:
    """The mark is 1 for that string and time; a run without such times has no topic."""
    flags = np.array(greeting.undetermined.values)
    assert not np.any(flags)
    later = greeting.t >= 4.9  # frames are at 4.8 and 5.0
    flags[later, greeting.undetermined.names.index("hand_left")] = True
    marked = dataclasses.replace(greeting, undetermined=greeting.undetermined.like(flags))
    read = messages(fan.export(marked, tmp_path / "marked.mcap", fps=5))
    for t, message in read["/undetermined"]:
        assert message.hand_left == (t > 4.9) and message.head == 0.0


def test_only_named_bodies_have_frames(greeting: fan.Trajectory, tmp_path: Path) -> None:
    read = messages(fan.export(greeting, tmp_path / "skull.mcap", fps=5, bodies=["skull"]))
    assert set(poses(read["/tf"][0][1])) == {"skull", "head.end"}  # and the end of its string
    assert {e.id for e in read["/bodies"][0][1].entities} & BODIES == {"skull"}
    assert [e.id for e in read["/strings"][0][1].entities] == ["head"]
    fields = [f.name for f in read["/tension"][0][1].DESCRIPTOR.fields]
    assert fields == ["timestamp", "head"]


def test_a_run_that_starts_late_and_one_that_stopped(
    thrown: fan.Trajectory, tmp_path: Path
) -> None:
    late = thrown.resample(np.linspace(0.5, 1.23, 60))
    read = messages(fan.export(late, tmp_path / "late.mcap", fps=10))
    assert [t for t, _ in read["/tf"]] == pytest.approx(0.5 + np.arange(8) / 10)
    arm = fan.puppets.arm2d()
    pull = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (2.0, 0.05)]})
    run = fan.simulate(arm, arm.rest({"hand.length": 0.8}), pull, 2.0, throw=False)
    with fan.export(run, tmp_path / "stopped.mcap").open("rb") as file:
        (record,) = make_reader(file).iter_metadata()
    assert record.metadata == {"name": "arm2d", "stopped": run.status.message}


def test_names_of_strings_become_fields() -> None:
    from fantoccini.output.animation.foxglove import identifiers

    names = ["pierrot.hand", "pierrot_hand", "2nd", "timestamp", "Ünder"]
    assert identifiers(names) == ["pierrot_hand", "pierrot_hand_", "_2nd", "timestamp_", "_nder"]


def test_a_missing_library_is_named(
    thrown: fan.Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    with pytest.raises(fan.errors.MissingLibraryError, match=r"fantoccini\[mcap\]"):
        fan.export(thrown, tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_writes_the_same(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.2)
    run.save(tmp_path / "run.npz")
    assert fantoccini("export", tmp_path / "run.npz", tmp_path / "a.mcap").exit_code == 0
    path = fan.export(run, tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == path.read_bytes()
    assert len(messages(path)["/tf"]) == 13


def test_a_run_that_begins_before_0_begins_with_the_clock(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    moves = {"hand.length": [(-0.5, 0.8), (0.2, 0.7)]}
    inputs = fan.Input.waypoints(arm, moves)
    x0 = dataclasses.replace(arm.rest({"hand.length": 0.8}), t=-0.5)
    run = fan.simulate(arm, x0, inputs, 0.1)
    fan.export(run, tmp_path / "early.mcap", fps=10)
    joint_messages = messages(tmp_path / "early.mcap")["/joints"]
    np.testing.assert_allclose([t for t, _ in joint_messages], np.arange(7) / 10, atol=1e-9)
    lengths = [
        joint.position
        for _, message in joint_messages
        for joint in message.joints
        if joint.name == "hand.length"
    ]
    column = run.coordinates.q_K.index("hand.length")
    at = run.resample(np.arange(7) / 10 - 0.5)
    np.testing.assert_allclose(lengths, at.q_K[:, column], atol=1e-9)
    assert joint_messages[0][1].timestamp.seconds == joint_messages[0][1].timestamp.nanos == 0
