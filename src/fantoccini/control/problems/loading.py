"""Problems of files.

A problem is a task prepared for a search.
"""

from __future__ import annotations

import os
from dataclasses import fields, replace
from typing import Any

from fantoccini.base import OnProgress
from fantoccini.control.problems.problem import Problem
from fantoccini.control.tasks import PlanConditions, ProblemFile, Task, TaskFile, read_task

_CONDITIONS = frozenset(field.name for field in fields(PlanConditions))


def load_problem(
    path: str | os.PathLike[str],
    *,
    threads: int | None = None,
    progress: OnProgress | None = None,
    **options: Any,
) -> Problem:
    """The problem of a problem file, or of a task file with an end.

    Args:
        path: path of the file, or the name of a bundled problem (``arm3d_boxes``) or task.
        threads: number of threads; all processors by default.
        progress: called as each slow step begins; ``what`` describes it.
        options: arguments of :class:`Problem` that replace the file's: ``tolerance=0.1``.

    Raises:
        FileError: all mistakes with their locations.
    """
    task, check = read_task(path, progress, ProblemFile, TaskFile)
    return check.need((), lambda: Problem.from_task(_with_options(task, threads, options)))


def _with_options(task: Task, threads: int | None, options: dict[str, Any]) -> Task:
    """The task with other options."""
    conditions = {key: value for key, value in options.items() if key in _CONDITIONS}
    task_fields = {key: value for key, value in options.items() if key not in _CONDITIONS}
    new_conditions = replace(task.conditions, **conditions)
    if threads is not None:
        new_conditions = replace(
            new_conditions, rollouts=replace(new_conditions.rollouts, threads=threads)
        )
    return replace(task, conditions=new_conditions, **task_fields)
