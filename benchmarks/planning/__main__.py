"""``python -m benchmarks.planning``: measures plans and writes docs/planning-measured.md."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ..strings import ROOT
from ..strings.report import Section, machine, wrap_paragraph
from . import absorbed, own, peers
from .marks import Mark, marks_table

OPENING = (
    "After this page you know the search times of plans, their quality, and whether they hold in "
    "other simulations. `make bench-plan` measures everything in one run and writes this page. "
    "Seeds are numbered from 0, and none is left out."
)


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/planning-measured.md.")
    parser.add_argument("--quick", action="store_true", help="few seeds and no page")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "planning-measured.md")
    options = parser.parse_args()
    n_first, n_better, n_marionette = (20, 4, 2) if options.quick else (1000, 100, 10)
    measures = {
        "first plans": lambda: own.first_plans(n_first),
        "boxes": lambda: own.count_plans_through_boxes(n_first),
        "better plans": lambda: own.better_plans(n_better),
        "marionette": lambda: own.full_marionette(n_marionette),
        "feedback": lambda: absorbed.chapter(4 if options.quick else 40),
        "OMPL": lambda: (peers.section(1 if options.quick else 3, 10.0), []),
    }
    sections: list[Section] = []
    marks: list[Mark] = []
    began = time.perf_counter()
    for name, measure in measures.items():
        section, new_marks = measure()
        sections.append(section)
        marks += new_marks
        print(f"{name}: after {time.perf_counter() - began:.0f} s", flush=True)
    parts = [
        "# Planning, measured",
        wrap_paragraph(OPENING),
        marks_table(marks).markdown(),
        machine(("numpy", "scipy")).markdown(),
        *(s.markdown() for s in sections),
    ]
    text = "\n\n".join(parts) + "\n"
    if options.quick:
        print(text)
    else:
        options.out.write_text(text, encoding="utf-8")
        print(marks_table(marks).markdown())


if __name__ == "__main__":
    main()
