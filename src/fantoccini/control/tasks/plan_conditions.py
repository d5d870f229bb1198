"""Conditions of plans, and options of the rollouts that find them.

A rollout is a simulation within a search. A segment is a piece of it with constant accelerations of
the driven coordinates; a check is an instant at which bounds and clearances are evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import check_not_negative, check_positive
from fantoccini.control.tasks.objective import Objective
from fantoccini.control.tasks.touches import KEEP_OFF, ContactLike
from fantoccini.kernel.runtime import default_threads

_MAX_STEPS = 10_000
"""Largest number of time steps in a segment."""
_MAX_SEGMENT = 10.0
"""Longest duration of a segment [s]."""
_ROUNDING = 1e-9
"""Rounding error of a segment's duration, relative to it."""


@dataclass(frozen=True)
class RolloutOptions:
    """Options for the simulation and checks of rollouts.

    Attributes:
        dt: step of the time-stepper [s].
        steps_per_check: number of steps between checks for collisions and the goal.
        n_checks: number of checks in a segment of constant accelerations, which lasts 0.1 s by
            default, 10 s at most. Rollouts of ``"est-2007"`` last 1 to 5 times as long.
        threads: number of threads, all processors by default; results do not depend on it.
        reserve: share of the bounds of speed and acceleration that plans leave unused, 0 to less
            than 1; feedback needs it to correct deviations from a plan that is at its bounds.
        strings: whether strings are kept clear of obstacles, too.

    Raises:
        ValueError: number out of range.
    """

    dt: float = 0.004
    steps_per_check: int = 5
    n_checks: int = 5
    threads: int = field(default_factory=default_threads)
    reserve: float = 0.0
    strings: bool = True

    def __post_init__(self) -> None:
        check_positive(dt=self.dt)
        for name in ("steps_per_check", "n_checks", "threads"):
            if not (number := getattr(self, name)) >= 1:
                raise ValueError(f"{name} is {number}; it must be at least 1")
        if not 0.0 <= self.reserve < 1.0:
            raise ValueError(f"reserve is {self.reserve!r}; it must be at least 0 and less than 1")
        if self.segment > _MAX_SEGMENT:
            raise ValueError(
                f"a segment lasts {self.segment:g} s; it must be at most {_MAX_SEGMENT:g} s"
            )
        steps = self.n_checks * self.steps_per_check
        if steps > _MAX_STEPS:
            raise ValueError(
                f"a segment of {steps * self.dt:g} s takes {steps} steps of {self.dt:g} s; it "
                f"must be at most {_MAX_STEPS}"
            )

    @property
    def interval(self) -> float:
        """Time between checks [s]."""
        return self.dt * self.steps_per_check

    @property
    def segment(self) -> float:
        """Duration of a segment [s]."""
        return self.n_checks * self.interval


def check_count(segment: float, interval: float) -> int:
    """Number of checks in a segment; both arguments are durations [s].

    Raises:
        ValueError: segment that is too long, or not a whole number of intervals.
    """
    if _MAX_SEGMENT < segment < np.inf:
        raise ValueError(f"segment is {segment} s; it must be at most {_MAX_SEGMENT:g} s")
    n_checks = round(segment / interval) if 0.0 < segment < np.inf else 0
    if n_checks < 1 or abs(segment - n_checks * interval) > _ROUNDING * segment:
        raise ValueError(
            f"segment is {segment} s; it must be a whole number of checks, which are "
            f"{interval:g} s apart"
        )
    return n_checks


@dataclass(frozen=True)
class PlanConditions:
    """Conditions that a plan must meet in addition to a task's bounds, and options of its search.

    Attributes:
        tolerance: largest distance from the end, in its unit [rad and m for poses and states, m for
            points].
        hold: time for which the puppet must stay at the end, with the inputs brought to rest [s];
            1 s if it must touch something, stand or push a prop, otherwise 0.
        contact: ``"keep off"``: the puppets touch nothing but themselves; or
            ``{"touch": [("hand", "table")]}``, the pairs that may touch. Pairs that must touch at
            the end may touch before, and so may props and the parts that they lie on.
        slack: whether taut strings may go slack on the way, also in optimisations. Plans in which
            no string goes slack are less sensitive to deviations.
        objective: cost that better plans reduce: ``"time"``; ``"gentle"``, catches of strings and
            limits, and time; ``"acceleration"``, accelerations of the driven coordinates, and time;
            or an :class:`Objective`.
        rollouts: options for the simulation and checks of rollouts.

    Raises:
        ValueError: number out of range, or an unknown objective.
    """

    tolerance: float = 0.1
    hold: float | None = None
    contact: ContactLike = KEEP_OFF
    slack: bool = True
    objective: str | Objective = "gentle"
    rollouts: RolloutOptions = field(default_factory=RolloutOptions)

    def __post_init__(self) -> None:
        check_positive(tolerance=self.tolerance)
        check_not_negative(hold=self.hold or 0.0)
        Objective.of(self.objective)
