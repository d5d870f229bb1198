"""``python -m benchmarks.growth``: measures puppets of all sizes and writes docs/growth.md."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from benchmarks.growth import report
from benchmarks.growth.measure import Size

ROOT = Path(__file__).resolve().parents[2]

DOF = (5, 10, 25, 50, 100, 200)
STRINGS = (1, 3, 10, 30, 100)
BODY = 25
"""Degrees of freedom of the puppet with increasing numbers of strings."""

SIZES = [
    *(("bushy", BODY, n) for n in STRINGS if n != 3),
    *((kind, dof, 3) for dof in DOF for kind in ("bushy", "chain")),
]


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/growth.md and its picture.")
    parser.add_argument("--kept", type=Path, help="file of measurements to continue from")
    file = parser.parse_args().kept
    sizes = [Size(**row) for row in json.loads(file.read_text())] if file and file.exists() else []
    for kind, dof, strings in SIZES:
        if any((s.kind, s.dof, s.strings) == (kind, dof, strings) for s in sizes):
            continue
        command = [sys.executable, "-m", "benchmarks.growth.measure", kind, str(dof), str(strings)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        sizes.append(Size(**json.loads(done.stdout)))
        print(sizes[-1], flush=True)
        if file:
            file.write_text(json.dumps([vars(size) for size in sizes], indent=1))
    report.write(ROOT, sizes, BODY, missing_sizes_text(sizes))


def missing_sizes_text(sizes: list[Size]) -> list[str]:
    """The sizes that were not measured, in words."""
    there = {(s.kind, s.dof, s.strings) for s in sizes}
    return [f"{k}, {n} DOF, {m} strings" for k, n, m in SIZES if (k, n, m) not in there]


if __name__ == "__main__":
    main()
