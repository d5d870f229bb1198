"""A box on eight winches whose lengths are its exact inverse kinematics: what runs say about
tensions that the motion does not determine.

    python -m benchmarks.trials.cables
"""

from __future__ import annotations

import numpy as np
from tests.runs.cable_robot import NAMES, moved, robot

import fantoccini as fan

CAP = 60.0


def tensions(run: fan.Trajectory, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tensions (8, T) [N], and whether the run calls them undetermined."""
    k = np.clip(np.searchsorted(run.t, t), 0, len(run.t) - 1)
    undetermined = run.undetermined
    marked = (
        np.stack([undetermined[name][k] if undetermined else np.zeros(len(k)) for name in NAMES])
        > 0
    )
    return np.stack([run.tension[name][k] for name in NAMES]), marked


def main() -> None:
    """Prints a line for each number of winches that yield."""
    t = np.linspace(0.05, 1.15, 111)
    for yielding in (2, 4, 8):
        puppet = robot({i: f", max_tension: {CAP}" for i in range(0, 8, 8 // yielding)})
        x0, inputs = moved(puppet)
        runs = [
            fan.simulate(puppet, x0, inputs, 1.2, method=method, throw=False)
            for method in ("event", "timestepping")
        ]
        (event, undetermined), (steps, _) = (tensions(run, t) for run in runs)
        differ = np.abs(event - steps) > 1.0
        print(
            f"{yielding} yield: {', '.join(run.status.name for run in runs)}, box at "
            f"{', '.join(f'{run.q_D[-1][0]:.4f}' for run in runs)} m; the methods differ by more "
            f"than 1 N in {np.sum(differ)} of {differ.size} tensions, "
            f"{np.sum(differ & ~undetermined)} of them not called undetermined"
        )


if __name__ == "__main__":
    main()
