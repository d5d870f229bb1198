"""One case of a sweep, as a study gets it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.errors import UnknownNameError
from fantoccini.marionette import Marionette

PUPPET = "puppet"
"""The name under which puppets are varied."""
PARAMETER = "p:"
"""What the names of values that are parameters of the puppet begin with."""


@dataclass(frozen=True, eq=False)
class Case:
    """One case of a sweep, as a study gets it. ``case["hand.length"]`` is a value.

    Attributes:
        index: place among all cases, 0-based.
        values: name -> value, of all that is varied or drawn; ``puppet`` is a label.
        repeat: which repetition of these values it is, 0-based.
        entropy: what its random numbers grow from.
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
        """A seed of the case's own, below 2^63, for what wants a number."""
        made = np.random.SeedSequence((*self.entropy, 0)).generate_state(1, np.uint64)
        return int(made[0] >> np.uint64(1))

    def on(self, marionette: Marionette | None) -> Case:
        """The case with its puppet, which gets the case's parameters, and fresh random numbers."""
        p = self.parameters()
        if marionette is not None and p:
            marionette = marionette.with_parameters(p)
        return dataclasses.replace(self, marionette=marionette)

    def parameters(self) -> dict[str, float]:
        """Parameter name -> value, of the values called ``p:NAME``."""
        return {
            name[len(PARAMETER) :]: value
            for name, value in self.values.items()
            if name.startswith(PARAMETER)
        }
