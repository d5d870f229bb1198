"""Plans over walls of several thicknesses, and through walls without a way, verified.

    python benchmarks/trials/wall.py

The distance of bob and string from the wall is computed here, in closed form, at 40,000 times.
"""

from __future__ import annotations

import numpy as np

import fantoccini as fan

RADIUS, TOP = 0.01, 0.15
BOB = f"""
puppet: bob
bodies:
- name: bob
  joint: {{type: translation, axes: [x, z]}}
  shapes: [{{type: sphere, radius: {RADIUS}, mass: 0.2}}]
strings:
- {{name: s, length: driven, path: [{{body: bob}}, {{driven: [x], at: [0, 0, 0.8]}}]}}
"""


def smallest_distance(run: fan.Trajectory, at: float, thickness: float, top: float) -> float:
    """Smallest distance of bob and string from the upright wall below ``top`` [m]."""
    t = np.linspace(run.t[0], run.t[-1], 40_001)
    now = run.resample(t)
    x, z = now.q_D.T
    hand = now.q_K[:, run.coordinates.q_K.index("s.x")]
    s = np.linspace(0.0, 1.0, 41)[:, None]
    xs, zs = x + s * (hand - x), z + s * (0.8 - z)
    off = np.hypot(np.maximum(np.abs(xs - at) - thickness / 2, 0.0), np.maximum(zs - top, 0.0))
    return float(min(np.min(off[0]) - RADIUS, np.min(off)))


def main() -> None:
    """Prints a line for each wall."""
    puppet = fan.loads(BOB)
    x0 = puppet.rest({"s.length": 0.8})
    bounds = fan.control.Bounds(
        clearance=0.004, speed=2.0, acceleration=15.0, position={"s.length": (0.2, 1.2)}
    )
    for thickness in (0.03, 0.002, 2e-4, 1e-5):
        for top in (TOP, 3.0):
            size = [thickness, 4.0, top + 1.0]
            wall = {"name": "wall", "type": "box", "size": size, "at": [0.4, 0, (top - 1.0) / 2]}
            for seed in range(2):
                plan = fan.plan(
                    puppet, x0, {"bob.x": 0.8}, [wall], bounds=bounds, tolerance=0.2, seed=seed,
                    time_limit=60.0,
                )  # fmt: skip
                text = f"{thickness:g} m, top {top:g} m, seed {seed}: {'plan' if plan else 'none'}"
                if plan:
                    event = plan.verify(method="event")
                    own = smallest_distance(event.run, 0.4, thickness, top)
                    text += f", arrives {event.arrives}, clearance {own:.5f} m in closed form"
                print(text, flush=True)


if __name__ == "__main__":
    main()
