"""Small puppets for pages: a red ball on a string, and a red block that hangs from a bar."""

from __future__ import annotations

from pathlib import Path

TOY = """\
puppet: toy
floor: 0.0
bodies:
  - name: bob
    joint: {type: free, damping: 2.0e-2}
    mass: {parameter: heaviness, value: 0.3}
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
    shapes: [{type: sphere, radius: 0.07, colour: "#c02020"}]
strings:
  - name: line
    path: [{body: bob, at: [0, 0, 0.07]}, {driven: [x, y], at: [0, 0, 1]}]
    length: driven
pose: {line.length: 0.6}
"""

BAR = """\
puppet: bar
floor: 0.0
bodies:
  - name: bar
    joint: {type: free, at: [0, 0, 1], driven: true}
    shapes: [{type: box, size: [0.04, 0.4, 0.02], density: 500}]
  - name: bob
    joint: {type: free, damping: 2.0e-2}
    mass: 0.3
    inertia: [1.0e-3, 1.0e-3, 1.0e-3]
    shapes: [{type: box, size: [0.06, 0.3, 0.06], colour: "#c02020"}]
strings:
  - name: left
    path: [{body: bob, at: [0, 0.12, 0.03]}, {body: bar, at: [0, 0.12, 0]}]
    length: 0.4
  - name: right
    path: [{body: bob, at: [0, -0.12, 0.03]}, {body: bar, at: [0, -0.12, 0]}]
    length: 0.4
"""

ROCKER = BAR.replace(
    """  - name: bob
""",
    """  - name: rocker
    parent: bar
    joint: {type: revolute, axis: [1, 0, 0], driven: true}
    shapes: [{type: box, size: [0.02, 0.3, 0.01], density: 500}]
  - name: bob
""",
)
"""The bar with a rocker on it."""

GREEN = TOY.replace("#c02020", "#20a020")
WRONG = TOY.replace("radius: 0.07", "radius: <img src=x onerror=alert(1)>")


def toy(folder: Path) -> Path:
    """The toy's file in a folder."""
    path = folder / "toy.yaml"
    path.write_text(TOY, encoding="utf-8")
    return path
