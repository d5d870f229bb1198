"""The names of the package, and where each is defined."""

from . import (
    clearance as clearance,
    compiled as compiled,
    derivatives as derivatives,
    equilibrium as equilibrium,
    marionette as marionette,
    mujoco as mujoco,
    simulation as simulation,
    steppers as steppers,
)
from .clearance import Clearance as Clearance, HalfSpace as HalfSpace
from .compiled import (
    Event as Event,
    Flow as Flow,
    ForwardDynamics as ForwardDynamics,
    Method as Method,
    TimeStepping as TimeStepping,
    Variational as Variational,
)
from .derivatives import (
    Linearisation as Linearisation,
    Partials as Partials,
    Rollout as Rollout,
    RolloutGradient as RolloutGradient,
    StepLinearisation as StepLinearisation,
    StepLinearisations as StepLinearisations,
)
from .equilibrium import (
    Mode as Mode,
    Modes as Modes,
    input_warnings as input_warnings,
    warnings as warnings,
)
from .marionette import Marionette as Marionette, load as load, loads as loads, puppets as puppets
from .mujoco import (
    Joint as Joint,
    MuJoCoPuppet as MuJoCoPuppet,
    all_joints as all_joints,
    mjcf as mjcf,
    mujoco_run as mujoco_run,
)
from .simulation import (
    Passage as Passage,
    RunSensitivity as RunSensitivity,
    sensitivity as sensitivity,
    simulate as simulate,
    simulate_batch as simulate_batch,
)
from .steppers import Stepper as Stepper, StepperBatch as StepperBatch
