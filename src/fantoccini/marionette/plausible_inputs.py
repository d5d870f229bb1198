"""What is no mistake in inputs, and still is hardly meant: warnings, with their times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.marionette.model import Model
from fantoccini.marionette.values_by_name import put_commands
from fantoccini.motion import Input
from fantoccini.tree import measure, path_lengths

REACH = 5.0
"""Farthest that something driven goes from its start, in the size of the puppet on its strings."""
SPEED = 10.0
"""Fastest that a hand or a winch moves something [m/s]: a hand that throws reaches 10 to 20."""
TURNING = 100.0
"""Fastest that something driven turns [rad/s]: 1,000 turns a minute."""
TURNS = 4.0
"""Most turns from one waypoint to the next."""
_LOOKS = 9
"""Times that every piece is looked at."""


@dataclass(frozen=True)
class InputWarning:
    """Something that is hardly meant.

    Attributes:
        name: of the driven coordinate, or of a rotation as a whole.
        t: when [s]: at the end of the piece of the motion that it is about.
        message: what was found, what is usual, what to do.
    """

    name: str
    t: float
    message: str


def input_warnings(model: Model, inputs: Input) -> list[InputWarning]:
    """What in inputs is out of all proportion to the puppet: one warning a coordinate and kind.

    Args:
        model: the puppet.
        inputs: what drives it.
    """
    table, found = model.coordinates, []
    ends = inputs.breaks[1:]
    share = np.linspace(0.0, 1.0, _LOOKS)
    t = inputs.breaks[:-1, None] + share * np.diff(inputs.breaks)[:, None]
    # Within each piece: at a break it is the next one's acceleration that would be given.
    q_K, v_K, _ = inputs.evaluate(np.nextafter(t, t.mean(axis=1, keepdims=True)))
    scale, starts = _scale(model), _starts(model)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_K:
        name = table.q_K[q]
        if not inputs.named[v]:
            continue
        if units[name] == "m":
            away = np.abs(q_K[:, :, q] - starts[q]).max(axis=1)
            if away[k := int(away.argmax())] > REACH * scale:
                text = f"goes {away[k]:.4g} m away from where it starts; the puppet on its strings "
                text += f"measures {scale:.3g} m: is it in other units?"
                found.append(InputWarning(name, float(ends[k]), text))
        else:
            turn = np.ptp(q_K[:, :, q], axis=1)
            if turn[k := int(turn.argmax())] > TURNS * 2 * np.pi:
                text = f"turns by {turn[k]:.4g} rad, {turn[k] / (2 * np.pi):.3g} turns, since the "
                text += "waypoint before; are these degrees? then write deg"
                found.append(InputWarning(name, float(ends[k]), text))
        bound, unit = (SPEED, "m/s") if units[name] == "m" else (TURNING, "rad/s")
        found += _speed(name, ends, np.abs(v_K[:, :, v]), bound, unit)
    for name, (_, v) in table.rotations.items():
        if inputs.named[v]:
            speed = np.linalg.norm(v_K[:, :, v : v + 3], axis=2)
            found += _speed(name, ends, speed, TURNING, "rad/s")
    return found


def _speed(
    name: str, ends: np.ndarray, speed: np.ndarray, bound: float, unit: str
) -> list[InputWarning]:
    fastest = speed.max(axis=1)
    if not fastest[k := int(fastest.argmax())] > bound:
        return []
    text = f"moves at up to {fastest[k]:.4g} {unit}; usual: up to {bound:g} {unit}; "
    return [InputWarning(name, float(ends[k]), text + "give it more time, or look at its units")]


def _scale(model: Model) -> float:
    """Size of the puppet and length of its longest string, together [m]."""
    tree, number = model.tree, model.number
    size = measure(tree, number)
    lengths = [*path_lengths(tree, size.poses, number).values()]
    lengths += [number(s.length) for s in (*tree.strings, *tree.chains) if s.length is not None]
    return float(np.linalg.norm(size.lengths)) + max(lengths, default=0.0)


def _starts(model: Model) -> np.ndarray:
    """(n_qK,) the start pose; driven lengths that it does not give are those that just reach."""
    tree, table = model.tree, model.coordinates
    q_D, q_K = table.start_D.copy(), table.start_K.copy()
    paths = path_lengths(tree, measure(tree, model.number).poses, model.number)
    for string in (*tree.strings, *tree.chains):
        string.just_reaches(paths[string.name], q_D, q_K)
    put_commands(tree.drives, (), q_D, q_K)
    return np.nan_to_num(q_K)
