"""Section 4: a puppet without contact, compared with its generated equations alone."""

from __future__ import annotations

from ..speed.bounds import CALLS
from ..speed.figures import Chapter, Goal, in_turns, ratio_text, spread_text
from ..speed.programs import Program, program_input
from ..speed.subject import swinging_state
from ..strings.report import Section, Table

MAX_RATIO = 1.7
"""Largest time of a step, relative to its equations."""

WHO = {"scalar": "a time step", "lanes": "a time step of a lane"}


def chapter(scalar: Program, lanes: Program, turns: int) -> Chapter:
    """Steps over equations, scalar and in lanes."""
    programs, start_words = {"scalar": scalar, "lanes": lanes}, program_input([swinging_state()])
    actions = {
        (who, work): lambda who=who, work=work: (
            programs[who].run(start_words, work, 1, CALLS).seconds[0]
        )
        for who in WHO
        for work in ("step", "step_dynamics")
    }
    named = {f"{who} {work}": action for (who, work), action in actions.items()}
    taken = in_turns(named, turns)
    rows, ratio_rows, goals = [], [], []
    for who, name in WHO.items():
        whole, alone = taken[f"{who} step"], taken[f"{who} step_dynamics"]
        rows += [
            [name, *spread_text(whole)],
            ["of it, the generated equations alone", *spread_text(alone)],
        ]
        ratio_rows.append([f"{name} / its equations", *spread_text(whole.over(alone), ratio_text)])
        what = f"equations alone / {name} without contact (target: 1/{MAX_RATIO:g})"
        goals.append(Goal(what, alone.over(whole), 1.0 / MAX_RATIO))
    text = (
        "The hanging marionette of [the page on speed](benchmarks.md), its inputs at rest, "
        f"{CALLS} steps per turn, {turns} turns, in processor time."
    )
    parts = [
        text,
        Table(["work", "median", "min", "max"], rows),
        Table(["ratio", "median", "min", "max"], ratio_rows),
    ]
    return Chapter(Section("4. Without contact", parts), goals)
