"""Compares follow_clip with inverse kinematics and swing feed-forward, on ten clips.

    python -m benchmarks.capture.baseline [CLIP.bvh ...] [--convention lafan1]

The baseline is that of Yamane, Hodgins and Brown (benchmarks/capture/kinematic.py): without
feed-forward, with that of pendulums of the strings' lengths, with that of a swing identified by
steps in the simulator, and the latter with the lag of the paper's live filter, scored with the
best constant delay. "hanging" plays the hands of the nearest hanging poses as they are: it
accounts for balance, but not for motion.

Errors above those of the nearest hanging poses, root mean squares in per cent of the puppet's
height, of event-driven runs. "width" is the largest standard deviation of the smoothing with which
the bounds of speed and acceleration hold.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from benchmarks.capture.clips import write
from benchmarks.capture.kinematic import kinematic_inputs
from benchmarks.capture.swing import Swing, identify_swing
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

import fantoccini as fan
from fantoccini.base.arrays import Times
from fantoccini.base.errors import ARRIVED
from fantoccini.theatre.retarget import (
    PartError,
    RetargetedClip,
    figure_of,
    follow_clip,
    retarget_clip,
)
from fantoccini.theatre.retarget.deviations import group_errors, part_errors
from fantoccini.theatre.retarget.following import eased_times

LAG = 0.2
"""T of the paper's filter 1/(T s + 1)^3 [s]."""
DELAYS = np.arange(0.0, 1.2, 0.02)
"""Delays for which a lagging run is scored [s]."""
LABELS = ("kinematics", "+ nominal", "+ identified", "+ lag", "hanging", "follow_clip")


def measure_run(
    clip: RetargetedClip, t: Times, inputs: fan.Input, start: fan.State, late: bool = False
) -> tuple[tuple[PartError, ...], str]:
    """Errors of an event-driven run, and a remark."""
    run = fan.simulate(clip.marionette, start, inputs, effort=False, throw=False)
    delays = DELAYS if late else DELAYS[:1]
    scored = [part_errors(clip, run, t + delay) for delay in delays]
    sizes = [sum(float(np.mean(e**2)) for e in errors.values()) for errors in scored]
    best = int(np.argmin(sizes))
    remark = f"late {delays[best]:.2f} s" if late else ""
    if run.status not in ARRIVED:
        remark += f" STOPPED at {run.t[-1]:.2f} s"
    return group_errors(clip, scored[best]), remark


def hanging_hands(clip: RetargetedClip) -> fan.Input:
    """The hands of the nearest hanging poses, smoothed as the inputs of follow_clip."""
    t = eased_times(clip.t)
    times = np.arange(0.0, t[-1], 0.01)
    q_K = gaussian_filter1d(
        CubicSpline(t, clip.hanging_poses.q_K)(times), 3.5, axis=0, mode="nearest"
    )
    columns = dict(zip(clip.marionette.coordinates.q_K, q_K.T, strict=True))
    return fan.Input.samples(clip.marionette, clip.start.t + times, columns)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--convention", default="lafan1")
    arguments = parser.parse_args()
    puppet = fan.puppets.marionette()
    swing = identify_swing(puppet, figure_of(puppet, puppet.rest()), puppet.rest())
    print("swing at lengths of", *(f"{length:.2f}" for length in swing.lengths), "m")
    for name in swing.a:
        print(
            f"{name:14} a",
            *(f"{x:.3f}" for x in swing.a[name]),
            "s^2   b",
            *(f"{x:.3f}" for x in swing.b[name]),
            "s   gain",
            *(f"{x:.2f}" for x in swing.gain[name]),
        )
    print(f"{'clip':14} {'inputs':14}{'hands':>7}{'head':>7}{'feet':>7}{'trunk':>7}")
    tables: dict[str, list[list[float]]] = {}
    variants: dict[str, tuple[bool | Swing, float]] = {
        "kinematics": (False, 0.0),
        "+ nominal": (True, 0.0),
        "+ identified": (swing, 0.0),
        "+ lag": (swing, LAG),
    }

    def show(clip: str, label: str, report: tuple[PartError, ...], remark: str) -> None:
        above = [100.0 * part.excess for part in report]
        tables.setdefault(label, []).append(above)
        print(f"{clip:14} {label:14}" + "".join(f"{x:7.1f}" for x in above), remark, flush=True)

    with tempfile.TemporaryDirectory() as folder:
        for path in arguments.files or write(Path(folder), arguments.convention):
            clip = retarget_clip(puppet, fan.theatre.load_bvh(path))
            for label, (feed_forward, lag) in variants.items():
                motion = kinematic_inputs(clip, feed_forward, lag=lag)
                report, remark = measure_run(clip, motion.t, motion.inputs, motion.start, lag > 0.0)
                width = max(motion.widths.values())
                show(path.stem, label, report, f"width {width:.3f} s {remark}")
            inputs = hanging_hands(clip)
            q_K, _, _ = inputs.evaluate(clip.start.t)
            start = puppet.rest(clip.start.replace(q_K=q_K))
            show(path.stem, "hanging", *measure_run(clip, eased_times(clip.t), inputs, start))
            followed = follow_clip(puppet, clip)
            show(path.stem, "follow_clip", followed.report, "" if followed else "STOPPED")
    for label in LABELS:
        mean = np.mean(tables[label], axis=0)
        print(f"{'mean':14} {label:14}" + "".join(f"{x:7.1f}" for x in mean))


if __name__ == "__main__":
    main()
