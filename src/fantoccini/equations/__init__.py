"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi."""

from fantoccini.equations.derivatives import Derivatives
from fantoccini.equations.functions import Equations, derive
from fantoccini.equations.variational import Variational

__all__ = ["Derivatives", "Equations", "Variational", "derive"]
