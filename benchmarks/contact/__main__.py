"""``python -m benchmarks.contact``: measures everything and writes docs/contact-measured.md."""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from ..speed.figures import Chapter, goals_table
from ..speed.programs import compiled, lane_source
from ..strings import ROOT
from . import alone, batches, methods, problems, scenarios, steps
from .page import page


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/contact-measured.md.")
    parser.add_argument("--quick", action="store_true", help="two turns, for a look; no page")
    parser.add_argument("--turns", type=int, default=15, help="of what is compared (default 15)")
    parser.add_argument("--problems", type=Path, help="folder of problems as Siconos writes them")
    parser.add_argument("--siconos", help="interpreter that has Siconos")
    options = parser.parse_args()
    quick = options.quick
    turns = 2 if quick else max(1, options.turns)
    began = time.perf_counter()

    def told(name: str, chapters: list[Chapter]) -> list[Chapter]:
        print(f"{name}: after {time.perf_counter() - began:.0f} s", flush=True)
        return chapters

    made = steps.pairs(turns, 500)
    chapters = told("steps", steps.chapters(made, turns, 500 if quick else 2000))
    few = max(2, turns // 3)
    chapters += told("batches", [batches.chapter(made, few, 64 if quick else 512)])
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        scalar = compiled("scalar", Path(one))
        lanes = compiled("lanes", Path(other), lane_source())
        chapters += told("alone", [alone.chapter(scalar, lanes, turns)])
    chapters += told("scenarios", [scenarios.chapter()])
    chapters += told("methods", [methods.chapter()])
    chapters += told("problems", [problems.chapter(options.problems, options.siconos)])
    text = page(chapters)
    if quick:
        print(text)
    else:
        (ROOT / "docs" / "contact-measured.md").write_text(text, encoding="utf-8")
        print(goals_table(chapters).markdown())


if __name__ == "__main__":
    main()
