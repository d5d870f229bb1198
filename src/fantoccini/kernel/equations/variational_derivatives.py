"""Derivatives of the discrete Euler-Lagrange equations
(:mod:`fantoccini.kernel.equations.variational`).

    e = M v_D + M_DK v_K + A_D^T tension            the momenta that a node leaves with, or has
    p_k(xi), p_k+1(xi), q_k+1(xi)                   of the midpoint rule

Derivatives by configurations are along tangent vectors in the body's frame, as those of q_k+1 are.
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
        equations: the continuous ones.
    """

    def __init__(self, equations: Equations):
        self.equations = equations

    def functions(self, library: str) -> dict[str, ca.Function]:
        """The functions of a library, by name; all results are dense."""
        made = {"momenta": Variational(self.equations).functions()["momenta"]}
        made |= {"momenta_by": self._momenta_by(), "midpoint_by": self._midpoint_by()}
        return made | Derivatives(self.equations.tree).functions(library)

    def _called(self, function: ca.Function) -> dict[str, ca.SX]:
        """The results of a function at the symbols, by name."""
        s = self.equations.system.symbols
        found = function.call([s[name] for name in function.name_in()])
        return dict(zip(function.name_out(), found, strict=True))

    def _momenta_by(self) -> ca.Function:
        s, tree = self.equations.system.symbols, self.equations.tree
        momenta = Variational(self.equations).functions()["momenta"]
        A_D = self._called(self.equations["A_D"])["A_D"]
        e = ca.cse(self._called(momenta)["p_D"] + A_D.T @ s.tension)
        names = {"e_q": "q_D", "M": "v_D", "e_qK": "q_K", "M_DK": "v_K", "e_p": "p"}
        found = {name: along_tangents(e, s, tree, by) for name, by in names.items()}
        return declared("momenta_by", s, found | {"e": e})

    def _midpoint_by(self) -> ca.Function:
        s, tree = self.equations.system.symbols, self.equations.tree
        made = self._called(Variational(self.equations).functions()["midpoint_rule"])
        found = {name: made[name] for name in ("before", "after")}
        both = ca.cse(ca.vertcat(made["before"], made["after"]))
        n = tree.coordinates.n_vD
        for name, by in (
            ("q", "q_D"),
            ("xi", "xi"),
            ("qm", "q_mid"),
            ("vm", "v_mid"),
            ("am", "acc_mid"),
            ("u", "u_D"),
            ("p", "p"),
        ):
            part = along_tangents(both, s, tree, by)
            found[f"before_{name}"], found[f"after_{name}"] = part[:n, :], part[n:, :]
        # N^T N is 1 of scalars and 1/4 of quaternions.
        weights = np.ones(n)
        for _, v in tree.coordinates.quaternions_D:
            weights[v : v + 3] = 4.0
        back = ca.substitute(tangents(s, tree, "q_D"), s.q_D, made["q_next"]).T
        for name in ("q", "xi"):
            by = "q_D" if name == "q" else "xi"
            moved = ca.diag(weights) @ (back @ along_tangents(made["q_next"], s, tree, by))
            found[f"next_{name}"] = moved
        return declared("midpoint_by", s, found)
