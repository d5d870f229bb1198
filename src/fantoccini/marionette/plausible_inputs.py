"""Warnings about inputs that are legal but out of proportion to the puppet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.marionette.initial_state import put_commands
from fantoccini.marionette.model import Model
from fantoccini.motion import Input
from fantoccini.tree import measure, path_lengths


@dataclass(frozen=True)
class Usual:
    """Usual motions of driven coordinates."""

    max_reach: float = 5.0  # Distance from the start, over the size of the puppet on its strings
    max_speed: float = 10.0  # Speed of a hand or a winch [m/s]: a hand that throws reaches 10 to 20
    max_angular_speed: float = 100.0  # [rad/s]: 1,000 turns a minute
    max_turns: float = 4.0  # Turns from one waypoint to the next
    times: int = 9  # At which every piece is evaluated


USUAL = Usual()


@dataclass(frozen=True)
class InputWarning:
    """An input that is probably not intended.

    Attributes:
        name: of the driven coordinate, or of a rotation as a whole.
        t: end of the piece of the motion in question [s].
        message: what was found, what is usual, what to do.
    """

    name: str
    t: float
    message: str


def input_warnings(model: Model, inputs: Input) -> list[InputWarning]:
    """Where inputs are out of proportion to the puppet: one warning a coordinate and kind."""
    table = model.coordinates
    found: list[InputWarning] = []
    ends = inputs.breaks[1:]
    share = np.linspace(0.0, 1.0, USUAL.times)
    t = inputs.breaks[:-1, None] + share * np.diff(inputs.breaks)[:, None]
    # Within each piece: at a break the next one's acceleration would be given.
    q_K, v_K, _ = inputs.evaluate(np.nextafter(t, t.mean(axis=1, keepdims=True)))
    scale, starts = _scale(model), _starts(model)
    units = {row.name: row.unit for row in table.rows}
    for q, v in table.scalars_K:
        name = table.q_K[q]
        if not inputs.named[v]:
            continue
        if units[name] == "m":
            away = np.abs(q_K[:, :, q] - starts[q]).max(axis=1)
            if away[k := int(away.argmax())] > USUAL.max_reach * scale:
                text = f"goes {away[k]:.4g} m away from where it starts; the puppet on its strings "
                text += f"measures {scale:.3g} m: is it in other units?"
                found.append(InputWarning(name, float(ends[k]), text))
        else:
            turn = np.ptp(q_K[:, :, q], axis=1)
            if turn[k := int(turn.argmax())] > USUAL.max_turns * 2 * np.pi:
                text = f"turns by {turn[k]:.4g} rad, {turn[k] / (2 * np.pi):.3g} turns, since the "
                text += "waypoint before; are these degrees? then write deg"
                found.append(InputWarning(name, float(ends[k]), text))
        metres = units[name] == "m"
        bound = USUAL.max_speed if metres else USUAL.max_angular_speed
        unit = "m/s" if metres else "rad/s"
        found += _speed(name, ends, np.abs(v_K[:, :, v]), bound, unit)
    for name, (_, v) in table.rotations.items():
        if inputs.named[v]:
            speed = np.linalg.norm(v_K[:, :, v : v + 3], axis=2)
            found += _speed(name, ends, speed, USUAL.max_angular_speed, "rad/s")
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
