"""From a mouse that moves in a picture to a handle that moves in the world."""

from __future__ import annotations

import numpy as np

_DAMPING = 0.15
"""Foreshortening at which a handle begins to lag behind the mouse: without it, an axis that points
into the picture would run away."""


def follow(axes: np.ndarray, ahead: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Where a handle goes that is to stay under the mouse.

    The displacement w along the handle's axes that looks most like the mouse's,

      min |P w - moved|^2 + eps^2 |w|^2,   P = 1 - a a^T,

    with a the line of sight. Along an axis across it that is the mouse's own displacement; along
    one into the picture it stays bounded.

    Args:
        axes: (k, 3) unit vectors along which the handle can move.
        ahead: (3,) unit vector, the line of sight.
        moved: (3,) the mouse's displacement in the plane of the picture at the handle [m].

    Returns:
        (3,) displacement [m].
    """
    if not len(axes):
        return np.zeros(3)
    seen = axes - np.outer(axes @ ahead, ahead)
    matrix = seen @ seen.T + _DAMPING**2 * np.eye(len(axes))
    share = np.linalg.solve(matrix, seen @ moved)
    # Straight across nothing is lost to the damping.
    return (1.0 + _DAMPING**2) * share @ axes


def nudge(axes: np.ndarray, ahead: np.ndarray, right: float, up: float) -> np.ndarray:
    """Where a handle goes on a push to the right and up, as seen by the viewer.

    A handle that cannot go up goes away from the viewer instead.

    Args:
        axes: (k, 3) unit vectors along which the handle can move.
        ahead: (3,) unit vector, the line of sight.
        right, up: how far [m].

    Returns:
        (3,) displacement [m], at most as long as the push.
    """
    if not len(axes):
        return np.zeros(3)
    sideways = np.cross(ahead, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(sideways))
    sideways = sideways / size if size > 1e-6 else np.array([0.0, -1.0, 0.0])
    forward = np.cross([0.0, 0.0, 1.0], sideways)
    basis = np.linalg.svd(axes.T, full_matrices=False)[0]
    within = basis @ basis.T
    vertical = within @ [0.0, 0.0, 1.0]
    towards = np.array([0.0, 0.0, 1.0]) if float(vertical @ vertical) > 0.5 else forward
    return within @ (right * sideways + up * towards)
