"""A marionette sits down on a crate and kicks a ball that rolls by.

Solids touch, stick and slide: `contact: true` in a scene or a puppet file. Writes out/stage.png and
out/stage.npz. See docs/contact.md.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output.view import strip

OUT = Path("out")
STAGE = """
scene: stage
floor: 0
contact: {friction: 0.6, pairs: [{between: [ball, floor], friction: 0.3, restitution: 0.5}]}
puppets:
- {name: pierrot, puppet: marionette}
props:
- name: crate
  at: [-0.13, 0, 0.0701]
  shapes: [{type: box, size: [0.16, 0.24, 0.14], mass: 0.8, colour: "#a9825a"}]
- name: ball
  at: [0.5, -0.03, 0.0301]
  shapes: [{type: sphere, radius: 0.03, mass: 0.02, colour: "#2f7d6b"}]
"""
DOWN = {
    "head": 0.17,
    "shoulder_left": 0.14,
    "shoulder_right": 0.14,
    "hand_left": 0.16,
    "hand_right": 0.16,
}


def main() -> None:
    """Lets the puppet down onto the crate, and prints the forces that carry it."""
    OUT.mkdir(exist_ok=True)
    stage = fan.loads(STAGE)
    x0 = stage.project(stage.state({"torso.z": 0.35}))
    v_D = x0.v_D.copy()
    v_D[stage.coordinates.v_D.index("ball.x")] = -0.55
    lengths = {
        f"{name}.length": [(0.0, x0[f"{name}.length"]), (1.0, x0[f"{name}.length"] + more)]
        for name, more in DOWN.items()
    }
    back = {
        f"{name}.x": [(0.0, x0[f"{name}.x"]), (0.9, x0[f"{name}.x"] - 0.13)]
        for name in (*DOWN, "knee_left", "knee_right")
    }
    inputs = fan.Input.waypoints(stage, lengths | back)
    method = fan.TimeStepping(dt=1e-3)
    run = fan.simulate(stage, x0.replace(v_D=v_D), inputs, t_end=2.0, method=method, save_every=4)
    run.save(OUT / "stage.npz")
    strip(stage, run, OUT / "stage.png", n=6, times="even", focus="bodies")
    whole = run.contact.force_on("crate", len(run))[-1]
    from_floor = run.contact.involving("crate", "floor").at_sample(len(run) - 1).force.sum(axis=0)
    touches = [event for event in run.events if event.kind == "touch"]
    print(f"{len(touches)} touches; the deepest overlap was {-run.contact.gap.min():.1e} m")
    print(f"at the end the puppet presses on the crate with {(from_floor - whole)[2]:.2f} N")
    lost = {name: run.ledger[name][-1] for name in ("friction", "impact")}
    print(f"friction took {lost['friction']:.3f} J, impacts {lost['impact']:.3f} J")


if __name__ == "__main__":
    main()
