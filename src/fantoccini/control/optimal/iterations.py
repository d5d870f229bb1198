"""The outer loop of sequential quadratic programming.

A method finds a step from the best motion so far, and goes along it as far as the motion gets
better; the loop decides when that ends. Methods differ in their programs and in what is better: a
filter (:mod:`.sqp`), a merit in a trust region (:mod:`.tightening`), or a line search to a goal
(:mod:`fantoccini.control.planning.descent`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from fantoccini.base import Array, OnProgress, Progress
from fantoccini.control.optimal.quadratic import StageProgram, StageSolution

_SMALL_STEPS = 4
"""In a row after which a motion counts as settled."""


class Improvable(Protocol):
    """A motion that is improved.

    Attributes:
        iterations: made.
    """

    iterations: int

    @property
    def stalled(self) -> bool:
        """Whether no step helps any more."""

    @property
    def settled(self) -> bool:
        """Whether none is needed."""

    @property
    def kkt(self) -> float:
        """The residual of the conditions of optimality."""


MotionT = TypeVar("MotionT", bound=Improvable)
StepT = TypeVar("StepT")


class Method(Protocol[MotionT, StepT]):
    """Steps, and whether they are taken.

    Attributes:
        best: the best motion so far.
    """

    best: MotionT

    def step(self) -> StepT | None:
        """A step from the best motion, whose residuals are noted; None where there is none."""

    def along(self, step: StepT) -> MotionT | None:
        """The motion after a step; None where it is not taken."""

    def learn(self, step: StepT | None, taken: bool) -> None:
        """Prepares the next step, or notes that the best motion is stalled."""


@dataclass(frozen=True)
class Limits:
    """When an optimisation ends.

    Attributes:
        tolerance: of the KKT residual.
        cost_tolerance: share of the cost; it ends after some steps that each save less.
        iterations: at most.
        until: time of ``time.perf_counter`` [s].
        damping: of the Hessian, above which it ends.
    """

    tolerance: float
    cost_tolerance: float
    iterations: int
    until: float = np.inf
    damping: float = np.inf


def improve(
    method: Method[MotionT, StepT], limits: Limits, progress: OnProgress | None = None
) -> MotionT:
    """Iterates until the motion is optimal, or there is no more progress.

    Args:
        method: finds and takes steps.
        limits: when it ends.
        progress: called after every iteration; ``best`` is the best motion.
    """
    for _ in range(limits.iterations):
        step, at = method.step(), method.best
        if at.stalled or at.settled or (step is not None and at.kkt <= limits.tolerance):
            break
        at.iterations += 1
        made = None if step is None else method.along(step)
        if made is not None:
            method.best = made
        method.learn(step, made is not None)
        at = method.best
        if progress is not None:
            progress(Progress(done=at.iterations, total=limits.iterations, best=at))
        if at.stalled or at.settled or time.perf_counter() > limits.until:
            break
    return method.best


class SmallSteps:
    """Counts steps in a row that hardly help."""

    def __init__(self) -> None:
        self._count = 0

    def settle(self, is_small: bool) -> bool:
        """Whether the motion is settled after one more step."""
        self._count = self._count + 1 if is_small else 0
        return self._count >= _SMALL_STEPS


def curved(program: StageProgram, solution: StageSolution) -> Array:
    """(N, k + n_z) H d of a step d, neighbouring inputs included."""
    u, z = solution.u, solution.z[1:]
    step = np.concatenate([u, z], axis=1)
    out = np.einsum("nij,nj->ni", program.H, step)
    out[1:, : u.shape[1]] += np.einsum("nij,ni->nj", program.cross[1:], step[:-1])
    out[:-1] += np.einsum("nij,nj->ni", program.cross[1:], u[1:])
    return out
