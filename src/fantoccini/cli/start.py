"""Where a run on the command line starts."""

from __future__ import annotations

import numpy as np
from pydantic import TypeAdapter, ValidationError

from fantoccini.cli.files import fail
from fantoccini.cli.terminal import number, say
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.puppet.values import Angle

_ANGLE = TypeAdapter(Angle)
_QUATERNION = (".qw", ".qx", ".qy", ".qz")

Values = dict[str, float | list[float]]


def read_values(settings: tuple[str, ...]) -> Values:
    """NAME=VALUE settings as numbers: ``0.3``, ``30 deg``, ``1,0,0,0``.

    Args:
        settings: as they stand on the command line.
    """
    values: Values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        name = name.strip()
        if not (name and equals):
            fail(f"found {setting!r}; needed: NAME=VALUE", "--start")
        if name.endswith(_QUATERNION):
            whole = name.rsplit(".", 1)[0]
            fail(f"{name} is one of four; set {whole}.rotation=w,x,y,z", "--start")
        if name in values:
            fail(f"{name} is given twice", "--start")
        parts = [_number(name, part) for part in text.strip().strip("[]").split(",")]
        if len(parts) > 1 and not name.endswith(".rotation"):
            fail(f"{name}: found {len(parts)} numbers; needed: one", "--start")
        values[name] = parts if len(parts) > 1 else parts[0]
    return values


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        pass
    try:
        return _ANGLE.validate_python(text)
    except ValidationError as error:
        fail(f"{name}: {error.errors()[0]['msg']}", "--start")
        raise AssertionError from error


def start_state(marionette: Marionette, inputs: Input | None, given: Values, quiet: bool) -> State:
    """The puppet at rest with the driven coordinates where the inputs begin.

    A puppet for which dynamic coordinates or velocities are given is not at rest: it starts from
    them, brought onto its strings where it breaks them.

    Args:
        marionette: the puppet.
        inputs: what will drive it, or None.
        given: coordinates that the user chose.
        quiet: do not say what was changed.
    """
    values = {**({} if inputs is None else inputs.first_values()), **given}
    table = marionette.coordinates
    driven = {*table.q_K, *table.rotations, *table.commands}
    if all(name in driven for name in given):
        x = marionette.rest(values)
    else:
        wanted = marionette.state(values)
        x = marionette.project(wanted)
        moved = np.abs(x.q_D - wanted.q_D)
        if not quiet and np.max(moved, initial=0.0) > 1e-9:
            most = int(np.argmax(moved))
            say(
                f"the start is the nearest one that no string or limit forbids; "
                f"{table.q_D[most]} is {number(float(x.q_D[most]))}"
            )
    return x if inputs is None else x.replace(t=inputs.start)
