"""Sweeps: one study over puppets, parameters, inputs and seeds, on many cores or machines."""

from fantoccini.sweep.case import Case
from fantoccini.sweep.outcome import Failure
from fantoccini.sweep.result import FailedCase, SweepResult
from fantoccini.sweep.run import sweep
from fantoccini.sweep.trial import Trial

__all__ = ["Case", "FailedCase", "Failure", "SweepResult", "Trial", "sweep"]
