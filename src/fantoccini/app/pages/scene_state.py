"""State of the drawn scene at one time: poses, strings and forces.

q_D and q_K are the dynamic and driven coordinates. A taut string pulls, and slip is the length that
a winch has let out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view import Geometry, chain_points, spring_ends

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class SceneState:
    """State of the drawn scene at one time.

    Attributes:
        t: time [s].
        poses: (n_links, 3, 4) link poses.
        points: (n_points, 3) points of each string [m].
        lengths: (n_strings,) lengths, including slip of the winches [m].
        taut: (n_strings,) whether strings are taut.
        tension: (n_strings,) tensions [N], or None if unknown.
        springs: (1, 2, 3) ends of each spring [m].
        chains: (n_points, 3) ends and masses of each chain [m].
        arrows: (n, 2, 3) foot and head of the arrows of forces [m]; None if unknown.
    """

    t: float
    poses: np.ndarray
    points: list[np.ndarray]
    lengths: np.ndarray
    taut: np.ndarray
    tension: np.ndarray | None
    springs: list[np.ndarray]
    chains: list[np.ndarray]
    arrows: np.ndarray | None = None


def scene_at_sample(geometry: Geometry, k: int) -> SceneState:
    """The scene of a geometry at time ``t[k]``."""
    return SceneState(
        t=float(geometry.t[k]),
        poses=geometry.poses[k],
        points=[p[k] for p in geometry.points],
        lengths=geometry.lengths[k],
        taut=geometry.taut[k],
        tension=None if geometry.tension is None else geometry.tension[k],
        springs=[s[k : k + 1] for s in geometry.springs],
        chains=[c[k] for c in geometry.chains],
        arrows=geometry.arrows[k] if geometry.arrows else None,
    )


def scene_of_state(
    marionette: Marionette,
    state: State,
    tension: np.ndarray | None,
    arrows: np.ndarray | None = None,
) -> SceneState:
    """The scene of a state.

    Args:
        marionette: the puppet.
        state: state of the puppet.
        tension: (n_strings,) tensions [N], or None if unknown.
        arrows: see :class:`SceneState`.
    """
    tree, n = marionette.tree, len(marionette.tree.strings)
    poses = np.asarray(marionette.poses(state.q_D, state.q_K))
    lengths = np.asarray(marionette.string_lengths(state.q_D, state.q_K))
    return SceneState(
        t=state.t,
        poses=poses,
        points=[np.asarray(p) for p in marionette.string_points(state.q_D, state.q_K).values()],
        lengths=lengths + state.slip if len(state.slip) else lengths,
        taut=state.taut[:n],
        tension=None if tension is None else np.asarray(tension)[:n],
        springs=[e[None] for e in spring_ends(tree, poses)],
        chains=list(chain_points(tree, poses)),
        arrows=arrows,
    )
