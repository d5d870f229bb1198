"""Puppets without strings: bodies on a floor whose motion with friction has a closed form."""

from __future__ import annotations

import numpy as np

import fantoccini as fan

G = 9.81
"""Gravity [m/s^2]."""


def on_slope(slope: float, friction: float, shape: str = "box", **more: str) -> fan.Marionette:
    """A body of 1 kg on a plane that is inclined by ``slope`` [rad], downhill along +x.

    Args:
        slope: of the floor; gravity is turned instead.
        friction: coefficient.
        shape: ``box`` of 0.2 x 0.3 x 0.1 m, or ``sphere`` of 0.1 m.
        more: further keys of the body, as YAML.
    """
    sizes = {"box": "size: [0.2, 0.3, 0.1]", "sphere": "radius: 0.1"}
    g = [G * np.sin(slope), 0.0, -G * np.cos(slope)]
    keys = "".join(f"\n  {key}: {value}" for key, value in more.items())
    return fan.loads(f"""
puppet: slope
floor: 0
gravity: {[float(x) for x in g]}
contact: {{friction: {friction}}}
bodies:
- name: body
  joint: {{type: free}}
  shapes: [{{type: {shape}, {sizes[shape]}, mass: 1}}]{keys}
""")


def thrown(
    marionette: fan.Marionette, place: dict[str, float], speed: dict[str, float]
) -> fan.State:
    """A state at a place with velocities by name."""
    x = marionette.state(place)
    v = np.array(x.v_D)
    for name, value in speed.items():
        v[marionette.coordinates.v_D.index(name)] = value
    return x.replace(v_D=v)


def stepped(
    marionette: fan.Marionette, x0: fan.State, t_end: float, dt: float
) -> fan.Trajectory:
    """A time-stepping run."""
    return fan.simulate(marionette, x0, t_end=t_end, method=fan.TimeStepping(dt=dt))


def errors(found: list[float], exact: float) -> list[float]:
    """Sizes of the errors."""
    return [abs(value - exact) for value in found]
