"""A string as a chain of point masses joined by stiff springs, instead of a constraint."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from fantoccini.puppet.quantities import Damping, PositiveMass, PositiveStiffness
from fantoccini.puppet.values import Model, mistake, value_of

PIECES = 8
"""Springs of a string that does not say how many."""
MOST_PIECES = 200
CORD_MASS, CORD_STIFFNESS, CORD_DAMPING = 5e-4, 5000.0, 0.05
"""A metre of polyester cord of 0.5 g/m, 0.7 mm thick. Its yarn has a specific modulus of 10 N/tex,
so EA = 10 N/tex x 500 tex. The damping is a loss factor of 0.05 at 800 Hz."""


class Chain(Model):
    """Springs in a row, joined by point masses; springs that push as well as pull."""

    pieces: int = Field(default=PIECES, ge=2, le=MOST_PIECES, strict=True)
    """Number of springs; one mass less."""
    mass: PositiveMass
    """Of the whole string [kg], shared equally among its masses."""
    stiffness: PositiveStiffness
    """EA: force per unit of strain [N]; a piece has EA over its relaxed length."""
    damping: Damping = 0.0
    """Force per unit of strain rate [N s]; a piece has it over its relaxed length."""


def check_chain(string: Any) -> None:
    """Raises a located mistake where a string cannot be a chain."""
    given = {
        "wire: true": string.wire,
        "restitution": value_of(string.restitution) > 0,
        "max_tension": string.max_tension is not None,
    }
    found = [what for what, is_given in given.items() if is_given]
    if found:
        raise mistake(
            f"found chain and {found[0]}; a chain is made of springs, which are not rigid and "
            "neither bounce nor slip"
        )
    if len(string.path) > 2:
        raise mistake(
            f"found chain and a path of {len(string.path)} points; masses do not run over pulleys: "
            "a chain has two ends"
        )


def chained(strings: list[dict[str, Any]], chain: dict[str, Any]) -> list[dict[str, Any]]:
    """Plain data of strings with a chain on all that have none; wires, which push, stay."""
    return [
        s if s.get("chain") or s.get("wire") else s | {"chain": chain} for s in strings
    ]
