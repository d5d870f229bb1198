"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi."""

from fantoccini.kernel.equations.derivatives import Derivatives
from fantoccini.kernel.equations.functions import Equations, derive
from fantoccini.kernel.equations.variational import Variational
from fantoccini.kernel.equations.variational_derivatives import VariationalDerivatives

__all__ = ["Derivatives", "Equations", "Variational", "VariationalDerivatives", "derive"]
