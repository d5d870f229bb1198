"""A puppet's compiled derivatives."""

from __future__ import annotations

from collections.abc import Mapping

from fantoccini.arrays import Array
from fantoccini.contract import FUNCTIONS
from fantoccini.runtime.functions import Functions


class Slopes(Functions):
    """A puppet's compiled derivatives; see :mod:`fantoccini.equations.derivatives`."""

    def at(self, name: str, values: Mapping[str, Array | float]) -> dict[str, Array]:
        """The results of a function by name.

        Args:
            name: of the function.
            values: its arguments by name, and perhaps others.

        Returns:
            result -> (..., n_rows or n_vD, width).
        """
        wanted = {a.name: values[a.name] for a in FUNCTIONS[name].arguments}
        return vars(self.evaluate(name, **wanted))
