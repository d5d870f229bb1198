"""Sec. VI of the paper as an experiment: does a puppet on drives move as the mixed model says?"""

from fantoccini.reduction.claims import Claim, Verdict
from fantoccini.reduction.report import ReductionReport
from fantoccini.reduction.validate import validate_reduction

__all__ = ["Claim", "ReductionReport", "Verdict", "validate_reduction"]
