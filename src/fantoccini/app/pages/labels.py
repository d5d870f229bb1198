"""Heights of the names of handles, chosen so that they do not overlap.

A handle is a driven string end, or a body on a driven joint, that a hand can hold.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fantoccini.app.pages.nodes import View

_MIN_HEIGHT = 0.026
"""Smallest height of a name above its handle, relative to the puppet's size."""
_NAME_HEIGHT, _LETTER_WIDTH = 0.021, 0.0096
"""Height of a name and width of a letter, relative to the puppet's size."""


def handle_label_heights(
    names: Sequence[str], positions: np.ndarray, view: View, size: float
) -> np.ndarray:
    """(n,) heights of names above their handles at which they do not overlap in a view [m].

    Args:
        names: names of the handles.
        positions: (n, 3) positions of the handles [m].
        view: point of view.
        size: size of the puppet [m].
    """
    direction = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    right = np.cross(direction, [0.0, 0.0, 1.0])
    right /= max(float(np.linalg.norm(right)), 1e-9)
    picture_axes = np.array([right, np.cross(right, direction)])
    projected = np.asarray(positions, dtype=float).reshape(-1, 3) @ picture_axes.T
    label_heights = np.full(len(names), _MIN_HEIGHT * size)
    placed_labels: list[tuple[float, float, float]] = []
    name_height = 0.999 * _NAME_HEIGHT * size
    for n in np.argsort(projected[:, 1], kind="stable"):
        label_half_width = 0.5 * _LETTER_WIDTH * size * len(names[n])
        while any(
            abs(x - projected[n, 0]) < label_half_width + half_width
            and abs(y - projected[n, 1] - label_heights[n]) < name_height
            for x, y, half_width in placed_labels
        ):
            label_heights[n] += 0.25 * _NAME_HEIGHT * size
        placed_labels.append(
            (projected[n, 0], projected[n, 1] + label_heights[n], label_half_width)
        )
    return label_heights
