"""The public names of fantoccini, and where each is defined."""

from . import (
    app as app,
    base as base,
    control as control,
    dynamics as dynamics,
    kernel as kernel,
    lab as lab,
    model as model,
    motion as motion,
    output as output,
    stand as stand,
    theatre as theatre,
)
from .app import show as show
from .base import FantocciniError as FantocciniError, Status as Status, errors as errors
from .control import (
    MPC as MPC,
    Task as Task,
    follow as follow,
    optimise as optimise,
    plan as plan,
    reach as reach,
    tune as tune,
)
from .dynamics import (
    Event as Event,
    Marionette as Marionette,
    TimeStepping as TimeStepping,
    Variational as Variational,
    load as load,
    loads as loads,
    puppets as puppets,
    simulate as simulate,
    simulate_batch as simulate_batch,
)
from .lab import identify as identify, sweep as sweep
from .model import Scene as Scene
from .motion import (
    Input as Input,
    State as State,
    Trajectories as Trajectories,
    Trajectory as Trajectory,
)
from .output import export as export, import_model as import_model
from .theatre import Performance as Performance, load_play as load_play, load_score as load_score

__version__: str
