"""One of each: a second class or function that does the same would fail here."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator

import fantoccini
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import CompiledPuppet


def _classes() -> Iterator[type]:
    """Every class of the package, from the module that defines it."""
    for found in pkgutil.walk_packages(fantoccini.__path__, "fantoccini."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        for _, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ == module.__name__:
                yield kind


def test_one_class_is_the_model():
    """Only a marionette has a tree with parameters and winches and gives compiled functions."""
    parts = {"tree", "p", "winches", "library", "with_parameters"}
    models = {kind for kind in _classes() if parts <= set(dir(kind)) | _annotated(kind)}
    assert models == {CompiledPuppet, Marionette}


def test_a_marionette_is_the_object_that_algorithms_take(arm):
    """``with_`` methods return marionettes, and nothing is wrapped."""
    others = (arm.with_p(arm.p + 0.0), arm.with_winches(arm.winches), arm.with_obstacles(()))
    assert all(type(other) is Marionette for other in others)
    assert not any(isinstance(part, CompiledPuppet) for part in vars(arm).values())


def _annotated(kind: type) -> set[str]:
    return {name for base in kind.__mro__ for name in vars(base).get("__annotations__", {})}
