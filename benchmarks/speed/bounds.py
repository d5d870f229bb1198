"""Section 8: what the figures that are missed consist of."""

from __future__ import annotations

from fantoccini.codegen import operations

from ..strings.report import Section, Table
from .figures import Chapter, Samples, in_turns, shown, spread, times
from .programs import Program, words
from .subject import DT, marionette, swinging

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


def chapter(scalar: Program, lanes: Program, turns: int) -> Chapter:
    """The generated equations by themselves, beside the works that contain them."""
    programs, given = {"scalar": scalar, "lanes": lanes}, words([swinging()])

    def timed(work: str) -> float:
        return programs[WORKS[work][0]].run(given, work.split()[-1], 1, CALLS).seconds[0]

    taken = in_turns({work: lambda work=work: timed(work) for work in WORKS}, turns)
    counts = operations(marionette().equations)
    rows = []
    for work, (_, name) in WORKS.items():
        function = work.split()[-1]
        count = counts.get(function)
        each = f"{1e9 * taken[work].median / count:.3f} ns" if count else "-"
        rows.append([name, *spread(taken[work]), str(count or "-"), each])
    real_time = Samples(tuple(DT / x for x in taken["lane step"].values))
    limit = Samples(tuple(DT / x for x in taken["lane step_dynamics"].values))
    shares = {
        work: taken[f"{work}_dynamics" if work != "evaluate" else "dynamics"].over(taken[work])
        for work in ("evaluate", "step", "lane step")
    }
    text = [
        "The same state as in section 2, by the processor's time. What no change outside the "
        "equations can go below is the time of the generated functions themselves: "
        + ", ".join(
            f"{100 * shares[work].median:.0f} % of {what}"
            for work, what in (
                ("evaluate", "an evaluation"), ("step", "a time step"),
                ("lane step", "a lane's time step"),
            )
        )
        + ". The rest is the inputs' polynomials, the rows' factor and its solution, the forces "
        "put together, the new configuration and the books.",
        Table(["work", "median", "min", "max", "operations", "an operation"], rows),
        f"A lane by itself makes {times(real_time.median)} real time; were the equations all "
        f"there is, {times(limit.median)}. `fan.simulate` adds its checks, the inputs, which "
        "differ from lane to lane, and limits that are near in some lanes only "
        f"(a step of {shown(DT)} is one of {counts['step_dynamics']} operations and "
        f"{counts['columns']} more for limits).",
    ]
    return Chapter(Section("8. What bounds them", text))
