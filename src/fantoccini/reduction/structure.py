"""Part (a): the structure that Sec. VI claims, looked at in expressions and in numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.reduction import configurations
from fantoccini.reduction.kinetic import KineticEnergy, kinetic_energy
from fantoccini.reduction.products import symmetric_products
from fantoccini.reduction.symbolic import Symbolic, symbolic
from fantoccini.reduction.tracking import Tracking, tracking

N_STATES = 12
"""Configurations of each kind that are looked at."""


@dataclass(frozen=True)
class Structure:
    """What the kinetic energy and the strings of a puppet on a fully actuated mechanism are.

    Attributes:
        kinetic: the blocks of the kinetic energy.
        symbolic: the same of a small puppet as expressions; None for a large one.
        slack: largest share of a symmetric product outside of span{Y_k}, strings slack.
        n_slack: configurations behind it.
        taut: the same for each configuration with taut strings, in the constrained connection.
        tracking: what the drives can accelerate in each of these.
    """

    kinetic: KineticEnergy
    symbolic: Symbolic | None
    slack: float
    n_slack: int
    taut: tuple[float, ...]
    tracking: tuple[Tracking, ...]

    @property
    def tied(self) -> dict[tuple[str, ...], int]:
        """Strings that tie drives to one another -> in how many of the configurations."""
        return dict(Counter(t.tied for t in self.tracking if t.tied))


def structure(
    marionette: Marionette, inertia: Array, n: int = N_STATES, seed: int = 0
) -> Structure:
    """Looks at a puppet's kinetic energy and strings.

    Args:
        marionette: the puppet, without drives.
        inertia: (n_vK,) reflected inertia of a drive on every driven coordinate [kg or kg m^2].
        n: configurations of each kind, at random.
        seed: of these.
    """
    rng = np.random.default_rng(seed)
    states = configurations.anywhere(marionette, n, rng)
    on = configurations.on_strings(marionette, n, rng)
    return Structure(
        kinetic_energy(marionette, states),
        symbolic(marionette),
        max(symmetric_products(marionette, x, inertia).worst for x in states),
        len(states),
        tuple(symmetric_products(marionette, x, inertia, rows).worst for x, rows in on),
        tuple(tracking(marionette, x, inertia, rows) for x, rows in on),
    )
