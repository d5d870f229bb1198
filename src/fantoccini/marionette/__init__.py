"""Marionette: the user's handle."""

from fantoccini.marionette.analysis import A_rate, coriolis_full, energies, link_index
from fantoccini.marionette.checks import (
    check_memory,
    check_rows,
    check_starts,
    check_step,
    many_of,
    ready,
    ready_many,
    rows_of_steps,
)
from fantoccini.marionette.closed import closed_rows
from fantoccini.marionette.dynamics import ForwardDynamics, with_mode
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.handle import Marionette
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.linearisation import Linearisation, Partials
from fantoccini.marionette.loading import StringModel, load, loads
from fantoccini.marionette.mass_check import check_mass_matrix
from fantoccini.marionette.methods import (
    Event,
    Method,
    MethodName,
    TimeStepping,
    Variational,
    as_method,
)
from fantoccini.marionette.model import Model
from fantoccini.marionette.modes import Mode, Modes
from fantoccini.marionette.parcel import Parcel
from fantoccini.marionette.plausible import warnings
from fantoccini.marionette.plausible_inputs import InputWarning, input_warnings
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
from fantoccini.marionette.vectors import check_positive

__all__ = [
    "STOPPED_BY",
    "A_rate",
    "Contradiction",
    "Event",
    "Flow",
    "ForwardDynamics",
    "InputWarning",
    "Linearisation",
    "Marionette",
    "Method",
    "MethodName",
    "Mode",
    "Model",
    "Modes",
    "Parcel",
    "Partials",
    "StepLinearisation",
    "Stepper",
    "StringModel",
    "TimeStepping",
    "Variational",
    "as_method",
    "check_mass_matrix",
    "check_memory",
    "check_positive",
    "check_rows",
    "check_starts",
    "check_step",
    "closed_rows",
    "contradiction",
    "coriolis_full",
    "energies",
    "input_warnings",
    "instant_at",
    "link_index",
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
    "with_mode",
]
