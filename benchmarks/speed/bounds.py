"""Section 8: contributions to the figures that miss their targets."""

from __future__ import annotations

from fantoccini.kernel.codegen import operations

from ..strings.report import Section, Table
from .figures import Chapter, Samples, in_turns, ratio_text, spread_text, time_text
from .programs import Program, program_input
from .subject import DT, marionette, swinging_state

WORKS = {
    "evaluate": ("scalar", "constrained evaluation"),
    "dynamics": ("scalar", "of it, the generated equations alone"),
    "step": ("scalar", "time step with complementarity"),
    "step_dynamics": ("scalar", "of it, the generated equations alone"),
    "lane step": ("lanes", "time step with complementarity, a lane of a bundle"),
    "lane step_dynamics": ("lanes", "of it, the generated equations alone"),
}
"""Work -> the program that does it, and its name on the page."""

CALLS = 10_000

BY_HAND = (
    "An analysis by hand of lanes of 8 with AVX-512, g++ 12.2 (not measured with this page): a "
    "lane's equations are 3,968 vector operations in 9,400 instructions, with 2,660 loads and "
    "1,371 stores of whole cache lines (1,198 since constants are written once), because about "
    "210 values are live at a time and the processor has 32 registers. A loop of two loads, one "
    "fused product and one store takes 2.5 cycles here, 3.4 where the addresses agree in their "
    "last 12 bits, as is frequent with 64 cache lines per page: the stores alone account for "
    "3,000 of the 5,300 cycles that the equations take with all their results in the first-level "
    "cache. With results and work arrays folded onto a few lines (and wrong values) they take "
    "0.79 of their time; with each piece called repeatedly, 0.90: neither the cache nor "
    "instruction fetch dominates. Bundles of 4 take 1.24 times as long per lane. No gain came "
    "from -O3, -fno-math-errno, -fno-trapping-math, other lengths of pieces, scheduling on and "
    "off, and an order of statements for short lifetimes."
)


def chapter(scalar: Program, lanes: Program, turns: int) -> Chapter:
    """The generated equations alone, compared with the work that contains them."""
    programs, start_words = {"scalar": scalar, "lanes": lanes}, program_input([swinging_state()])

    def timed(work: str) -> float:
        return programs[WORKS[work][0]].run(start_words, work.split()[-1], 1, CALLS).seconds[0]

    taken = in_turns({work: lambda work=work: timed(work) for work in WORKS}, turns)
    counts = operations(marionette().equations)
    rows = []
    for work, (_, name) in WORKS.items():
        function = work.split()[-1]
        count = counts.get(function)
        each = f"{1e9 * taken[work].median / count:.3f} ns" if count else "-"
        rows.append([name, *spread_text(taken[work]), str(count or "-"), each])
    real_time = Samples(tuple(DT / x for x in taken["lane step"].values))
    limit = Samples(tuple(DT / x for x in taken["lane step_dynamics"].values))
    shares = {
        work: taken[f"{work}_dynamics" if work != "evaluate" else "dynamics"].over(taken[work])
        for work in ("evaluate", "step", "lane step")
    }
    text = [
        "The same state as in section 2, in processor time. The generated functions alone are a "
        "lower bound for every change outside the equations: "
        + ", ".join(
            f"{100 * shares[work].median:.0f} % of {what}"
            for work, what in (
                ("evaluate", "an evaluation"),
                ("step", "a time step"),
                ("lane step", "a lane's time step"),
            )
        )
        + ". The rest is the inputs' polynomials, the rows' factor and its solution, the sum of "
        "the forces, the new configuration and the ledger.",
        Table(["work", "median", "min", "max", "operations", "an operation"], rows),
        f"A lane alone makes {ratio_text(real_time.median)} real time; with the equations alone, "
        f"{ratio_text(limit.median)}. `fan.simulate` adds its checks, the inputs, which differ "
        "from "
        f"lane to lane, and limits that are near in some lanes only (a step of {time_text(DT)} is "
        f"one of {counts['step_dynamics']} operations and {counts['columns']} more for limits).",
        BY_HAND,
    ]
    return Chapter(Section("8. Lower bounds", text))
