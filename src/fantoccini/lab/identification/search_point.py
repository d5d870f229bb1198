"""Where a search stands: the unknowns, the states, and what they predict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, MaskRows


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the unknowns stand in theta.

    Attributes:
        parameters: places in p of those that are looked for.
        offsets: places among v_K of driven coordinates with an unknown offset.
        places: numbers of the markers whose places are looked for.
        delay: whether the delay is looked for.
    """

    parameters: tuple[int, ...]
    offsets: tuple[int, ...]
    places: tuple[int, ...]
    delay: bool

    @property
    def n_rolled(self) -> int:
        """Unknowns that act through the motion."""
        return len(self.parameters) + len(self.offsets)

    def __len__(self) -> int:
        return self.n_rolled + 3 * len(self.places) + int(self.delay)


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search stands.

    Attributes:
        q_D, v_D: (S, ...) first states of the segments.
        theta: (P,) unknowns.
        held: (S, n_rows) bool, the strings and limits that hold the first states.
    """

    q_D: Array
    v_D: Array
    theta: Array
    held: MaskRows

    def differs(self, other: Point) -> MaskRows:
        """(S,) bool, segments that begin elsewhere than another point's."""
        moved = np.any(self.q_D != other.q_D, axis=1) | np.any(self.v_D != other.v_D, axis=1)
        return np.asarray(moved | np.any(self.held != other.held, axis=1))

    def mixed(self, other: Point, some: MaskRows) -> Point:
        """This point with the states of some segments (S,) from another."""
        own = some[:, None]
        return Point(
            np.where(own, other.q_D, self.q_D),
            np.where(own, other.v_D, self.v_D),
            self.theta,
            np.where(own, other.held, self.held),
        )


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a point predicts.

    Attributes:
        y: (N, n_c) the channels.
        q_D, v_D: (S, ...) ends of the segments.
        arrived: whether all segments were simulated to their ends.
    """

    y: Array
    q_D: Array
    v_D: Array
    arrived: bool

    def mixed(self, other: Predicted, some: MaskRows, segments: Indices) -> Predicted:
        """This with what another says of some segments (S,); samples lie in ``segments`` (N,)."""
        own = some[:, None]
        return Predicted(
            np.where(own[segments], other.y, self.y),
            np.where(own, other.q_D, self.q_D),
            np.where(own, other.v_D, self.v_D),
            self.arrived and other.arrived,
        )


@dataclass(frozen=True, eq=False)
class Jacobians:
    """Derivatives of what a point predicts, by (dq_D, dv_D) of the segment and theta.

    Attributes:
        samples: (N, n_c, 2 n_vD + P) of the channels.
        begin: (S, 2 n_vD, 2 n_vD + P) of the first states, as far as strings let them move.
        end: (S, 2 n_vD, 2 n_vD + P) of the ends of the segments.
    """

    samples: Array
    begin: Array
    end: Array


@dataclass(frozen=True, eq=False)
class Weights:
    """What residuals count.

    Attributes:
        noise: (n_c,) standard deviations of the channels.
        drift: by how much a segment may begin elsewhere than the one before ends: standard
            deviations of configuration and velocity [m or rad, and per second].
        final: whether samples far off count by Cauchy's measure instead of Huber's: a segment that
            is caught in another order of events must not bend the numbers in the end.
        joined: whether gaps count by Huber's measure instead of Cauchy's, so that none is given up.
    """

    noise: Array
    drift: tuple[float, float]
    final: bool = False
    joined: bool = False
