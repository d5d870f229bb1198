"""Optimal control: the motion of least cost of a puppet within bounds."""

from fantoccini.optimal.api import follow as follow, optimise as optimise
from fantoccini.optimal.bounds import Bounds as Bounds
from fantoccini.optimal.clip import Clip as Clip
from fantoccini.optimal.costs import Smooth as Smooth, Track as Track
from fantoccini.optimal.mpc import MPC as MPC, MPCStatus as MPCStatus
from fantoccini.optimal.outlook import out_of_reach as out_of_reach
from fantoccini.optimal.reached import (
    Reach as Reach,
    ReachedPose as ReachedPose,
    ReachStatus as ReachStatus,
)
from fantoccini.optimal.reaching import reach as reach
from fantoccini.optimal.result import OptimalStatus as OptimalStatus, Optimum as Optimum
from fantoccini.optimal.task import Task as Task
from fantoccini.optimal.task_file import load_task as load_task, task_names as task_names
from fantoccini.optimal.task_schema import task_schema as task_schema
from fantoccini.optimal.touch import Touch as Touch, Touched as Touched
from fantoccini.optimal.tuning import (
    Tuned as Tuned,
    TunedStatus as TunedStatus,
    tune as tune,
)
