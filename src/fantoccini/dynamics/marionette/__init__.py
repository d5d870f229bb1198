"""Marionette: the public class of a puppet, loaded from files, texts and the bundled ones.

A marionette is a puppet with its equations and its compiled library.
"""

from fantoccini.dynamics.marionette import puppets
from fantoccini.dynamics.marionette.loading import StringModel, load, loads
from fantoccini.dynamics.marionette.marionette import Marionette

__all__ = ["Marionette", "StringModel", "load", "loads", "puppets"]
