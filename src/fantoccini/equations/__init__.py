"""Derivation: Tree -> Equations (Eqs. 1-11), symbolically with CasADi."""

from fantoccini.equations.functions import (
    ANALYSIS_INPUTS,
    MODEL_INPUTS,
    Equations,
    derive,
)

__all__ = ["ANALYSIS_INPUTS", "MODEL_INPUTS", "Equations", "derive"]
