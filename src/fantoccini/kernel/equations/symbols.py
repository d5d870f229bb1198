"""Symbols of all expressions, with the paper's letters.

D stands for dynamic coordinates, K for driven ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

import casadi as ca

from fantoccini.kernel.contract import ARGUMENTS
from fantoccini.model.tree import Tree


class Symbols(dict[str, ca.SX]):
    """Name -> symbol of an argument of the contract, also as attributes; without the factor L."""

    @classmethod
    def of(cls, tree: Tree) -> Symbols:
        """Fresh symbols with the sizes of a tree."""
        quantities = (q for q in ARGUMENTS.values() if "n_packed" not in q.shape)
        return cls({q.name: ca.SX.sym(q.name, *q.dimensions(tree.sizes)) for q in quantities})

    def __getattr__(self, name: str) -> ca.SX:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None
