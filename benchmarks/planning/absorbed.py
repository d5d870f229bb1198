"""The chapter on feedback: arrivals in MuJoCo, and kicks that are absorbed."""

from __future__ import annotations

import fantoccini as fan

from ..strings.report import Section, Table
from . import feedback
from .marks import Mark


def chapter(seeds: int) -> tuple[Section, list[Mark]]:
    """Plans in another engine, without looking and with feedback.

    Args:
        seeds: plans.
    """
    problem = fan.load_problem("arm3d_boxes")
    rows = feedback.measure(problem, range(seeds))
    section = Section("Plans in MuJoCo, and feedback")
    section.parts += [
        f"{seeds} plans of `arm3d_boxes`, improved for half a second, are made again in MuJoCo "
        "(RK4, steps of 1 ms): open loop, and with the regulator of `plan.feedback()`, asked once "
        "a segment. Then kicked: all joint velocities at the start are changed, together by so "
        "much.",
        Table(
            ["", "within the tolerance", "and touch nothing"],
            [[r.name, f"{r.within} of {r.runs}", f"{r.clear} of {r.runs}"] for r in rows],
        ),
    ]
    for name in ("open loop, MuJoCo", "feedback, MuJoCo"):
        within, clear = (feedback.half(rows, name, what) for what in ("within", "clear"))
        section.parts.append(
            f"{name}: half of the runs absorb a kick of {within:.2g} rad/s ({clear:.2g} rad/s "
            "touching nothing)."
        )
    closed = next(r for r in rows if r.name == "feedback, MuJoCo")
    share = 100.0 * closed.within / closed.runs
    return section, [Mark("with feedback: arrive in MuJoCo", share, 95.0, "%", True)]
