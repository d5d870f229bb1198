"""Objectives: costs of plans.

A catch is a slack string that becomes taut, with an impulse. acc_K are the accelerations of the
driven coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fantoccini.base import Array


@dataclass(frozen=True)
class Objective:
    """A cost that better plans reduce::

        J = T + c n_catches + r integral |acc_K|^2 dt

    Attributes:
        catch: weight c of a catch of a string or a limit [s].
        acceleration: weight r of the driven accelerations [s^4/m^2].

    Raises:
        ValueError: weight that is negative or not finite.
    """

    catch: float = 0.0
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        for name in ("catch", "acceleration"):
            weight = getattr(self, name)
            if not 0.0 <= weight < math.inf:
                raise ValueError(
                    f"an objective's {name} is {weight}; the weight must be finite and at least 0"
                )

    @classmethod
    def of(cls, objective: str | Objective) -> Objective:
        """An objective, given as such or by its name in ``OBJECTIVES``.

        Raises:
            ValueError: unknown name.
        """
        if isinstance(objective, Objective):
            return objective
        if objective not in OBJECTIVES:
            names = ", ".join(OBJECTIVES)
            raise ValueError(
                f"objective is {objective!r}; it must be an Objective or one of {names}"
            )
        return OBJECTIVES[objective]

    def cost(self, time: Array, catches: Array, acceleration: Callable[[], Array]) -> Array:
        """(n,) costs J [s].

        Args:
            time: (n,) durations T [s].
            catches: (n,) numbers of catches.
            acceleration: function that returns the integrals (n,); called only for r > 0.
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
