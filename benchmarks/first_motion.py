"""Prints the time from a puppet's file to its first motion, each in a new process.

    python -m benchmarks.first_motion [FOLDER]

Rows: the first puppet on a machine (an empty cache), the same from the cache, one with contact, and
changed files: another colour and pose, another radius that sets an inertia. With FOLDER, the
package in FOLDER is measured (another version's ``src``).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from fantoccini.model.puppet import bundled

MOTION = """
import os, sys, time
start = time.perf_counter()
import fantoccini as fan
puppet = fan.load(sys.argv[1])
fan.simulate(puppet, puppet.rest({}), t_end=0.1)
times = os.times()
print(time.perf_counter() - start, times.user + times.system,
      times.children_user + times.children_system)
"""
CHANGES = {
    "the marionette, first on the machine": (),
    "the same again": (),
    "another colour and pose": (("#c4563f", "#d4563f"), ("torso.z: 0.345", "torso.z: 0.346")),
    "another radius and inertia": (("0.0115, density: 450", "0.012, density: 450"),),
}


def main() -> None:
    """Measures and prints."""
    source = bundled("marionette")
    folder = Path(sys.argv[1] if sys.argv[1:] else source.parents[3]).resolve()
    text = source.read_text(encoding="utf-8")
    print(f"{'':40} {'wall':>7} {'python':>7} {'compilers':>10}  [s, s and s of processor]")
    with tempfile.TemporaryDirectory() as scratch:
        for label, changes in CHANGES.items():
            file = Path(scratch) / "puppet.yaml"
            changed = text
            for old, new in changes:
                if old not in changed:
                    raise ValueError(f"marionette.yaml has no {old!r}")
                changed = changed.replace(old, new)
            file.write_text(changed, encoding="utf-8")
            report(label, file, folder, Path(scratch) / "cache")
        stage = source.parent / "scenes" / "promenade.yaml"
        report("promenade, which has contact", stage, folder, Path(scratch) / "cache")
        report("the same again", stage, folder, Path(scratch) / "cache")


def report(label: str, file: Path, package_folder: Path, cache: Path) -> None:
    """Prints the times of one file."""
    environment = os.environ | {"FANTOCCINI_CACHE": str(cache), "PYTHONPATH": str(package_folder)}
    command = [sys.executable, "-c", MOTION, str(file)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    wall, own, compilers = map(float, done.stdout.split())
    print(f"{label:40} {wall:7.2f} {own:7.2f} {compilers:10.2f}", flush=True)


if __name__ == "__main__":
    main()
