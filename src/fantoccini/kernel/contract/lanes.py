"""The lane record: arrays of n trajectories that are advanced together, in pieces.

A lane is one of these trajectories. D stands for dynamic coordinates, K for driven ones; slip is
the length that each winch has let out.
"""

from __future__ import annotations

from fantoccini.kernel.contract.samples import SUMS
from fantoccini.kernel.contract.structure import IN, OUT, Field

LANE: tuple[Field, ...] = (
    Field("fresh", "unsigned char*", "(n,) whether to restart from the arrays; cleared"),
    Field("p", IN, "(n, n_p)"),
    Field("q_D", OUT, "(n, n_qD) state before the piece, then after it; so are the others"),
    Field("v_D", OUT, "(n, n_vD)"),
    Field("q_K", OUT, "(n, n_qK)"),
    Field("v_K", OUT, "(n, n_vK)"),
    Field("slip", OUT, "(n, n_strings)"),
    Field("tension", OUT, "(n, n_rows) written"),
    Field("taut", "unsigned char*", "(n, n_rows) written"),
    Field(
        "energy_terms",
        OUT,
        f"(n, {len(SUMS)}) work, damping, impact, slip loss, friction; written [J]",
    ),
    Field("energy", OUT, "(n, 2) kinetic and potential; written [J]"),
    Field("violation", OUT, "(n,) largest since it began; written"),
    Field("advanced", OUT, "(n,) time by which it was advanced in the piece; written [s]"),
    Field("status", "int*", "(n,) Status; written"),
    Field("attribution", OUT, "(n, n_rows + n_watched) shares in causing it; written"),
)
"""The lane record of compiled code and Python."""
