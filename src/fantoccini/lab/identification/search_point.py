"""Points of a search: unknowns and first states, with their predictions and derivatives.

theta are the unknown numbers. A segment is a piece of the record that is simulated from its own
first state: dynamic coordinates q_D and velocities v_D. In names, K stands for driven coordinates:
ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, MaskRows


@dataclass(frozen=True, eq=False)
class Layout:
    """Order of the unknowns in theta.

    Attributes:
        parameters: indices in p of unknown parameters.
        offsets: indices in v_K of driven coordinates with an unknown offset.
        marker_indices: indices of markers with an unknown position.
        delay: whether the delay is unknown.
    """

    parameters: tuple[int, ...]
    offsets: tuple[int, ...]
    marker_indices: tuple[int, ...]
    delay: bool

    @property
    def n_motion(self) -> int:
        """Number of unknowns that change the motion: parameters and offsets."""
        return len(self.parameters) + len(self.offsets)

    def __len__(self) -> int:
        return self.n_motion + 3 * len(self.marker_indices) + int(self.delay)


@dataclass(frozen=True, eq=False)
class Point:
    """Unknowns and the first states of all segments.

    Attributes:
        q_D, v_D: (S, ...) first states of the segments.
        theta: (P,) unknowns.
        active_rows: (S, n_rows) bool, the active set of the first states.
    """

    q_D: Array
    v_D: Array
    theta: Array
    active_rows: MaskRows

    def changed_segments(self, other: Point) -> MaskRows:
        """(S,) bool, segments whose first state differs from that of the other point."""
        is_moved = np.any(self.q_D != other.q_D, axis=1) | np.any(self.v_D != other.v_D, axis=1)
        return np.asarray(is_moved | np.any(self.active_rows != other.active_rows, axis=1))

    def with_segments(self, other: Point, selected: MaskRows) -> Point:
        """This point, with the states of the chosen segments (S,) taken from another."""
        mask = selected[:, None]
        return Point(
            np.where(mask, other.q_D, self.q_D),
            np.where(mask, other.v_D, self.v_D),
            self.theta,
            np.where(mask, other.active_rows, self.active_rows),
        )


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predictions of a point.

    Attributes:
        y: (N, n_c) channels.
        q_D, v_D: (S, ...) ends of the segments.
        arrived: whether all segments were simulated to their ends.
    """

    y: Array
    q_D: Array
    v_D: Array
    arrived: bool

    def with_segments(self, other: Prediction, selected: MaskRows, segments: Indices) -> Prediction:
        """These predictions, with those of the chosen segments (S,) taken from other predictions.

        ``segments`` (N,) is the index of each sample's segment.
        """
        mask = selected[:, None]
        return Prediction(
            np.where(mask[segments], other.y, self.y),
            np.where(mask, other.q_D, self.q_D),
            np.where(mask, other.v_D, self.v_D),
            self.arrived and other.arrived,
        )


@dataclass(frozen=True, eq=False)
class Jacobians:
    """Derivatives of predictions with respect to each segment's first state (dq_D, dv_D) and theta.

    Attributes:
        samples: (N, n_c, 2 n_vD + P) of the channels.
        begin: (S, 2 n_vD, 2 n_vD + P) of the first states after projection onto the active rows.
        end: (S, 2 n_vD, 2 n_vD + P) of the segments' last states.
    """

    samples: Array
    begin: Array
    end: Array


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of residuals and jumps.

    Attributes:
        noise: (n_c,) standard deviations of the channels.
        drift: standard deviations of jumps between segments: of the configuration [m or rad] and
            of the velocity [m/s or rad/s].
        final: whether samples have Cauchy's loss instead of Huber's, so that a segment with a wrong
            order of events does not distort the final estimates.
        joined: whether jumps have Huber's loss instead of Cauchy's, so that large ones shrink, too.
    """

    noise: Array
    drift: tuple[float, float]
    final: bool = False
    joined: bool = False
