"""Part (c), the other half: a string with mass. No bandwidth brings the mixed model back.

One string becomes a chain of point masses between stiff springs, the rest stays as it is. Its
masses are coordinates that the mixed model does not have, so that the motions stay apart by an
amount that goes with the string's mass, however well the drives track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import FantocciniError
from fantoccini.marionette import Event
from fantoccini.motion import State, tangent
from fantoccini.puppet import Chain, Parameter, Puppet, String
from fantoccini.reduction.bandwidth import Tracked, beside
from fantoccini.reduction.mechanism import Mechanism
from fantoccini.reduction.motions import Motion
from fantoccini.simulation import simulate

STRING_MASS = "reduction_string_mass"
MASSES = (0.01, 0.03, 0.1)
"""Masses of the string, over that of the puppet."""
BANDWIDTHS = tuple(20.0 * 4.0**k for k in range(4))
"""Of the drives, over sqrt(g/l)."""
_PIECES = 4
_STIFFNESS = 20_000.0
"""EA of the string, over the puppet's weight."""
_DAMPING = 0.02
"""Of a piece's stretch, as a part of what would damp it critically for the lightest string."""
_RTOL = 1e-8


@dataclass(frozen=True, eq=False)
class Massive:
    """A string of some mass, with drives of several bandwidths.

    Attributes:
        string: the one that is a chain.
        mass: of it [kg].
        coupling: largest |M_DK| / sqrt(M_DD M_KK) that a straight string of that mass makes, with
            drives as heavy as the puppet.
        exact: the mixed model with that string beside the massless one, both counted from rest.
        tracked: the full model with it, in the same way.
    """

    string: str
    mass: float
    coupling: float
    exact: Tracked
    tracked: tuple[Tracked, ...]


class NoStringError(FantocciniError):
    """No string of the puppet can be a chain."""


def heaviest(motion: Motion, puppet: Puppet) -> str:
    """The string that pulls most at the start, of those that can be chains.

    Raises:
        NoStringError: there is none that pulls.
    """
    pulls = {
        s.name: float(motion.run.tension[s.name][0]) for s in puppet.strings if _can_be_chain(s)
    }
    name = max(pulls, key=lambda n: pulls[n], default="")
    if not name or pulls[name] <= 0.0:
        raise NoStringError("no string that pulls at rest can be a chain of masses")
    return name


def massive(
    mechanism: Mechanism,
    motion: Motion,
    masses: tuple[float, ...] = MASSES,
    bandwidths: tuple[float, ...] = BANDWIDTHS,
) -> list[Massive]:
    """The motion with one string heavier and heavier, on drives of several bandwidths.

    Args:
        mechanism: the puppet.
        motion: of the mixed model.
        masses: of the string, over that of the puppet.
        bandwidths: over sqrt(g/l).

    Raises:
        NoStringError: no string can be a chain.
    """
    name = heaviest(motion, mechanism.mixed.puppet.expanded())
    own = mechanism.chained(name, _chain(mechanism))
    full, found = own.full(bandwidth=1.0), []
    options = {"method": Event(rtol=_RTOL, atol=_RTOL), "effort": False, "throw": False}
    for share in masses:
        given = {STRING_MASS: share * mechanism.mixed.mass}
        heavy = own.mixed.with_parameters(given)
        start = heavy.rest(heavy.state(mechanism.values(motion.x0)))
        commands = own.commanded(full, motion.inputs)
        end = motion.inputs.end
        run = simulate(heavy, start, own.commanded(heavy, motion.inputs), end, **options)
        runs = [beside(mechanism, motion.run, run, np.inf, from_rest=True)]
        for w in (w / mechanism.pace for w in bandwidths):
            tuned = mechanism.tuned(full.with_parameters(given), 1.0, w)
            run = simulate(tuned, own.state(tuned, start), commands, end, **options)
            runs.append(beside(mechanism, motion.run, run, w, from_rest=True))
        mass = share * mechanism.mixed.mass
        coupling = straight_coupling(mechanism, motion.x0, name, mass)
        found.append(Massive(name, mass, coupling, runs[0], tuple(runs[1:])))
    return found


def straight_coupling(mechanism: Mechanism, x: State, name: str, mass: float) -> float:
    """|M_DK| / sqrt(M_DD M_KK) of a uniform string that stays straight between its ends.

    T = m/6 (v_A.v_A + v_A.v_S + v_S.v_S) of ends A on the puppet and S on the mechanism, so that
    M_DK = m/6 J_A^T J_S.
    """
    mixed = mechanism.mixed
    table, step = mixed.coordinates, 1e-6
    index = [s.name for s in mixed.tree.strings].index(name)

    def ends(move: Array) -> Array:
        q_D = tangent.moved(table.scalars_D, table.quaternions_D, x.q_D, move[: table.n_vD])
        q_K = tangent.moved(table.scalars_K, table.quaternions_K, x.q_K, move[table.n_vD :])
        return mixed.string_points(q_D, q_K)[index][[0, -1]].ravel()

    n = table.n_vD + table.n_vK
    J = np.array([(ends(step * e) - ends(-step * e)) / (2 * step) for e in np.eye(n)]).T
    weights = np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]) * mass / 6.0, np.eye(3))
    T = J.T @ weights @ J
    M_DD = mixed.mass_matrix(x) + T[: table.n_vD, : table.n_vD]
    M_KK = np.diag(mixed.mass_matrix_KK(x)) + mechanism.inertia(1.0) + np.diag(T)[table.n_vD :]
    scale = np.sqrt(np.outer(np.diag(M_DD), M_KK))
    return float(np.max(np.abs(T[: table.n_vD, table.n_vD :]) / scale))


def _can_be_chain(string: String) -> bool:
    bounces = not isinstance(string.restitution, float) or string.restitution > 0
    slips = string.max_tension is not None or string.wire or bounces
    return not slips and len(string.path) == 2 and string.chain is None


def _chain(mechanism: Mechanism) -> Chain:
    mass = MASSES[0] * mechanism.mixed.mass
    stiffness = _STIFFNESS * mechanism.mixed.weight
    piece = mechanism.size / _PIECES
    critical = 2.0 * np.sqrt(stiffness / piece * mass / (_PIECES - 1)) * piece
    return Chain(
        pieces=_PIECES, mass=Parameter(parameter=STRING_MASS, value=mass), stiffness=stiffness,
        damping=_DAMPING * float(critical),
    )  # fmt: skip
