"""Lazy import of ``fantoccini.output`` for methods that draw, such as ``run.plot()``.

These methods belong to packages that may not import ``output``. This import by name is the one
exception to the import order. It keeps matplotlib unloaded until something is drawn.
"""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def output() -> ModuleType:
    """The package ``fantoccini.output``, imported on the first call."""
    return import_module("fantoccini.output")
