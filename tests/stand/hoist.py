"""A bob on a winch, and stands for it."""

from __future__ import annotations

import numpy as np

import fantoccini as fan
from fantoccini.stand import Stand, loads_stand

MASS, RADIUS, ROTOR = 0.3, 0.01, 1e-5
HOIST = f"""
puppet: hoist
bodies:
  - {{name: bob, joint: {{type: translation, axes: [z]}}, mass: {MASS}}}
strings:
  - {{name: line, path: [{{body: bob}}, {{world: [0, 0, 1]}}], length: driven}}
"""
STAND = """
stand: one_winch
axes:
  winch:
    motor: {type: stepper, torque: TORQUE, inertia: 1.0e-5}
    transmission: {type: drum, radius: 0.01}
    moves: {line.length: 1}
    travel: [0.2, 0.9]
    speed: 1
    acceleration: 20
"""
LIFT = {"line.length": [(0.1, 0.8), (0.6, 0.4), (0.8, 0.4), (1.3, 0.8)]}


def stand(torque: str = "0.5", text: str = STAND, **changes: str) -> Stand:
    """The stand with a torque, and other texts replaced (underscores stand for blanks)."""
    text = text.replace("TORQUE", torque)
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    return loads_stand(text)


def lift(hoist: fan.Marionette, method: str = "event") -> fan.Trajectory:
    """The bob goes up and down."""
    x0 = hoist.rest({"line.length": 0.8})
    inputs = fan.Input.waypoints(hoist, LIFT)
    save_at = np.linspace(0.0, 1.5, 1501) if method == "event" else None
    return fan.simulate(hoist, x0, inputs, t_end=1.5, method=method, save_at=save_at)
