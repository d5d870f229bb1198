"""Digests of values and studies, equal if these give equal results.

They identify stored cases, and show whether the same study wrote a store.

A study is the function that a sweep applies to its cases.
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

from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene import Scene, assembled


def digest(value: Any) -> str:
    """32 hexadecimal digits, equal for equal values.

    Args:
        value: numbers, texts, arrays, puppets, states, inputs, and lists and dicts of them.

    Raises:
        TypeError: a value of another kind.
    """
    text = json.dumps(_json_data(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def study_name(study: Any) -> str:
    """Module and name of a study, for messages."""
    while isinstance(study, partial):
        study = study.func
    owner = study if hasattr(study, "__qualname__") else type(study)
    return f"{owner.__module__}.{owner.__qualname__}"


def study_digest(study: Any) -> str | None:
    """A digest of a study's code and settings; None unless a function, partial or dataclass.

    It covers a function's byte code, constants, defaults and captured values, but not the functions
    it calls.
    """
    if isinstance(study, partial):
        inner = study_digest(study.func)
        keywords = {name: _digest_or_type(value) for name, value in study.keywords.items()}
        return inner and digest([inner, [_digest_or_type(v) for v in study.args], keywords])
    if inspect.isfunction(study):
        captured_values = [_digest_or_type(cell.cell_contents) for cell in study.__closure__ or ()]
        defaults = [_digest_or_type(study.__defaults__), _digest_or_type(study.__kwdefaults__)]
        return digest([_code(study.__code__), captured_values, defaults])
    if dataclasses.is_dataclass(study) and not isinstance(study, type):
        return _digest_or_type(study)
    return None


def _digest_or_type(value: Any) -> str:
    """The digest of plain data; the name of its type otherwise."""
    try:
        return digest(value)
    except (TypeError, ValueError):
        return _type_name(value)


def _type_name(value: Any) -> str:
    """A type's name; without the module for types of this package, so that they can move."""
    module = type(value).__module__
    module = "fantoccini" if module.startswith("fantoccini.") else module
    return f"{module}.{type(value).__qualname__}"


def _code(code: CodeType) -> list[Any]:
    """Byte code, constants and names, without line numbers."""
    constants = [_constant(c) for c in code.co_consts]
    return [code.co_code.hex(), constants, list(code.co_names), list(code.co_varnames)]


def _constant(value: Any) -> Any:
    if isinstance(value, CodeType):
        return _code(value)
    # The order of a set of texts differs from process to process.
    return sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value)


def _json_data(value: Any) -> Any:
    """Data for JSON; types that JSON does not distinguish are tagged."""
    match value:
        case enum.Enum():
            return _json_data(value.value)
        case None | bool() | int() | float() | str():
            return value
        case np.generic():
            return _json_data(value.item())
        case np.ndarray():
            if value.dtype.kind not in "biufcSU":
                raise TypeError(f"an array of {value.dtype} is not plain numbers")
            content = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()
            return {"array": [value.dtype.str, list(value.shape), content]}
        case Marionette():
            return {"marionette": [_json_data(value.puppet), value.p.tolist()]}
        case Scene():
            return _json_data(assembled(value))
        case Puppet():
            return {"puppet": hashlib.sha256(value.canonical().encode()).hexdigest()}
        case PurePath() | complex() | bytes():
            return {type(value).__name__: str(value)}
        case Mapping():
            return {"map": {str(k): _json_data(v) for k, v in value.items()}}
        case Sequence():
            return [_json_data(v) for v in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        field_names = [f.name for f in dataclasses.fields(value) if f.compare]
        fields = {name: _json_data(getattr(value, name)) for name in field_names}
        return {_type_name(value): fields}
    raise TypeError(
        f"found {value!r:.80}, a {type(value).__name__}; a sweep takes numbers, texts, arrays, "
        "puppets, states, inputs, and lists and dicts of them"
    )
