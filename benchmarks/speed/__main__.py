"""``python -m benchmarks.speed``: measures everything and writes docs/benchmarks.md."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from ..strings import ROOT
from . import accuracy, batches, peers, pipeline, real_time, steps
from .figures import Chapter, goals_table
from .page import page
from .programs import compiled


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/benchmarks.md.")
    parser.add_argument("--quick", action="store_true", help="few turns, for a look; no page")
    parser.add_argument("--turns", type=int, default=15, help="of what is compared (default 15)")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "benchmarks.md")
    parser.add_argument(
        "--older-mujoco", type=Path, default=peers.OLDER, help="interpreter that has MuJoCo 3.17"
    )
    options = parser.parse_args()
    turns = 2 if options.quick else max(1, options.turns)
    few = max(2, turns // 3)
    everyone = peers.gather(options.older_mujoco)
    chapters: list[Chapter] = [peers.chapter(everyone)]
    try:
        with tempfile.TemporaryDirectory() as folder:
            scalar = compiled("scalar", Path(folder))
            chapters += steps.chapters(everyone, scalar, turns, 500 if options.quick else 5000)
        chapters.append(batches.chapter(everyone, few, 64 if options.quick else 1024))
        chapters.append(accuracy.chapter(everyone, few, 0.5 if options.quick else 60.0))
    finally:
        everyone.stop()
    chapters.append(real_time.chapter(turns))
    chapters.append(pipeline.chapter(few if options.quick else 7))
    text = page(chapters, everyone, scalar.flags)
    if options.quick:
        print(text)
    else:
        options.out.write_text(text, encoding="utf-8")
        print(goals_table(chapters).markdown())


if __name__ == "__main__":
    main()
