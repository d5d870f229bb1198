"""``python -m benchmarks.speed``: measures everything and writes docs/benchmarks.md."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from ..strings import ROOT
from . import accuracy, batches, bounds, peers, pipeline, real_time, steps
from .figures import Chapter, goals_table
from .page import page
from .programs import compile_program, lane_source


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/benchmarks.md.")
    parser.add_argument("--quick", action="store_true", help="two turns and no page")
    parser.add_argument("--turns", type=int, default=15, help="turns per comparison (default 15)")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "benchmarks.md")
    parser.add_argument(
        "--older-mujoco", type=Path, default=peers.OLDER, help="interpreter that has MuJoCo 3.17"
    )
    options = parser.parse_args()
    quick = options.quick
    turns = 2 if quick else max(1, options.turns)
    n_long_turns = max(2, turns // 3)
    began, everyone = time.perf_counter(), peers.start_peers(options.older_mujoco)
    measures = {
        "steps": lambda: steps.chapters(everyone, scalar, turns, 500 if quick else 5000),
        "batches": lambda: [batches.chapter(everyone, turns, 64 if quick else 1024)],
        "error and cost": lambda: [
            accuracy.chapter(everyone, min(n_long_turns, 3), 0.5 if quick else 10.0)
        ],
        "real time": lambda: [real_time.chapter(turns)],
        "pipeline": lambda: [pipeline.chapter(2 if quick else 7)],
        "bounds": lambda: [bounds.chapter(scalar, lanes, turns)],
    }
    chapters: list[Chapter] = [peers.chapter(everyone)]
    try:
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as other:
            scalar = compile_program("scalar", Path(folder))
            lanes = compile_program("lanes", Path(other), lane_source())
            for name, measure in measures.items():
                chapters += measure()
                print(f"{name}: after {time.perf_counter() - began:.0f} s", flush=True)
    finally:
        everyone.stop()
    text = page(chapters, everyone, scalar.flags)
    if quick:
        print(text)
    else:
        options.out.write_text(text, encoding="utf-8")
        print(goals_table(chapters).markdown())


if __name__ == "__main__":
    main()
