"""Chains: strings as point masses, and their start configuration.

q_D are the dynamic coordinates, to which the masses belong, and q_K the driven ones, the ends and
lengths of strings.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base.documents import Number
from fantoccini.model.puppet import UnitInertia
from fantoccini.model.tree.coordinates import Role
from fantoccini.model.tree.placement import Value, link_poses, point_position
from fantoccini.model.tree.structure import WORLD, Link, MassShare, Tree


def mass_link(name: str, mass: Number, n_masses: int) -> Link:
    """A point mass of a chain, free in the world.

    Args:
        name: name of the link and of its joint: string, dot, number from 1.
        mass: mass of the whole string [kg].
        n_masses: number of point masses.
    """
    point = MassShare(mass, 1.0 / n_masses, UnitInertia(np.zeros(3), np.zeros((3, 3))))
    return Link(
        name=name,
        parent=WORLD,
        joint=name,
        kind="translation",
        axes=np.eye(3),
        rotation=np.eye(3),
        offset=(0.0, 0.0, 0.0),
        role=Role.DYNAMIC,
        q=slice(0, 0),
        v=slice(0, 0),
        mass_shares=(point,),
    )


def placed(
    tree: Tree,
    q_D: np.ndarray,
    q_K: np.ndarray,
    number: Value,
    given_names: frozenset[str] = frozenset(),
) -> tuple[np.ndarray, np.ndarray]:
    """A configuration with the masses of chains placed between the strings' ends.

    The masses lie on the line between the ends; if the string is longer, they lie on a V that
    hangs down. The springs of the V are unstretched.

    Args:
        tree: tree with the chains.
        q_D: (n_qD,) configuration; entries of the chains' masses are ignored.
        q_K: (n_qK,) configuration; a driven length of nan becomes the distance between its ends.
        number: function that evaluates a Number of the puppet (a constant or a parameter).
        given_names: names of coordinates set by the user; masses with any of them keep their
            position.

    Returns:
        q_D (n_qD,), q_K (n_qK,).
    """
    q_D, q_K = q_D.copy(), q_K.copy()
    if not tree.chains:
        return q_D, q_K
    poses = link_poses(tree.links, np.nan_to_num(q_D)[None], np.nan_to_num(q_K)[None], number)
    for chain in tree.chains:
        start, end = (point_position(poses, chain.points[k], number)[0] for k in (0, -1))
        chain.set_unknown_length(float(np.linalg.norm(end - start)), q_D, q_K)
        line = _line(start, end, float(chain.unstretched_length(q_D, q_K, number)), chain.pieces)
        for point, position in zip(chain.points[1:-1], line, strict=True):
            q_slice = tree.links[point.link].q
            names = tree.coordinates.q_D[q_slice]
            if not given_names.intersection(names):
                q_D[q_slice] = position
    return q_D, q_K


def _line(start: np.ndarray, end: np.ndarray, length: float, pieces: int) -> np.ndarray:
    """(pieces - 1, 3) positions of the masses between two points [m]."""
    start_to_end = end - start
    distance = float(np.linalg.norm(start_to_end))
    fraction = np.arange(1, pieces)[:, None] / pieces
    depth = 0.5 * np.sqrt(max(length**2 - distance**2, 0.0))
    down = np.array([0.0, 0.0, -1.0])
    if distance > 0.0:
        direction = start_to_end / distance
        down = down - (down @ direction) * direction
        if np.linalg.norm(down) < 1e-6:  # a vertical string sags to one side
            down = np.array([1.0, 0.0, 0.0])
        down = down / np.linalg.norm(down)
    return start + fraction * start_to_end + depth * (1.0 - np.abs(2.0 * fraction - 1.0)) * down
