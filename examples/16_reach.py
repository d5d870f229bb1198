"""Find the places that the marionette's hand reaches with its own string, and its limits.

Writes out/reach.csv: the distance of the hand from places at increasing heights above it, and the
tension of its string there.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

puppet = fan.puppets.marionette()
start = puppet.rest()
hand = ("forearm_right", (0.0, 0.0, -0.09))
pose = puppet.pose(start, "forearm_right")
place = pose[:3, 3] + pose[:3, :3] @ hand[1]

held = tuple(name for name in puppet.coordinates.v_K if not name.startswith("hand_right"))
heights = np.linspace(0.0, 0.6, 61)
above = place + heights[:, None] * [0.0, 0.0, 1.0]
reached = fan.reach(puppet, {hand: above}, start, bounds=fan.control.Bounds(held=held))

print(reached)
print(f"straight up it rises by {100 * heights[reached.reached][-1]:.0f} cm")
print(reached[-1].summary())
string = [s.name for s in puppet.tree.strings].index("hand_right")
table = np.column_stack([heights, reached.distance, reached.tension[:, string]])
np.savetxt(out / "reach.csv", table, fmt="%.6g", delimiter=",", header="higher,distance,tension")
