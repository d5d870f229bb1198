"""Marionettes from files and texts.

A marionette is a puppet with its equations and its compiled library.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from fantoccini.base import Mistake, OnProgress, PuppetError
from fantoccini.dynamics.marionette.marionette import Marionette
from fantoccini.model import scene
from fantoccini.model.puppet import Puppet

StringModel = Literal["constraint", "chain"]


def load(
    path: str | Path,
    progress: OnProgress | None = None,
    *,
    string_model: StringModel = "constraint",
) -> Marionette:
    """The marionette of a puppet or scene file.

    Args:
        path: path of a YAML file.
        progress: callback for each stage that begins (``what``: "deriving", "compiling").
        string_model: ``constraint`` for the massless strings of the file; ``chain`` for chains of
            point masses joined by springs, from :meth:`Puppet.with_chains`.

    Raises:
        PuppetError: the file has mistakes; the message lists all of them.
    """
    if Path(path).suffix.lower() == ".npz":
        text = "found a run or inputs; needed: a puppet. fan.Trajectory.load reads a run, "
        text += "fan.Input.load inputs"
        raise PuppetError([Mistake(str(path), None, "", text)])
    return Marionette(_with_strings(scene.load(path), string_model), progress)


def loads(
    text: str, progress: OnProgress | None = None, *, string_model: StringModel = "constraint"
) -> Marionette:
    """The marionette of YAML text; arguments and errors as in :func:`load`."""
    return Marionette(_with_strings(scene.loads(text), string_model), progress)


def _with_strings(puppet: Puppet, string_model: StringModel) -> Puppet:
    if string_model not in (allowed := get_args(StringModel)):
        names = ", ".join(allowed)
        raise ValueError(f"string_model is {string_model!r}; it must be one of {names}")
    return puppet.with_chains() if string_model == "chain" else puppet
