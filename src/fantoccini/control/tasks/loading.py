"""Tasks of files: task files, and problem files of plans.

A task file describes a motion of least cost, a problem file a plan among obstacles.
"""

from __future__ import annotations

import os
from typing import Any

from fantoccini.base import OnProgress
from fantoccini.base.documents import Mistakes, document_schema
from fantoccini.control.tasks.control_file import ControlFile, begin_reading, read_control_file
from fantoccini.control.tasks.problem_file import ProblemFile, task_of_problem
from fantoccini.control.tasks.schema import TaskFile
from fantoccini.control.tasks.task import Task
from fantoccini.control.tasks.task_file import task_of_file


def task_names() -> tuple[str, ...]:
    """Names of the bundled tasks."""
    return TaskFile.kind.bundled


def problem_names() -> tuple[str, ...]:
    """Names of the bundled problems."""
    return ProblemFile.kind.bundled


def task_schema() -> dict[str, Any]:
    """JSON Schema of a task file, for editors."""
    return document_schema(TaskFile)


def problem_schema() -> dict[str, Any]:
    """JSON Schema of a problem file, for editors."""
    return document_schema(ProblemFile)


def load_task(path: str | os.PathLike[str], *, progress: OnProgress | None = None) -> Task:
    """The task of a task file or a problem file.

    Args:
        path: path of the file, or the name of a bundled task (``crane``) or problem.
        progress: called as each slow step begins; ``what`` describes it.

    Raises:
        FileError: all mistakes with their locations.
    """
    return read_task(path, progress, TaskFile, ProblemFile)[0]


def read_task(
    path: str | os.PathLike[str], progress: OnProgress | None, *schemas: type[ControlFile]
) -> tuple[Task, Mistakes]:
    """The task of a file, and the collector of its mistakes.

    Args:
        path, progress: see :func:`load_task`.
        schemas: task file and problem file; the first is named if there is no such file.

    Raises:
        FileError: all mistakes with their locations.
    """
    file = read_control_file(path, *schemas)
    if isinstance(file, ProblemFile):
        problem = begin_reading(file, progress)
        return task_of_problem(problem), problem.check
    assert isinstance(file, TaskFile)
    reading = begin_reading(file, progress)
    return task_of_file(reading), reading.check
