"""A box on eight winches, and its exact inverse kinematics."""

from __future__ import annotations

import itertools

import numpy as np

import fantoccini as fan

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
FRAME = CORNERS * [2.0, 2.0, 1.5] + [0.0, 0.0, 1.5]
BOX = CORNERS * [0.2, 0.2, -0.2]
"""Lower corners hang from above, upper ones are pulled from below."""
MIDDLE = np.array([0.0, 0.0, 1.5])
NAMES = tuple(f"c{i}" for i in range(8))
LIMITED = {i: f", max_tension: {{parameter: most{i}, value: 60}}" for i in (0, 2, 4, 6)}
REWOUND = {i: more + ", rewind_speed: 0.5" for i, more in LIMITED.items()}


def robot(extra: dict[int, str] | None = None) -> fan.Marionette:
    """A free box on eight driven lengths; ``extra`` keys by string."""
    lines = [
        "puppet: robot",
        "bodies:",
        "  - {name: box, joint: {type: free, at: [0, 0, 1.5]}, shapes: [{type: box, "
        "size: [0.4, 0.4, 0.4], mass: 10}]}",
        "strings:",
    ]
    for i, (at, end) in enumerate(zip(BOX.tolist(), FRAME.tolist(), strict=True)):
        more = (extra or {}).get(i, "")
        path = f"[{{body: box, at: {at}}}, {{world: {end}}}]"
        lines.append(f"  - {{name: c{i}, path: {path}, length: driven{more}}}")
    return fan.loads("\n".join(lines))


def lengths(moved: np.ndarray) -> np.ndarray:
    """(8,) lengths for a box moved by (3,) without a turn."""
    return np.linalg.norm(MIDDLE + moved + BOX - FRAME, axis=1)


def moved(
    marionette: fan.Marionette, shift=(0.3, 0.0, 0.0), n: int = 101, end: float = 1.0
) -> tuple[fan.State, fan.Input]:
    """Initial state and input of a move by `shift` until `end`, from `n` samples of the inverse
    kinematics.
    """
    t = np.linspace(0.0, end, n)
    s = t / end
    share = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    sampled = np.array([lengths(np.asarray(shift) * part) for part in share])
    columns = {f"{name}.length": sampled[:, i] for i, name in enumerate(NAMES)}
    x0 = marionette.state({name: column[0] for name, column in columns.items()})
    return x0, fan.Input.samples(marionette, t, columns)
