"""``python -m benchmarks.contact``: measures everything and writes docs/contact-measured.md."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from ..speed.figures import Chapter, goals_table
from ..speed.programs import compile_program, lane_source
from ..strings import ROOT
from . import alone, batches, methods, problems, scenarios, steps
from .page import page


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/contact-measured.md.")
    parser.add_argument("--quick", action="store_true", help="two turns and no page")
    parser.add_argument("--turns", type=int, default=15, help="turns per comparison (default 15)")
    parser.add_argument("--problems", type=Path, help="folder of problems as Siconos writes them")
    parser.add_argument("--siconos", help="interpreter that has Siconos")
    options = parser.parse_args()
    quick = options.quick
    turns = 2 if quick else max(1, options.turns)
    began = time.perf_counter()

    def reported(name: str, chapters: list[Chapter]) -> list[Chapter]:
        print(f"{name}: after {time.perf_counter() - began:.0f} s", flush=True)
        return chapters

    pairs = steps.compiled_pairs(turns, 500)
    chapters = reported("steps", steps.chapters(pairs, turns, 500 if quick else 2000))
    n_batch_turns = max(2, turns // 3)
    chapters += reported("batches", [batches.chapter(pairs, n_batch_turns, 64 if quick else 512)])
    with (
        tempfile.TemporaryDirectory() as scalar_folder,
        tempfile.TemporaryDirectory() as lanes_folder,
    ):
        scalar = compile_program("scalar", Path(scalar_folder))
        lanes = compile_program("lanes", Path(lanes_folder), lane_source())
        chapters += reported("alone", [alone.chapter(scalar, lanes, turns)])
    chapters += reported("scenarios", [scenarios.chapter()])
    chapters += reported("methods", [methods.chapter()])
    chapters += reported("problems", [problems.chapter(options.problems, options.siconos)])
    text = page(chapters)
    if quick:
        print(text)
    else:
        (ROOT / "docs" / "contact-measured.md").write_text(text, encoding="utf-8")
        print(goals_table(chapters).markdown())


if __name__ == "__main__":
    main()
