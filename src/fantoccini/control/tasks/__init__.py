"""Tasks of control: goals, costs, bounds, paths and touches, and their files.

A task is a motion to be computed. A track is a quantity that should follow a path, a touch a point
of a body that should pass a place. A driven coordinate is an end or a length of a string, or a
driven joint; its accelerations acc_K are the inputs. z = (dq_D, dv_D, dq_K, dv_K) is a change of a
state: of the dynamic coordinates and velocities, then of the driven ones.
"""

from fantoccini.control.tasks.answer import Answer, AnswerStatus
from fantoccini.control.tasks.bounds import Bounds, Interval, Magnitudes
from fantoccini.control.tasks.chosen_parameters import ChosenParameters
from fantoccini.control.tasks.clip import Clip
from fantoccini.control.tasks.control_file import ControlFile
from fantoccini.control.tasks.costs import Smooth, Track
from fantoccini.control.tasks.drawn_inputs import DrivenConditions, hat_functions
from fantoccini.control.tasks.driven_bounds import DrivenBounds
from fantoccini.control.tasks.goals import Goal, GoalLike
from fantoccini.control.tasks.loading import (
    load_task,
    problem_names,
    problem_schema,
    read_task,
    task_names,
    task_schema,
)
from fantoccini.control.tasks.nodes import Nodes, entry_names
from fantoccini.control.tasks.objective import OBJECTIVES, TIME, Objective
from fantoccini.control.tasks.plan_conditions import PlanConditions, RolloutOptions
from fantoccini.control.tasks.problem_file import ProblemFile
from fantoccini.control.tasks.residuals import (
    NodeKinematics,
    Residual,
    ScalarResidual,
    active_fraction,
    track_path,
    track_residual,
)
from fantoccini.control.tasks.schema import TaskFile
from fantoccini.control.tasks.state_arrays import StateArrays, flattened
from fantoccini.control.tasks.targets import Target
from fantoccini.control.tasks.task import GuessLike, Task
from fantoccini.control.tasks.touch import ClosestApproach, Touch
from fantoccini.control.tasks.touches import (
    KEEP_OFF,
    ContactLike,
    TouchEvent,
    TouchRules,
    carried_share,
)

__all__ = [
    "KEEP_OFF",
    "OBJECTIVES",
    "TIME",
    "Answer",
    "AnswerStatus",
    "Bounds",
    "ChosenParameters",
    "Clip",
    "ClosestApproach",
    "ContactLike",
    "ControlFile",
    "DrivenBounds",
    "DrivenConditions",
    "Goal",
    "GoalLike",
    "GuessLike",
    "Interval",
    "Magnitudes",
    "NodeKinematics",
    "Nodes",
    "Objective",
    "PlanConditions",
    "ProblemFile",
    "Residual",
    "RolloutOptions",
    "ScalarResidual",
    "Smooth",
    "StateArrays",
    "Target",
    "Task",
    "TaskFile",
    "Touch",
    "TouchEvent",
    "TouchRules",
    "Track",
    "active_fraction",
    "carried_share",
    "entry_names",
    "flattened",
    "hat_functions",
    "load_task",
    "problem_names",
    "problem_schema",
    "read_task",
    "task_names",
    "task_schema",
    "track_path",
    "track_residual",
]
