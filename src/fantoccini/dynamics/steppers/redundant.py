"""Redundant strings whose lengths contradict one another.

More rigid strings than degrees of freedom hold a body only while their lengths agree. For a
self-stress, tensions y >= 0 that balance,

    A_D^T y = 0,  sum y = 1,   y . hdot = y . A_K v_K,   y . hddot = y . (A_K acc_K + rates)

no motion satisfies rows with y . hdot > 0, or y . hdot = 0 and y . hddot > 0. Integrators of rigid
strings then give unbounded tensions, or tensions that only their own regularisation bounds.

h is the gap of a string, path length minus string length, A_D and A_K its derivatives by the
dynamic and the driven coordinates; v_K and acc_K are the driven velocities and accelerations, and a
row is a string with its gap. A winch changes the length of a string; slip is the length that it
lets out at its largest tension. A taut string pulls, a slack one does not. With the inertia matrix
M_DD = F^T F, w0 = F^-T f are the scaled forces f without strings, and W = F^-T A_D^T those of unit
tensions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, Status, nonnegative_least_squares
from fantoccini.dynamics.compiled import CompiledPuppet, Evaluation
from fantoccini.model.tree import Role, StringRow
from fantoccini.motion import State

Motion = tuple[State, Array]
"""A state and the accelerations (n_vK,) of the driven coordinates there."""

CONTRADICTION_STATUSES = (
    Status.IMPOSSIBLE_INPUT,
    Status.TENSION_CAP,
    Status.TOO_MANY_EVENTS,
    Status.NOT_SETTLED,
    Status.PROJECTION_FAILED,
    Status.STEP_TOO_SMALL,
)
"""Statuses of runs that may end because of contradicting strings."""


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of contradictions between strings."""

    taut_gap: float = 1e-6  # -h below which a string counts as taut, relative to its length
    min_share: float = 1e-6  # Part of the largest entry of y above which a string takes part
    dependence: float = 1e-9
    """Singular value of W, relative to the largest, below which strings are redundant."""
    min_excess: float = 10.0
    """Tensions that only a contradiction explains, relative to the least ones plus the weight."""
    min_samples: int = 2
    """Minimum number of samples with such tensions: one, as at a catch, is no contradiction."""
    max_samples: int = 32  # Maximum number of samples examined in a run, which bounds the time
    speed_rounding: float = 1e-10  # y . hdot that counts as rounding [m/s]
    equality_weight: float = 1e6  # Weight of W z = W x against |z| in least tensions, relative to W


TOLERANCES = Tolerances()


@dataclass(frozen=True)
class Contradiction:
    """Rates at which the lengths of redundant strings contradict one another.

    Attributes:
        names: names of the strings.
        freedoms: number of degrees of freedom that they move.
        speed: y . hdot [m/s].
        acceleration: y . hddot [m/s^2].
    """

    names: tuple[str, ...]
    freedoms: int
    speed: float
    acceleration: float

    def __str__(self) -> str:
        return (
            f"{', '.join(self.names)} are {len(self.names)} strings on {self.freedoms} degrees of "
            f"freedom, and their lengths contradict one another by {max(0.0, self.speed):.2g} m/s "
            f"and {max(0.0, self.acceleration):.2g} m/s^2, which rigid strings cannot bear: drop "
            "strings, let some hang slack, or give some a max_tension, so that winches give way"
        )


def may_be_redundant(marionette: CompiledPuppet, *, winches: bool = False) -> bool:
    """Whether the puppet has more rigid strings than the degrees of freedom that they move.

    By Hall's theorem it does not if every string can be assigned its own degree of freedom.

    Args:
        marionette: the puppet.
        winches: whether strings with a largest tension count, too.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    strings = marionette.tree.strings
    moved_velocities = [
        _velocity_indices(marionette, s)
        for s, max_tension in zip(strings, marionette.max_forces[: len(strings)], strict=True)
        if winches or not np.isfinite(max_tension)
    ]
    moved_velocities = [velocities for velocities in moved_velocities if velocities]
    if not moved_velocities:
        return False
    incidence = np.zeros((len(moved_velocities), marionette.coordinates.n_vD), dtype=np.int8)
    for row, velocities in zip(incidence, moved_velocities, strict=True):
        row[list(velocities)] = 1
    matching = maximum_bipartite_matching(csr_array(incidence), perm_type="column")
    return bool(np.any(matching < 0))


def contradiction(marionette: CompiledPuppet, x: State, acc_K: Array) -> Contradiction | None:
    """Contradiction of redundant strings at a state; None without one."""
    x = x.replace(slip=np.maximum(x.slip, 0.0))  # rounding may make the slip negative
    evaluation = Evaluation.at_state(marionette, x, acc_K)
    n = len(marionette.tree.strings)
    scale = marionette.row_scales(x.q_D, x.q_K)[:n]
    is_rigid = ~np.isfinite(marionette.max_forces[:n])
    rigid_taut = np.flatnonzero((evaluation.h[:n] >= -TOLERANCES.taut_gap * scale) & is_rigid)
    W = evaluation.W[:, rigid_taut]
    threshold = TOLERANCES.dependence * np.linalg.norm(W, 2) if len(rigid_taut) else 0.0
    if not len(rigid_taut) or np.linalg.matrix_rank(W, threshold) == len(rigid_taut):
        return None
    hddot = evaluation.gamma[rigid_taut] + W.T @ evaluation.w0
    stresses_and_rates = []
    for rate in (evaluation.hdot[rigid_taut], hddot):
        y = _self_stress(W, rate)
        if y is None:
            return None
        stresses_and_rates.append((y, float(rate @ y)))
    (y, speed), (y_rate, acceleration) = stresses_and_rates
    y = y if speed > TOLERANCES.speed_rounding else y_rate
    stressed = rigid_taut[y > TOLERANCES.min_share * np.max(y)]
    string_group, freedoms = _group(marionette, rigid_taut, stressed)
    if not freedoms or len(string_group) <= freedoms:
        return None  # a string that moves nothing contradicts its own ends
    names = tuple(marionette.tree.strings[i].name for i in string_group)
    return Contradiction(names, freedoms, speed, acceleration)


def first_excess_tension(
    marionette: CompiledPuppet, tension: Array, motion: Callable[[int], Motion]
) -> int | None:
    """First sample with tensions far above those that its motion needs; None without one.

    They are compared with the least tensions x >= 0 of equal A_D^T x; the excess are tensions that
    pull against one another.
    against one another.

    Args:
        marionette: the puppet.
        tension: (T, n_strings) tensions [N].
        motion: callback: sample -> state and driven accelerations.
    """
    max_tensions = np.max(tension, axis=1, initial=0.0)
    large_samples = np.flatnonzero(
        max_tensions > TOLERANCES.min_excess * marionette.reference_force
    )
    selected = large_samples[:: max(1, len(large_samples) // TOLERANCES.max_samples)]
    excess = [int(i) for i in selected if _exceeds(marionette, tension[i], *motion(int(i)))]
    return excess[0] if len(excess) >= TOLERANCES.min_samples else None


def _exceeds(marionette: CompiledPuppet, tension: Array, x: State, acc_K: Array) -> bool:
    taut = np.flatnonzero(tension > 0.0)
    W = Evaluation.at_state(marionette, x.replace(slip=()), acc_K).W[:, taut]
    if np.max(np.abs(W), initial=0.0) == 0.0:
        return False  # strings that move nothing pull against no other
    threshold = np.max(_least_tensions(W, tension[taut]))
    return bool(np.max(tension) > TOLERANCES.min_excess * (threshold + marionette.reference_force))


def _self_stress(W: Array, rate: Array) -> Array | None:
    """Vector y >= 0 with W y = 0, sum y = 1 and largest rate . y; None without one."""
    from scipy.optimize import linprog

    size = np.max(np.abs(W), initial=0.0)
    if size == 0.0:
        return None  # strings that move nothing: each contradicts its own ends
    equations = np.vstack([W / size, np.ones(len(rate))])
    right_side = np.append(np.zeros(len(W)), 1.0)
    rate_scale = np.max(np.abs(rate), initial=0.0) or 1.0
    solutions = linprog(-rate / rate_scale, A_eq=equations, b_eq=right_side, bounds=(0.0, None))
    return solutions.x if solutions.success else None


def _least_tensions(W: Array, x: Array) -> Array:
    """Vector z >= 0 of least norm with W z = W x."""
    equality_scale = TOLERANCES.equality_weight / np.max(np.abs(W))
    stacked = np.vstack([equality_scale * W, np.eye(len(x))])
    return nonnegative_least_squares(stacked, np.append(equality_scale * (W @ x), 0.0 * x))[0]


def _group(marionette: CompiledPuppet, holds: Indices, stressed: Indices) -> tuple[list[int], int]:
    """Taut strings that move only freedoms of stressed strings, and the number of freedoms."""
    strings = marionette.tree.strings
    moved_velocities = set().union(*(_velocity_indices(marionette, strings[i]) for i in stressed))
    group = [int(i) for i in holds if _velocity_indices(marionette, strings[i]) <= moved_velocities]
    return group, len(moved_velocities)


def _velocity_indices(marionette: CompiledPuppet, string: StringRow) -> set[int]:
    """Indices in v_D of the velocities that a string can change."""
    tree = marionette.tree
    links_above = {i for point in string.points for i in tree.ancestors(point.link)}
    links = [tree.links[i] for i in links_above if tree.links[i].role is Role.DYNAMIC]
    velocities = {k for link in links for k in range(link.v.start, link.v.stop)}
    return velocities | ({string.wound_length[1]} if string.wound_length else set())
