"""A play of two balls on strings, as small as possible: it compiles within a second."""

from __future__ import annotations

from pathlib import Path

BALL = """\
puppet: bob
bodies:
  - name: ball
    joint: {type: translation, axes: [x, y, z]}
    shapes: [{type: sphere, radius: 0.05, mass: 0.2}]
strings:
  - {name: hold, path: [{body: ball}, {driven: [x, y], at: [0, 0, 1]}], length: driven}
pose: {ball.x: 0, ball.y: 0, ball.z: 0.2, hold.length: 0.8}
"""
HOP = """\
gesture: hop
moves: {hold.length: [[0, 0], [0.5, -10 cm], [1, 0]]}
marks: {top: 0.5}
"""
SWAY = """\
gesture: sway
moves: {hold.y: [[0, 0], [1.5, 60 cm], [3, 0]]}
"""
CUES = """\
      - {who: one, does: hop.yaml, when: 0.5, says: "<Hop> & hop"}
      - {who: two, does: hop.yaml, on: {top: 2}}
"""
TOUCHING_CUES = """\
      - {who: two, does: hop.yaml, when: 0.5}
      - {who: one, does: sway.yaml, when: 0.75}
"""
"""The ball of `one` would go through that of `two`."""
OPTIONAL_TOUCHING_CUES = TOUCHING_CUES.replace("sway.yaml,", "sway.yaml, optional: true,")


def write_play(folder: Path, cues: str = CUES, extra_keys: str = "") -> Path:
    """Write a play with its files, and further keys; returns its path."""
    for name, text in (("bob.yaml", BALL), ("hop.yaml", HOP), ("sway.yaml", SWAY)):
        (folder / name).write_text(text, encoding="utf-8")
    path = folder / "tiny.yaml"
    path.write_text(
        "play: tiny\nabout: Two <b>balls</b> & their hops.\nstage:\n  marks:\n"
        "    here: {at: [0, -0.3]}\n    there: {at: [0, 0.3]}\n"
        "  obstacles: [{type: box, name: block, at: [-0.4, 0, 0.1], size: [0.1, 0.3, 0.2]}]\n"
        "cast:\n  one: {puppet: bob.yaml, at: here}\n  two: {puppet: bob.yaml, at: there}\n"
        f'acts:\n  - act: "First <act>"\n    cues:\n{cues}{extra_keys}',
        encoding="utf-8",
    )
    return path
