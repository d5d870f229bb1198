"""Plan files: npz without pickle. From a file and its problem, the search can be continued.

The search tree has the states that were reached as nodes, with the pieces of motion between them.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from fantoccini.base import Array, FileError, Mistake, npz
from fantoccini.control.planning.options import SearchOptions
from fantoccini.control.planning.planners import Planner
from fantoccini.control.planning.polish import PolishResult
from fantoccini.control.planning.search import Search, SearchRecord
from fantoccini.control.planning.search_tree import SearchTree
from fantoccini.control.problems import Problem
from fantoccini.control.tasks import Objective

FORMAT = "fantoccini.plan.4"

_KEYS = {"n_checks": "looks"}
"""Array of a search tree -> its key in files, where the two names differ."""


def save(path: str | Path, search: Search, record: SearchRecord, status: str) -> None:
    """Writes a plan with its search tree.

    Args:
        path: path of the file, which is put in place when it is complete.
        search: search that found the plan.
        record: results of the search, with the plan as the best one.
        status: status of the plan, for readers of the file.
    """
    problem = search.problem
    metadata = {
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
        "late": record.timed_out,
        "refused": record.refused,
        "polished": None if record.polished is None else record.polished.as_list,
        "fingerprint": problem.fingerprint,
    }
    arrays = {
        **{_KEYS.get(name, name): array for name, array in record.tree.arrays.items()},
        "path": np.array(record.tree.path(record.best)),
        "curve": np.array(record.curve),
    }
    npz.write(path, arrays, metadata, compressed=True)


def load(path: str | Path, problem: Problem, planner: Planner | None = None) -> Search:
    """The search that found the plan in a file, ready to continue.

    Args:
        path: path of a file that :func:`save` wrote.
        problem: the planning problem.
        planner: planner of the search, if it was given as a function without a name.

    Raises:
        FileError: file that is not a plan, is damaged, or belongs to another problem.
    """
    label = "a plan"
    arrays, metadata = npz.contents(path, FORMAT, label)
    with npz.unreadable_as(path, label):
        if metadata["fingerprint"] != problem.fingerprint:
            text = (
                f"is a plan of {metadata['puppet']} for another problem: start, goal, obstacles, "
                "bounds or parameters differ"
            )
            raise FileError([Mistake(str(path), None, "", text)])
        nodes = npz.checked(arrays, "path", (None,), "i")
        options = SearchOptions(
            planner or metadata["planner"] or "explore",
            confirm=bool(metadata["confirm"]),
            objective=Objective(**metadata["objective"]),
        )
        search = Search(problem, options)
        tree_arrays = {name: arrays[_KEYS.get(name, name)] for name in search.tree.arrays}
        tree, best = SearchTree.from_arrays(tree_arrays, template=search.tree), int(nodes[-1])
        if not 0 <= best < len(tree) or tree.path(best) != nodes.tolist():
            raise ValueError("its path does not lie in its tree")
        search.restore(
            SearchRecord(
                tree=tree,
                best=best,
                tried=int(metadata["tried"]),
                seconds=float(metadata["seconds"]),
                curve=tuple((float(s), int(n), float(t)) for s, n, t in _curve(arrays)),
                random_state=metadata["random"],
                timed_out=bool(metadata["late"]),
                refused=int(metadata["refused"]),
                polished=PolishResult.from_list(metadata["polished"]),
            )
        )
    return search


def _curve(arrays: dict[str, Array]) -> Array:
    """(n, 3) seconds, rollouts and duration of each plan that was the best; (0,) means none."""
    if arrays["curve"].size == 0:
        return npz.finite(arrays, "curve", (0,)).reshape(0, 3)
    return npz.finite(arrays, "curve", (None, 3))
