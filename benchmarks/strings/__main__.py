"""``python -m benchmarks.strings``: measures everything and writes docs/strings.md."""

import argparse
import time

from . import ROOT, closed_forms, contest, convergence, energy, fixed_steps, rest, soak, tolerance
from .report import write

SECTIONS = {
    "convergence": convergence.section,
    "closed-forms": closed_forms.launches,
    "reeling": closed_forms.reeling,
    "defaults": tolerance.defaults,
    "rest": rest.section,
    "energy": energy.section,
    "steps": fixed_steps.section,
    "ledger": tolerance.ledger,
    "rivals": contest.section,
    "soak": soak.section,
}


OPENING = (
    "After this page you know the accuracy of fantoccini for strings that go slack and snap "
    "taut, compared with closed forms, with independent integrations by SciPy at 1e-13, with "
    "MuJoCo and with two classical methods. Errors are absolute and in SI units unless stated "
    "otherwise. `event` and `timestepping` are the methods of `fan.simulate`; see [Physics and "
    "methods](physics.md). `make strings-report` measures everything and writes this page."
)


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/strings.md and its pictures.")
    parser.add_argument("--only", choices=SECTIONS, help="measure one section, print it")
    chosen = parser.parse_args().only
    sections = []
    for name, section in SECTIONS.items():
        if chosen in (None, name):
            began = time.perf_counter()
            sections.append(section())
            print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)
    if chosen:
        print(sections[0].markdown())
        for mark in sections[0].marks:
            print(mark.what, mark.value, mark.bound, mark.met)
    else:
        write(ROOT / "docs" / "strings.md", OPENING, sections)


if __name__ == "__main__":
    main()
