"""A bowl catches a ball, and a peg a ring: dented meshes touch as convex pieces.

Writes out/dented.yaml, out/bowl.obj, out/ring.obj and out/dented.png. See docs/contact.md.
"""

from pathlib import Path

import numpy as np
import trimesh

import fantoccini as fan
from fantoccini.output.view import strip

OUT = Path("out")
SCENE = """
puppet: dented
floor: 0
contact: {friction: 0.4}
obstacles:
- {name: bowl, type: mesh, file: bowl.obj, colour: "#c9b79c"}
- {name: peg, type: capsule, from: [0.3, -0.08, 0.2], to: [0.3, 0.08, 0.2], radius: 0.02}
bodies:
- name: ball
  joint: {type: free}
  drag: {linear: 0.02, angular: 1.0e-4}
  shapes: [{type: sphere, radius: 0.02, mass: 0.1, colour: "#2f7d6b"}]
- name: ring
  joint: {type: free}
  drag: {linear: 0.1, angular: 0.002}
  shapes: [{type: mesh, file: ring.obj, mass: 0.3, colour: "#a9552f"}]
pose: {ball.x: 0.05, ball.y: 0.01, ball.z: 0.25, ring.x: 0.29, ring.z: 0.15}
"""


def main() -> None:
    """Writes the meshes, releases ball and ring, and prints where they come to rest."""
    OUT.mkdir(exist_ok=True)
    turn = np.linspace(0.0, np.pi / 2, 4)
    outer, inner = (
        np.column_stack([r * np.sin(turn), 0.1 - r * np.cos(turn)]) for r in (0.1, 0.08)
    )
    trimesh.creation.revolve(np.concatenate([outer, inner[::-1]]), sections=12).export(
        OUT / "bowl.obj"
    )
    ring = trimesh.creation.torus(0.1, 0.02, major_sections=16, minor_sections=8)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    ring.export(OUT / "ring.obj")
    (OUT / "dented.yaml").write_text(SCENE)
    scene = fan.load(OUT / "dented.yaml")
    print(f"the two meshes are {len(scene.contacts.hulls)} convex pieces")
    run = fan.simulate(scene, scene.state(), t_end=2.5, method="timestepping")
    strip(scene, run, OUT / "dented.png", n=5, times=[0.0, 0.2, 0.4, 0.8, 2.5], view=(-60.0, 38.0))
    print(f"the ball lies at {run.q_D[-1, :3].round(3)} m, after {len(run.events)} events")
    print(f"no overlap is deeper than {max(0.0, -run.contact.gap.min()):.0e} m")


if __name__ == "__main__":
    main()
