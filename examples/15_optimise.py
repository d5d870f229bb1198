"""Motions of least cost: a crane in the least time, and a circle drawn by a marionette's hand.

The crane's load arrives at rest, within the bounds of trolley and winch. Nine of the marionette's
21 inputs move; its body stays where it is. Writes out/optimal_crane.png and
out/optimal_circle.png.
"""

from pathlib import Path

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

crane = fan.optimise(fan.control.load_task("crane"), tolerance=1e-3)
print(f"crane: {crane.t[-1]:.2f} s, {crane.status.name}, {crane.end_gap:.1e} from its end")
crane.plot(out / "optimal_crane.png")

circle = fan.optimise(fan.control.load_task("circle"), tolerance=1e-3)
off = 1e3 * circle.rms()["forearm_right"]
print(f"circle: {off:.2f} mm RMS error, {circle.iterations} iterations, KKT {circle.kkt:.1e}")
circle.plot(out / "optimal_circle.png")
