"""Steppers: runs advanced step by step; correction of start states with small overlaps.

A ledger is the table of energies and work of a run. Lanes are runs that the vector unit of the
processor advances together. q_D are the dynamic and q_K the driven coordinates (ends and lengths of
strings), v and acc their rates; a row is a string or a joint limit, and the taut rows are the
active set.
"""

from fantoccini.dynamics.steppers.determinacy import ForceSamples, force_names, undetermined
from fantoccini.dynamics.steppers.ledgers import ledger_of, ledgers_of_terms
from fantoccini.dynamics.steppers.parting import separated, separated_starts
from fantoccini.dynamics.steppers.prescribed import (
    Overlap,
    deepest,
    measuring_times,
    overlap_events,
    prescribed_overlaps,
)
from fantoccini.dynamics.steppers.redundant import (
    CONTRADICTION_STATUSES,
    Contradiction,
    contradiction,
    first_excess_tension,
    may_be_redundant,
)
from fantoccini.dynamics.steppers.soundness import (
    BOUNDS,
    LedgerCheck,
    excused_share,
    fault_of_run,
    faults,
    springs_swing,
)
from fantoccini.dynamics.steppers.stepper import Stepper, held_input
from fantoccini.dynamics.steppers.stepper_batch import StepperBatch
from fantoccini.dynamics.steppers.verdict import Check, Verdict, decide

__all__ = [
    "BOUNDS",
    "CONTRADICTION_STATUSES",
    "Check",
    "Contradiction",
    "ForceSamples",
    "LedgerCheck",
    "Overlap",
    "Stepper",
    "StepperBatch",
    "Verdict",
    "contradiction",
    "decide",
    "deepest",
    "excused_share",
    "fault_of_run",
    "faults",
    "first_excess_tension",
    "force_names",
    "held_input",
    "ledger_of",
    "ledgers_of_terms",
    "may_be_redundant",
    "measuring_times",
    "overlap_events",
    "prescribed_overlaps",
    "separated",
    "separated_starts",
    "springs_swing",
    "undetermined",
]
