"""Parameter studies over puppets, parameters, inputs and seeds, on many cores or machines.

A sweep applies one study, a function, to many cases; a case is one combination of values. The
figures of a case are the numbers that the study returns for it.
"""

from fantoccini.lab.sweeps import trial
from fantoccini.lab.sweeps.case import Case
from fantoccini.lab.sweeps.outcome import Failure
from fantoccini.lab.sweeps.result import FailedCase, SweepResult
from fantoccini.lab.sweeps.run import sweep
from fantoccini.lab.sweeps.trial import Trial

__all__ = ["Case", "FailedCase", "Failure", "SweepResult", "Trial", "sweep", "trial"]
