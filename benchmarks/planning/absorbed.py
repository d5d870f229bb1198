"""The chapter on feedback: arrivals in MuJoCo, and absorbed kicks."""

from __future__ import annotations

import fantoccini as fan

from ..strings.report import Section, Table
from . import events, feedback
from .marks import Mark


def chapter(seeds: int) -> tuple[Section, list[Mark]]:
    """Plans in another engine, open loop and with feedback.

    Args:
        seeds: number of plans.
    """
    problem = fan.control.load_problem("arm3d_boxes")
    rows = feedback.measure(problem, range(seeds))
    section = Section("Plans in MuJoCo, and feedback")
    section.parts += [
        f"{seeds} plans of `arm3d_boxes`, improved for half a second, are repeated in MuJoCo "
        "(RK4, steps of 1 ms): open loop, and with the regulator of `plan.feedback()`, evaluated "
        "once per segment. A kick changes all joint velocities at the start; the table gives its "
        "norm.",
        Table(
            ["", "within the tolerance", "and touch nothing"],
            [[r.name, f"{r.within} of {r.runs}", f"{r.clear} of {r.runs}"] for r in rows],
        ),
    ]
    for name in ("open loop, MuJoCo", "feedback, MuJoCo"):
        within, clear = (
            feedback.half_absorbed_kick(rows, name, count) for count in ("within", "clear")
        )
        section.parts.append(
            f"{name}: half of the runs absorb a kick of {within:.2g} rad/s ({clear:.2g} rad/s "
            "touching nothing)."
        )
    engines = {"fantoccini": events.run_in_fantoccini, "MuJoCo": events.run_in_mujoco}
    slack = max(1, seeds // 5)
    rows_slack = events.compare_laws(events.slack_plans(slack), 6, events.SIZES[1:], engines)
    bell, taken = events.bell(6)
    section.parts += [
        f"The next table is for strings that go slack: {slack} such plans, improved for time "
        "alone, 6 kicks of each size; gains by time, and by the active set of the puppet.",
        Table(events.HEAD, [row.cells() for row in rows_slack]),
        f"The full marionette's bell, whose law is computed in {taken:.1f} s:",
        Table(events.HEAD, [row.cells() for row in bell]),
    ]
    closed = next(r for r in rows if r.name == "feedback, MuJoCo")
    share = 100.0 * closed.within / closed.runs
    return section, [Mark("with feedback: arrive in MuJoCo", share, 95.0, "%", True)]
