"""The kinetic energy in [q_D, q_K]: is it block diagonal, and does each block keep to its own?

    T = 1/2 v_D . M_DD v_D + v_D . M_DK v_K + 1/2 v_K . M_KK v_K

Sec. VI needs three things: M_DK = 0, M_DD a function of q_D alone, M_KK a function of q_K alone.
The second is not contained in the first: a driven joint that shifts a mass along a turning arm has
M_DK = 0, and yet the arm's inertia depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.arrays import Array
from fantoccini.equations import Equations
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.tree import Role

MASSLESS = 1e-300
"""M_KK at or below which a driven coordinate moves no mass."""


@dataclass(frozen=True)
class KineticEnergy:
    """The blocks of the kinetic energy's matrix.

    Attributes:
        identically: M_DK is the expression 0 in every entry.
        coupled: (dynamic velocity, driven velocity) of the entries of M_DK that are not.
        D_of_K: the expressions of M_DD contain q_K.
        K_of_D: the expressions of M_KK contain q_D.
        massless: driven velocities that move no mass: their rows of M_KK are the expression 0.
        n: configurations at which the following were evaluated.
        coupling: largest |M_DK| over them, relative to sqrt(M_DD M_KK) of its row and column.
        D_varies, K_varies: largest change of M_DD where only q_K changes, of M_KK where only q_D
            does, relative to the diagonal entries of its row and column.
        jump: largest share of the kinetic energy of a driven coordinate that moves alone which the
            puppet takes when it is set in motion by a blow: v . M_KD M_DD^-1 M_DK v / v . M_KK v.
    """

    identically: bool
    coupled: tuple[tuple[str, str], ...]
    D_of_K: bool
    K_of_D: bool
    massless: tuple[str, ...]
    n: int
    coupling: float
    D_varies: float
    K_varies: float
    jump: float

    @property
    def separate(self) -> bool:
        """M_DK = 0, M_DD(q_D), M_KK(q_K), as expressions."""
        return self.identically and not self.D_of_K and not self.K_of_D


def kinetic_energy(marionette: Marionette, states: list[State]) -> KineticEnergy:
    """Looks at the expressions, and at their values at some states.

    Args:
        marionette: the puppet.
        states: two or more random configurations.
    """
    table = marionette.coordinates
    M_DD, M_DK, M_KK = (_block(marionette.equations, *roles) for roles in _BLOCKS)
    s = marionette.equations.system.symbols
    coupled = [
        (table.v_D[i], table.v_K[j])
        for i in range(table.n_vD)
        for j in range(table.n_vK)
        if not M_DK[i, j].is_zero()
    ]
    massless = [
        name for j, name in enumerate(table.v_K) if all(x.is_zero() for x in M_KK[j].flat)
    ]
    coupling = D_varies = K_varies = jump = 0.0
    for x, other in zip(states, [*states[1:], *states[:1]], strict=True):
        M, DK, KK = blocks(marionette, x)
        d, k = np.sqrt(np.diag(M)), np.sqrt(np.maximum(np.diag(KK), 0.0))
        coupling = max(coupling, _relative(DK, d, k))
        moved_K = blocks(marionette, x.replace(q_K=other.q_K))[0]
        D_varies = max(D_varies, _relative(moved_K - M, d, d))
        moved_D = blocks(marionette, x.replace(q_D=other.q_D))[2]
        K_varies = max(K_varies, _relative(moved_D - KK, k, k))
        if np.any(DK):
            taken = np.einsum("ij,ij->j", DK, np.linalg.solve(M, DK))
            heavy = k**2 > MASSLESS
            jump = max(jump, float(np.max(taken[heavy] / k[heavy] ** 2, initial=0.0)))
    return KineticEnergy(
        not coupled,
        tuple(coupled),
        _contains(M_DD, s.q_K),
        _contains(M_KK, s.q_D),
        tuple(massless),
        len(states),
        coupling,
        D_varies,
        K_varies,
        jump,
    )


def blocks(marionette: Marionette, x: State) -> tuple[Array, Array, Array]:
    """M_DD (n_vD, n_vD), M_DK (n_vD, n_vK), M_KK (n_vK, n_vK) at a state."""
    found = marionette.equations["mass_matrix"](q_D=x.q_D, q_K=x.q_K, p=marionette.p)
    return tuple(np.array(found[name]) for name in ("M", "M_DK", "M_KK"))


_BLOCKS = (
    (Role.DYNAMIC, Role.DYNAMIC),
    (Role.DYNAMIC, Role.DRIVEN),
    (Role.DRIVEN, Role.DRIVEN),
)


def _block(equations: Equations, rows: Role, columns: Role) -> Array:
    return equations.system.mass(rows, columns)


def _contains(block: Array, symbols: ca.SX) -> bool:
    """Whether some entry's expression contains some of the symbols."""
    entries = ca.vertcat(*block.flat) if block.size else ca.SX(0, 1)
    return bool(ca.depends_on(entries, symbols)) if symbols.numel() else False


def _relative(block: Array, rows: Array, columns: Array) -> float:
    """Largest entry over the product of its row's and column's scale; 0 where the scale is 0."""
    scale = np.outer(rows, columns)
    known = scale > MASSLESS
    return float(np.max(np.abs(block[known]) / scale[known], initial=0.0))
