"""The puppets that come with fantoccini: ``fan.puppets.arm2d()`` is a marionette."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from fantoccini.errors import UnknownNameError
from fantoccini.marionette import Marionette
from fantoccini.marionette import load as _load

_FOLDER = Path(__file__).parent


def names() -> tuple[str, ...]:
    """Names of the bundled puppets."""
    return tuple(sorted(p.stem for p in _FOLDER.glob("*.yaml")))


def path(name: str) -> Path:
    """Where a bundled puppet's file lies.

    Args:
        name: one of ``names()``.
    """
    if name not in names():
        raise UnknownNameError("bundled puppet", name, names())
    return _FOLDER / f"{name}.yaml"


def __getattr__(name: str) -> Callable[..., Marionette]:
    if name.startswith("_") or name not in names():
        raise AttributeError(f"module {__name__!r} has no puppet {name!r}; there are {names()}")
    return partial(_load, path(name))


def __dir__() -> list[str]:
    return [*names(), "names", "path"]
