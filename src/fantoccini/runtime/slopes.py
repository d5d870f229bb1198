"""A puppet's compiled derivatives."""

from __future__ import annotations

import ctypes
from pathlib import Path

from fantoccini.arrays import Array
from fantoccini.codegen import DERIVATIVE_SIZES
from fantoccini.equations import DERIVATIVE_ARGUMENTS, DERIVATIVE_RESULTS
from fantoccini.errors import BuildError
from fantoccini.runtime.functions import Functions
from fantoccini.tree import Tree


class Slopes(Functions):
    """A puppet's compiled derivatives; see :mod:`fantoccini.equations.derivatives`.

    Args:
        path: the shared library.
        tree: the tree it was generated from.

    Raises:
        BuildError: it cannot be loaded, or is not this tree's.
    """

    def __init__(self, path: Path, tree: Tree):
        t = tree.coordinates
        widths = {
            "q_D": t.n_qD, "v_D": t.n_vD, "acc_D": t.n_vD, "q_K": t.n_qK, "v_K": t.n_vK,
            "acc_K": t.n_vK, "tension": tree.n_rows, "dt": 1, "p": len(tree.parameters),
        }  # fmt: skip
        self._shapes = {
            name: [
                (tree.n_rows if name == "rows_by" else t.n_vD, widths[by])
                for by in results.values()
            ]
            for name, results in DERIVATIVE_RESULTS.items()
        }
        super().__init__(
            path,
            {
                name: (
                    tuple(widths[a] for a in arguments),
                    tuple(n * m for n, m in self._shapes[name]),
                )
                for name, arguments in DERIVATIVE_ARGUMENTS.items()
            },
        )
        expected = (t.n_qD, t.n_vD, t.n_qK, t.n_vK, tree.n_rows, len(tree.parameters))
        sizes = (ctypes.c_int * len(DERIVATIVE_SIZES))()
        self.handle.fan_sizes(sizes)
        if tuple(sizes) != expected:
            raise BuildError(
                f"the compiled derivatives {path} are of another puppet: their sizes are "
                f"{tuple(sizes)}; delete the file to have it made again"
            )

    def at(self, name: str, values: dict[str, Array]) -> dict[str, Array]:
        """The results of a function by name, as matrices.

        Args:
            name: of the function.
            values: its arguments by name (..., n); others are not looked at.

        Returns:
            result -> (..., n_rows or n_vD, width).
        """
        flat = self.evaluate(name, [values[a] for a in DERIVATIVE_ARGUMENTS[name]])
        found = {}
        for result, part, (n, m) in zip(
            DERIVATIVE_RESULTS[name], flat, self._shapes[name], strict=True
        ):
            by_column = part.reshape(*part.shape[:-1], m, n)
            found[result] = by_column.swapaxes(-1, -2)
        return found
