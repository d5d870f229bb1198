"""Whether M_DD resists every dynamic velocity, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Problem, PuppetError
from fantoccini.puppet import Number, Parameter
from fantoccini.tree import Tree, joint_inertias
from fantoccini.world import World

_SINGULAR = 1e-12
"""Smallest eigenvalue of a joint's scaled inertia below which it counts as singular."""
_POSES = 3
"""The file's pose and random ones: the first that passes will do."""


def check_mass_matrix(world: World, tree: Tree, values: Mapping[str, float] | None = None) -> None:
    """Raises when a joint moves no mass, in the file's pose and in random ones.

    Args:
        world: the puppets.
        tree: of the world.
        values: of parameters; those of the file when not given.

    Raises:
        PuppetError: naming the coordinates that M does not resist.
    """
    present = tree.parameters if values is None else values

    def number(value: Number) -> float:
        return float(present[value.parameter] if isinstance(value, Parameter) else value)

    table, wrong = tree.coordinates, ([], "")
    rng = np.random.default_rng(0)
    for trial in range(_POSES):
        q_D, q_K = (np.nan_to_num(q, nan=1.0) for q in (table.start_D, table.start_K))
        if trial:
            q_D = q_D + rng.normal(size=table.n_qD)
            for q, _ in table.quaternions_D:
                q_D[q : q + 4] /= np.linalg.norm(q_D[q : q + 4])
        wrong = _unresisted(tree, q_D, q_K, number)
        if not wrong[0]:
            return
    raise PuppetError([_massless(world, *wrong)])


def _unresisted(tree: Tree, q_D: Array, q_K: Array, number) -> tuple[list[str], str]:
    """Velocities of the joint nearest the leaves that M does not resist, and what M is."""
    for i, held, D in joint_inertias(tree, q_D, q_K, number):
        names = np.array(tree.coordinates.v_D)[tree.links[i].v]
        if not np.all(np.isfinite(D)):
            return list(names), "is not finite"
        size = np.diag(held)
        scale = 1.0 / np.sqrt(np.maximum(size, 1e-300))
        values, vectors = np.linalg.eigh(D * np.outer(scale, scale))
        if values[0] <= _SINGULAR or np.any(size <= 1e-300):
            still = np.where(size <= 1e-300, 1.0, np.abs(vectors[:, 0]))
            return list(names[still > 1e-3 * np.max(still)]), "is singular"
    return [], ""


def _massless(world: World, names: list[str], what: str) -> Problem:
    owner = names[0].split(".")[0]
    file, line = world.puppets[0].locate(owner.split("/")[-1])
    return Problem(
        file,
        line,
        owner,
        f"the mass matrix {what}: look at {', '.join(names)}; give the bodies below this joint "
        "a mass and an inertia that are neither zero nor beyond all measure, or make the joint "
        "driven or fixed",
    )
