"""``python -m benchmarks.section_vi``: writes docs/reduction.md, or the report of one puppet."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from benchmarks.section_vi import plots
from benchmarks.section_vi.measure import measure
from benchmarks.section_vi.page import page
from benchmarks.section_vi.report import SectionReport
from benchmarks.string_model.report import chain_table
from benchmarks.strings.report import machine, wrap_paragraph

import fantoccini as fan
from fantoccini import puppets

ROOT = Path(__file__).resolve().parents[2]
BUNDLED = ("arm2d", "arm3d", "marionette")
PICTURED = "marionette"
BOOM = Path(__file__).with_name("boom.yaml")


def measure_all() -> list[SectionReport]:
    """The reports of the bundled puppets and of the boom."""
    reports = []
    for puppet in [*(getattr(puppets, name)() for name in BUNDLED), fan.load(BOOM)]:
        began = time.perf_counter()
        reports.append(measure(puppet))
        print(f"{reports[-1].name}: {time.perf_counter() - began:.0f} s", flush=True)
    return reports


def write_page() -> None:
    """Writes docs/reduction.md and its pictures."""
    reports, pictures = measure_all(), ROOT / "docs" / "pictures"
    drawn = next(r for r in reports if r.name == PICTURED)
    plots.draw(drawn, pictures, "reduction_", ("Exact tracking", "Catches", "A string with mass"))
    text = page(reports, chain_table(), machine().markdown())
    parts = (p if p[:1] in "|#!`- " else wrap_paragraph(p) for p in text.split("\n\n") if p.strip())
    (ROOT / "docs" / "reduction.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def write_report(file: str, inputs: Path | None, folder: Path) -> None:
    """Writes the report of one puppet, with plots, and prints its results."""
    puppet = fan.load(puppets.path(file) if file in puppets.names() else file)
    report = measure(puppet, inputs and fan.Input.load(puppet, inputs), lambda at: print(at.what))
    folder.mkdir(parents=True, exist_ok=True)
    files = report.write(folder)
    print(*report.verdicts(), "wrote " + ", ".join(map(str, files)), sep="\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="Measures the paper's Section VI.")
    parser.add_argument(
        "file",
        nargs="?",
        metavar="FILE",
        help="puppet file, or name of a bundled one, for a report; else writes docs/reduction.md",
    )
    parser.add_argument("--inputs", type=Path, metavar="FILE", help="its motion; else small moves")
    parser.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="its folder")
    arguments = parser.parse_args()
    if arguments.file is None:
        write_page()
    else:
        write_report(arguments.file, arguments.inputs, arguments.out)


if __name__ == "__main__":
    main()
