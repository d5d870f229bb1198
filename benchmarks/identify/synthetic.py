"""Compares the estimates of ``fan.identify`` with the true values, on synthetic records.

    python -m benchmarks.identify.synthetic [--puppet marionette] [--seeds 3] [--duration 30]
        [--drift 2e-4]

Records are event-driven runs (rtol 1e-9) of the puppet with other parameters, sampled at 60 Hz:
markers with 2 mm of noise, each hidden for a tenth of the time. Wanted: lengths to 1 mm,
masses to 2 %, damping to 10 %, delays to 1 ms, in 10 s.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from benchmarks.identify.cases import arm, marionette, record

import fantoccini as fan


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--puppet", choices=("arm", "marionette"), default="arm")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=30.0)
    parser.add_argument(
        "--drift", type=float, default=5e-4, help="of configurations; velocities: ten times"
    )
    arguments = parser.parse_args()
    case = {"arm": arm, "marionette": marionette}[arguments.puppet]()
    truth, scores, converged, times = dict(case.truth), [], 0, []
    for seed in range(arguments.seeds):
        synthetic = record(case, arguments.duration, seed, gaps=0.1)
        if seed == 0:
            fan.identify(record(case, 1.0, 0))  # compiles the libraries, outside the timing
        began, worked = time.perf_counter(), time.process_time()
        identified = fan.identify(synthetic, drift=(arguments.drift, 10.0 * arguments.drift))
        wall, cpu = time.perf_counter() - began, time.process_time() - worked
        converged += identified.converged
        times.append(cpu)
        print(
            f"seed {seed}: {wall:.1f} s, {cpu:.1f} s of processors, chi2 {identified.chi2:.3f}, "
            f"drift {identified.drift:.2g}, {len(identified.outliers)} outliers"
        )
        print(_row("", "value", "truth", "error", "deviation", "z"))
        for name, value, deviation in zip(
            identified.names, identified.values, identified.deviations, strict=True
        ):
            true, z = truth[name], (value - truth[name]) / deviation
            scores.append(z)
            print(
                _row(
                    name,
                    f"{value:.6g}",
                    f"{true:.6g}",
                    _error_text(name, value - true, true),
                    _error_text(name, deviation, true),
                    f"{z:.2f}",
                )
            )
    z = np.abs(scores)
    print(f"within 95 % intervals: {100 * np.mean(z < 1.96):.0f} % of {len(z)}")
    print(f"converged: {converged} of {arguments.seeds}, {np.mean(times):.1f} s of processors each")


def _row(*cells: str) -> str:
    return f"  {cells[0]:26s}" + "".join(f"{cell:>12s}" for cell in cells[1:])


def _error_text(name: str, error: float, truth: float) -> str:
    """The error in mm or ms for positions and the delay, otherwise relative."""
    if name == "delay":
        return f"{1e3 * error:.3f} ms"
    if name.endswith("offset") or ".at." in name or "tie" in name:
        return f"{1e3 * error:.3f} mm"
    return f"{100 * error / abs(truth):.2f} %"


if __name__ == "__main__":
    main()
