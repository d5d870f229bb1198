"""The public names of fantoccini, and where each is defined."""

from . import puppets as puppets
from .animation import (
    export as export,
)
from .capture import (
    Capture as Capture,
    Skeleton as Skeleton,
    clip_names as clip_names,
    load_bvh as load_bvh,
)
from .errors import (
    BuildError as BuildError,
    ExchangeError as ExchangeError,
    FantocciniError as FantocciniError,
    FileError as FileError,
    InputError as InputError,
    MissingLibraryError as MissingLibraryError,
    PacketError as PacketError,
    PictureError as PictureError,
    PuppetError as PuppetError,
    SimulationError as SimulationError,
    StandError as StandError,
    StateError as StateError,
    Status as Status,
    StoreError as StoreError,
    StreamError as StreamError,
    SweepStopped as SweepStopped,
    UnknownNameError as UnknownNameError,
)
from .exchange import (
    Imported as Imported,
    ImportNote as ImportNote,
    import_model as import_model,
)
from .gestures import (
    Conductor as Conductor,
    Gesture as Gesture,
    Score as Score,
    gesture_names as gesture_names,
    load_gesture as load_gesture,
    load_score as load_score,
    rehearse as rehearse,
)
from .identification import (
    Identified as Identified,
    Marker as Marker,
    Record as Record,
    Unknown as Unknown,
    identify as identify,
    load_record as load_record,
    suggest_motion as suggest_motion,
)
from .lab import (
    ReductionReport as ReductionReport,
    validate_reduction as validate_reduction,
)
from .marionette import (
    Event as Event,
    Flow as Flow,
    ForwardDynamics as ForwardDynamics,
    Linearisation as Linearisation,
    Marionette as Marionette,
    Method as Method,
    Mode as Mode,
    Modes as Modes,
    Partials as Partials,
    Rollout as Rollout,
    RolloutGradient as RolloutGradient,
    StepLinearisation as StepLinearisation,
    StepLinearisations as StepLinearisations,
    Stepper as Stepper,
    StepperBatch as StepperBatch,
    TimeStepping as TimeStepping,
    Variational as Variational,
    load as load,
    loads as loads,
)
from .motion import (
    Columns as Columns,
    EventKind as EventKind,
    EventRecord as EventRecord,
    Input as Input,
    InputDerivative as InputDerivative,
    Inputs as Inputs,
    State as State,
    Trajectories as Trajectories,
    Trajectory as Trajectory,
)
from .optimal import (
    MPC as MPC,
    Bounds as Bounds,
    Clip as Clip,
    MPCStatus as MPCStatus,
    OptimalStatus as OptimalStatus,
    Optimum as Optimum,
    Reach as Reach,
    ReachedPose as ReachedPose,
    ReachStatus as ReachStatus,
    Smooth as Smooth,
    Task as Task,
    Touch as Touch,
    Touched as Touched,
    Track as Track,
    Tuned as Tuned,
    TunedStatus as TunedStatus,
    follow as follow,
    load_task as load_task,
    optimise as optimise,
    reach as reach,
    tune as tune,
)
from .perform import (
    Balance as Balance,
    Handle as Handle,
    Performance as Performance,
    Recording as Recording,
    Show as Show,
)
from .planning import (
    Clearance as Clearance,
    Goal as Goal,
    HalfSpace as HalfSpace,
    PlanResult as PlanResult,
    PlanStatus as PlanStatus,
    Problem as Problem,
    load_problem as load_problem,
    plan as plan,
    solve as solve,
)
from .plays import (
    Play as Play,
    Verification as Verification,
    load_play as load_play,
    play_schema as play_schema,
    verify_play as verify_play,
)
from .puppet import (
    Puppet as Puppet,
)
from .retarget import (
    Followed as Followed,
    Retargeted as Retargeted,
    follow_clip as follow_clip,
    retarget_clip as retarget_clip,
)
from .scene import (
    Member as Member,
    Prop as Prop,
    Scene as Scene,
)
from .simulation import (
    Passage as Passage,
    Sensitivity as Sensitivity,
    sensitivity as sensitivity,
    simulate as simulate,
    simulate_batch as simulate_batch,
)
from .stand import (
    SetPoints as SetPoints,
    Stand as Stand,
    StandCheck as StandCheck,
    check_stand as check_stand,
    load_stand as load_stand,
    set_points as set_points,
    stand_schema as stand_schema,
)
from .sweeps import (
    Case as Case,
    SweepResult as SweepResult,
    Trial as Trial,
    sweep as sweep,
)
from .web import (
    show as show,
)

__version__: str
