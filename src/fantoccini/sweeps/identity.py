"""What a value, a study or a case is, as a text: equal texts for what gives equal results.

Texts, and digests of them, say which stored case belongs to which values, and whether a store was
made by the same study. Nothing is read back from them.
"""

from __future__ import annotations

import dataclasses
import enum
import hashlib
import inspect
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import PurePath
from types import CodeType
from typing import Any

import numpy as np

from fantoccini.marionette import Marionette
from fantoccini.puppet import Puppet
from fantoccini.world import World


def digest(value: Any) -> str:
    """32 hexadecimal digits that are equal for equal values.

    Args:
        value: numbers, texts, arrays, puppets, states, inputs, and lists and dicts of them.

    Raises:
        TypeError: naming a value of another kind.
    """
    text = json.dumps(_plain(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def study_name(study: Any) -> str:
    """Module and name of a study, for people."""
    while isinstance(study, partial):
        study = study.func
    named = study if hasattr(study, "__qualname__") else type(study)
    return f"{named.__module__}.{named.__qualname__}"


def study_digest(study: Any) -> str | None:
    """A digest of what a study does; None where that cannot be told.

    Of a function it is the compiled code with its constants, defaults and captured values, not what
    it calls; of a dataclass or a ``functools.partial`` the settings as well.
    """
    if isinstance(study, partial):
        inner = study_digest(study.func)
        keywords = {name: _or_kind(value) for name, value in study.keywords.items()}
        return inner and digest([inner, [_or_kind(value) for value in study.args], keywords])
    if inspect.isfunction(study):
        # What a closure has captured takes part where it is plain data.
        captured = [_or_kind(cell.cell_contents) for cell in study.__closure__ or ()]
        given = [_or_kind(study.__defaults__), _or_kind(study.__kwdefaults__)]
        return digest([_code(study.__code__), captured, given])
    if dataclasses.is_dataclass(study) and not isinstance(study, type):
        return _or_kind(study)
    return None


def _or_kind(value: Any) -> Any:
    """The value where it is plain data, otherwise its kind."""
    try:
        return digest(value)
    except (TypeError, ValueError):
        return f"{type(value).__module__}.{type(value).__qualname__}"


def _code(code: CodeType) -> list:
    """What a function does, without where it stands in its file."""
    constants = [_constant(c) for c in code.co_consts]
    return [code.co_code.hex(), constants, list(code.co_names), list(code.co_varnames)]


def _constant(value: Any) -> Any:
    if isinstance(value, CodeType):
        return _code(value)
    # The order of a set of texts is another one in every process.
    return sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)


def _plain(value: Any) -> Any:
    """JSON-able data; kinds that JSON would mix up are marked."""
    match value:
        case enum.Enum():
            return _plain(value.value)
        case None | bool() | int() | float() | str():
            return value
        case np.generic():
            return _plain(value.item())
        case np.ndarray():
            if value.dtype.kind not in "biufcSU":
                raise TypeError(f"an array of {value.dtype} is not plain numbers")
            content = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
            return {"array": [value.dtype.str, list(value.shape), content]}
        case Marionette():
            return {"marionette": [_plain(value.world), value.p.tolist()]}
        case World():
            return {"world": [value.name, *(_plain(p) for p in value.puppets)]}
        case Puppet():
            return {"puppet": hashlib.sha256(value.canonical().encode()).hexdigest()}
        case PurePath() | complex() | bytes():
            return {type(value).__name__: str(value)}
        case Mapping():
            return {"map": {str(k): _plain(v) for k, v in value.items()}}
        case Sequence():
            return [_plain(v) for v in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        kept = [f.name for f in dataclasses.fields(value) if f.compare]
        fields = {name: _plain(getattr(value, name)) for name in kept}
        return {f"{type(value).__module__}.{type(value).__qualname__}": fields}
    raise TypeError(
        f"found {value!r:.80}, a {type(value).__name__}; a sweep takes numbers, texts, arrays, "
        "puppets, states, inputs, and lists and dicts of them"
    )
