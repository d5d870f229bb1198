"""Part (c), continued: a string with mass, whose effect remains at any bandwidth.

One string becomes a chain of point masses between stiff springs; everything else stays the same.
The mixed model lacks the coordinates of these masses, so the motions differ by an amount in
proportion to the string's mass, however well the drives track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from benchmarks.section_vi.bandwidth import TrackingRun
from benchmarks.section_vi.deviation import Deviation, deviation
from benchmarks.section_vi.mechanism import Mechanism
from benchmarks.section_vi.reference import Reference

from fantoccini.base.arrays import Array
from fantoccini.base.documents import Parameter
from fantoccini.base.errors import FantocciniError
from fantoccini.dynamics.compiled import Event
from fantoccini.dynamics.simulation import simulate
from fantoccini.lab.reduction_states import displaced
from fantoccini.model.puppet import Chain, Puppet, String
from fantoccini.motion import State

STRING_MASS = "reduction_string_mass"
MASSES = (0.01, 0.03, 0.1)
"""Masses of the string, relative to the puppet's."""
BANDWIDTHS = tuple(20.0 * 4.0**k for k in range(4))
"""Bandwidths of the drives, relative to sqrt(g/l)."""
_EVENT = Event(rtol=1e-8, atol=1e-8)
_DIFFERENCE_STEP = 1e-6
"""Step of central differences [m or rad]."""


@dataclass(frozen=True)
class _ChainModel:
    """The chain that replaces a string.

    Attributes:
        pieces: springs, with a point mass between two.
        stiffness: EA, relative to the puppet's weight.
        damping_ratio: damping ratio of a piece, for the lightest string.
    """

    pieces: int = 4
    stiffness: float = 20_000.0
    damping_ratio: float = 0.02


_CHAIN = _ChainModel()


@dataclass(frozen=True, eq=False)
class HeavyString:
    """Motions with a string of some mass, each relative to its own rest.

    Attributes:
        string: string that is a chain.
        mass: mass of the string [kg].
        coupling: largest |M_DK| / sqrt(M_DD M_KK) that a straight string of that mass causes, with
            drives as heavy as the puppet.
        exact: deviation of the mixed model with that string from the massless one.
        tracking: likewise for the full model, at several bandwidths.
    """

    string: str
    mass: float
    coupling: float
    exact: Deviation
    tracking: tuple[TrackingRun, ...]


class NoStringError(FantocciniError):
    """No string of the puppet can be a chain."""


def most_loaded(reference: Reference, puppet: Puppet) -> str:
    """The string with the largest tension at the start, among those that can be chains.

    Raises:
        NoStringError: none of them is taut.
    """
    tension = {
        s.name: float(reference.run.tension[s.name][0]) for s in puppet.strings if _can_be_chain(s)
    }
    name = max(tension, key=lambda n: tension[n], default="")
    if not name or tension[name] <= 0.0:
        raise NoStringError("no string that is taut at rest can be a chain of masses")
    return name


def heavy_strings(
    mechanism: Mechanism,
    reference: Reference,
    masses: tuple[float, ...] = MASSES,
    bandwidths: tuple[float, ...] = BANDWIDTHS,
) -> list[HeavyString]:
    """The motion with one string of increasing mass, on drives of several bandwidths.

    Args:
        mechanism: the puppet.
        reference: motion of the mixed model.
        masses: masses of the string, relative to the puppet's.
        bandwidths: bandwidths of the drives, relative to sqrt(g/l).

    Raises:
        NoStringError: no string can be a chain.
    """
    name = most_loaded(reference, mechanism.mixed.puppet.expanded())
    chained = mechanism.with_chain(name, _chain(mechanism))
    full, end, motions = chained.full(bandwidth=1.0), reference.inputs.end, []
    commands = chained.translated(reference.inputs, full)
    for share in masses:
        mass = share * mechanism.mixed.mass
        heavy = chained.mixed.with_parameters({STRING_MASS: mass})
        x0 = heavy.rest(heavy.state(mechanism.values(reference.x0)))
        inputs = chained.translated(reference.inputs, heavy)
        run = simulate(heavy, x0, inputs, end, method=_EVENT, effort=False, throw=False)
        exact = deviation(mechanism, reference.run, run, from_rest=True)
        tracking = []
        for w in (w / mechanism.time_scale for w in bandwidths):
            driven = full.with_parameters({STRING_MASS: mass})
            driven = mechanism.with_drives(driven, 1.0, w)
            x = chained.full_state(driven, x0)
            run = simulate(driven, x, commands, end, method=_EVENT, effort=False, throw=False)
            apart = deviation(mechanism, reference.run, run, from_rest=True)
            tracking.append(TrackingRun(w, apart))
        coupling = straight_coupling(mechanism, reference.x0, name, mass)
        motions.append(HeavyString(name, mass, coupling, exact, tuple(tracking)))
    return motions


def straight_coupling(mechanism: Mechanism, x: State, name: str, mass: float) -> float:
    """|M_DK| / sqrt(M_DD M_KK) of a uniform string that stays straight between its ends.

    T = m/6 (v_A.v_A + v_A.v_S + v_S.v_S) with ends A on the puppet and S on the mechanism, so
    M_DK = m/6 J_A^T J_S.
    """
    mixed, step = mechanism.mixed, _DIFFERENCE_STEP

    def ends(move: Array) -> Array:
        y = displaced(mixed, x, move)
        return mixed.string_points(y.q_D, y.q_K)[name][[0, -1]].ravel()

    n_vD = mixed.coordinates.n_vD
    n = n_vD + mixed.coordinates.n_vK
    J = np.array([(ends(step * e) - ends(-step * e)) / (2 * step) for e in np.eye(n)]).T
    weights = np.kron(np.array([[2.0, 1.0], [1.0, 2.0]]) * mass / 6.0, np.eye(3))
    T = J.T @ weights @ J
    M_DD = mixed.mass_matrix(x) + T[:n_vD, :n_vD]
    M_KK = np.diag(mixed.mass_matrix_KK(x)) + mechanism.inertia(1.0) + np.diag(T)[n_vD:]
    scale = np.sqrt(np.outer(np.diag(M_DD), M_KK))
    return float(np.max(np.abs(T[:n_vD, n_vD:]) / scale))


def _can_be_chain(string: String) -> bool:
    bounces = not isinstance(string.restitution, float) or string.restitution > 0
    slips = string.max_tension is not None or string.wire or bounces
    return not slips and len(string.path) == 2 and string.chain is None


def _chain(mechanism: Mechanism) -> Chain:
    mass = MASSES[0] * mechanism.mixed.mass
    stiffness = _CHAIN.stiffness * mechanism.mixed.weight
    piece = mechanism.length_scale / _CHAIN.pieces
    critical = 2.0 * np.sqrt(stiffness / piece * mass / (_CHAIN.pieces - 1)) * piece
    return Chain(
        pieces=_CHAIN.pieces,
        mass=Parameter(parameter=STRING_MASS, value=mass),
        stiffness=stiffness,
        damping=_CHAIN.damping_ratio * float(critical),
    )
