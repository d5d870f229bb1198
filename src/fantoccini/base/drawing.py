"""What draws, found when it is called: the one exception to the import order.

``run.plot()`` and other methods that draw stand on objects far above the package that draws. It is
imported by their first call, so that nobody pays for matplotlib who does not draw.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def output() -> ModuleType:
    """The package with the pictures, plots, films and pages."""
    return import_module("fantoccini.output")
