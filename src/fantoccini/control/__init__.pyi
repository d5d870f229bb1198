"""The names of the package, and where each is defined."""

from . import optimal as optimal, planning as planning, problems as problems, tasks as tasks
from .optimal import (
    MPC as MPC,
    DrawOptions as DrawOptions,
    MPCStatus as MPCStatus,
    Optimum as Optimum,
    ReachedPose as ReachedPose,
    ReachedPoses as ReachedPoses,
    TuningResult as TuningResult,
    follow as follow,
    optimise as optimise,
    reach as reach,
    tune as tune,
)
from .planning import (
    EST2007 as EST2007,
    PLANNERS as PLANNERS,
    Check as Check,
    ClosedLoopRollout as ClosedLoopRollout,
    Explore as Explore,
    Feedback as Feedback,
    PlanResult as PlanResult,
    PolishResult as PolishResult,
    PolishStatus as PolishStatus,
    Search as Search,
    SearchOptions as SearchOptions,
    plan as plan,
    solve as solve,
)
from .problems import Problem as Problem, load_problem as load_problem
from .tasks import (
    OBJECTIVES as OBJECTIVES,
    Answer as Answer,
    AnswerStatus as AnswerStatus,
    Bounds as Bounds,
    Clip as Clip,
    ClosestApproach as ClosestApproach,
    Goal as Goal,
    Objective as Objective,
    PlanConditions as PlanConditions,
    RolloutOptions as RolloutOptions,
    Smooth as Smooth,
    StateArrays as StateArrays,
    Task as Task,
    Touch as Touch,
    TouchEvent as TouchEvent,
    TouchRules as TouchRules,
    Track as Track,
    load_task as load_task,
    problem_names as problem_names,
    problem_schema as problem_schema,
)
