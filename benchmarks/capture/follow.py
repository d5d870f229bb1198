"""Prints a puppet's errors in following clips, crossings of its strings, and the computing time.

    python -m benchmarks.capture.follow [CLIP.bvh ...] [--puppet hans] [--convention lafan1]

Without files, the clips are the project's own (benchmarks/capture/clips.py). The puppet is the
bundled marionette, another bundled one, or a file. Errors are root mean squares, in per cent of the
puppet's height: of the hanging poses nearest to the clip ("reach"), and the excess of the
event-driven run's errors over them.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.capture.clips import write

import fantoccini as fan
from fantoccini.theatre.retarget import follow_clip, retarget_clip

ABOVE, SECONDS, FRAMES = 2.0, 0.5, 2000.0
"""Largest wanted error above reach [per cent], time for a second of clip [s], poses a second."""


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--puppet", default="marionette")
    parser.add_argument("--convention", default="lafan1")
    arguments = parser.parse_args()
    name = arguments.puppet
    puppet = fan.load(name) if Path(name).exists() else getattr(fan.puppets, name)()
    with tempfile.TemporaryDirectory() as folder:
        files = arguments.files or write(Path(folder), arguments.convention)
        print(
            f"{'clip':14} {'length':>6} {'poses/s':>8} {'time':>6}   hands       head        "
            "feet        trunk      speed acceleration crossings"
        )
        for path in files:
            clip = fan.theatre.load_bvh(path)
            retarget_clip(puppet, clip)
            begun = time.thread_time()
            retargeted = retarget_clip(puppet, clip)
            rate = len(retargeted.t) / (time.thread_time() - begun)
            begun = time.perf_counter()
            followed = follow_clip(puppet, clip)
            taken = time.perf_counter() - begun
            height = retargeted.figure.height
            errors = "  ".join(
                f"{100 * part.pose_error / height:4.1f} + {100 * part.excess:3.1f}"
                for part in followed.report
            )
            print(
                f"{path.stem:14} {clip.duration:5.1f}s {rate:8.0f} {taken:5.1f}s  {errors}  "
                f"{np.abs(followed.run.v_K).max():5.2f} {np.abs(followed.acc_K).max():5.1f} "
                f"{len(followed.crossings):9} "
                f"{followed.status.name if not followed else ''}",
                flush=True,
            )


if __name__ == "__main__":
    main()
