"""The outer loop of sequential quadratic programming.

A method computes a step from the best motion so far, and shortens it until it improves the motion;
the loop decides when to end. Methods differ in their quadratic programs and in their measure of
improvement: a filter (:mod:`.sqp`), a merit function in a trust region (:mod:`.trust_region`), or
the distance from a goal (:mod:`fantoccini.control.planning.descent`), evaluated for all step
lengths of a line search at once.

No acceptance rule serves all: with a merit function, :mod:`.sqp` does not solve the bundled task
``crane`` in 100 iterations; with the filter it needs 20. With a filter, :mod:`.trust_region` stops
at ``swing_up`` without a solution.

A stage is an interval of the motion with its inputs u and the state z at its end.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from fantoccini.base import Array, OnProgress, Progress
from fantoccini.control.optimal.quadratic import StageProgram, StageSolution

MIN_DECREASE_RATIO, POOR_DECREASE_RATIO, GOOD_DECREASE_RATIO = 1e-4, 0.25, 0.75
"""Decreases relative to the predicted ones: minimum of an accepted step, and the limits between
which damping and trust radius remain unchanged."""
_MAX_SMALL_STEPS = 4
"""Number of successive small steps after which a motion counts as settled."""


class Improvable(Protocol):
    """A motion that a method improves.

    Attributes:
        iterations: number of iterations so far.
    """

    iterations: int

    @property
    def stalled(self) -> bool:
        """Whether no step improves the motion."""

    @property
    def settled(self) -> bool:
        """Whether several steps in a row were small, so that the iteration ends."""

    @property
    def kkt(self) -> float:
        """KKT residual."""


MotionT = TypeVar("MotionT", bound=Improvable)
StepT = TypeVar("StepT")


class Method(Protocol[MotionT, StepT]):
    """A method: the computation and acceptance of steps.

    Attributes:
        best: the best motion so far.
    """

    best: MotionT

    def step(self) -> StepT | None:
        """Next step from the best motion, or None; updates the motion's residuals."""

    def try_step(self, step: StepT) -> MotionT | None:
        """The motion after a step; None if the step is rejected."""

    def prepare_next(self, step: StepT | None, is_accepted: bool) -> None:
        """Prepares the next step, or marks the best motion as stalled."""


@dataclass(frozen=True)
class Limits:
    """Conditions for the end of an optimisation.

    Attributes:
        tolerance: tolerance of the KKT residual.
        cost_tolerance: relative decrease of the cost that counts as small; several such steps in a
            row end the iteration.
        iterations: largest number of iterations.
        deadline: time of ``time.perf_counter`` at which the iteration ends [s].
        damping: damping of the Hessian above which the iteration ends.
    """

    tolerance: float
    cost_tolerance: float
    iterations: int
    deadline: float = np.inf
    damping: float = np.inf


def improve(
    method: Method[MotionT, StepT], limits: Limits, progress: OnProgress | None = None
) -> MotionT:
    """The best motion, after iterating until it is optimal or improves no more.

    Args:
        method: computes and accepts steps.
        limits: conditions for the end.
        progress: called after every iteration, with the best motion as ``best``.
    """
    for _ in range(limits.iterations):
        step, best = method.step(), method.best
        if best.stalled or best.settled or (step is not None and best.kkt <= limits.tolerance):
            break
        best.iterations += 1
        next_motion = None if step is None else method.try_step(step)
        if next_motion is not None:
            method.best = next_motion
        method.prepare_next(step, next_motion is not None)
        best = method.best
        if progress is not None:
            progress(Progress(done=best.iterations, total=limits.iterations, best=best))
        if best.stalled or best.settled or time.perf_counter() > limits.deadline:
            break
    return method.best


class SmallSteps:
    """Counter of successive steps with small improvements."""

    def __init__(self) -> None:
        self._count = 0

    def record(self, is_small: bool) -> bool:
        """Counts a step, and returns whether the motion is settled."""
        self._count = self._count + 1 if is_small else 0
        return self._count >= _MAX_SMALL_STEPS


def hessian_product(program: StageProgram, solution: StageSolution) -> Array:
    """(N, k + n_z) product H d for a step d = (u, z) of N stages, with k inputs and n_z states.

    ``cross`` couples the inputs of a stage with the inputs and states of the one before.
    """
    u, z = solution.u, solution.z[1:]
    step = np.concatenate([u, z], axis=1)
    product = np.einsum("nij,nj->ni", program.H, step)
    product[1:, : u.shape[1]] += np.einsum("nij,ni->nj", program.cross[1:], step[:-1])
    product[:-1] += np.einsum("nij,nj->ni", program.cross[1:], u[1:])
    return product
