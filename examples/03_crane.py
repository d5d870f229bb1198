"""Move and hoist a load with a crane: how much does it sway, and what does the cable carry?

Compares a brisk and a gentle move over the same distance.
Writes out/crane.png.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.output import view

out = Path("out")
out.mkdir(exist_ok=True)

crane = fan.puppets.crane()
x0 = crane.rest({"trolley": -1.5})
hook = crane.forward_dynamics(x0)[1][0]
print(f"{crane}; the cable carries {hook:.1f} N at rest, the load weighs {crane.weight:.1f} N")


def sway(run: fan.Trajectory, after: float) -> float:
    """Largest distance of the load from below the trolley after a time [m]."""
    columns = run.columns()
    late = run.t >= after
    return float(np.max(np.abs(columns["load.x"] - columns["trolley"])[late]))


for seconds in (2.5, 6.0):
    move = fan.Input.waypoints(
        crane, {"trolley": [(0, -1.5), (seconds, 1.5)], "hoist.length": [(0, 2.51), (seconds, 2.0)]}
    )
    run = fan.simulate(crane, x0, move, t_end=seconds + 6.0)
    print(
        f"3 m in {seconds:.1f} s: cable up to {run.tension['hoist'].max():7.1f} N, "
        f"drive up to {np.abs(run.effort['trolley']).max():6.1f} N, "
        f"sway afterwards {100 * sway(run, seconds):.1f} cm"
    )

view.strip(crane, run, out / "crane.png", n=5, times="even", view="front", scale=1.0)
print("wrote", out / "crane.png")
