"""Part (a): the structure that Sec. VI claims, examined in expressions and in numbers."""

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
"""Configurations of each kind."""


@dataclass(frozen=True)
class Structure:
    """The kinetic energy and the strings of a puppet on a fully actuated mechanism.

    Attributes:
        kinetic: the blocks of the kinetic energy.
        symbolic: the same as expressions; None for a large puppet.
        slack: largest share of a symmetric product outside of span{Y_k}, with slack strings.
        n_slack: number of configurations it is taken over.
        taut: the same for each configuration with taut strings, in the constrained connection.
        tracking: the accelerations that the drives can give in each of these.
    """

    kinetic: KineticEnergy
    symbolic: Symbolic | None
    slack: float
    n_slack: int
    taut: tuple[float, ...]
    tracking: tuple[Tracking, ...]

    @property
    def tied(self) -> dict[tuple[str, ...], int]:
        """Strings that tie drives to one another -> number of configurations."""
        return dict(Counter(t.tied for t in self.tracking if t.tied))


def structure(
    marionette: Marionette, inertia: Array, n: int = N_STATES, seed: int = 0
) -> Structure:
    """Examines a puppet's kinetic energy and strings at random configurations.

    Args:
        marionette: the puppet, without drives.
        inertia: (n_vK,) reflected inertia of a drive on every driven coordinate [kg or kg m^2].
        n: configurations of each kind.
        seed: of these.
    """
    rng = np.random.default_rng(seed)
    states = configurations.random_states(marionette, n, rng)
    on = configurations.taut_states(marionette, n, rng)
    return Structure(
        kinetic_energy(marionette, states),
        symbolic(marionette),
        max(symmetric_products(marionette, x, inertia).max_outside for x in states),
        len(states),
        tuple(symmetric_products(marionette, x, inertia, rows).max_outside for x, rows in on),
        tuple(tracking(marionette, x, inertia, rows) for x, rows in on),
    )
