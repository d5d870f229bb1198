"""Plans on disk: npz without pickle; with its problem a plan is whole again, and can go on."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.errors import FileError
from fantoccini.errors import Problem as Mistake
from fantoccini.motion.archive import UNREADABLE, replacing
from fantoccini.plan.objective import Objective
from fantoccini.plan.planners import Planner
from fantoccini.plan.polish import Polish
from fantoccini.plan.problem import Problem
from fantoccini.plan.search import Search
from fantoccini.plan.search_tree import SearchTree

if TYPE_CHECKING:
    from fantoccini.plan.result import PlanResult

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

    def wrong(text: str) -> FileError:
        return FileError([Mistake(str(path), None, "", text)])

    try:
        with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        about: dict[str, Any] = json.loads(arrays.pop("about").tobytes())
        if about["format"] != FORMAT:
            raise ValueError(f"has the format {about['format']!r}; this version reads {FORMAT!r}")
        if about["fingerprint"] != problem.fingerprint:
            raise wrong(
                f"is a plan of {about['puppet']} for another problem: start, goal, obstacles, "
                "bounds or parameters differ"
            )
        nodes, curve = arrays.pop("path"), arrays.pop("curve")
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
    except FileNotFoundError:
        raise wrong("there is no such file") from None
    except (*UNREADABLE, AttributeError, LookupError, TypeError) as error:
        if isinstance(error, FileError):
            raise
        raise wrong(f"is no plan, or damaged: {error}") from None
    return search
