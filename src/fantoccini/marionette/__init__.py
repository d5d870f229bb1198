"""Marionette: the user's handle."""

from fantoccini.marionette.handle import Marionette, check_method, load, loads
from fantoccini.marionette.stepper import Stepper, check_inputs, check_speed

__all__ = ["Marionette", "Stepper", "check_inputs", "check_method", "check_speed", "load", "loads"]
