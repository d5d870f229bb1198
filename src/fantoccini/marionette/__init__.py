"""Marionette: the user's handle."""

from fantoccini.marionette.checks import (
    check_inputs,
    check_method,
    check_speeds,
    check_starts,
    check_step,
    many_of,
)
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.handle import Marionette
from fantoccini.marionette.linearisation import Linearisation, Partials
from fantoccini.marionette.loading import load, loads
from fantoccini.marionette.modes import Mode, Modes
from fantoccini.marionette.portable import Parcel
from fantoccini.marionette.spring_steps import tension_step
from fantoccini.marionette.step_linearisation import StepLinearisation
from fantoccini.marionette.stepper import Stepper

__all__ = [
    "Flow",
    "Linearisation",
    "Marionette",
    "Mode",
    "Modes",
    "Parcel",
    "Partials",
    "StepLinearisation",
    "Stepper",
    "check_inputs",
    "check_method",
    "check_speeds",
    "check_starts",
    "check_step",
    "load",
    "loads",
    "many_of",
    "tension_step",
]
