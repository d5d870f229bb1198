"""Plan files: npz without pickle. With its problem, a plan can be searched further."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from fantoccini.base import Array, FileError, Mistake, npz
from fantoccini.control.planning.options import SearchOptions
from fantoccini.control.planning.planners import Planner
from fantoccini.control.planning.polish import Polish
from fantoccini.control.planning.search import Search, SearchRecord
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Objective, Problem

FORMAT = "fantoccini.plan.4"


def save(path: str | Path, search: Search, record: SearchRecord, status: str) -> None:
    """Writes a plan with its tree.

    Args:
        path: of the file, which appears whole or not at all.
        search: that found the plan.
        record: of the search, with the plan as the best.
        status: the plan's, for readers of the file.
    """
    problem = search.problem
    about = {
        "format": FORMAT,
        "problem": problem.name,
        "puppet": problem.marionette.name,
        "status": status,
        "planner": search.options.planner_name,
        "confirm": search.options.confirm,
        "objective": dataclasses.asdict(search.objective),
        "tried": record.tried,
        "seconds": record.seconds,
        "random": record.random_state,
        "late": record.late,
        "refused": record.refused,
        "polished": None if record.polished is None else record.polished.plain,
        "fingerprint": problem.fingerprint,
    }
    arrays = {
        **record.tree.arrays,
        "path": np.array(record.tree.path(record.best)),
        "curve": np.array(record.curve),
    }
    npz.write(path, arrays, about, compressed=True)


def load(path: str | Path, problem: Problem, planner: Planner | None = None) -> Search:
    """The search that found a file's plan, ready to go on.

    Args:
        path: of a file that :func:`save` wrote.
        problem: that was planned.
        planner: that was used, where it has no name.

    Raises:
        FileError: the file is not a plan, is damaged, or belongs to another problem.
    """
    what = "a plan"
    arrays, about = npz.contents(path, FORMAT, what)
    with npz.understanding(path, what):
        if about["fingerprint"] != problem.fingerprint:
            text = (
                f"is a plan of {about['puppet']} for another problem: start, goal, obstacles, "
                "bounds or parameters differ"
            )
            raise FileError([Mistake(str(path), None, "", text)])
        nodes = npz.checked(arrays, "path", (None,), "i")
        options = SearchOptions(
            planner or about["planner"] or "explore",
            confirm=bool(about["confirm"]),
            objective=Objective(**about["objective"]),
        )
        search = Search(problem, options)
        tree, best = SearchTree.of(arrays, like=search.tree), int(nodes[-1])
        if not 0 <= best < len(tree) or tree.path(best) != nodes.tolist():
            raise ValueError("its path does not lie in its tree")
        search.restore(
            SearchRecord(
                tree=tree,
                best=best,
                tried=int(about["tried"]),
                seconds=float(about["seconds"]),
                curve=tuple((float(s), int(n), float(t)) for s, n, t in _curve(arrays)),
                random_state=about["random"],
                late=bool(about["late"]),
                refused=int(about["refused"]),
                polished=Polish.of(about["polished"]),
            )
        )
    return search


def _curve(arrays: dict[str, Array]) -> Array:
    """(n, 3) of the best plans so far; without any, the file has (0,)."""
    if arrays["curve"].size == 0:
        return npz.finite(arrays, "curve", (0,)).reshape(0, 3)
    return npz.finite(arrays, "curve", (None, 3))
