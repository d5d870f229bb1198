"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi."""

from fantoccini.equations.derivatives import Derivatives
from fantoccini.equations.functions import Equations, derive
from fantoccini.equations.variational import Variational
from fantoccini.equations.variational_derivatives import VariationalDerivatives

__all__ = ["Derivatives", "Equations", "Variational", "VariationalDerivatives", "derive"]
