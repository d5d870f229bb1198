"""Studies of a puppet: whether its driven coordinates may be inputs."""

from fantoccini.lab.reduction import Claim, ReductionReport, validate_reduction

__all__ = ["Claim", "ReductionReport", "validate_reduction"]
