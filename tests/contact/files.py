"""Small puppets with contact, as YAML."""

BOX = """
puppet: box
floor: 0
contact: {friction: 0.4}
bodies:
- {name: body, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.3, 0.1], mass: 1}]}
"""

BALL = """
puppet: ball
floor: 0
contact: {friction: 0.3}
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: sphere, radius: 0.1, at: [0.02, 0.01, 0.03], mass: 1}]
"""

BALLS = """
puppet: balls
floor: 0
contact: {friction: 0.4, restitution: 0.5}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: sphere, radius: 0.1, mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: sphere, radius: 0.07, mass: 0.5}]}
"""

# Balls with restitution, without gravity.
BOUNCER = """
puppet: bouncer
gravity: [0, 0, 0]
floor: 0
contact: {friction: 0.3, restitution: 0.8}
obstacles: [{name: wall, type: box, size: [0.1, 4, 4], at: [10, 0, 5]}]
bodies:
- {name: ball, joint: {type: free}, shapes: [{type: sphere, radius: 0.05, mass: 0.1}]}
- {name: other, joint: {type: free}, shapes: [{type: sphere, radius: 0.07, mass: 0.3}]}
"""

CAPSULE = """
puppet: capsule
floor: 0
contact: {friction: 0.4}
bodies:
- name: body
  joint: {type: free}
  shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.03, mass: 1}]
"""

EGG = """
puppet: egg
floor: -1
obstacles: [{name: dome, type: sphere, radius: 0.3, at: [1, 0, 0]}]
contact: {friction: 0.4}
bodies:
- {name: egg, joint: {type: free}, shapes: [{type: ellipsoid, radii: [0.1, 0.06, 0.05], mass: 1}]}
"""

# One leg stands on a tray in a hand, and a string holds the body.
ACROBAT = """
puppet: acrobat
contact: {friction: 0.5}
bodies:
- name: tray
  joint: {type: free, driven: true}
  shapes: [{type: box, size: [0.6, 0.6, 0.04], mass: 1}]
- name: body
  joint: {type: free}
  shapes: [{type: capsule, from: [0, 0, 0.06], to: [0, 0, 0.3], radius: 0.03, mass: 0.5}]
- name: leg
  parent: body
  joint:
    {type: revolute, axis: [0, 1, 0], at: [0, 0, {parameter: hip, value: 0.06}], damping: 0.01}
  shapes: [{type: capsule, from: [0, 0, 0], to: [0, 0, -0.2], radius: 0.02, mass: 0.2}]
- name: arm
  parent: body
  joint: {type: ball, at: [0, 0.05, {parameter: shoulder, value: 0.25}], damping: 0.01}
  shapes: [{type: sphere, radius: 0.03, at: [0, 0.1, 0], mass: {parameter: hand, value: 0.1}}]
strings:
- {name: rope, path: [{body: body, at: [0, 0, 0.3]}, {world: [0, 0, 1.5]}], length: driven}
pose: {tray.z: -0.02, body.z: 0.17, rope.length: 1.0}
"""

STACK = """
puppet: stack
floor: 0
contact: {friction: 0.4}
bodies:
- {name: a, joint: {type: free}, shapes: [{type: box, size: [0.3, 0.3, 0.1], mass: 1}]}
- {name: b, joint: {type: free}, shapes: [{type: box, size: [0.2, 0.2, 0.1], mass: 1}]}
"""

LOGS = """
puppet: logs
floor: 0
contact: {friction: 0.4}
bodies:
- name: a
  joint: {type: free}
  shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.03, mass: 1}]
- name: b
  joint: {type: free}
  shapes: [{type: capsule, from: [-0.1, 0, 0], to: [0.1, 0, 0], radius: 0.04, mass: 1}]
"""

STOOL = """
puppet: stool
floor: 0
contact: {friction: 0.8}
bodies:
- {name: seat, joint: {type: free}, mass: 1, inertia: [0.01, 0.01, 0.01]}
- {name: left, parent: seat, joint: {name: hip_left, type: ball, at: [0, 0.1, 0]},
   shapes: [{type: box, size: [0.1, 0.06, 0.02], at: [0, 0, -0.29], mass: 0.2}]}
- {name: right, parent: seat, joint: {name: hip_right, type: ball, at: [0, -0.1, 0]},
   shapes: [{type: box, size: [0.1, 0.06, 0.02], at: [0, 0, -0.29], mass: 0.2}]}
pose: {seat.z: 0.3}
"""
