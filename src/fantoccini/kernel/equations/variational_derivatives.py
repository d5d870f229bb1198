"""Derivatives of the discrete Euler-Lagrange equations.

They are those of :mod:`fantoccini.kernel.equations.variational`:

    e = M v_D + M_DK v_K + A_D^T tension            momenta at a node, with or without impulses
    p_k(xi), p_k+1(xi), q_k+1(xi)                   results of the midpoint rule

Derivatives of and by configurations are along tangent vectors in the body's frame.

D stands for dynamic coordinates, K for driven ones; A_D are the derivatives of string gaps, and xi
is the move of a step.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from fantoccini.kernel.equations.declared import declared
from fantoccini.kernel.equations.derivatives import Derivatives, along_tangents, tangents
from fantoccini.kernel.equations.functions import Equations
from fantoccini.kernel.equations.variational import Variational


class VariationalDerivatives:
    """The derivatives of a tree's discrete equations as CasADi functions.

    Attributes:
        equations: continuous equations of the tree.
    """

    def __init__(self, equations: Equations):
        self.equations = equations

    def functions(self, library: str) -> dict[str, ca.Function]:
        """Name -> function of a library; all results are dense."""
        momenta = {"momenta": Variational(self.equations).functions()["momenta"]}
        momenta |= {"momenta_by": self._momenta_by(), "midpoint_by": self._midpoint_by()}
        return momenta | Derivatives(self.equations.tree).functions(library)

    def _called(self, function: ca.Function) -> dict[str, ca.SX]:
        """Name -> result of a function at the symbols."""
        s = self.equations.system.symbols
        results = function.call([s[name] for name in function.name_in()])
        return dict(zip(function.name_out(), results, strict=True))

    def _momenta_by(self) -> ca.Function:
        s, tree = self.equations.system.symbols, self.equations.tree
        momenta = Variational(self.equations).functions()["momenta"]
        A_D = self._called(self.equations["A_D"])["A_D"]
        e = ca.cse(self._called(momenta)["p_D"] + A_D.T @ s.tension)
        names = {"e_q": "q_D", "M": "v_D", "e_qK": "q_K", "M_DK": "v_K", "e_p": "p"}
        derivatives = {
            name: along_tangents(e, s, tree, variable) for name, variable in names.items()
        }
        return declared("momenta_by", s, derivatives | {"e": e})

    def _midpoint_by(self) -> ca.Function:
        s, tree = self.equations.system.symbols, self.equations.tree
        rule = self._called(Variational(self.equations).functions()["midpoint_rule"])
        results = {name: rule[name] for name in ("before", "after")}
        momenta = ca.cse(ca.vertcat(rule["before"], rule["after"]))
        n = tree.coordinates.n_vD
        for name, variable in (
            ("q", "q_D"),
            ("xi", "xi"),
            ("qm", "q_mid"),
            ("vm", "v_mid"),
            ("am", "acc_mid"),
            ("u", "u_D"),
            ("p", "p"),
        ):
            derivative = along_tangents(momenta, s, tree, variable)
            results[f"before_{name}"], results[f"after_{name}"] = (
                derivative[:n, :],
                derivative[n:, :],
            )
        # N^T N is 1 for scalars and 1/4 for quaternions.
        weights = np.ones(n)
        for _, v in tree.coordinates.quaternions_D:
            weights[v : v + 3] = 4.0
        to_tangents = ca.substitute(tangents(s, tree, "q_D"), s.q_D, rule["q_next"]).T
        for name in ("q", "xi"):
            variable = "q_D" if name == "q" else "xi"
            next_q = ca.diag(weights) @ (
                to_tangents @ along_tangents(rule["q_next"], s, tree, variable)
            )
            results[f"next_{name}"] = next_q
        return declared("midpoint_by", s, results)
