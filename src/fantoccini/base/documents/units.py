"""Units of quantities in files: ``12 cm`` and ``30 deg`` as numbers in m and rad."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

Units = Mapping[str, float]
"""Unit -> its size in m or rad."""

LENGTHS: Units = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
ANGLES: Units = {"deg": math.radians(1.0), "rad": 1.0}
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?) *([a-z]+)", re.ASCII)


def without_unit(value: Any, units: Units) -> Any:
    """The number in m or rad of a text with one of these units; any other value unchanged."""
    match = _QUANTITY.fullmatch(value.strip()) if isinstance(value, str) else None
    if match is None or match[2] not in units:
        return value
    return float(match[1]) * units[match[2]]


def quantity_schema(*kinds: Units) -> dict[str, Any]:
    """JSON Schema of a number, with or without a unit of these kinds."""
    names = "|".join(name for units in kinds for name in units)
    text = {"type": "string", "pattern": f"^ *[-+.0-9eE]+ *({names}) *$"}
    return {"anyOf": [{"type": "number"}, text]}
