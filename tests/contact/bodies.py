"""Puppets without strings: bodies on a floor with a motion with friction in closed form."""

from __future__ import annotations

import numpy as np

import fantoccini as fan

G = 9.81
"""Gravity [m/s^2]."""


def on_slope(slope: float, friction: float, shape: str = "box", **more: str) -> fan.Marionette:
    """A body of 1 kg on a plane inclined by `slope` [rad], downhill along +x.

    Args:
        slope: slope of the floor; gravity is turned instead.
        friction: coefficient.
        shape: `box` of 0.2 x 0.3 x 0.1 m, or `sphere` of 0.1 m.
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


def stepped(marionette: fan.Marionette, x0: fan.State, t_end: float, dt: float) -> fan.Trajectory:
    """A time-stepping run."""
    return fan.simulate(marionette, x0, t_end=t_end, method=fan.TimeStepping(dt=dt))


def errors(values: list[float], exact: float) -> list[float]:
    """Sizes of the errors."""
    return [abs(value - exact) for value in values]


def balls_that_meet() -> tuple[fan.Marionette, fan.State]:
    """Two balls in free flight that collide off-centre and with spin."""
    marionette = fan.loads("""
puppet: billiard
gravity: [0, 0, 0]
contact: {friction: 0.3}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.07, mass: 0.3}]}
""")
    return marionette, thrown(
        marionette,
        {"a.x": -0.5, "a.y": 0.03, "b.x": 0.2, "b.z": 0.05},
        {"a.x": 2.0, "a.wz": 9.0, "b.x": -1.0, "b.y": 0.1},
    )


def ladder(angle: float) -> tuple[fan.Marionette, fan.State]:
    """A thin rod of 1 m and 1 kg between a smooth wall and a smooth floor, `angle` up from it."""
    marionette = fan.loads("""
puppet: ladder
floor: 0
contact: {friction: 0}
obstacles:
- {name: wall, type: box, size: [2, 4, 8], at: [-1, 0, 0]}
bodies:
- name: rod
  joint: {type: free}
  shapes: [{type: capsule, from: [0, 0, -0.5], to: [0, 0, 0.5], radius: 0.001}]
  mass: 1
  inertia: [0.083333333333333333, 0.083333333333333333, 1.0e-4]
""")
    tilt = np.pi / 2 - angle
    return marionette, marionette.state(
        {
            "rod.x": 0.5 * np.cos(angle) + 0.001,
            "rod.z": 0.5 * np.sin(angle) + 0.001,
            "rod.rotation": (np.cos(tilt / 2), 0.0, -np.sin(tilt / 2), 0.0),
        }
    )


def rocking_block(lean: float) -> tuple[fan.Marionette, fan.State, float]:
    """A block on one lower edge, and the angle a between its diagonal and its height."""
    marionette = fan.loads("""
puppet: rocker
floor: 0
contact: {friction: 5}
bodies:
- name: block
  joint: {type: free}
  shapes: [{type: box, size: [0.1, 0.3, 0.5], mass: 1}]
""")
    a, R = np.arctan(0.1 / 0.5), 0.5 * np.hypot(0.1, 0.5)
    x0 = marionette.state(
        {
            "block.x": 0.05 - R * np.sin(a - lean),
            "block.z": R * np.cos(a - lean),
            "block.rotation": (np.cos(lean / 2), 0.0, np.sin(lean / 2), 0.0),
        }
    )
    return marionette, x0, a
