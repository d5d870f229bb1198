"""Spans of a line over time: their directions, frames and sag.

A line is a string, chain or spring, and a span its part between two points of its path. Slip is the
length that a winch has let out; q_D and q_K are the dynamic and driven coordinates. Slip is the
length of string that a winch lets out at its largest tension. A taut string pulls, a slack one does
not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, Quaternion, Times, rotation
from fantoccini.model.tree import WORLD
from fantoccini.motion import Trajectory
from fantoccini.output.animation.grid import Grid
from fantoccini.output.animation.scene import AnimatedScene, Line
from fantoccini.output.view import rope

_SAMPLE_RATE = 60.0
"""Evenly spaced samples of the strings per second, besides those at catches and releases."""


@dataclass(frozen=True, eq=False)
class StringSamples:
    """State of the strings and their links at chosen samples.

    Attributes:
        t: (T,) times of the samples [s].
        poses: (T, n_links, 3, 4) poses of the links.
        orientations: (T, 4) orientations of the links, by index.
        lengths, taut: (T, n_strings) lengths of the strings [m], and whether they are taut.
        floor: height below which no string sags [m]; minus infinity without a floor.
    """

    t: Times
    poses: Array
    orientations: dict[int, Quaternion]
    lengths: Array
    taut: Array
    floor: float

    @classmethod
    def at_even_times(cls, scene: AnimatedScene, grid: Grid) -> StringSamples:
        """Evenly spaced samples, and those around every change between slack and taut."""
        taut, last = grid.run.taut.values, len(grid.t) - 1
        even_samples = np.searchsorted(grid.t, np.arange(0.0, grid.t[-1], 1.0 / _SAMPLE_RATE))
        changes = np.flatnonzero(np.any(taut[1:] != taut[:-1], axis=1))
        samples = np.unique(np.clip([*even_samples, *changes, *(changes + 1), last], 0, last))
        return cls.from_run(
            scene, grid.run, grid.t, samples[np.append(np.diff(grid.t[samples]) > 0.0, True)]
        )

    @classmethod
    def from_run(
        cls, scene: AnimatedScene, run: Trajectory, t: Times, samples: Indices
    ) -> StringSamples:
        """Chosen samples of a run whose times in the file are ``t``."""
        still, q_D, q_K = scene.still, run.q_D[samples], run.q_K[samples]
        poses = still.poses(q_D, q_K)
        slip = 0.0 if run.slip is None else run.slip.values[samples]
        wires = np.array([s.wire for s in scene.tree.strings], dtype=bool)
        links = {point.link for line in scene.lines for point in line.points} - {WORLD}
        return cls(
            t=t[samples],
            poses=poses,
            orientations={k: rotation.quaternion(poses[:, k, :, :3]) for k in links},
            lengths=still.string_lengths(q_D, q_K) + slip,
            taut=run.taut.values[samples] | wires,
            floor=scene.geometry.floor if scene.geometry.ground else -np.inf,
        )


@dataclass(frozen=True, eq=False)
class Spans:
    """Spans of a line; S spans, T samples.

    Attributes:
        t: (T,) times [s].
        points: (T, S + 1, 3) points that the line runs through [m].
        directions: (S, T, 3) unit vectors along the spans.
        frames: (S, T, 4) orientations whose z axes are the directions, without twist.
        orientations: (T, 4) orientations of the links, by index.
        slack_length: (T,) length of the string while it is slack, zero while it is taut [m]; None
            for a line that is never slack.
        floor: height below which no string sags [m].
    """

    t: Times
    points: Array
    directions: Array
    frames: Quaternion
    orientations: dict[int, Quaternion]
    slack_length: Array | None
    floor: float

    @classmethod
    def of_line(cls, scene: AnimatedScene, line: Line, samples: StringSamples) -> Spans:
        """Spans of a line of a scene."""
        points = np.stack(
            [scene.world_positions(point, samples.poses) for point in line.points], axis=1
        )
        offsets = np.swapaxes(np.diff(points, axis=1), 0, 1)
        length = np.linalg.norm(offsets, axis=-1, keepdims=True)
        directions = np.where(length > 1e-9, offsets / np.maximum(length, 1e-9), [0.0, 0.0, 1.0])
        slack_length = None
        if line.string is not None:
            slack = np.logical_not(samples.taut[:, line.string])
            if slack.any():
                slack_length = np.where(slack, samples.lengths[:, line.string], 0.0)
        return cls(
            samples.t,
            points,
            directions,
            _transported_frames(directions),
            samples.orientations,
            slack_length,
            samples.floor,
        )

    def sag_offsets(self, rings: int) -> Array:
        """(T, S, rings, 3) offsets of the string from the straight spans, in their frames [m].

        The rings are evenly spread along the string.
        """
        matrices = np.swapaxes(rotation.matrix(self.frames), 0, 1)
        return (self.curves(rings) - self._straight(rings)) @ matrices

    def curves(self, rings: int) -> Array:
        """(T, S, rings, 3) points along the string [m]."""
        points_by_span, n = self._straight(rings), len(self.directions)
        slack_length = np.zeros(len(self.t)) if self.slack_length is None else self.slack_length
        for k in np.flatnonzero(slack_length > 0.0):
            points = self.points[k]
            lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
            span_lengths = slack_length[k] * (lengths / lengths.sum() if lengths.sum() else 1.0 / n)
            for s in range(n):
                line = rope.hanging_curve(points[s], points[s + 1], float(span_lengths[s]))
                line = np.maximum(line, [-np.inf, -np.inf, min(self.floor, *points[s : s + 2, 2])])
                points_by_span[k, s] = _resampled(line, rings)
        return points_by_span

    def _straight(self, rings: int) -> Array:
        share = np.linspace(0.0, 1.0, rings)[:, None]
        starts, ends = self.points[:, :-1, None], self.points[:, 1:, None]
        straight: Array = starts + share * (ends - starts)
        return straight


def _resampled(line: Array, n: int) -> Array:
    """(n, 3) evenly spaced points along a polyline (m, 3)."""
    arc_lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    positions = np.linspace(0.0, arc_lengths[-1], n)
    return np.column_stack([np.interp(positions, arc_lengths, x) for x in line.T])


def _transported_frames(directions: Array) -> Quaternion:
    """Frames (S, T, 4) with these z axes (S, T, 3), each rotated the shortest way from the last."""
    frames = np.empty((*directions.shape[:2], 4))
    previous, frame = np.tile([0.0, 0.0, 1.0], (len(directions), 1)), np.eye(1, 4)
    for k in range(directions.shape[1]):
        step = rotation.shortest(previous, directions[:, k])
        frame = rotation.normalised(rotation.multiply(step, frame))
        frames[:, k] = frame
        previous = directions[:, k]
    return frames
