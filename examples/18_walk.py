"""Walk puppets on a floor with little slide of their feet: a gait made for the puppet at hand.

`Gait` makes steps from a few numbers for puppets with pairs of legs. `find_gait` finds numbers with
which the feet slide less, by simulated steps; here only a few of them. Writes out/walk.png.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.control import DrawOptions
from fantoccini.output import view
from fantoccini.theatre import Gait, find_gait, footfalls
from fantoccini.theatre.gestures import BodyParts

STEPS = 8
out = Path("out")
out.mkdir(exist_ok=True)
stage = fan.puppets.promenade()
x0, body_parts = stage.rest(), BodyParts.for_puppet(stage, "pierrot")


def walk(gait: Gait) -> fan.Trajectory:
    """Run of a gait's steps, with its slide printed."""
    inputs = gait.inputs(stage, STEPS, x0)
    run = fan.simulate(stage, x0, inputs, method=fan.TimeStepping(dt=2e-3), save_every=2)
    feet = footfalls(body_parts, run, gait, STEPS)
    print(f"{feet.status.name}: {feet.message}; {1e3 * feet.slide.mean():.2f} mm on average")
    return run


first = Gait()
walk(first)
tuned = find_gait(stage, first, rounds=2, draws=DrawOptions(runs=16, generations=3))
print(tuned)
run = walk(tuned.gait)
times = [first.step_time * k for k in (0.0, 2.5, 3.0, 3.5, 4.0, 8.5)]
view.strip(stage, run, out / "walk.png", times=times)
