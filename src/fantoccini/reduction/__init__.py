"""Sec. VI of the paper as an experiment: is the mixed model what a puppet on drives does?"""

from fantoccini.reduction.claims import Claim, Verdict
from fantoccini.reduction.report import ReductionReport, validate_reduction

__all__ = ["Claim", "ReductionReport", "Verdict", "validate_reduction"]
