"""Where can the marionette's hand go with its own string alone, and what stops it?"""

import numpy as np

import fantoccini as fan

puppet = fan.puppets.marionette()
start = puppet.rest()
hand = ("forearm_right", (0.0, 0.0, -0.09))
pose = puppet.pose(start, "forearm_right")
place = pose[:3, 3] + pose[:3, :3] @ hand[1]

held = tuple(name for name in puppet.coordinates.v_K if not name.startswith("hand_right"))
above = place + np.linspace(0.0, 0.6, 61)[:, None] * [0.0, 0.0, 1.0]
found = fan.reach(puppet, {hand: above}, start, bounds=fan.Bounds(held=held))

print(found)
highest = above[found.reached][-1, 2] - place[2]
print(f"straight up it rises by {100 * highest:.0f} cm")
print(found[-1].summary())
