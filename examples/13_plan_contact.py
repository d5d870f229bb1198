"""Plans with contact: a hand onto a table, past a post, and a crate pushed by 10 cm.

All other contacts are excluded. Writes out/touch.png and out/push.png. See docs/planning.md.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output.view import strip

OUT = Path("out")


def arm(height: float, link: tuple[float, float], wrist: float, sleeve: float) -> dict:
    """An arm of two links on two driven strings.

    Args:
        height: height of the shoulder [m].
        link: x and z of each link's end, from its joint [m].
        wrist, sleeve: lengths of the strings [m].
    """
    x, z = link
    joint = {"type": "revolute", "axis": [0, 1, 0], "damping": 0.02}
    shapes = [{"type": "capsule", "from": [0, 0, 0], "to": [x, 0, z], "radius": 0.015, "mass": 0.1}]
    ends = {"wrist": ("hand", 0.3), "sleeve": ("upper", 0.2)}
    strings = [
        {
            "name": name,
            "length": "driven",
            "path": [
                {"body": body, "at": [0.8 * x, 0, 0.8 * z]},
                {"driven": ["x"], "at": [above, 0, 1.2]},
            ],
        }
        for name, (body, above) in ends.items()
    ]
    shoulder, elbow = {"name": "shoulder", "at": [0, 0, height]}, {"name": "elbow", "at": [x, 0, z]}
    return {
        "puppet": "arm",
        "bodies": [
            {"name": "upper", "joint": joint | shoulder, "shapes": shapes},
            {"name": "hand", "parent": "upper", "joint": joint | elbow, "shapes": shapes},
        ],
        "strings": strings,
        "pose": {"wrist.length": wrist, "sleeve.length": sleeve},
    }


def touch() -> None:
    """Plans a motion of the arm, held out over a table, that lays the hand on it."""
    table = {"name": "table", "type": "box", "size": [0.2, 0.3, 0.02], "at": [0.4, 0, 0.4]}
    post = {"name": "post", "type": "box", "size": [0.04, 0.3, 0.1], "at": [0.45, 0, 0.46]}
    held = arm(0.6, (0.2, 0.0), 0.6, 0.6) | {"contact": True, "obstacles": [table]}
    puppet = fan.loads(str(held))
    x0 = puppet.rest({"wrist.length": 0.55})
    goal = fan.control.Goal.touch(puppet, [("hand", "table")])
    plan = fan.plan(puppet, x0, goal, [post], bounds=fan.control.Bounds(clearance=0.005), seed=0)
    print(plan)
    for met in plan.verify().touches:
        print(met)
    plan.plot(OUT / "touch.png")


def push() -> None:
    """Plans a push of a crate along the floor."""
    hung = arm(0.55, (0.0, -0.25), 1.2, 0.95)
    crate = {"type": "box", "size": [0.08, 0.12, 0.16], "mass": 0.05}
    scene = fan.Scene.model_validate(
        {
            "scene": "yard",
            "floor": 0,
            "contact": {"friction": 0.4},
            "puppets": [{"name": "pierrot", "puppet": fan.loads(str(hung)).puppet}],
            "props": [{"name": "crate", "shapes": [crate], "at": [0.15, 0, 0.08]}],
        }
    )
    stage = fan.Marionette(scene)
    x0 = stage.rest({"wrist.length": 1.12, "sleeve.length": 0.87})
    goal = fan.control.Goal.displaced(stage, "crate", [0.1, 0, 0], x0)
    plan = fan.plan(stage, x0, goal, contact={"touch": [("hand", "crate")]}, tolerance=0.05, seed=0)
    print(plan)
    for met in plan.verify().touches:
        print(met)
    strip(stage, plan.trajectory, OUT / "push.png", forces=True)


def main() -> None:
    """Makes both plans."""
    OUT.mkdir(exist_ok=True)
    touch()
    push()


if __name__ == "__main__":
    main()
