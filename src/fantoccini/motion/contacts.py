"""Contact points of a run: forces and sliding over time.

A contact is a point at which two solids touch; its gap is their distance there.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, UnknownNameError, frozen


def pair_name(pair: tuple[str, str]) -> str:
    """The name of a contact pair in events: ``foot|floor``."""
    return "|".join(pair)


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """The n points with contact forces in all samples of a run; the arrays are read-only copies.

    Attributes:
        sample: (n,) index of the sample, not decreasing.
        pair: (n,) index of the pair in ``names``.
        gap: (n,) distance of the surfaces, negative if they overlap [m].
        point: (n, 3) midpoint between the surfaces, in the world [m].
        normal: (n, 3) unit normal from the second solid to the first, in the world.
        force: (n, 3) force on the first solid, in the world [N].
        velocity: (n, 3) velocity of the first solid relative to the second at the point [m/s].
        names: names of the body, obstacle or floor on both sides of every pair.
    """

    sample: Indices
    pair: Indices
    gap: Array
    point: Array
    normal: Array
    force: Array
    velocity: Array
    names: tuple[tuple[str, str], ...]

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if field.name == "names":
                continue
            kind = int if field.name in ("sample", "pair") else float
            object.__setattr__(self, field.name, frozen(getattr(self, field.name), kind))

    def __len__(self) -> int:
        return len(self.sample)

    def __repr__(self) -> str:
        return f"<ContactPoints: {len(self)} of {len(set(self.names))} pairs>"

    @property
    def normal_force(self) -> Array:
        """(n,) force along the normal, >= 0 [N]."""
        return np.einsum("ij,ij->i", self.force, self.normal)

    @property
    def sliding_speed(self) -> Array:
        """(n,) tangential speed [m/s]."""
        normal_velocity = np.einsum("ij,ij->i", self.velocity, self.normal)
        return np.linalg.norm(self.velocity - normal_velocity[:, None] * self.normal, axis=1)

    def involving(self, *parts: str) -> ContactPoints:
        """The points of a body, an obstacle or ``floor``; with two names, those between the two.

        Raises:
            UnknownNameError: there is no part of this name in a contact pair.
        """
        names = {name for pair in self.names for name in pair}
        for part in parts:
            if part not in names:
                raise UnknownNameError("part that may touch", part, sorted(names))
        matches = np.array([set(parts) <= set(pair) for pair in self.names], dtype=bool)
        return self.subset(matches[self.pair])

    def at_sample(self, sample: int) -> ContactPoints:
        """The points of one sample."""
        return self.subset(self.sample == sample)

    def force_on(self, part: str, n_samples: int) -> Array:
        """(n_samples, 3) sum of the forces on a body over time, in the world [N]."""
        points = self.involving(part)
        sign = np.array([1.0 if part == self.names[k][0] else -1.0 for k in points.pair])
        out = np.zeros((n_samples, 3))
        np.add.at(out, points.sample, sign[:, None] * points.force)
        return out

    def subset(self, selection: np.ndarray) -> ContactPoints:
        """The points that a mask or indices select."""
        fields = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return ContactPoints(
            **{
                name: values if name == "names" else values[selection]
                for name, values in fields.items()
            }
        )

    def resampled(self, old_samples: Indices) -> ContactPoints:
        """The points of new samples: sample i has the points of sample ``old_samples[i]``."""
        starts = np.searchsorted(self.sample, old_samples, side="left")
        ends = np.searchsorted(self.sample, old_samples, side="right")
        indices = np.concatenate(
            [np.arange(start, end) for start, end in zip(starts, ends, strict=True)]
        )
        sample = np.repeat(np.arange(len(old_samples)), ends - starts)
        return dataclasses.replace(self.subset(indices.astype(int)), sample=sample)
