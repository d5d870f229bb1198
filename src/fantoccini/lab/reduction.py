"""Check of the claims of the paper's Sec. VI for one puppet: may driven coordinates be inputs?

Sec. VI moves the driven coordinates by drives, here of inertia J. Over v = (v_D, v_K) the kinetic
energy then has the metric M = [M_DD, M_DK; M_DK^T, M_KK + J]. A force on driven coordinate i
accelerates along Y_i = M^-1 e_i; with taut rows A = [A_D A_K] along X_i = P Y_i, P the M-orthogonal
projection on A v = 0. The section asks for M_DK = 0, M_DD(q_D), M_KK(q_K) and symmetric products
<X_i, X_j> in span{X_k}. The mixed model needs less: that the drives can produce any acc_K.

q_D are dynamic coordinates and q_K driven ones (ends and lengths of strings, driven joints). A row
is a string or a limit with its gap; A_D and A_K are the derivatives of the gaps, and a row is taut
if its gap is 0. A drive is a motor with a controller.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fantoccini.base import Array, nonnegative_least_squares
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.reduction_states import (
    Rows,
    drive_inertia,
    in_metres,
    metric,
    random_states,
    taut_states,
    without_drives,
)
from fantoccini.motion import State

N_STATES = 12
"""Configurations of each kind."""
MAX_OUTSIDE_SHARE = 1e-9
"""Largest share outside of a span, relative entry or relative change that counts as rounding."""
RANK_TOL = 1e-9
"""Largest singular value, load or residual that counts as zero, relative to the largest of all."""
TIE_TOLERANCE = 1e-6
"""Largest component of a string in the null space of A_D^T (rows of unit length) that counts as
zero."""
MIN_DIVISOR = 1e-300
"""Smallest divisor; M_KK is 0 for a coordinate that moves no mass."""


@dataclass(frozen=True)
class Claim:
    """A claim of Sec. VI.

    Attributes:
        text: the claim.
        holds: for this puppet; None if it does not apply.
        evidence: the reason, with numbers.
    """

    text: str
    holds: bool | None
    evidence: str


@dataclass(frozen=True)
class KineticEnergy:
    """The blocks of the kinetic energy's matrix, without drives: largest values over the states.

    Attributes:
        coupling: |M_DK| / sqrt(M_DD M_KK).
        coupled: the dynamic and the driven velocity with the largest coupling; empty if M_DK is 0.
        M_DD_change, M_KK_change: change of M_DD with q_K alone, of M_KK with q_D alone, relative to
            the diagonal entries of its row and column.
        impact_share: share of the kinetic energy of a single driven coordinate that the puppet
            absorbs when it starts with a jump, v . M_KD M_DD^-1 M_DK v / v . M_KK v.
    """

    coupling: float
    coupled: tuple[str, ...]
    M_DD_change: float
    M_KK_change: float
    impact_share: float


@dataclass(frozen=True)
class Tracking:
    """The drives' accelerations with some strings taut, acc_K = G u_K + ...

    Attributes:
        min_singular_value: smallest singular value of F^-T A_D^T with columns of length 1,
            M_DD = F^T F: 1 if the strings accelerate the puppet at right angles to one another, 0
            if they depend linearly.
        min_acceleration: smallest eigenvalue of D G D, D^2 the diagonal of M_KK + J: the share of
            its acceleration that a drive keeps.
        tied: strings that tie drives to one another; empty if G is regular.
        pulls_apart: the drives can pull the tied strings against one another.
    """

    min_singular_value: float
    min_acceleration: float
    tied: tuple[str, ...]
    pulls_apart: bool


@dataclass(frozen=True)
class ReductionReport:
    """Claims of Sec. VI that hold for a puppet, and the consequences for the mixed model.

    Attributes:
        name: name of the puppet.
        driven: its driven velocities.
        kinetic: the blocks of the kinetic energy.
        slack: largest share of a symmetric product outside span{Y_k}, with slack strings.
        taut: the same for span{X_k}, one value for each configuration with taut strings.
        tracking: accelerations that the drives can produce, one for each of these configurations.
    """

    name: str
    driven: tuple[str, ...]
    kinetic: KineticEnergy
    slack: float
    taut: tuple[float, ...]
    tracking: tuple[Tracking, ...]

    @property
    def valid(self) -> bool:
        """Whether driven coordinates may be inputs: no drives can pull against one another."""
        return not any(t.pulls_apart for t in self.tracking)

    @property
    def tied(self) -> dict[tuple[str, ...], int]:
        """Strings that tie drives to one another -> number of configurations."""
        return dict(Counter(t.tied for t in self.tracking if t.tied))

    @property
    def claims(self) -> tuple[Claim, ...]:
        """The claims of Sec. VI in order."""
        kinetic, count = self.kinetic, f"({N_STATES} configurations)"
        pair = f", of {' with '.join(kinetic.coupled)}" if kinetic.coupled else ""
        D, K = kinetic.M_DD_change, kinetic.M_KK_change
        any_acc_K, products = None, None
        reason = outside = "no configuration with taut strings"
        if n := len(self.taut):
            any_acc_K, products = not self.tied, max(self.taut) <= MAX_OUTSIDE_SHARE
            tied = ", ".join(f"{' + '.join(names)} ({k})" for names, k in self.tied.items())
            share = min(t.min_acceleration for t in self.tracking)
            smallest = min(t.min_singular_value for t in self.tracking)
            reason = (
                f"strings tie drives to one another: {tied} of {n} configurations"
                if tied
                else f"a drive keeps {share:.2g} or more of its acceleration; smallest singular "
                f"value of the scaled A_D {smallest:.2g} ({n} configurations)"
            )
            outside = (
                f"outside in {sum(share > MAX_OUTSIDE_SHARE for share in self.taut)} of {n} "
                f"configurations; largest part outside {max(self.taut):.2g}"
            )
        return (
            Claim(
                "the kinetic energy is block diagonal in [q_D, q_K]",
                not pair,
                f"largest |M_DK| {kinetic.coupling:.2g} of sqrt(M_DD M_KK){pair} {count}",
            ),
            Claim(
                "each block depends on its own coordinates alone",
                max(D, K) <= MAX_OUTSIDE_SHARE,
                f"M_DD changes with q_K by {D:.2g} of itself, M_KK with q_D by {K:.2g} {count}",
            ),
            Claim(
                "<Y_i, Y_j> lies in span{Y_k} while the strings are slack",
                self.slack <= MAX_OUTSIDE_SHARE,
                f"largest part outside {self.slack:.2g} {count}",
            ),
            Claim("with taut strings the drives can still give any acc_K", any_acc_K, reason),
            Claim(
                "<X_i, X_j> lies in span{X_k} with taut strings, constrained connection",
                products,
                outside,
            ),
        )

    @property
    def conclusion(self) -> str:
        """Sentence that says whether driven coordinates may be inputs, and why."""
        if not self.valid:
            strings = " and ".join(next(t.tied for t in self.tracking if t.pulls_apart))
            return (
                f"no: the drives can pull {strings} against one another; motions that do so have "
                "no solution in the mixed model, and stop a run with a status"
            )
        share = self.kinetic.impact_share
        return (
            "yes: the mixed model is exact if the drives follow inputs of bounded acceleration"
            + (
                f"; a jump of v_K would give the puppet up to {100.0 * share:.2g} % of a driven "
                "coordinate's kinetic energy"
                if share > MAX_OUTSIDE_SHARE
                else ""
            )
            + ("; tied strings go slack if the drives move apart" if self.tied else "")
        )


def validate_reduction(marionette: Marionette) -> ReductionReport:
    """The claims of Sec. VI, checked at random configurations; nothing is simulated.

    Every driven coordinate gets a drive as heavy as the puppet, instead of those of the file.

    Raises:
        PuppetError: no coordinate is driven.
        StateError: the puppet has contact.
    """
    mixed, rng = without_drives(marionette), np.random.default_rng(0)
    inertia = np.where(in_metres(mixed)[mixed.coordinates.n_vD :], *drive_inertia(mixed))
    states = random_states(mixed, N_STATES, rng)
    configurations = taut_states(mixed, N_STATES, rng)
    return ReductionReport(
        mixed.name,
        mixed.coordinates.v_K,
        kinetic_energy(mixed, states),
        max(symmetric_products(mixed, x, inertia)[1] for x in states),
        tuple(symmetric_products(mixed, x, inertia, rows)[1] for x, rows in configurations),
        tuple(tracking(mixed, x, inertia, rows) for x, rows in configurations),
    )


def kinetic_energy(marionette: Marionette, states: list[State]) -> KineticEnergy:
    """The blocks at two or more random configurations, each compared with the next."""
    n, table = marionette.coordinates.n_vD, marionette.coordinates
    shares, D_change, K_change, impact_share = np.zeros((n, table.n_vK)), 0.0, 0.0, 0.0
    for x, next_state in zip(states, [*states[1:], *states[:1]], strict=True):
        M = metric(marionette, x)
        scale, M_DK = np.sqrt(np.maximum(np.diag(M), 0.0)), M[:n, n:]
        shares = np.maximum(shares, _relative(M, scale)[:n, n:])
        change_with_K = _relative(metric(marionette, x.replace(q_K=next_state.q_K)) - M, scale)[
            :n, :n
        ]
        change_with_D = _relative(metric(marionette, x.replace(q_D=next_state.q_D)) - M, scale)[
            n:, n:
        ]
        D_change = max(D_change, float(np.max(change_with_K, initial=0.0)))
        K_change = max(K_change, float(np.max(change_with_D, initial=0.0)))
        absorbed_energy = M_DK.T @ np.linalg.solve(M[:n, :n], M_DK)
        absorbed_energy = np.diag(_relative(absorbed_energy, scale[n:]))
        impact_share = max(impact_share, float(np.max(absorbed_energy, initial=0.0)))
    i, j = np.unravel_index(np.argmax(shares), shares.shape) if shares.size else (0, 0)
    coupling = float(np.max(shares, initial=0.0))
    pair = (table.v_D[i], table.v_K[j]) if coupling > MAX_OUTSIDE_SHARE else ()
    return KineticEnergy(coupling, pair, D_change, K_change, impact_share)


def _relative(block: Array, divisor: Array) -> Array:
    """|block[i, j]| / (size[i] size[j]); 0 where the divisor is 0."""
    divisor = np.outer(divisor, divisor)
    return np.divide(np.abs(block), divisor, out=np.zeros_like(block), where=divisor > MIN_DIVISOR)


def symmetric_products(
    marionette: Marionette, x: State, inertia: Array, rows: Rows | tuple[int, ...] = ()
) -> tuple[Array, float]:
    """<X_i, X_j> (n, n_vK, n_vK) over (v_D, v_K), and their largest share outside of span{X_k}.

    The symmetric product is <X, Y> = nabla_X Y + nabla_Y X, with P before it if strings are taut
    (constrained connection). With C(q, v) of Eq. 8 (dM/dt - 2 C skew) and multipliers mu,

        X_i = M^-1 (e_i + A^T mu_i),   A X_i = 0
        <X_i, X_j> = -P M^-1 (C(X_j)^T X_i + C(X_i)^T X_j - dA(X_j)^T mu_i - dA(X_i)^T mu_j)

    With slack strings it is the gradient of the (i, j) entry of the driven block of M^-1. The share
    is a norm in the metric M, relative to the norms of the four terms, 0 to 1.

    Args:
        marionette: the puppet.
        x: the configuration; velocities do not matter.
        inertia: (n_vK,) of the drives, J [kg or kg m^2]; equal for the three axes of a rotation.
        rows: taut strings; none by default.
    """
    n_vD, k, taut = marionette.coordinates.n_vD, len(inertia), np.asarray(rows, dtype=int)
    n = n_vD + k
    A = np.hstack([marionette.A_D(x), marionette.A_K(x)])[taut]
    L = np.linalg.cholesky(metric(marionette, x, inertia))
    free_fields, W = np.linalg.solve(L, np.eye(n)[:, n_vD:]), np.linalg.solve(L, A.T)
    mu = -np.linalg.pinv(W, rcond=RANK_TOL) @ free_fields
    fields = np.linalg.solve(L.T, free_fields + W @ mu)
    C, Adot = np.zeros((k, n, n)), np.zeros((k, len(taut), n))
    for i in range(k):
        moving_state = x.replace(v_D=fields[:n_vD, i], v_K=fields[n_vD:, i])
        C[i] = marionette.interpreted("coriolis", moving_state).C
        rate = marionette.interpreted("A_rate", moving_state)
        Adot[i] = np.hstack([rate.Adot_D, rate.Adot_K])[taut]
    row_basis, field_basis = _basis(W), _basis(free_fields + W @ mu)
    products, outside = np.zeros((n, k, k)), 0.0
    for i in range(k):
        for j in range(i + 1):
            terms = np.stack(
                [
                    -C[j].T @ fields[:, i],
                    -C[i].T @ fields[:, j],
                    Adot[j].T @ mu[:, i],
                    Adot[i].T @ mu[:, j],
                ],
                axis=1,
            )
            terms = np.linalg.solve(L, terms)
            terms = terms - row_basis @ (row_basis.T @ terms)
            total = terms.sum(axis=1)
            outside_part = total - field_basis @ (field_basis.T @ total)
            scale = float(np.sum(np.linalg.norm(terms, axis=0)))
            products[:, i, j] = products[:, j, i] = np.linalg.solve(L.T, total)
            outside = max(outside, float(np.linalg.norm(outside_part)) / max(scale, MIN_DIVISOR))
    return products, outside


def _basis(columns: Array) -> Array:
    """(n, rank) orthonormal basis of the columns' span."""
    U, s, _ = np.linalg.svd(columns, full_matrices=False)
    return U[:, s > RANK_TOL * np.max(s, initial=0.0)] if len(s) else columns[:, :0]


def tracking(marionette: Marionette, x: State, inertia: Array, rows: Rows) -> Tracking:
    """Accelerations that the drives can produce at x while some strings are taut.

    G, the driven block of M^-1 - M^-1 A^T (A M^-1 A^T)^-1 A M^-1, is regular if and only if no
    tensions y have A_D^T y = 0 and A_K^T y != 0. Strings with such a y tie drives to one another.
    If y >= 0, the drives can pull against one another, and some of their motions are impossible; if
    its signs differ, one of the strings goes slack instead.
    """
    n, M = marionette.coordinates.n_vD, metric(marionette, x, inertia)
    A_D, A_K = marionette.A_D(x)[rows], marionette.A_K(x)[rows]
    W = np.linalg.solve(np.linalg.cholesky(M[:n, :n]), A_D.T)
    W = W / np.maximum(np.linalg.norm(W, axis=0), MIN_DIVISOR)
    _, s, V = np.linalg.svd(np.hstack([A_D, A_K]))
    N = V[int(np.sum(s > RANK_TOL * np.max(s, initial=0.0))) :].T  # null space of A
    G = (N @ np.linalg.solve(N.T @ M @ N, N.T))[n:, n:]
    D = np.sqrt(np.diag(M)[n:])
    tied, pulls_apart = _ties(A_D, A_K)
    return Tracking(
        float(np.linalg.svd(W, compute_uv=False)[-1]) if W.shape[0] >= W.shape[1] else 0.0,
        float(np.linalg.eigvalsh(D[:, None] * G * D)[0]),
        tuple(marionette.tree.strings[i].name for i in rows[tied]),
        pulls_apart,
    )


def _ties(A_D: Array, A_K: Array) -> tuple[NDArray[np.bool_], bool]:
    """(n,) mask of rows in a y with A_D^T y = 0, A_K^T y != 0; whether some such y is >= 0."""
    scale = np.maximum(np.linalg.norm(np.hstack([A_D, A_K]), axis=1), MIN_DIVISOR)[:, None]
    A_D, A_K = A_D / scale, A_K / scale
    U, s, _ = np.linalg.svd(A_D)
    null_space = U[:, int(np.sum(s > RANK_TOL * np.max(s, initial=0.0))) :]
    loads = (
        null_space @ np.linalg.svd(A_K.T @ null_space)[2].T if null_space.shape[1] else null_space
    )
    loads = loads[:, np.linalg.norm(A_K.T @ loads, axis=0) > RANK_TOL]
    tied = np.linalg.norm(loads, axis=1) > TIE_TOLERANCE
    if not np.any(tied):
        return tied, False
    # y >= 0 with A_D^T y = 0 and a sum of 1, by least squares.
    B = np.vstack([A_D[tied].T, np.ones(int(tied.sum()))])
    y, residual = nonnegative_least_squares(B, np.append(np.zeros(A_D.shape[1]), 1.0))
    return tied, bool(residual < RANK_TOL and np.linalg.norm(A_K[tied].T @ y) > RANK_TOL)
