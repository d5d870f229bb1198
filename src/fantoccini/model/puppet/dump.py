"""Puppets as plain data, YAML and canonical JSON.

Canonical JSON is the same for equal puppets, for example as a key of the cache.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
from pydantic import BaseModel

_UNQUOTED = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
_YAML_CONSTANTS = {"true", "false", "null"}
_LEADING_KEYS = ("name", "type")
"""Keys that are written first."""
_MAX_LINE_WIDTH = 90
"""Longest line on which a value is written in flow style [characters]."""


def plain(value: Any) -> Any:
    """Models, tuples and arrays as dicts, lists and scalars, with the keys of a file."""
    if isinstance(value, BaseModel):
        fields = type(value).model_fields
        values = {
            k: getattr(value, k) for k in sorted(fields, key=lambda k: k not in _LEADING_KEYS)
        }
        return {
            fields[k].alias or k: plain(v)
            for k, v in values.items()
            if k == "type" or v != fields[k].get_default(call_default_factory=True)
        }
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value


def canonical(data: dict[str, Any], meshes: dict[str, str]) -> str:
    """JSON with sorted keys; equal data gives equal text.

    Args:
        data: plain data of an expanded puppet.
        meshes: file name -> digest of its content.
    """
    return json.dumps([data, meshes], sort_keys=True, separators=(",", ":"), allow_nan=False)


def to_yaml(data: dict[str, Any]) -> str:
    """YAML: long values in block style, values that fit on a line in flow style.

    Args:
        data: plain data of a puppet.
    """
    return "\n".join(_block(data, "")) + "\n"


def _block(value: Any, indent: str) -> list[str]:
    lines = []
    if isinstance(value, dict):
        for key, item in value.items():
            lines += _entry(f"{indent}{_scalar(key)}:", item, indent + "  ", indent)
    else:
        for item in value:
            if isinstance(item, dict) and len(_flow(item)) + len(indent) > _MAX_LINE_WIDTH - 2:
                block = _block(item, indent + "  ")
                lines += [f"{indent}- {block[0].lstrip()}", *block[1:]]
            else:
                lines.append(f"{indent}- {_flow(item)}")
    return lines


def _entry(head: str, item: Any, inner_indent: str, indent: str) -> list[str]:
    flow = _flow(item)
    is_list_of_mappings = isinstance(item, list) and item and isinstance(item[0], dict)
    if not isinstance(item, (dict, list)) or not item:
        return [f"{head} {flow}"]
    if len(head) + 1 + len(flow) <= _MAX_LINE_WIDTH and not (is_list_of_mappings and not indent):
        return [f"{head} {flow}"]
    if isinstance(item, list) and not is_list_of_mappings:
        return [f"{head} {flow}"]
    return [head, *_block(item, inner_indent)]


def _flow(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_scalar(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return _scalar(value)


def _scalar(value: Any) -> str:
    if (
        isinstance(value, str)
        and _UNQUOTED.fullmatch(value)
        and value.lower() not in _YAML_CONSTANTS
    ):
        return value
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
