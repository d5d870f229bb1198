"""Parameter studies over puppets, parameters, inputs and seeds, on many cores or machines."""

from fantoccini.sweeps.case import Case
from fantoccini.sweeps.outcome import Failure
from fantoccini.sweeps.result import FailedCase, SweepResult
from fantoccini.sweeps.run import sweep
from fantoccini.sweeps.trial import Trial

__all__ = ["Case", "FailedCase", "Failure", "SweepResult", "Trial", "sweep"]
