"""Marionette: the user's handle."""

from fantoccini.marionette.checks import (
    check_memory,
    check_method,
    check_positive,
    check_rows,
    check_starts,
    check_step,
    many_of,
    ready,
    ready_many,
    rows_of_steps,
)
from fantoccini.marionette.closed import closed_rows
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.handle import Marionette
from fantoccini.marionette.linearisation import Linearisation, Partials
from fantoccini.marionette.loading import StringModel, load, loads
from fantoccini.marionette.modes import Mode, Modes
from fantoccini.marionette.plausible import warnings
from fantoccini.marionette.plausible_inputs import InputWarning, input_warnings
from fantoccini.marionette.portable import Parcel
from fantoccini.marionette.redundant import (
    STOPPED_BY,
    Contradiction,
    contradiction,
    may_contradict,
    overpulled,
)
from fantoccini.marionette.spring_steps import tension_step
from fantoccini.marionette.step_linearisation import StepLinearisation
from fantoccini.marionette.stepper import Stepper

__all__ = [
    "STOPPED_BY",
    "Contradiction",
    "Flow",
    "InputWarning",
    "Linearisation",
    "Marionette",
    "Mode",
    "Modes",
    "Parcel",
    "Partials",
    "StepLinearisation",
    "Stepper",
    "StringModel",
    "check_memory",
    "check_method",
    "check_positive",
    "check_rows",
    "check_starts",
    "check_step",
    "closed_rows",
    "contradiction",
    "input_warnings",
    "load",
    "loads",
    "many_of",
    "may_contradict",
    "overpulled",
    "ready",
    "ready_many",
    "rows_of_steps",
    "tension_step",
    "warnings",
]
