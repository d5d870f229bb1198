"""A string as a chain of point masses joined by stiff springs, instead of a constraint.

EA is the force per relative elongation of a spring. A wire, a string that also pushes, cannot be a
chain.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field

from fantoccini.base.documents import Model, validation_error
from fantoccini.model.puppet.limits import LIMITS
from fantoccini.model.puppet.quantities import Damping, PositiveMass, PositiveStiffness

DEFAULT_PIECES = 8
"""Default number of springs of a chain."""
CORD_MASS, CORD_STIFFNESS, CORD_DAMPING = 5e-4, 5000.0, 0.05
"""Mass [kg], EA [N] and damping [N s] of one metre of polyester cord, 0.5 g/m, 0.7 mm thick.

EA = 10 N/tex (specific modulus of the yarn) x 500 tex. The damping is a loss factor of 0.05 at
800 Hz.
"""


class Chain(Model):
    """Springs in series, joined by point masses; the springs pull and push."""

    pieces: int = Field(default=DEFAULT_PIECES, ge=2, le=LIMITS.max_pieces, strict=True)
    """Number of springs; there is one mass fewer."""
    mass: PositiveMass
    """Mass of the string [kg], shared equally among the point masses."""
    stiffness: PositiveStiffness
    """EA: force per unit of strain [N]; each spring's stiffness is EA / (its relaxed length)."""
    damping: Damping = 0.0
    """Force per unit of strain rate [N s]; each spring's damping is this / (its relaxed length)."""


def check_chain(wire: bool, has_restitution: bool, can_slip: bool, n_points: int) -> None:
    """Raises a mistake if a string cannot be a chain.

    Args:
        wire, has_restitution, can_slip: properties of the string.
        n_points: number of points of its path.
    """
    conflicts = {"wire: true": wire, "restitution": has_restitution, "max_tension": can_slip}
    keys = [key for key, is_given in conflicts.items() if is_given]
    if keys:
        raise validation_error(
            f"found chain and {keys[0]}; a chain is made of springs, which are not rigid and "
            "neither bounce nor slip"
        )
    if n_points > 2:
        raise validation_error(
            f"found chain and a path of {n_points} points; masses do not run over pulleys: "
            "a chain has two ends"
        )


def chained(strings: list[dict[str, Any]], chain: dict[str, Any]) -> list[dict[str, Any]]:
    """Plain data of strings, with ``chain`` added to those that are neither chains nor wires."""
    return [s if s.get("chain") or s.get("wire") else s | {"chain": chain} for s in strings]
