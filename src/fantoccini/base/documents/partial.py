"""The valid parts of invalid data: checks run on these, so one reading reports all mistakes.

`UNCLEAR` stands for an invalid value, about which checks report nothing.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError

from fantoccini.base.documents.located import Located, tags_of

ModelT = TypeVar("ModelT", bound=BaseModel)


class Unclear:
    """Stands for an invalid value: every attribute is unclear, it is false and empty."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self

    def __bool__(self) -> bool:
        return False

    def __iter__(self) -> Iterator[Any]:
        return iter(())


UNCLEAR: Any = Unclear()


def valid_parts(model: type[ModelT], data: Any, located: Located) -> ModelT:
    """An instance without validation: valid values, texts as written, else ``UNCLEAR``.

    Args:
        model: model of the data; its checks of whole parts do not run.
        data: plain data, of any form.
        located: context of validation.
    """
    part: ModelT = _part(model, data, located)
    return part


def _part(annotation: Any, value: Any, located: Located) -> Any:
    """The valid parts of an invalid value."""
    alternatives = list(_alternatives(annotation))
    if isinstance(value, list | tuple):
        items = [get_args(form)[0] for form in alternatives if get_origin(form) is tuple]
        return tuple(_part(items[0], item, located) for item in value) if items else UNCLEAR
    if isinstance(value, str) and any(f is str or get_origin(f) is Literal for f in alternatives):
        return value
    models = [f for f in alternatives if isinstance(f, type) and issubclass(f, BaseModel)]
    if not isinstance(value, dict) or not models:
        return UNCLEAR
    tag = value.get("type")
    tagged_models = [m for m in models if isinstance(tag, str) and tag in tags_of(m)]
    model = tagged_models[0] if tagged_models else models[0]
    values: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        key = field.alias if field.alias in value else name
        if key in value:
            values[name] = _value(model, name, value[key], located)
        elif field.is_required():
            values[name] = UNCLEAR
    return model.model_construct(**values)


def _value(model: type[BaseModel], name: str, value: Any, located: Located) -> Any:
    """The value of a field."""
    try:
        return _adapter(model, name).validate_python(value, context=located)
    except ValidationError:
        return _part(model.model_fields[name].annotation, value, located)


@lru_cache(maxsize=1000)
def _adapter(model: type[BaseModel], name: str) -> TypeAdapter[Any]:
    """Adapter of one field, without checks that involve other fields."""
    field = model.model_fields[name]
    # `None` is an annotation without effect, for fields without one.
    annotation: Any = Annotated[field.annotation, None, *field.metadata]
    return TypeAdapter(annotation)


def _alternatives(annotation: Any) -> Iterator[Any]:
    """The alternatives of a type."""
    origin = get_origin(annotation)
    if origin is Annotated:
        yield from _alternatives(get_args(annotation)[0])
    elif origin in (Union, types.UnionType):
        for form in get_args(annotation):
            yield from _alternatives(form)
    else:
        yield annotation
