"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi."""

from fantoccini.equations.derivatives import (
    ARGUMENTS as DERIVATIVE_ARGUMENTS,
    RESULTS as DERIVATIVE_RESULTS,
    Derivatives,
)
from fantoccini.equations.functions import (
    ANALYSIS_INPUTS,
    MODEL_INPUTS,
    Equations,
    derive,
)
from fantoccini.equations.variational import Variational

__all__ = [
    "ANALYSIS_INPUTS",
    "DERIVATIVE_ARGUMENTS",
    "DERIVATIVE_RESULTS",
    "MODEL_INPUTS",
    "Derivatives",
    "Equations",
    "Variational",
    "derive",
]
