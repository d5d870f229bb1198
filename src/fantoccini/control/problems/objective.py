"""Objectives: costs of plans."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fantoccini.base import Array


@dataclass(frozen=True)
class Objective:
    """The cost that better plans reduce::

        J = T + c n_catches + r integral |acc_K|^2 dt

    Attributes:
        catch: c, weight of a catch of a string or a limit [s].
        acceleration: r, weight of the driven accelerations [s^4/m^2].

    Raises:
        ValueError: a weight that is negative or not finite.
    """

    catch: float = 0.0
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        for what in ("catch", "acceleration"):
            weight = getattr(self, what)
            if not 0.0 <= weight < math.inf:
                raise ValueError(
                    f"an objective's {what} is {weight}; the weight must be finite and at least 0"
                )

    @classmethod
    def of(cls, given: str | Objective) -> Objective:
        """An objective, by itself or by its name in ``OBJECTIVES``.

        Raises:
            ValueError: an unknown name.
        """
        if isinstance(given, Objective):
            return given
        if given not in OBJECTIVES:
            names = ", ".join(OBJECTIVES)
            raise ValueError(f"objective is {given!r}; it must be an Objective or one of {names}")
        return OBJECTIVES[given]

    def cost(self, time: Array, catches: Array, acceleration: Callable[[], Array]) -> Array:
        """(n,) J [s].

        Args:
            time: (n,) T [s].
            catches: (n,) number of catches.
            acceleration: returns the integral (n,); called only if it has a weight.
        """
        cost = time + self.catch * catches
        return cost + self.acceleration * acceleration() if self.acceleration else cost


TIME = Objective()

OBJECTIVES = {
    "gentle": Objective(catch=3.0),
    "time": TIME,
    "acceleration": Objective(acceleration=1.0),
}
"""Objectives by name."""
