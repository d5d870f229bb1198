"""``python -m benchmarks.reduction``: Section VI on several puppets; docs/reduction.md."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from benchmarks.reduction.report import page
from benchmarks.string_model.report import chain_table
from benchmarks.strings.report import machine, wrapped

import fantoccini as fan
from fantoccini import puppets
from fantoccini.reduction import ReductionReport, plots

ROOT = Path(__file__).resolve().parents[2]
BUNDLED = ("arm2d", "arm3d", "marionette")
PICTURED = "marionette"
BOOM = Path(__file__).with_name("boom.yaml")


def measured() -> list[ReductionReport]:
    """The reports of the bundled puppets and of the boom."""
    made = []
    for puppet in [*(getattr(puppets, name)() for name in BUNDLED), fan.load(BOOM)]:
        began = time.perf_counter()
        made.append(fan.validate_reduction(puppet))
        print(f"{made[-1].name}: {time.perf_counter() - began:.0f} s", flush=True)
    return made


def main() -> None:
    argparse.ArgumentParser(description="Writes docs/reduction.md and its pictures.").parse_args()
    reports, pictures = measured(), ROOT / "docs" / "pictures"
    drawn = next(r for r in reports if r.name == PICTURED)
    plots.draw(drawn, pictures, "reduction_", ("Exact tracking", "Catches", "A string with mass"))
    text = page(reports, chain_table(), machine().markdown())
    parts = (p if p[:1] in "|#!`- " else wrapped(p) for p in text.split("\n\n") if p.strip())
    (ROOT / "docs" / "reduction.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
