"""One case of a sweep, as its study receives it.

A sweep applies one study, a function, to many cases; a case is one combination of values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.base import UnknownNameError
from fantoccini.dynamics.marionette import Marionette

PUPPET_KEY = "puppet"
"""Name of the value that selects the puppet."""
PARAMETER_PREFIX = "p:"
"""Prefix of values that set a parameter of the puppet."""


@dataclass(frozen=True, eq=False)
class Case:
    """One case of a sweep, as its study receives it. ``case["hand.length"]`` is a value.

    Attributes:
        index: number of the case, 0-based.
        values: name -> value, varied or drawn; ``puppet`` is a label.
        repeat: number of the repetition with these values, 0-based.
        entropy: seed sequence of the case's random numbers.
        marionette: the case's puppet with the case's parameters; None in a sweep without one.
    """

    index: int
    values: Mapping[str, Any]
    repeat: int
    entropy: tuple[int, ...]
    marionette: Marionette | None = None

    def __getitem__(self, name: str) -> Any:
        if name not in self.values:
            raise UnknownNameError("value of the sweep", name, self.values)
        return self.values[name]

    @cached_property
    def rng(self) -> np.random.Generator:
        """The case's own random numbers: the same wherever and whenever it runs."""
        return np.random.default_rng(np.random.SeedSequence(self.entropy))

    @cached_property
    def seed(self) -> int:
        """An integer seed of the case's own, below 2^63."""
        state = np.random.SeedSequence((*self.entropy, 0)).generate_state(1, np.uint64)
        return int(state[0] >> np.uint64(1))

    def with_marionette(self, marionette: Marionette | None) -> Case:
        """The case with a puppet that has the case's parameters, and fresh random numbers."""
        p = {
            name.removeprefix(PARAMETER_PREFIX): value
            for name, value in self.values.items()
            if name.startswith(PARAMETER_PREFIX)
        }
        if marionette is not None and p:
            marionette = marionette.with_parameters(p)
        return dataclasses.replace(self, marionette=marionette)
