"""Marionette: the user's handle."""

from fantoccini.marionette.handle import Marionette, load, loads
from fantoccini.marionette.stepper import Stepper

__all__ = ["Marionette", "Stepper", "load", "loads"]
