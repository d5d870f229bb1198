"""Motion of a handle in the world for a motion of the mouse in the picture.

A handle is a driven string end, or a body on a driven joint, that a hand can hold; it moves along
the axes of its joint.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class _MouseFollowing(NamedTuple):
    """Constants of :func:`follow`."""

    min_foreshortening: float = 0.15
    """Foreshortening (1 across the line of sight) below which a handle lags behind the mouse.
    Without the lag a handle on an axis that points into the picture would move without bound."""
    steps: int = 8  # Integration steps along the mouse's path


_FOLLOWING = _MouseFollowing()


def drag_displacement(
    axes: np.ndarray, eye: np.ndarray, grab: np.ndarray, start: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """(3,) displacement of a handle that stays under the mouse [m].

    The image of a handle at p moves with the mouse m. With the rays u = (p - e) / |p - e| through
    the handle and r = (m - e) / |m - e| through the mouse,

      dp = |p - e| A g(P A) dr,   P = 1 - u u^T,

    along the mouse's path. g inverts the singular values s of P A, the foreshortening of the axes:
    1 / s, and s / f^2 below f = ``min_foreshortening``. A handle stays under the mouse unless its
    axes are strongly foreshortened, and never moves against the mouse. (A plane above the eye is
    seen from below: there, down in the picture is away.) A handle with three axes moves in the
    plane of the picture.

    Args:
        axes: (k, 3) unit vectors along which the handle can move.
        eye: (3,) e, the camera's position [m].
        grab: (3,) point at which the handle was grabbed [m].
        start, end: (3,) positions of the mouse then and now, in a plane normal to the camera's axis
            [m].
    """
    if len(axes) == 3:
        return end - start
    p, m, step = grab, start, (end - start) / _FOLLOWING.steps
    for _ in range(_FOLLOWING.steps if len(axes) else 0):
        midpoint = p + 0.5 * _increment(axes, eye, p, m, step)
        p = p + _increment(axes, eye, midpoint, m + 0.5 * step, step)
        m = m + step
    return p - grab


def _increment(
    axes: np.ndarray, eye: np.ndarray, p: np.ndarray, m: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Displacement of a handle at ``p`` for a small step of the mouse from ``m``."""
    offset, ray = p - eye, m - eye
    distance, mouse_distance = max(np.linalg.norm(offset), 1e-9), max(np.linalg.norm(ray), 1e-9)
    u, r = offset / distance, ray / mouse_distance
    ray_change = (step - (r @ step) * r) / mouse_distance
    left, foreshortening, right = np.linalg.svd(axes.T - np.outer(u, axes @ u), full_matrices=False)
    min_foreshortening = _FOLLOWING.min_foreshortening
    gains = np.where(
        foreshortening > min_foreshortening,
        1.0 / np.maximum(foreshortening, min_foreshortening),
        foreshortening / min_foreshortening**2,
    )
    return distance * axes.T @ (right.T @ (gains * (left.T @ ray_change)))


def push_displacement(axes: np.ndarray, sight: np.ndarray, right: float, up: float) -> np.ndarray:
    """(3,) displacement of a handle pushed to the right and up in the picture [m].

    The displacement is at most as long as the push. A handle that cannot move up moves away from
    the viewer.

    Args:
        axes: (k, 3) unit vectors along which the handle can move.
        sight: (3,) unit vector along the line of sight.
        right, up: components of the push [m].
    """
    if not len(axes):
        return np.zeros(3)
    sideways = np.cross(sight, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(sideways))
    sideways = sideways / size if size > 1e-6 else np.array([0.0, -1.0, 0.0])
    forward = np.cross([0.0, 0.0, 1.0], sideways)
    basis = np.linalg.svd(axes.T, full_matrices=False)[0]
    projection = basis @ basis.T
    vertical = projection @ [0.0, 0.0, 1.0]
    towards = np.array([0.0, 0.0, 1.0]) if float(vertical @ vertical) > 0.5 else forward
    return projection @ (right * sideways + up * towards)
