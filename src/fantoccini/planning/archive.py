"""Plans on disk: npz without pickle; with its problem a plan is whole again, and can go on."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import FileError, Problem as Mistake
from fantoccini.files import replacing
from fantoccini.motion.npz import checked, contents, finite, understanding
from fantoccini.planning.objective import Objective
from fantoccini.planning.planners import Planner
from fantoccini.planning.polish import Polish
from fantoccini.planning.problem import Problem
from fantoccini.planning.search import Search
from fantoccini.planning.search_tree import SearchTree

if TYPE_CHECKING:
    from fantoccini.planning.result import PlanResult

FORMAT = "fantoccini.plan.4"


def save(plan: PlanResult, path: str | Path) -> None:
    """Writes a plan with its tree."""
    search = plan.search
    about = {
        "format": FORMAT,
        "problem": plan.problem.name,
        "puppet": plan.problem.marionette.name,
        "status": plan.status.name,
        "planner": search.planner_name,
        "confirm": search.confirm,
        "objective": dataclasses.asdict(search.objective),
        "tried": plan.tried,
        "seconds": plan.seconds,
        "random": search.random_state,
        "late": search.late,
        "refused": search.refused,
        "polished": None if search.polished is None else search.polished.plain,
        "fingerprint": plan.problem.fingerprint,
    }
    arrays = {**plan.tree.arrays, "path": np.array(plan.path), "curve": np.array(plan.curve)}
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def load(path: str | Path, problem: Problem, planner: Planner | None = None) -> Search:
    """The search that a file's plan came from, ready to go on.

    Args:
        path: what :func:`save` wrote.
        problem: what was planned.
        planner: the one that was used, where that has no name.

    Raises:
        FileError: the file is none of these, damaged, or of another problem.
    """

    what = "a plan"
    arrays, about = contents(path, FORMAT, what)
    with understanding(path, what):
        if about["fingerprint"] != problem.fingerprint:
            text = (
                f"is a plan of {about['puppet']} for another problem: start, goal, obstacles, "
                "bounds or parameters differ"
            )
            raise FileError([Mistake(str(path), None, "", text)])
        nodes = checked(arrays, "path", (None,), "i")
        curve = _curve(arrays)
        asked = planner or about["planner"] or "explore"
        search = Search(
            problem, asked, confirm=bool(about["confirm"]),
            objective=Objective(**about["objective"]),
        )  # fmt: skip
        tree, end = SearchTree.of(arrays, like=search.tree), int(nodes[-1])
        if not 0 <= end < len(tree) or tree.path(end) != nodes.tolist():
            raise ValueError("its path is none of its tree")
        search.restore(
            tree, end, int(about["tried"]), float(about["seconds"]), curve, about["random"],
            bool(about["late"]), int(about["refused"]), Polish.of(about["polished"]),
        )  # fmt: skip
    return search


def _curve(arrays: dict[str, Array]) -> Array:
    """(n, 3) of the plans that were the best so far; of none the file has (0,)."""
    empty = arrays["curve"].size == 0
    return finite(arrays, "curve", (0,) if empty else (None, 3))
