"""Marionette: a puppet with its equations, compiled model, states and algorithms."""

from fantoccini.marionette.active_set import ActiveSet
from fantoccini.marionette.analysis import A_rate, coriolis_full, energies, link_index
from fantoccini.marionette.checks import (
    as_inputs,
    bind_input,
    bind_inputs,
    check_memory,
    check_samples,
    check_start,
    check_starts,
    check_step,
    check_steps,
    count_samples,
    refuse_contact,
)
from fantoccini.marionette.contact_rows import ContactMode, HeldPoint
from fantoccini.marionette.critical_step import critical_step_of_tensions
from fantoccini.marionette.dynamics import ForwardDynamics
from fantoccini.marionette.evaluation import Evaluation
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.linearisation import Linearisation, Partials
from fantoccini.marionette.loading import StringModel, load, loads
from fantoccini.marionette.marionette import Marionette
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
from fantoccini.marionette.parameter_values import parameter_rows
from fantoccini.marionette.parting import parted, parted_starts
from fantoccini.marionette.plausible import InputWarning, input_warnings, warnings
from fantoccini.marionette.portable import PortablePuppet
from fantoccini.marionette.redundant import (
    CONTRADICTION_STATUSES,
    Contradiction,
    contradiction,
    first_excess_tension,
    may_be_redundant,
)
from fantoccini.marionette.rollout_gradient import Rollout, RolloutGradient
from fantoccini.marionette.step_linearisation import StepLinearisation
from fantoccini.marionette.step_partials import StepLinearisations, linearise_steps
from fantoccini.marionette.stepper import Stepper
from fantoccini.marionette.stepper_batch import StepperBatch

__all__ = [
    "CONTRADICTION_STATUSES",
    "A_rate",
    "ActiveSet",
    "ContactMode",
    "Contradiction",
    "Evaluation",
    "Event",
    "Flow",
    "ForwardDynamics",
    "HeldPoint",
    "InputWarning",
    "Linearisation",
    "Marionette",
    "Method",
    "MethodName",
    "Mode",
    "Model",
    "Modes",
    "Partials",
    "PortablePuppet",
    "Rollout",
    "RolloutGradient",
    "StepLinearisation",
    "StepLinearisations",
    "Stepper",
    "StepperBatch",
    "StringModel",
    "TimeStepping",
    "Variational",
    "as_inputs",
    "as_method",
    "bind_input",
    "bind_inputs",
    "check_mass_matrix",
    "check_memory",
    "check_samples",
    "check_start",
    "check_starts",
    "check_step",
    "check_steps",
    "contradiction",
    "coriolis_full",
    "count_samples",
    "critical_step_of_tensions",
    "energies",
    "first_excess_tension",
    "input_warnings",
    "linearise_steps",
    "link_index",
    "load",
    "loads",
    "may_be_redundant",
    "parameter_rows",
    "parted",
    "parted_starts",
    "refuse_contact",
    "warnings",
]
