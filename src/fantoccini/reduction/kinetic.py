"""The kinetic energy in [q_D, q_K]: is it block diagonal, and what does each block depend on?

    T = 1/2 v_D . M_DD v_D + v_D . M_DK v_K + 1/2 v_K . M_KK v_K

Sec. VI needs three things: M_DK = 0, M_DD a function of q_D alone, M_KK a function of q_K alone.
The first does not imply the second: a driven joint that shifts a mass along a turning arm has
M_DK = 0, yet the arm's inertia depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.tree import Role

MASSLESS = 1e-300
"""M_KK up to this counts as zero: the driven coordinate moves no mass [kg or kg m^2]."""


@dataclass(frozen=True)
class KineticEnergy:
    """The blocks of the kinetic energy's matrix.

    Attributes:
        block_diagonal: every entry of M_DK is the expression 0.
        coupled: (dynamic velocity, driven velocity) of the other entries of M_DK.
        M_DD_has_q_K: the expressions of M_DD contain q_K.
        M_KK_has_q_D: the expressions of M_KK contain q_D.
        n: configurations at which the following were evaluated.
        coupling: largest |M_DK| over them, relative to sqrt(M_DD M_KK) of its row and column.
        M_DD_change, M_KK_change: largest change of M_DD with q_K alone, of M_KK with q_D alone,
            relative to the diagonal entries of its row and column.
        impact_share: largest share of the kinetic energy of a single driven coordinate that the
            puppet absorbs when it starts with a jump, v . M_KD M_DD^-1 M_DK v / v . M_KK v.
    """

    block_diagonal: bool
    coupled: tuple[tuple[str, str], ...]
    M_DD_has_q_K: bool
    M_KK_has_q_D: bool
    n: int
    coupling: float
    M_DD_change: float
    M_KK_change: float
    impact_share: float

    @property
    def separate(self) -> bool:
        """M_DK = 0, M_DD(q_D), M_KK(q_K), as expressions."""
        return self.block_diagonal and not self.M_DD_has_q_K and not self.M_KK_has_q_D


def kinetic_energy(marionette: Marionette, states: list[State]) -> KineticEnergy:
    """Examines the expressions, and their values at some states.

    Args:
        marionette: the puppet.
        states: two or more random configurations.
    """
    table = marionette.coordinates
    system = marionette.equations.system
    M_DD = system.mass(Role.DYNAMIC, Role.DYNAMIC)
    M_DK = system.mass(Role.DYNAMIC, Role.DRIVEN)
    M_KK = system.mass(Role.DRIVEN, Role.DRIVEN)
    coupled = [
        (table.v_D[i], table.v_K[j])
        for i in range(table.n_vD)
        for j in range(table.n_vK)
        if not M_DK[i, j].is_zero()
    ]
    coupling = D_change = K_change = impact_share = 0.0
    for x, other in zip(states, [*states[1:], *states[:1]], strict=True):
        M, DK, KK = blocks(marionette, x)
        d, k = np.sqrt(np.diag(M)), np.sqrt(np.maximum(np.diag(KK), 0.0))
        coupling = max(coupling, _relative(DK, d, k))
        moved_K = blocks(marionette, x.replace(q_K=other.q_K))[0]
        D_change = max(D_change, _relative(moved_K - M, d, d))
        moved_D = blocks(marionette, x.replace(q_D=other.q_D))[2]
        K_change = max(K_change, _relative(moved_D - KK, k, k))
        if np.any(DK):
            absorbed = np.einsum("ij,ij->j", DK, np.linalg.solve(M, DK))
            heavy = k**2 > MASSLESS
            shares = absorbed[heavy] / k[heavy] ** 2
            impact_share = max(impact_share, float(np.max(shares, initial=0.0)))
    return KineticEnergy(
        not coupled, tuple(coupled),
        _contains(M_DD, system.symbols.q_K), _contains(M_KK, system.symbols.q_D),
        len(states), coupling, D_change, K_change, impact_share,
    )  # fmt: skip


def blocks(marionette: Marionette, x: State) -> tuple[Array, Array, Array]:
    """M_DD (n_vD, n_vD), M_DK (n_vD, n_vK), M_KK (n_vK, n_vK) at a state."""
    found = marionette.equations["mass_matrix"](q_D=x.q_D, q_K=x.q_K, p=marionette.p)
    return np.array(found["M"]), np.array(found["M_DK"]), np.array(found["M_KK"])


def _contains(block: Array, symbols: ca.SX) -> bool:
    """Whether any entry depends on any of the symbols."""
    entries = ca.vertcat(*block.flat) if block.size else ca.SX(0, 1)
    return bool(ca.depends_on(entries, symbols)) if symbols.numel() else False


def _relative(block: Array, rows: Array, columns: Array) -> float:
    """Largest entry relative to the scales of its row and column; 0 where a scale is 0."""
    scale = np.outer(rows, columns)
    known = scale > MASSLESS
    return float(np.max(np.abs(block[known]) / scale[known], initial=0.0))
