"""CasADi functions with the arguments and results of the contract.

The contract declares the functions that Python and C++ share.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from fantoccini.kernel.contract import FUNCTIONS


def declared(name: str, symbols: Mapping[str, ca.SX], results: Mapping[str, ca.SX]) -> ca.Function:
    """The function of a name, with arguments and dense results in the contract's order.

    Args:
        name: name of the function.
        symbols: name -> symbol, for all arguments; others are ignored.
        results: name -> expression, for all results; others are ignored.
    """
    function = FUNCTIONS[name]
    names = [q.name for q in function.arguments], [q.name for q in function.results]
    arguments = [symbols[a] for a in names[0]]
    expressions = ca.cse([ca.densify(results[r]) for r in names[1]])
    return ca.Function(f"fan_{name}", arguments, expressions, *names)
