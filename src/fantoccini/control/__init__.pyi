"""The names of the package, and where each is defined."""

from . import (
    optimal as optimal,
    planning as planning,
    problems as problems,
    tasks as tasks,
)
from .optimal import (
    MPC as MPC,
    MPCStatus as MPCStatus,
    OptimalStatus as OptimalStatus,
    Optimum as Optimum,
    Reach as Reach,
    ReachedPose as ReachedPose,
    ReachStatus as ReachStatus,
    Tuned as Tuned,
    TunedStatus as TunedStatus,
    follow as follow,
    optimise as optimise,
    reach as reach,
    tune as tune,
)
from .planning import (
    PlanResult as PlanResult,
    PlanStatus as PlanStatus,
    plan as plan,
    solve as solve,
)
from .problems import (
    Goal as Goal,
    Problem as Problem,
    load_problem as load_problem,
)
from .tasks import (
    Bounds as Bounds,
    Clip as Clip,
    Smooth as Smooth,
    Task as Task,
    Touch as Touch,
    Touched as Touched,
    Track as Track,
    load_task as load_task,
)
