"""CasADi functions with the arguments and results that the contract declares."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from fantoccini.kernel.contract import FUNCTIONS


def declared(name: str, symbols: Mapping[str, ca.SX], results: Mapping[str, ca.SX]) -> ca.Function:
    """The function of a name, its arguments and results in the contract's order; all are dense.

    Args:
        name: of the function.
        symbols: its arguments, and perhaps more, by name.
        results: expressions of its results, and perhaps more, by name.
    """
    function = FUNCTIONS[name]
    names = [q.name for q in function.arguments], [q.name for q in function.results]
    arguments = [symbols[a] for a in names[0]]
    expressions = ca.cse([ca.densify(results[r]) for r in names[1]])
    return ca.Function(f"fan_{name}", arguments, expressions, *names)
