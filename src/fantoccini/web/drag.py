"""From a mouse that moves in a picture to a handle that moves in the world."""

from __future__ import annotations

import numpy as np

_GRAZING = 0.15
"""Foreshortening below which a handle lags behind the mouse: without a bound, an axis that points
into the picture would run away."""
_STEPS = 8
"""Pieces of the mouse's way."""


def follow(
    axes: np.ndarray, eye: np.ndarray, place: np.ndarray, start: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """Where a handle goes that is to stay under the mouse.

    A handle at p moves along its axes so that it is seen to move as the mouse m does. With the
    rays u = (p - e) / |p - e| through the handle and r = (m - e) / |m - e| through the mouse,

      dp = |p - e| A g(P A) dr,   P = 1 - u u^T,

    along the mouse's way. g inverts the singular values s of P A, the foreshortening of the axes:
    1 / s, and below ``_GRAZING`` s / _GRAZING^2. So a handle stays under the mouse wherever its
    axes are seen well, and never goes against it: a plane above the eye is seen from below, where
    down in the picture is away. A handle that moves along three axes goes with the mouse, in the
    plane of the picture.

    Args:
        axes: (k, 3) unit vectors along which the handle can move.
        eye: (3,) e, the camera's place [m].
        place: (3,) the handle's when it was taken [m].
        start, end: (3,) the mouse when it took the handle, and now, in a plane across the camera's
            axis [m].

    Returns:
        (3,) displacement [m].
    """
    if len(axes) == 3:
        return end - start
    p, m, step = place, start, (end - start) / _STEPS
    for _ in range(_STEPS if len(axes) else 0):
        half = p + 0.5 * _drawn(axes, eye, p, m, step)
        p = p + _drawn(axes, eye, half, m + 0.5 * step, step)
        m = m + step
    return p - place


def _drawn(
    axes: np.ndarray, eye: np.ndarray, p: np.ndarray, m: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """How a handle at ``p`` moves where the mouse moves by a small step from ``m``."""
    away, ray = p - eye, m - eye
    far, near = max(np.linalg.norm(away), 1e-9), max(np.linalg.norm(ray), 1e-9)
    u, r = away / far, ray / near
    turned = (step - (r @ step) * r) / near
    left, seen, right = np.linalg.svd(axes.T - np.outer(u, axes @ u), full_matrices=False)
    share = np.where(seen > _GRAZING, 1.0 / np.maximum(seen, _GRAZING), seen / _GRAZING**2)
    return far * axes.T @ (right.T @ (share * (left.T @ turned)))


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
