"""Prints what ``fan.identify`` finds in synthetic records, beside the truth.

    python -m benchmarks.identify.synthetic [--puppet arm|marionette] [--seeds 3] [--duration 30]

Records are event-driven runs (rtol 1e-9) of the puppet with other numbers, sampled at 60 Hz: markers
with 2 mm of noise, each hidden for a tenth of the time. Wanted: lengths to 1 mm, masses to 2 %,
damping to 10 %, delays to 1 ms, in 10 s.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import fantoccini as fan
from benchmarks.identify.cases import arm, marionette, record


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--puppet", choices=("arm", "marionette"), default="arm")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=30.0)
    given = parser.parse_args()
    case = {"arm": arm, "marionette": marionette}[given.puppet]()
    truth, scores = dict(case.truth), []
    for seed in range(given.seeds):
        one = record(case, given.duration, seed, gaps=0.1)
        if seed == 0:
            fan.identify(record(case, 1.0, 0))  # compiles what is missing
        began, worked = time.perf_counter(), time.process_time()
        found = fan.identify(one)
        wall, cpu = time.perf_counter() - began, time.process_time() - worked
        print(f"seed {seed}: {wall:.1f} s, {cpu:.1f} s of processors, chi2 {found.chi2:.3f}, "
              f"drift {found.drift:.2g}, {len(found.outliers)} outliers")  # fmt: skip
        print(f"  {'':24s} {'value':>12s} {'truth':>12s} {'error':>10s} {'deviation':>10s} {'z':>6s}")
        for name, value, deviation in zip(found.names, found.values, found.deviations, strict=True):
            error = value - truth[name]
            scores.append(error / deviation)
            print(f"  {name:24s} {value:12.6g} {truth[name]:12.6g} {_shown(error, truth[name]):>10s} "
                  f"{_shown(deviation, truth[name]):>10s} {error / deviation:6.2f}")  # fmt: skip
    z = np.abs(scores)
    print(f"within 95 % intervals: {100 * np.mean(z < 1.96):.0f} % of {len(z)}")


def _shown(error: float, truth: float) -> str:
    """Relative where the number is none of a place or a time."""
    small = abs(truth) < 0.5 and abs(error) < 0.05 and abs(truth) in (0.0, 0.003, 0.004, 0.006, 0.013)
    return f"{1e3 * error:.3f} m-" if small else f"{100 * error / truth:.3f} %"


if __name__ == "__main__":
    main()
