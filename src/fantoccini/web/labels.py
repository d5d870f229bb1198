"""Where the names of handles stand, so that they can be read where handles are close together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.web.stage import View

_ABOVE = 0.026
"""A name stands so far above its handle at least, of the puppet's size."""
_HIGH, _WIDE = 0.021, 0.0096
"""Height of a name and width of a letter, of the puppet's size, in a window that shows it all."""


def heights(names: Sequence[str], places: np.ndarray, view: View, size: float) -> np.ndarray:
    """How far above its handle each name stands, so that in a view none covers another.

    Args:
        names: of the handles.
        places: (n, 3) of the handles [m].
        view: where they are looked at from.
        size: of the puppet [m].

    Returns:
        (n,) [m].
    """
    ahead = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= max(float(np.linalg.norm(right)), 1e-9)
    picture = np.array([right, np.cross(right, ahead)])
    seen = np.asarray(places, dtype=float).reshape(-1, 3) @ picture.T
    above = np.full(len(names), _ABOVE * size)
    taken: list[tuple[float, float, float]] = []
    high = 0.999 * _HIGH * size
    for n in np.argsort(seen[:, 1], kind="stable"):
        half = 0.5 * _WIDE * size * len(names[n])
        while any(
            abs(x - seen[n, 0]) < half + wide and abs(y - seen[n, 1] - above[n]) < high
            for x, y, wide in taken
        ):
            above[n] += 0.25 * _HIGH * size
        taken.append((seen[n, 0], seen[n, 1] + above[n], half))
    return above
