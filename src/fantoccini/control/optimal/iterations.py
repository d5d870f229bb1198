"""The outer loop of sequential quadratic programming.

A method computes a step from the best motion so far and accepts the part of it that improves the
motion; the loop decides when to end. Methods differ in their programs and in their measure of
improvement: a filter (:mod:`.sqp`), a merit in a trust region (:mod:`.trust_region`), or a line
search to a goal (:mod:`fantoccini.control.planning.descent`), whose lanes try all step lengths at
once.

No acceptance rule serves all: with the merit instead of the filter, the bundled task ``crane`` is
not solved in 100 iterations instead of 20; with the filter in the trust region, ``swing_up``
settles without being solved.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from fantoccini.base import Array, OnProgress, Progress
from fantoccini.control.optimal.quadratic import StageProgram, StageSolution

SUFFICIENT_DECREASE, POOR_DECREASE, GOOD_DECREASE = 1e-4, 0.25, 0.75
"""Decreases relative to their prediction: minimum of an accepted step, and limits of the range in
which damping and trust radius are kept."""
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
        """Whether no further step is needed."""

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
        """A step from the best motion, None without one; updates the motion's residuals."""

    def try_step(self, step: StepT) -> MotionT | None:
        """The motion after a step; None if the step is rejected."""

    def prepare_next(self, step: StepT | None, is_accepted: bool) -> None:
        """Prepares the next step, or marks the best motion as stalled."""


@dataclass(frozen=True)
class Limits:
    """Conditions for the end of an optimisation.

    Attributes:
        tolerance: tolerance of the KKT residual.
        cost_tolerance: relative decrease of the cost; after several smaller steps in a row it ends.
        iterations: largest number of iterations.
        until: time of ``time.perf_counter`` at which it ends [s].
        damping: damping of the Hessian above which it ends.
    """

    tolerance: float
    cost_tolerance: float
    iterations: int
    until: float = np.inf
    damping: float = np.inf


def improve(
    method: Method[MotionT, StepT], limits: Limits, progress: OnProgress | None = None
) -> MotionT:
    """The best motion of iterations, which end when it is optimal or makes no more progress.

    Args:
        method: computes and accepts steps.
        limits: conditions for the end.
        progress: called after every iteration; ``best`` is the best motion.
    """
    for _ in range(limits.iterations):
        step, at = method.step(), method.best
        if at.stalled or at.settled or (step is not None and at.kkt <= limits.tolerance):
            break
        at.iterations += 1
        next_motion = None if step is None else method.try_step(step)
        if next_motion is not None:
            method.best = next_motion
        method.prepare_next(step, next_motion is not None)
        at = method.best
        if progress is not None:
            progress(Progress(done=at.iterations, total=limits.iterations, best=at))
        if at.stalled or at.settled or time.perf_counter() > limits.until:
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
    """(N, k + n_z) product H d for a step d, including terms between neighbouring inputs."""
    u, z = solution.u, solution.z[1:]
    step = np.concatenate([u, z], axis=1)
    product = np.einsum("nij,nj->ni", program.H, step)
    product[1:, : u.shape[1]] += np.einsum("nij,ni->nj", program.cross[1:], step[:-1])
    product[:-1] += np.einsum("nij,nj->ni", program.cross[1:], u[1:])
    return product
