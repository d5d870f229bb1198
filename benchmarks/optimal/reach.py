"""Prints the rate at which ``fan.reach`` finds hanging poses of the marionette, on one core.

    python -m benchmarks.optimal.reach [--places 500]

The right hand reaches for points along a circle and for random points in boxes centred on its
hanging position, with all strings free and with the shoulders' strings held.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import fantoccini as fan

PER_SECOND = 2000.0
"""Target rate [poses/s]."""
HAND = ("forearm_right", (0.0, 0.0, -0.09))
HELD = fan.control.Bounds(held=("shoulder_left.length", "shoulder_right.length"))
TURNS = 5


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--places", type=int, default=500)
    n = parser.parse_args().places
    puppet, random = fan.puppets.marionette(), np.random.default_rng(0)
    hanging = puppet.rest()
    pose = puppet.pose(hanging, HAND[0])
    home = pose[:3, 3] + pose[:3, :3] @ HAND[1]
    angle = np.linspace(0.0, 2.0 * np.pi, n)
    ring = 0.05 * np.stack([0.0 * angle, np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    ways = [("a circle of 10 cm", ring, None)]
    for half in (0.05, 0.1, 0.25):
        box = random.uniform(-half, half, (n, 3))
        ways.append((f"a box of {200 * half:g} cm", box, None))
        if half < 0.1:
            ways.append((f"a box of {200 * half:g} cm, the body's strings held", box, HELD))
    for name, offsets, bounds in ways:
        targets = {HAND: home + offsets}
        taken = []
        for _ in range(TURNS):
            begun = time.thread_time()
            poses = fan.reach(puppet, targets, hanging, bounds=bounds)
            taken.append(time.thread_time() - begun)
        reached = sum(bool(pose) for pose in poses)
        print(
            f"{name:40} {n / min(taken):7.0f} poses a second (at least {PER_SECOND:g}), "
            f"{reached} of {n} reached, {np.median(poses.iterations):g} iterations (median)"
        )


if __name__ == "__main__":
    main()
