"""Tasks of control: goals, costs, bounds, paths and touches, and their files."""

from fantoccini.control.tasks.answer import Answer, AnswerStatus
from fantoccini.control.tasks.bounds import Bounds, Interval, Magnitudes
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.clip import Clip
from fantoccini.control.tasks.control_file import (
    ControlFile,
    Reading,
    check_one_of,
    read_control_file,
)
from fantoccini.control.tasks.costs import Smooth, Track
from fantoccini.control.tasks.drawn_inputs import DrivenConditions, hats
from fantoccini.control.tasks.goals import Goal, GoalLike
from fantoccini.control.tasks.nodes import Nodes, entry_names
from fantoccini.control.tasks.residuals import (
    NodeKinematics,
    NumberResidual,
    Residual,
    path_of,
    residual_of,
    share,
)
from fantoccini.control.tasks.state_arrays import StateArrays, flattened
from fantoccini.control.tasks.targets import Target
from fantoccini.control.tasks.task import PlanConditions, Task
from fantoccini.control.tasks.task_file import load_task, task_names, task_schema
from fantoccini.control.tasks.touch import Touch, Touched
from fantoccini.control.tasks.touches import (
    KEEP_OFF,
    ContactLike,
    Meeting,
    Touches,
    carried,
    touching,
)

__all__ = [
    "KEEP_OFF",
    "Answer",
    "AnswerStatus",
    "Bounds",
    "ChosenParameters",
    "Clip",
    "ContactLike",
    "ControlFile",
    "DrivenConditions",
    "Goal",
    "GoalLike",
    "Interval",
    "Magnitudes",
    "Meeting",
    "NodeKinematics",
    "Nodes",
    "NumberResidual",
    "PlanConditions",
    "Reading",
    "Residual",
    "Smooth",
    "StateArrays",
    "Target",
    "Task",
    "Touch",
    "Touched",
    "Touches",
    "Track",
    "carried",
    "check_one_of",
    "entry_names",
    "flattened",
    "hats",
    "load_task",
    "path_of",
    "read_control_file",
    "residual_of",
    "share",
    "task_names",
    "task_schema",
    "touching",
]
