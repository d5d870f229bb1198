"""Heights of the names of handles: close ones do not cover each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.app.pages.nodes import View

_ABOVE = 0.026
"""Least height of a name above its handle, relative to the puppet's size."""
_HIGH, _WIDE = 0.021, 0.0096
"""Height of a name and width of a letter, relative to the puppet's size, as seen as a whole."""


def heights(names: Sequence[str], places: np.ndarray, view: View, size: float) -> np.ndarray:
    """(n,) heights of names above their handles, at which none covers another in a view [m].

    Args:
        names: of the handles.
        places: (n, 3) of the handles [m].
        view: point of view.
        size: of the puppet [m].
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
