"""Poses and strings at one time, as pages show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.output.view import Geometry, chain_points, spring_ends

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette
    from fantoccini.motion import State


@dataclass(frozen=True, eq=False)
class Moment:
    """Poses and strings at one time.

    Attributes:
        t: [s].
        poses: (n_links, 3, 4) link poses.
        points: of each string, (n_points, 3) [m].
        lengths: (n_strings,) including slip of the winches [m].
        taut: (n_strings,) True for taut strings.
        tension: (n_strings,) [N], or None when unknown.
        springs: of each spring, (1, 2, 3) ends [m].
        chains: of each chain, (n_points, 3) [m].
        arrows: (n, 2, 3) foot and head of the arrows of forces [m]; None when unknown.
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


def moment_of(geometry: Geometry, k: int) -> Moment:
    """The moment ``t[k]`` of a geometry."""
    return Moment(
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


def moment_at(
    marionette: Marionette,
    state: State,
    tension: np.ndarray | None,
    arrows: np.ndarray | None = None,
) -> Moment:
    """The moment of a state.

    Args:
        marionette: the puppet.
        state: its state.
        tension: (n_strings,) [N], or None when unknown.
        arrows: as in :class:`Moment`.
    """
    tree, n = marionette.tree, len(marionette.tree.strings)
    poses = np.asarray(marionette.poses(state.q_D, state.q_K))
    lengths = np.asarray(marionette.string_lengths(state.q_D, state.q_K))
    return Moment(
        t=state.t,
        poses=poses,
        points=[np.asarray(p) for p in marionette.string_points(state.q_D, state.q_K)],
        lengths=lengths + state.slip if len(state.slip) else lengths,
        taut=state.taut[:n],
        tension=None if tension is None else np.asarray(tension)[:n],
        springs=[e[None] for e in spring_ends(tree, poses)],
        chains=list(chain_points(tree, poses)),
        arrows=arrows,
    )
