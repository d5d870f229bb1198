"""The file of a bob on a winch that moves along x."""

CRANE_TEXT = """
puppet: small_crane
bodies:
  - name: bob
    joint: {type: translation, axes: [x, z]}
    shapes:
      - {type: sphere, radius: 0.04, mass: 0.5}
strings:
  - name: line
    path:
      - {body: bob, at: [0, 0, 0]}
      - {driven: [x], at: [0, 0, 0]}
    length: driven
pose: {bob.z: -1.0, line.length: 1.0}
"""
