"""Check that M_DD is not singular, joint by joint.

M_DD is the inertia matrix of the dynamic velocities v_D; it is singular if some of them move no
mass. In names, K stands for driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Mistake, PuppetError
from fantoccini.base.documents import Number, Parameter
from fantoccini.model.puppet import Puppet
from fantoccini.model.tree import Tree, joint_inertias

_N_POSES = 3
"""Number of poses tried: the file's and random ones, up to the first without a singular joint."""


@dataclass(frozen=True)
class Tolerances:
    """Singularity thresholds of a joint's inertia, scaled to a unit diagonal."""

    min_eigenvalue: float = (
        1e-12  # Smallest eigenvalue: above rounding, far below that of any puppet
    )
    zero_diagonal: float = 1e-300  # Diagonal entry that counts as 0 [kg or kg m^2]
    named_share: float = 1e-3  # Part of a mode's largest entry above which a coordinate is named


TOLERANCES = Tolerances()


def check_mass_matrix(
    puppet: Puppet, tree: Tree, values: Mapping[str, float] | None = None
) -> None:
    """Raises PuppetError if a joint moves no mass, in the file's pose and in random ones.

    Args:
        puppet: puppet as described by its file.
        tree: tree of the puppet.
        values: values of parameters; by default those of the file.

    Raises:
        PuppetError: a joint moves no mass; the message names the coordinates.
    """
    parameter_values = tree.parameters if values is None else values

    def number(value: Number) -> float:
        return float(parameter_values[value.parameter] if isinstance(value, Parameter) else value)

    table = tree.coordinates
    names: list[str] = []
    rng = np.random.default_rng(0)
    for trial in range(_N_POSES):
        q_D, q_K = (np.nan_to_num(q, nan=1.0) for q in (table.start_D, table.start_K))
        if trial:
            q_D = q_D + rng.normal(size=table.n_qD)
            for q, _ in table.quaternions_D:
                q_D[q : q + 4] /= np.linalg.norm(q_D[q : q + 4])
        names, property_text = _singular(tree, q_D, q_K, number)
        if not names:
            return
    owner = puppet.owner_of(names[0])
    file, line = puppet.locate(owner)
    text = (
        f"the mass matrix {property_text}: look at {', '.join(names)}; give the bodies below "
        "this joint a "
        "mass and an inertia that are positive and finite, or the joint an armature, or make it "
        "driven or fixed"
    )
    raise PuppetError([Mistake(file, line, owner, text)])


def _singular(
    tree: Tree, q_D: Array, q_K: Array, number: Callable[[Number], float]
) -> tuple[list[str], str]:
    """Velocities of the singular joint nearest the leaves, and the property of its inertia."""
    for i, inertia, D in joint_inertias(tree, q_D, q_K, number):
        names = np.array(tree.coordinates.v_D)[tree.links[i].v]
        if not np.all(np.isfinite(D)):
            return list(names), "is not finite"
        diagonal = np.diag(inertia)
        scale = 1.0 / np.sqrt(np.maximum(diagonal, TOLERANCES.zero_diagonal))
        values, vectors = np.linalg.eigh(D * np.outer(scale, scale))
        is_massless = diagonal <= TOLERANCES.zero_diagonal
        if values[0] <= TOLERANCES.min_eigenvalue or np.any(is_massless):
            mode_share = np.where(is_massless, 1.0, np.abs(vectors[:, 0]))
            return list(
                names[mode_share > TOLERANCES.named_share * np.max(mode_share)]
            ), "is singular"
    return [], ""
