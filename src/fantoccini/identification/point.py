"""Where a search stands: the unknowns, the states, and what they predict."""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.arrays import Array, MaskRows


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


@dataclass(frozen=True, eq=False)
class Weights:
    """What residuals count.

    Attributes:
        noise: (n_c,) standard deviations of the channels.
        drift: by how much a segment may begin elsewhere than the one before ends: standard
            deviations of configuration and velocity [m or rad, and per second].
        final: whether samples far off count by Cauchy's measure instead of Huber's: a segment that
            is caught in another order of events must not bend the numbers in the end.
    """

    noise: Array
    drift: tuple[float, float]
    final: bool = False
