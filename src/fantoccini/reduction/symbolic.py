"""The kinetic energy's blocks of a small puppet as expressions, and the condition on them.

SymPy is loaded when it is first needed: it takes long, and most of fantoccini does without.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fantoccini.marionette import Marionette

if TYPE_CHECKING:
    import sympy as sp

_MOST = 3
"""Dynamic velocities up to which M_DD is inverted symbolically."""
_MOST_OPERATIONS = 300
"""Operations of the blocks up to which they are read as expressions."""


@dataclass(frozen=True)
class Symbolic:
    """A small puppet's kinetic energy in [q_D, q_K].

    Attributes:
        names: symbol -> name in the puppet file, of those that occur.
        M_DD, M_DK, M_KK: the blocks; M_KK without the drives' own inertia.
        felt: M_KK - M_KD M_DD^-1 M_DK, what a drive moves while the puppet's momentum is zero; its
            inverse, with the drives' inertia, must not depend on q_D. None where it is too large.
        of_q_D: entries (i, j) of ``felt`` that depend on q_D; None where that was not looked at.
    """

    names: dict[str, str]
    M_DD: sp.Matrix
    M_DK: sp.Matrix
    M_KK: sp.Matrix
    felt: sp.Matrix | None
    of_q_D: tuple[tuple[int, int], ...] | None


def symbolic(marionette: Marionette) -> Symbolic | None:
    """The blocks as SymPy expressions; None where they would fill pages."""
    import sympy as sp

    from fantoccini.equations.printing import TooLargeError, printable

    if marionette.equations["mass_matrix"].n_instructions() > _MOST_OPERATIONS:
        return None
    try:
        page = printable(marionette.equations, ("mass_matrix",))
    except TooLargeError:
        return None
    M, DK, KK = (page.objects[name] for name in ("M", "M_DK", "M_KK"))
    occur = M.free_symbols | DK.free_symbols | KK.free_symbols
    names = {str(s): name for s, name in page.notation.names.items() if s in occur}
    felt = KK
    if not DK.is_zero_matrix:
        if M.rows > _MOST or page.notation.quaternions["q_D"]:
            return Symbolic(names, M, DK, KK, None, None)
        felt = (KK - DK.T * M.adjugate() * DK / M.det()).applyfunc(sp.simplify)
    q_D = page.notation.symbols["q_D"]
    depends = [
        (i, j)
        for i in range(felt.rows)
        for j in range(felt.cols)
        if any(sp.simplify(felt[i, j].diff(q)) != 0 for q in q_D)
    ]
    return Symbolic(names, M, DK, KK, felt, tuple(depends))
