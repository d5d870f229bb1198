"""Small puppets with a reduction in closed form."""

CART = """
puppet: cart
bodies:
  - name: trolley
    joint: {type: prismatic, axis: [1, 0, 0], driven: true}
    mass: 2.0
    inertia: [1, 1, 1]
  - name: rod
    parent: trolley
    joint: {name: swing, type: revolute, axis: [0, -1, 0]}
    mass: 1.0
    com: [0, 0, -0.5]
    inertia: [0.1, 0.1, 0.1]
"""
"""A rod hangs from a driven trolley by a hinge: M_DK = m l cos(theta)."""

RADIAL = """
puppet: radial
bodies:
  - name: arm
    joint: {name: turn, type: revolute, axis: [0, 0, 1]}
    mass: 1.0
    inertia: [1, 1, 1]
  - name: slider
    parent: arm
    joint: {name: out, type: prismatic, axis: [1, 0, 0], driven: true}
    mass: 1.0
    inertia: [0.1, 0.1, 0.1]
pose: {out: 0.5}
"""
"""A slider is driven along a turning arm: M_DK = 0, and M_DD depends on the slider."""

WINCH = """
puppet: winch
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    shapes: [{type: sphere, radius: 0.04, mass: 0.5}]
strings:
  - name: line
    path: [{body: bob, at: [0, 0, 0]}, {driven: [x], at: [0, 0, 0]}]
    length: driven
pose: {bob.x: 0.3, bob.z: -1.0}
"""
"""A bob on a winch that moves along x."""

HELD = """
puppet: held
bodies:
  - name: bob
    joint: {type: prismatic, axis: [0, 0, 1]}
    mass: 0.5
    inertia: [1, 1, 1]
strings:
  - name: above
    path: [{body: bob, at: [0, 0, 0]}, {world: [0, 0, 1]}]
    length: driven
  - name: below
    path: [{body: bob, at: [0, 0, 0]}, {world: [0, 0, -1]}]
    length: driven
"""
"""A bob on a rail between two winches that can pull against each other."""

LIFTED = HELD.replace("[0, 0, -1]", "[0, 0, 2]").replace("below", "higher")
"""A bob on a rail that two winches lift."""

TURNED = """
puppet: turned
bodies:
  - name: hand
    joint: {type: free, driven: true}
    mass: 0.8
    com: [0.1, -0.05, 0.02]
    inertia: [0.02, 0.03, 0.025]
  - name: arm
    parent: hand
    joint: {name: wrist, type: ball, at: [0.2, 0.1, 0]}
    mass: 0.5
    com: [0.05, 0, -0.2]
    inertia: [0.02, 0.015, 0.01]
  - name: finger
    parent: arm
    joint: {name: knuckle, type: revolute, axis: [0, -1, 0], at: [0, 0, -0.3]}
    mass: 0.2
    com: [0.1, 0, 0]
    inertia: [0.001, 0.002, 0.002]
"""
"""An arm on a ball joint of a hand that is driven in all six directions."""
