"""Differences of configurations: tangent vectors, ordered as the velocities.

A tangent vector has a rotation vector, of three numbers, for an orientation, of four. q_D are the
dynamic coordinates, n_qD is their number and n_vD that of their velocities. In names, K stands for
driven coordinates: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from fantoccini.base import Array, tangent
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.vector_checks import vectors


def difference(marionette: CompiledPuppet, q0: Array, q1: Array, driven: bool = False) -> Array:
    """Vector dq with ``integrate(model, q0, dq)`` = q1; see :meth:`Marionette.difference`."""
    scalars, quaternions, n_q, n_v = _layout(marionette, driven)
    q0, q1 = (vectors("q", q, n_q) for q in (q0, q1))
    return tangent.between(scalars, quaternions, q0, q1, n_v)


def integrate(marionette: CompiledPuppet, q: Array, dq: Array, driven: bool = False) -> Array:
    """Configuration q moved by dq; see :meth:`Marionette.integrate`."""
    scalars, quaternions, n_q, n_v = _layout(marionette, driven)
    return tangent.moved(scalars, quaternions, vectors("q", q, n_q), vectors("dq", dq, n_v))


def retract(marionette: CompiledPuppet, q_D: Array, move: Array) -> Array:
    """Configurations q_D (..., n_qD) moved by tangent vectors (..., n_vD), without checks."""
    table = marionette.coordinates
    return tangent.moved(table.scalars_D, table.quaternions_D, q_D, move)


def _layout(
    marionette: CompiledPuppet, driven: bool
) -> tuple[tangent.IndexPairs, tangent.IndexPairs, int, int]:
    t = marionette.coordinates
    if driven:
        return t.scalars_K, t.quaternions_K, t.n_qK, t.n_vK
    return t.scalars_D, t.quaternions_D, t.n_qD, t.n_vD
