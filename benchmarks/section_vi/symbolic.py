"""The blocks of a small puppet's kinetic energy as expressions, and the condition on them.

SymPy is imported on first use, because that takes long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fantoccini.dynamics.marionette import Marionette

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class _Size:
    """Largest readable sizes.

    Attributes:
        inverted: largest number of dynamic velocities for a symbolic inverse of M_DD.
        operations: number of operations of all blocks together.
        characters: length of a printed expression.
    """

    inverted: int = 3
    operations: int = 300
    characters: int = 120


_MAX = _Size()


@dataclass(frozen=True)
class Symbolic:
    """A small puppet's kinetic energy in [q_D, q_K].

    Attributes:
        names: symbol -> name in the puppet file, for the symbols that occur.
        M_DD, M_DK, M_KK: the blocks; M_KK without the drives' own inertia.
        effective: M_KK - M_KD M_DD^-1 M_DK, the inertia that a drive moves while the puppet's
            momentum is zero; its inverse, with the drives' inertia, must not depend on q_D. None if
            it is too large.
        of_q_D: entries (i, j) of ``effective`` that depend on q_D; None if it is too large.
    """

    names: dict[str, str]
    M_DD: sp.Matrix
    M_DK: sp.Matrix
    M_KK: sp.Matrix
    effective: sp.Matrix | None
    of_q_D: tuple[tuple[int, int], ...] | None

    def text(self) -> str:
        """The blocks, entry by entry."""
        lines = [f"{symbol}: {name}" for symbol, name in self.names.items()]
        for label, block in (("M_DD", self.M_DD), ("M_DK", self.M_DK), ("M_KK", self.M_KK)):
            lines += _entries(label, block)
        if self.effective is not None and not self.M_DK.is_zero_matrix:
            lines += _entries("(M_KK - M_KD M_DD^-1 M_DK)", self.effective)
        if self.of_q_D is not None:
            depends = "depends" if self.of_q_D else "does not depend"
            lines.append(f"M_KK - M_KD M_DD^-1 M_DK {depends} on q_D")
        return "\n".join(lines)


def symbolic_blocks(marionette: Marionette) -> Symbolic | None:
    """The blocks as SymPy expressions; None if they would fill pages."""
    import sympy as sp

    from fantoccini.kernel.equations.printing import TooLargeError, printable

    if marionette.equations["mass_matrix"].n_instructions() > _MAX.operations:
        return None
    try:
        page = printable(marionette.equations, ("mass_matrix",))
    except TooLargeError:
        return None
    M, DK, KK = (page.objects[name] for name in ("M", "M_DK", "M_KK"))
    occur = M.free_symbols | DK.free_symbols | KK.free_symbols
    names = {str(s): name for s, name in page.notation.names.items() if s in occur}
    effective = KK
    if not DK.is_zero_matrix:
        if M.rows > _MAX.inverted or page.notation.quaternions["q_D"]:
            return Symbolic(names, M, DK, KK, None, None)
        effective = (KK - DK.T * M.adjugate() * DK / M.det()).applyfunc(sp.simplify)
    q_D = page.notation.symbols["q_D"]
    depends = [
        (i, j)
        for i in range(effective.rows)
        for j in range(effective.cols)
        if any(sp.simplify(effective[i, j].diff(q)) != 0 for q in q_D)
    ]
    return Symbolic(names, M, DK, KK, effective, tuple(depends))


def _entries(label: str, block: sp.Matrix) -> list[str]:
    import sympy as sp

    from fantoccini.kernel.equations.printing import decimal

    if block.is_zero_matrix:
        return [f"{label} = 0  ({block.rows} x {block.cols})"]
    lines = []
    for i in range(block.rows):
        for j in range(i if block.is_symmetric() else 0, block.cols):
            if block[i, j] == 0:
                continue
            text = str(decimal(block[i, j]))
            if len(text) > _MAX.characters:
                text = f"({sp.count_ops(block[i, j])} operations)"
            lines.append(f"{label}[{i + 1},{j + 1}] = {text}")
    return lines
