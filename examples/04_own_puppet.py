"""Load your own puppet: bird.yaml, next to this file, flaps its wings and moves forward.

Writes out/bird.png and out/bird.npz.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.output import view

out = Path("out")
out.mkdir(exist_ok=True)

# A mistake in the file, such as this misspelled parent, is reported with its line.
file = Path(__file__).parent / "bird.yaml"
misspelled = out / "wrong_bird.yaml"
misspelled.write_text(file.read_text().replace("parent: body", "parent: bodi"))
try:
    fan.load(misspelled)
except fan.errors.PuppetError as error:
    print(error)
misspelled.unlink()

bird = fan.load(file)  # derived and compiled once, then read from a cache
print(bird)
print("driven:", ", ".join(bird.coordinates.q_K))
x0 = bird.rest()
tensions = bird.forward_dynamics(x0)[1]
for string, tension in zip(bird.tree.strings, tensions, strict=False):
    print(f"{string.name} carries {tension:.3f} N of {bird.weight:.3f} N")

beats = [(0.6 * k, 0.57 if k % 2 == 0 else 0.49) for k in range(9)]
flapping = fan.Input.waypoints(
    bird, {"tip_left.length": beats, "tip_right.length": beats, "back.x": [(0, 0.0), (4.8, 0.1)]}
)
run = fan.simulate(bird, x0, flapping, t_end=6.0)
flap = run.columns()["flap_left"]
print(f"the left wing went from {np.degrees(flap.min()):.0f} to {np.degrees(flap.max()):.0f} deg")

run.save(out / "bird.npz")
view.strip(bird, run, out / "bird.png", n=6, scale=1.0)
print("wrote", out / "bird.png")
