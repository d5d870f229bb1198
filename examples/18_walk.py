"""Walk the marionette with little slip of its feet, and tune the parameters of its gait.

`Gait` makes steps from parameters. From a gait that slips, `fan.tune` draws others around it,
simulates them in a batch and moves to the best; more generations would improve it further.
Writes out/walk.png.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.control import Draws
from fantoccini.output import view
from fantoccini.theatre.gestures import Gait

STEPS, HEEL = 10, (-0.02, 0.0, -0.141)
out = Path("out")
out.mkdir(exist_ok=True)
stage = fan.puppets.promenade()
x0, method = stage.rest(), fan.TimeStepping(dt=1e-3)


def slip(run: fan.Trajectory) -> float:
    """Distance that the heels slide along the floor, per step [m]."""
    poses, way = stage.poses(run.q_D, run.q_K), 0.0
    for side in ("left", "right"):
        shin = poses[:, stage.link_index(f"shin_{side}")]
        heel = shin[:, :, 3] + shin[:, :, :3] @ HEEL
        low = heel[:, 2] < 1e-4
        moved = np.linalg.norm(np.diff(heel[:, :2], axis=0), axis=1)
        way += float(np.sum(moved[low[1:] & low[:-1]]))
    return way / STEPS


def walk(gait: Gait) -> fan.Trajectory:
    return fan.simulate(stage, x0, gait.inputs(stage, STEPS, x0), method=method, save_every=5)


shipped = Gait()
stiff = replace(shipped, sway=0.0, apart=0.0, lower=2e-3)
print(f"shipped: {1e3 * slip(walk(shipped)):.2f} mm a step")
print(f"without sway, knees not apart: {1e3 * slip(walk(stiff)):.2f} mm a step")

tuned = fan.tune(
    stage,
    lambda v: replace(stiff, **v).inputs(stage, STEPS, x0),
    {"sway": (0.0, 0.004), "apart": (0.0, 0.008), "lower": (0.002, 0.001)},
    slip,
    x0,
    method=method,
    save_every=5,
    draws=Draws(runs=16, generations=4),
)
print(f"after {len(tuned.curve)} generations: {1e3 * tuned.cost:.2f} mm a step")
print(", ".join(f"{name} {value:.4f}" for name, value in tuned.values.items()))
times = [shipped.duration * k for k in (1.0, 1.25, 1.5, 2.0, 6.0, 11.0)]
view.strip(stage, walk(shipped), out / "walk.png", times=times)
