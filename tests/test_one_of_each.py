"""No class or function is duplicated: a second one with the same task would fail here."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections import Counter
from collections.abc import Iterator
from functools import partial
from operator import attrgetter
from types import ModuleType

import pytest

import fantoccini
from fantoccini.dynamics import Marionette
from fantoccini.dynamics.compiled import CompiledPuppet

PACKAGES = ("control", "dynamics", "lab", "model", "motion", "output", "stand", "theatre")


def _classes() -> Iterator[type]:
    """Every class of the package, from the module that defines it."""
    for info in pkgutil.walk_packages(fantoccini.__path__, "fantoccini."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for _, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ == module.__name__:
                yield kind


def test_one_class_is_the_model():
    """Only a marionette has a tree with parameters and winches and gives compiled functions."""
    parts = {"tree", "p", "winches", "library", "with_parameters"}
    models = {kind for kind in _classes() if parts <= set(dir(kind)) | _annotated(kind)}
    assert models == {CompiledPuppet, Marionette}


def test_a_marionette_is_the_object_that_algorithms_take(arm):
    """`with_` methods return marionettes, and there are no wrappers."""
    others = (arm.with_p(arm.p + 0.0), arm.with_winches(arm.winches), arm.with_obstacles(()))
    assert all(type(other) is Marionette for other in others)
    assert not any(isinstance(part, CompiledPuppet) for part in vars(arm).values())


def test_the_public_face_is_small():
    """About 30 names and the packages; every other name is in its package."""
    names = [n for n in fantoccini.__all__ if not inspect.ismodule(getattr(fantoccini, n))]  # type: ignore[attr-defined]
    assert len(names) <= 36


def test_no_two_public_names_differ_in_case_alone():
    packages = [m for m in map(partial(getattr, fantoccini), PACKAGES) if inspect.ismodule(m)]
    public = {name for package in (fantoccini, *packages) for name in _offered(package)}
    twice = Counter(name.lower() for name in public)
    assert [name for name in public if twice[name.lower()] > 1] == []


@pytest.mark.parametrize(
    ("name", "path", "note"),
    [
        ("Track", "control.Track", ""),
        ("StateError", "errors.StateError", ""),
        ("Reach", "control.ReachedPoses", ""),
        ("Sensitivity", "dynamics.RunSensitivity", ""),
        ("Show", "theatre.LivePlay", ""),
        ("Puppet", "model.Puppet", ", the contents of a file; fan.load returns a marionette"),
    ],
)
def test_a_name_that_moved_says_where_it_is(name, path, note):
    with pytest.raises(AttributeError, match=rf"it is fantoccini\.{path}{note}$"):
        getattr(fantoccini, name)
    assert attrgetter(path)(fantoccini) is not None
    with pytest.raises(AttributeError, match=r"no attribute 'nothing'$"):
        _ = fantoccini.nothing  # type: ignore[attr-defined]


def _offered(package: ModuleType) -> set[str]:
    """Functions, classes and constants that a package offers."""
    names = getattr(package, "__all__", ())
    return {n for n in names if not inspect.ismodule(getattr(package, n))}


def _annotated(kind: type) -> set[str]:
    return {name for base in kind.__mro__ for name in vars(base).get("__annotations__", {})}
