"""Marionettes from files and texts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

from fantoccini import puppet
from fantoccini.marionette.handle import Marionette
from fantoccini.puppet import Puppet

StringModel = Literal["constraint", "chain"]


def load(
    path: str | Path,
    progress: Callable[[str], None] | None = None,
    *,
    string_model: StringModel = "constraint",
) -> Marionette:
    """The marionette of a puppet file.

    Args:
        path: a YAML file.
        progress: told what takes long while it happens.
        string_model: ``constraint`` for the massless strings of the file; ``chain`` for chains of
            point masses joined by springs, as :meth:`Puppet.with_chains` makes them.

    Raises:
        PuppetError: with every mistake in the file.
    """
    return Marionette(_modelled(puppet.load(path), string_model), progress)


def loads(
    text: str,
    progress: Callable[[str], None] | None = None,
    *,
    string_model: StringModel = "constraint",
) -> Marionette:
    """The marionette of a puppet written in a string.

    Args:
        text: YAML, as in a puppet file.
        progress: told what takes long while it happens.
        string_model: as in :func:`load`.

    Raises:
        PuppetError: with every mistake in the text.
    """
    return Marionette(_modelled(puppet.loads(text), string_model), progress)


def _modelled(found: Puppet, string_model: str) -> Puppet:
    if string_model not in get_args(StringModel):
        allowed = ", ".join(get_args(StringModel))
        raise ValueError(f"string_model is {string_model!r}; it must be one of {allowed}")
    return found.with_chains() if string_model == "chain" else found
