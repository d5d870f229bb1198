"""The paper's Section VII: an arm on one string is planned past two boxes.

The dots are the hand at every state of the search tree, as in the paper's Fig. 4; the line is the
way that was found, and the arm is drawn along it. Writes out/plan.png and out/plan.npz.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

arm = fan.puppets.arm3d()
hanging = arm.rest(
    {"shoulder.rotation": [0, 0, 0], "elbow": 0.05, "hand.x": 0.3, "hand.length": 1.34}
)
goal = {"shoulder.rotation": [0, -np.radians(80), 0], "elbow": np.radians(80)}
boxes = [
    {"name": "low", "type": "box", "size": [0.12, 0.3, 0.1], "at": [0.24, 0.0, -0.42]},
    {"name": "high", "type": "box", "size": [0.1, 0.16, 0.2], "at": [0.32, -0.12, -0.1]},
]

plan = fan.plan(arm, hanging, goal, boxes, tolerance=0.25, margin=0.01, seed=3)
print(plan)
again = plan.verify(method="event")
print(f"simulated anew with located events: {again.distance:.3f} from the goal, "
      f"{1e3 * again.clearance:.1f} mm from the boxes")  # fmt: skip
plan.trajectory.save(out / "plan.npz")


def drawn(q_D: np.ndarray, q_K: np.ndarray) -> np.ndarray:
    """Shoulder, elbow, hand and the string's upper end at each state (n, 4, 3)."""
    hand = arm.string_points(q_D, q_K)[0]
    joints = [arm.poses(q_D, q_K)[:, arm.link(body), :, 3] for body in ("upper", "lower")]
    return np.stack([*joints, hand[:, 0], hand[:, 1]], axis=1)


figure, axes = plt.subplots(1, 2, figsize=(9, 6), sharey=True)
nodes = drawn(plan.tree.q_D, plan.tree.q_K)[:, 2]
way = drawn(plan.trajectory.q_D, plan.trajectory.q_K)
poses = way[np.linspace(0, len(way) - 1, 7).astype(int)]
for panel, (across, name) in zip(axes, ((0, "x [m]"), (1, "y [m]")), strict=True):
    panel.plot(nodes[:, across], nodes[:, 2], "k.", markersize=2, alpha=0.3)
    for k, pose in enumerate(poses):
        shade = 0.25 + 0.75 * k / (len(poses) - 1)
        panel.plot(pose[:3, across], pose[:3, 2], "-o", color="#b5713a", alpha=shade, lw=4)
        panel.plot(pose[2:, across], pose[2:, 2], "-", color="0.4", alpha=shade, lw=0.8)
    panel.plot(way[:, 2, across], way[:, 2, 2], color="#2b6cb0", lw=2)
    for box in boxes:
        low = np.array(box["at"]) - np.array(box["size"]) / 2
        size = box["size"][across], box["size"][2]
        panel.add_patch(plt.Rectangle((low[across], low[2]), *size, color="#8c8c8c", alpha=0.7))
    panel.set(xlabel=name, xlim=(-0.5, 0.75), ylim=(-0.7, 0.75), aspect="equal")
axes[0].set_ylabel("z [m]")
figure.savefig(out / "plan.png", dpi=120, bbox_inches="tight")
