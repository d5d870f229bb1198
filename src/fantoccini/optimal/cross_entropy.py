"""The cross-entropy method: random numbers that move to the best of what was drawn.

    theta ~ N(mean, spread^2),   mean <- kept mean + (1 - kept) mean of the best,  spread likewise

(Rubinstein, Methodol. Comput. Appl. Probab. 1, 1999). What it lowers is a mean over many draws,
which is smooth where the cost of one of them has kinks and jumps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array

KEPT = 0.3
"""Of mean and spread, from one generation to the next."""


@dataclass(frozen=True, eq=False)
class Normal:
    """A normal distribution of independent numbers.

    Attributes:
        mean, spread: arrays of one shape.
    """

    mean: Array
    spread: Array

    def drawn(self, rng: np.random.Generator, n: int) -> Array:
        """(n, ...) draws, of which the first is the mean."""
        noise = rng.standard_normal((n, *self.mean.shape))
        noise[0] = 0.0
        return np.asarray(self.mean + self.spread * noise)

    def moved(self, best: Array) -> Normal:
        """The distribution, nearer to that of the best draws (m, ...)."""
        mean = KEPT * self.mean + (1.0 - KEPT) * np.mean(best, axis=0)
        return Normal(mean, KEPT * self.spread + (1.0 - KEPT) * np.std(best, axis=0))

    def narrowed(self) -> Normal:
        """The same with half the spread."""
        return Normal(self.mean, 0.5 * self.spread)
