"""The room that draws, imported by the first call of a method that draws.

``run.plot()`` and its like are methods of objects in rooms above ``output``. This import by name is
the one exception to the order of rooms; nobody who does not draw pays for matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def output() -> ModuleType:
    """``fantoccini.output``: pictures, plots, films and pages."""
    return import_module("fantoccini.output")
