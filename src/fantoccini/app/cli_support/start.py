"""Start state of a run on the command line.

q_D are the dynamic coordinates and q_K the driven ones, the ends and lengths of strings. The
projection moves the puppet until no string is too short.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fantoccini.app.cli_support.files import fail
from fantoccini.app.cli_support.terminal import format_number, print_message
from fantoccini.base.documents import Angle
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.sweeps import trial
from fantoccini.motion import Input, State

_ANGLE = TypeAdapter(Angle)
_MAX_REPORTED = 6
"""Largest number of changed coordinates in a message."""
_MIN_REPORTED_MOVE = 1e-9
"""Smallest change of a start coordinate by projection that is reported [m or rad]."""
_QUATERNION_ENDINGS = (".qw", ".qx", ".qy", ".qz")

Values = dict[str, float | list[float]]


def read_values(settings: Sequence[str]) -> Values:
    """Parses NAME=VALUE settings with numbers such as ``0.3``, ``30 deg``, ``1,0,0,0``.

    Args:
        settings: settings from the command line.
    """
    values: Values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        name = name.strip()
        if not (name and equals):
            fail(f"found {setting!r}; needed: NAME=VALUE", "--start")
        if name.endswith(_QUATERNION_ENDINGS):
            quaternion = name.rsplit(".", 1)[0]
            fail(f"{name} is one of four components; set {quaternion}.rotation=w,x,y,z", "--start")
        if name in values:
            fail(f"{name} is given twice", "--start")
        numbers = [_parse_number(name, part) for part in text.strip().strip("[]").split(",")]
        if len(numbers) > 1 and not name.endswith(".rotation"):
            fail(f"{name}: found {len(numbers)} numbers; needed: one", "--start")
        values[name] = numbers if len(numbers) > 1 else numbers[0]
    return values


def _parse_number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        pass
    try:
        return _ANGLE.validate_python(text)
    except ValidationError as error:
        fail(f"{name}: {error.errors()[0]['msg']}", "--start")


def start_state(
    marionette: Marionette, inputs: Input | None, start_values: Values, quiet: bool
) -> State:
    """Start state as in :class:`fantoccini.lab.Trial`, projected onto strings and limits.

    Prints up to ``_MAX_REPORTED`` coordinates that the projection changed, those of
    ``start_values`` first, then those that moved most, unless ``quiet``.
    """
    x = trial.start_state(marionette, inputs, start_values)
    coordinates = marionette.coordinates
    if not quiet and not {*start_values} <= {
        *coordinates.q_K,
        *coordinates.rotations,
        *coordinates.commands,
    }:
        values = {**({} if inputs is None else inputs.first_values()), **start_values}
        displacement = np.abs(x.q_D - marionette.state(values).q_D)
        changed = np.flatnonzero(displacement > _MIN_REPORTED_MOVE)
        order = sorted(
            changed, key=lambda i: (coordinates.q_D[i] not in start_values, -displacement[i])
        )
        texts = [f"{coordinates.q_D[i]} is {format_number(float(x.q_D[i]))}" for i in order]
        if texts:
            n_hidden = len(texts) - _MAX_REPORTED
            more = f" and {n_hidden} more" if n_hidden > 0 else ""
            print_message(
                "changed the start to the nearest state that strings and limits allow: "
                f"{', '.join(texts[:_MAX_REPORTED])}{more}"
            )
    return x
