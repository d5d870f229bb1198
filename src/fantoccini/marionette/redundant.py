"""Redundant strings whose lengths contradict one another.

More rigid strings than degrees of freedom hold a body only while their lengths agree. With
tensions y >= 0 that balance by themselves,

    A_D^T y = 0,  sum y = 1,   y . hdot = y . A_K v_K,   y . hddot = y . (A_K acc_K + rates)

no motion satisfies rows with y . hdot > 0, or y . hdot = 0 and y . hddot > 0. Integrators of rigid
strings answer with tensions without bound, or with tensions that only their own regularisation
bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.model import Model
from fantoccini.motion import State
from fantoccini.tree import Role, StringRow

Motion = tuple[State, Array]
"""A state and (n_vK,) the accelerations of the driven coordinates there."""

STOPPED_BY = (
    Status.IMPOSSIBLE_INPUT,
    Status.TENSION_CAP,
    Status.TOO_MANY_EVENTS,
    Status.NOT_SETTLED,
    Status.PROJECTION_FAILED,
    Status.STEP_TOO_SMALL,
)
"""Statuses that strings which contradict one another lead to."""

_NEAR = 1e-6
"""Gap below which a string counts as holding, relative to its length."""
_PULLS = 1e-6
"""Part of the largest entry of y from which a string takes part."""
_DEPENDS = 1e-9
"""Singular values below this part of the largest are none."""
_EXCESS = 10.0
"""Tensions above so many times those of least norm and the weight come of a contradiction."""
_RECURS = 2
"""Rows at which they have to be found."""
_MOST_LOOKS = 32
"""Rows of a run whose tensions are looked at."""
_NOISE = 1e-10
"""m/s: a rate of contradiction that is rounding."""


@dataclass(frozen=True)
class Contradiction:
    """What redundant strings ask for together.

    Attributes:
        names: of the strings.
        freedoms: degrees of freedom that they move.
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


def may_contradict(model: Model) -> bool:
    """Whether some rigid strings of the puppet are more than the degrees of freedom they move.

    By Hall's theorem there are none where every string can be given a degree of freedom of its own.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import maximum_bipartite_matching

    strings = model.tree.strings
    moved = [
        _moved(model, s)
        for s, most in zip(strings, model.upper[: len(strings)], strict=True)
        if not np.isfinite(most)
    ]
    moved = [places for places in moved if places]
    if not moved:
        return False
    reaches = np.zeros((len(moved), model.coordinates.n_vD), dtype=np.int8)
    for row, places in zip(reaches, moved, strict=True):
        row[list(places)] = 1
    own = maximum_bipartite_matching(csr_array(reaches), perm_type="column")
    return bool(np.any(own < 0))


def contradiction(model: Model, x: State, acc_K: Array) -> Contradiction | None:
    """What redundant strings contradict one another in at a state; None where none do.

    Args:
        model: the puppet.
        x: the state.
        acc_K: (n_vK,) accelerations of the driven coordinates.
    """
    x = x.replace(slip=np.maximum(x.slip, 0.0))  # that of a winch which slips may be rounding
    instant = instant_at(model, x, acc_K)
    n = len(model.tree.strings)
    scale = model.row_scales(x.q_D, x.q_K)[:n]
    holds = np.flatnonzero((instant.h[:n] >= -_NEAR * scale) & ~np.isfinite(model.upper[:n]))
    W = instant.W[:, holds]
    if not len(holds) or np.linalg.matrix_rank(W, _DEPENDS * np.linalg.norm(W, 2)) == len(holds):
        return None
    hddot = instant.gamma[holds] + W.T @ instant.w0
    found = []
    for asked in (instant.hdot[holds], hddot):
        y = _self_stress(W, asked)
        if y is None:
            return None
        found.append((y, float(asked @ y)))
    (y, speed), (y_rate, acceleration) = found
    y = y if speed > _NOISE else y_rate
    group, freedoms = _group(model, holds, holds[y > _PULLS * np.max(y)])
    if not freedoms or len(group) <= freedoms:
        return None  # a string that moves nothing contradicts its own ends
    names = tuple(model.tree.strings[i].name for i in group)
    return Contradiction(names, freedoms, speed, acceleration)


def overpulled(
    model: Model, tension: Array, motion: Callable[[int], Motion]
) -> int | None:
    """The first row of a run at which tensions are far beyond what its motion needs, or None.

    Of all tensions x >= 0 with the same A_D^T x the least are compared: what exceeds them are
    tensions that pull against one another. Once, as at a catch, is no contradiction.

    Args:
        model: the puppet.
        tension: (T, n_strings) [N].
        motion: row -> the state there and the driven accelerations.
    """
    pulls = np.max(tension, axis=1, initial=0.0)
    rows = np.flatnonzero(pulls > _EXCESS * model.reference_force)
    looks = rows[:: max(1, len(rows) // _MOST_LOOKS)]
    beyond = [int(row) for row in looks if _exceeds(model, tension[row], *motion(int(row)))]
    return beyond[0] if len(beyond) >= _RECURS else None


def _exceeds(model: Model, tension: Array, x: State, acc_K: Array) -> bool:
    some = np.flatnonzero(tension > 0.0)
    W = instant_at(model, x.replace(slip=()), acc_K).W[:, some]
    if np.max(np.abs(W), initial=0.0) == 0.0:
        return False  # strings that move nothing pull against no other
    least = _least(W, tension[some])
    return bool(np.max(tension) > _EXCESS * (np.max(least) + model.reference_force))


def _self_stress(W: Array, asked: Array) -> Array | None:
    """y >= 0 with W y = 0 and sum y = 1 of largest asked . y; None where there is no such y."""
    from scipy.optimize import linprog

    size = np.max(np.abs(W), initial=0.0)
    if size == 0.0:
        return None  # strings that move nothing: each contradicts its own ends
    equal = np.vstack([W / size, np.ones(len(asked))])
    right = np.append(np.zeros(len(W)), 1.0)
    largest = np.max(np.abs(asked), initial=0.0) or 1.0
    found = linprog(-asked / largest, A_eq=equal, b_eq=right, bounds=(0.0, None))
    return found.x if found.success else None


def _least(W: Array, x: Array) -> Array:
    """The shortest z >= 0 with W z = W x."""
    from scipy.optimize import nnls

    heavy = 1e6 / np.max(np.abs(W))
    return nnls(np.vstack([heavy * W, np.eye(len(x))]), np.append(heavy * (W @ x), 0.0 * x))[0]


def _group(model: Model, holds: Array, stressed: Array) -> tuple[list[int], int]:
    """The strings that hold and move nothing but what stressed ones do, and how much that is."""
    strings = model.tree.strings
    moved = set().union(*(_moved(model, strings[i]) for i in stressed))
    group = [int(i) for i in holds if _moved(model, strings[i]) <= moved]
    return group, len(moved)


def _moved(model: Model, string: StringRow) -> set[int]:
    """Places in v_D that a string can pull at."""
    tree = model.tree
    ways = {i for point in string.points for i in tree.ancestors(point.link)}
    links = [tree.links[i] for i in ways if tree.links[i].role is Role.DYNAMIC]
    places = {k for link in links for k in range(link.v.start, link.v.stop)}
    return places | ({string.wound_length[1]} if string.wound_length else set())
