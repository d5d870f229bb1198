"""Tasks of optimal control: costs, bounds, paths and touches, and their files."""

from fantoccini.control.tasks.answer import Answer, AnswerStatus
from fantoccini.control.tasks.bounds import Bounds, Interval, Most
from fantoccini.control.tasks.chosen import Chosen
from fantoccini.control.tasks.clip import Clip
from fantoccini.control.tasks.control_file import (
    ControlFile,
    Reading,
    check_one_of,
    read_control_file,
)
from fantoccini.control.tasks.costs import Smooth, Track
from fantoccini.control.tasks.drawn_inputs import Driven, hats
from fantoccini.control.tasks.nodes import Nodes, number_names
from fantoccini.control.tasks.residuals import (
    Looks,
    NumberResidual,
    Residual,
    path_of,
    residual_of,
    share,
)
from fantoccini.control.tasks.targets import Target
from fantoccini.control.tasks.task import Task
from fantoccini.control.tasks.task_file import load_task, task_names, task_schema
from fantoccini.control.tasks.touch import Touch, Touched

__all__ = [
    "Answer",
    "AnswerStatus",
    "Bounds",
    "Chosen",
    "Clip",
    "ControlFile",
    "Driven",
    "Interval",
    "Looks",
    "Most",
    "Nodes",
    "NumberResidual",
    "Reading",
    "Residual",
    "Smooth",
    "Target",
    "Task",
    "Touch",
    "Touched",
    "Track",
    "check_one_of",
    "hats",
    "load_task",
    "number_names",
    "path_of",
    "read_control_file",
    "residual_of",
    "share",
    "task_names",
    "task_schema",
]
