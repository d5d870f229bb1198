"""Small puppets that tests of the schema extend."""

TEXT = """\
puppet: p
mirror: {plane: xz, from: left, to: right}
bodies:
  - name: bob_left
    joint: {type: translation, axes: [z], at: [0, 1, 0]}
    mass: 1
strings:
  - name: s_left
    path: [{body: bob_left}, {world: [0, 1, 1]}]
    length: 1
"""
"""A bob on a string and its twin; the file ends inside the string, so that keys may follow."""
