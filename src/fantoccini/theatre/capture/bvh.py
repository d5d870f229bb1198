"""Reader of BVH files: a skeleton, and its channels frame by frame. Mistakes have their lines.

    R_i = R_parent R_1 R_2 R_3,   p_i = p_parent + R_parent (o_i or its position channels)

with the rotations of a joint's channels in the order in which the file lists them.

A channel is one number of a joint in every frame: a coordinate of its position, or an angle about
an axis. o_i is the offset of a joint from its parent, in the parent's axes; R_i and p_i are its
orientation and position.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from fantoccini.base import Array, FileError, Mistake, decoded, lines_of
from fantoccini.base.documents import shown
from fantoccini.theatre.capture.clip_files import clip_path
from fantoccini.theatre.capture.skeleton import Capture, Skeleton

_AXIS_INDICES = {"x": 0, "y": 1, "z": 2}
_CHANNEL_KINDS = {
    f"{axis}{kind}": (kind, k)
    for axis, k in _AXIS_INDICES.items()
    for kind in ("position", "rotation")
}
_BRACE_PATTERN = re.compile(r"(?<![^\x00-\x7f])([{}])")
"""Braces, except after a byte of another encoding, where they are half of a character."""
_HEADER_LABEL = re.compile(r"\s*(frames|frame\s+time)\s*:", re.IGNORECASE)
"""Label of the motion's header, with or without blanks around its colon."""
_PADDING = "\0\x1a"
"""Characters that some programs write after the end of a text."""
_BLANK_PATTERN = re.compile(r"[ \t\f\v]+")
_MAX_BYTES = 256_000_000
"""Largest size of a file [bytes]."""
_MAX_JOINTS = 1000
"""Largest number of joints."""
_MAX_DEPTH = 200
"""Largest depth of the hierarchy of joints."""
_MAX_FRAMES = 10_000_000
"""Largest number of frames."""
_MAX_RELATIVE_POSITION = 0.05
"""Mean of positions, relative to that of offsets, below which positions are relative to offsets."""
_MIN_FRAME_TIME = 1e-5
"""Least duration of a frame [s]."""


@dataclass
class _Joint:
    """A joint under construction, with the columns of its channels in a frame."""

    name: str
    parent: int
    offset: tuple[float, ...] = (0.0, 0.0, 0.0)
    channels: list[tuple[str, int, int]] = field(default_factory=list)  # kind, axis, column


def load_bvh(path: str | os.PathLike[str]) -> Capture:
    """Capture of a BVH file in its unit and axes; :meth:`Capture.upright` gives metres and z up.

    Position channels may belong to any joint, whose offset they replace; channels may have any
    order. Angles are in degrees, as the format says. A file may have one frame less or more than
    its header says; :attr:`Capture.notes` then reports it. With a single frame, the frame time is
    ignored and may be 0.

    Args:
        path: path of the file, or the name of a bundled clip (``jumps``).

    Raises:
        FileError: the file has a mistake; only the first one is reported, with its line.
    """
    path = clip_path(path)
    try:
        if path.stat().st_size > _MAX_BYTES:
            _fail(path, None, f"has more than {_MAX_BYTES / 1e6:.0f} MB")
        text = decoded(path.read_bytes())
    except (OSError, ValueError) as error:
        _fail(path, None, f"cannot be read: {getattr(error, 'strerror', None) or error}")
    words = _WordReader(path, text)
    joints, n_channels = _hierarchy(words)
    n_frames, frame_time = _motion_header(words)
    header_line = words.line
    channels = words.numbers(n_frames, n_channels)
    if not len(channels):
        channels = _rest_pose_channels(joints, n_channels)
    if len(channels) > 1 and not frame_time >= _MIN_FRAME_TIME:
        text = f"found a frame time of {frame_time:g} s; needed: at least {_MIN_FRAME_TIME:g} s"
        _fail(path, header_line, text)
    return _capture(path, joints, channels, frame_time, tuple(words.notes))


class _WordReader:
    """Words of a file, with their lines.

    Attributes:
        notes: differences between the number of frames and the header.
    """

    def __init__(self, path: Path, text: str):
        self.path, self._lines, self._size = path, lines_of(text.rstrip(_PADDING)), len(text)
        self.line, self._row, self.notes = 0, list[str](), list[str]()
        self._rows = self._read_rows()

    def _read_rows(self) -> Iterator[list[str]]:
        for number, line in enumerate(self._lines, 1):
            self.line = number
            line = _HEADER_LABEL.sub(r"\1: ", line, count=1) if ":" in line else line
            if row := [
                word for word in _BLANK_PATTERN.split(_BRACE_PATTERN.sub(r" \1 ", line)) if word
            ]:
                yield row

    def next_word(self, needed: str) -> str:
        """Next word.

        Args:
            needed: description of the word, for the message.
        """
        if not self._row:
            self._row = next(self._rows, [])
            if not self._row:
                self.fail(f"the file ends; needed: {needed}")
        return self._row.pop(0)

    def read_until_brace(self) -> list[str]:
        """Remaining words of the line before an opening brace."""
        brace_index = self._row.index("{") if "{" in self._row else len(self._row)
        words, self._row = self._row[:brace_index], self._row[brace_index:]
        return words

    def next_is_brace(self) -> bool:
        """Whether the next word is an opening brace."""
        if not self._row:
            self._row = next(self._rows, [])
        return self._row[:1] == ["{"]

    def expect_word(self, *words: str) -> str:
        """Next word in lower case, if it is one of these."""
        word = self.next_word(" or ".join(words))
        if word.lower() not in [word.lower() for word in words]:
            self.fail(f"found {shown(word)}; needed: {' or '.join(words)}")
        return word.lower()

    def number(self, needed: str) -> float:
        """Next word as a finite number; ``needed`` describes it in the message."""
        word = self.next_word(needed)
        try:
            value = float(word)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            self.fail(f"found {shown(word)}; needed: {needed}")
        return value

    def numbers(self, n_frames: int, n_columns: int) -> Array:
        """(rows, columns) remaining numbers; each row is a frame, which begins on a new line."""
        if self._row:
            self.fail(f"found {shown(' '.join(self._row))}; needed: a new line with numbers")
        if n_frames * n_columns > self._size:
            self.fail(f"the file is too short for {n_frames} frames of {n_columns} numbers")
        values = np.empty((n_frames + 1, n_columns))
        for frame in range(n_frames + 1):
            words = self._next_frame(n_columns)
            if not words:
                n_frames = self._checked_frame_count(frame, n_frames)
                break
            try:
                values[frame] = [float(word) for word in words]
            except ValueError:
                self.fail(f"found {shown(' '.join(words))}; needed: {n_columns} numbers")
            if not np.all(np.isfinite(values[frame])):
                self.fail("found a number that is not finite")
        else:
            if next(self._rows, []):
                self.fail(f"more than {n_frames + 1} frames; its header says {n_frames}")
            n_frames = self._checked_frame_count(n_frames + 1, n_frames)
        return values[:n_frames]

    def _next_frame(self, columns: int) -> list[str]:
        """Words of the next frame, from one line or several; empty at the end of the file."""
        row = next(self._rows, [])
        first_line, n_words = self.line, len(row)
        while 0 < len(row) < columns and (next_row := next(self._rows, [])):
            row = row + next_row
        if row and len(row) != columns:
            self.line = first_line
            noun = "number" if n_words == 1 else "numbers"
            self.fail(
                f"found {n_words} {noun}; needed: {columns}, one for each channel, in a line or in "
                "several that hold nothing else"
            )
        return row

    def _checked_frame_count(self, n_frames: int, n_header: int) -> int:
        """Number of frames in the file, which may differ by one from that of its header."""
        if n_frames < n_header - 1 or (not n_frames and n_header):
            text = f"the file ends after {n_frames} frames; needed: {n_header}, as its header says"
            self.fail(text)
        if n_frames != n_header:
            self.notes.append(f"{self.path}: has {n_frames} frames; its header says {n_header}")
        if not n_frames:
            self.notes.append(f"{self.path}: has no frames; read as one pose with all angles 0")
        return n_frames

    def fail(self, text: str) -> NoReturn:
        """Raises FileError at the current line."""
        _fail(self.path, self.line or None, text)


def _hierarchy(words: _WordReader) -> tuple[list[_Joint], int]:
    """Joints of a file, parents first, and the number of their channels."""
    words.expect_word("HIERARCHY")
    joints: list[_Joint] = []
    columns = 0
    word = words.expect_word("ROOT")
    while word == "root":
        columns = _joint(words, joints, -1, columns)
        word = words.expect_word("ROOT", "MOTION")
    return joints, columns


def _joint(words: _WordReader, joints: list[_Joint], parent: int, columns: int) -> int:
    """Reads a joint and its descendants, without recursion; returns the columns so far."""
    open_joints = [_add_joint(words, joints, parent)]
    while open_joints:
        i = open_joints[-1]
        word = words.expect_word("OFFSET", "CHANNELS", "JOINT", "END", "}")
        if word == "offset":
            joints[i].offset = tuple(words.number("three numbers of an offset") for _ in range(3))
        elif word == "channels":
            columns = _channels(words, joints[i], columns)
        elif word == "joint":
            if len(open_joints) >= _MAX_DEPTH:
                words.fail(f"joints are more than {_MAX_DEPTH} deep")
            open_joints.append(_add_joint(words, joints, i))
        elif word == "end":
            words.expect_word("SITE")
            words.read_until_brace()
            words.expect_word("{")
            words.expect_word("OFFSET")
            offset = tuple(words.number("three numbers of an offset") for _ in range(3))
            words.expect_word("}")
            joints.append(_Joint(f"{joints[i].name}.end", i, offset))
        else:
            open_joints.pop()
    return columns


def _add_joint(words: _WordReader, joints: list[_Joint], parent: int) -> int:
    """Adds a joint, named by the rest of the line; returns its index."""
    name = " ".join([words.next_word("the joint's name"), *words.read_until_brace()])
    # A brace after a byte of another encoding opens the joint unless another one follows.
    has_brace = name.endswith("{") and not words.next_is_brace()
    name = name.removesuffix("{") if has_brace else name
    if not name or name == "{":
        words.fail("found a joint without a name; needed: JOINT or ROOT, a name and {")
    if name in [joint.name for joint in joints]:
        words.fail(f"found a second joint {shown(name)}")
    if len(joints) >= _MAX_JOINTS:
        words.fail(f"found more than {_MAX_JOINTS} joints")
    joints.append(_Joint(name, parent))
    if not has_brace:
        words.expect_word("{")
    return len(joints) - 1


def _channels(words: _WordReader, joint: _Joint, columns: int) -> int:
    """Reads the channels of a joint; returns the number of columns so far."""
    n_channels = words.number("the number of channels")
    if joint.channels or n_channels != int(n_channels) or not 0 <= n_channels <= 6:
        words.fail(f"found {n_channels:g} channels; needed: 0 to 6, once a joint")
    for _ in range(int(n_channels)):
        channel = words.next_word("a channel: Xposition to Zrotation")
        if channel.lower() not in _CHANNEL_KINDS:
            words.fail(f"found {shown(channel)}; needed: a channel, Xposition to Zrotation")
        kind, axis = _CHANNEL_KINDS[channel.lower()]
        if (kind, axis) in [channel_key[:2] for channel_key in joint.channels]:
            words.fail(f"found {channel} twice")
        joint.channels.append((kind, axis, columns))
        columns += 1
    return columns


def _motion_header(words: _WordReader) -> tuple[int, float]:
    """Number of frames, and duration of a frame [s]."""
    words.expect_word("Frames:")
    n_frames = words.number("the number of frames")
    if n_frames != int(n_frames) or not 0 <= n_frames <= _MAX_FRAMES:
        words.fail(f"found {n_frames:g} frames; needed: a whole number of at least 0")
    words.expect_word("Frame")
    words.expect_word("Time:")
    frame_time = words.number("the time of a frame [s]")
    return int(n_frames), frame_time


def _rest_pose_channels(joints: list[_Joint], n_channels: int) -> Array:
    """(1, n_channels) channels of the pose with all angles 0."""
    channels = np.zeros((1, n_channels))
    for joint in joints:
        for kind, axis, column in joint.channels:
            if kind == "position":
                channels[0, column] = joint.offset[axis]
    return channels


def _capture(
    path: Path, joints: list[_Joint], channels: Array, interval: float, notes: tuple[str, ...]
) -> Capture:
    """Capture with the poses of all frames, from channels (T, n_channels)."""
    n_frames, n_joints = len(channels), len(joints)
    channels, are_relative = _with_offsets(joints, channels)
    if are_relative:
        notes += (f"{path}: positions of joints are near 0; taken as relative to their offsets",)
    positions, rotations = np.zeros((n_frames, n_joints, 3)), np.empty((n_frames, n_joints, 3, 3))
    for i, joint in enumerate(joints):
        local_positions = np.tile(joint.offset, (n_frames, 1)).astype(float)
        rotation = np.broadcast_to(np.eye(3), (n_frames, 3, 3))
        for kind, axis, column in joint.channels:
            if kind == "position":
                local_positions[:, axis] = channels[:, column]
            else:
                rotation = rotation @ _axis_rotations(axis, np.radians(channels[:, column]))
        if joint.parent < 0:
            positions[:, i], rotations[:, i] = local_positions, rotation
            continue
        parent_rotation = rotations[:, joint.parent]
        offset = np.einsum("tij,tj->ti", parent_rotation, local_positions)
        positions[:, i] = positions[:, joint.parent] + offset
        rotations[:, i] = parent_rotation @ rotation
    skeleton = Skeleton(
        tuple(joint.name for joint in joints),
        tuple(joint.parent for joint in joints),
        np.array([joint.offset for joint in joints], dtype=float),
    )
    times = interval * np.arange(n_frames, dtype=float)
    return Capture(skeleton, times, positions, rotations, path.stem, notes)


def _with_offsets(joints: list[_Joint], channels: Array) -> tuple[Array, bool]:
    """Channels whose positions include the offsets, if they are relative to these in the file.

    Poses of MakeHuman are such files; without the offsets all joints would lie at one point.

    Returns:
        (T, n_channels) channels, and whether they are increased.
    """
    columns = [
        (column, joint.offset[axis])
        for joint in joints
        if joint.parent >= 0
        for kind, axis, column in joint.channels
        if kind == "position"
    ]
    position_columns, offsets = (
        [column for column, _ in columns],
        np.array([offset for _, offset in columns]),
    )
    if not columns or not np.mean(
        np.abs(channels[:, position_columns])
    ) < _MAX_RELATIVE_POSITION * np.mean(np.abs(offsets)):
        return channels, False
    channels = channels.copy()
    channels[:, position_columns] += offsets
    return channels, True


def _axis_rotations(axis: int, angle: Array) -> Array:
    """(T, 3, 3) rotations about a coordinate axis."""
    matrices = np.zeros((len(angle), 3, 3))
    next_axis, last_axis = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(angle), np.sin(angle)
    matrices[:, axis, axis] = 1.0
    (
        matrices[:, next_axis, next_axis],
        matrices[:, next_axis, last_axis],
        matrices[:, last_axis, next_axis],
        matrices[:, last_axis, last_axis],
    ) = c, -s, s, c
    return matrices


def _fail(path: Path, line: int | None, text: str) -> NoReturn:
    raise FileError([Mistake(str(path), line, "", text)])
