"""Dynamics of marionettes: articulated rigid bodies hung from massless strings.

import fantoccini as fan

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
run = fan.simulate(arm, x0, lift, t_end=3.0)
"""

from fantoccini import puppets
from fantoccini.errors import (
    BuildError,
    ExchangeError,
    FantocciniError,
    InputError,
    MissingLibraryError,
    PuppetError,
    SimulationError,
    StateError,
    Status,
    StoreError,
    SweepStopped,
    UnknownNameError,
)
from fantoccini.marionette import (
    Flow,
    Linearisation,
    Marionette,
    Mode,
    Modes,
    Partials,
    StepLinearisation,
    Stepper,
    load,
    loads,
)
from fantoccini.motion import (
    Columns,
    Event,
    EventKind,
    Input,
    InputDerivative,
    Inputs,
    State,
    Trajectories,
    Trajectory,
)
from fantoccini.perform import Handle, Performance, Recording
from fantoccini.plan import (
    Clearance,
    Goal,
    HalfSpace,
    PlanResult,
    PlanStatus,
    Problem,
    load_problem,
    plan,
    solve,
)
from fantoccini.puppet import Puppet
from fantoccini.reduction import ReductionReport, validate_reduction
from fantoccini.show import show
from fantoccini.simulate import Passage, Sensitivity, sensitivity, simulate
from fantoccini.sweep import Case, SweepResult, Trial, sweep
from fantoccini.world import World

__version__ = "0.1.0"

__all__ = [
    "BuildError",
    "Case",
    "Clearance",
    "Columns",
    "Event",
    "EventKind",
    "ExchangeError",
    "FantocciniError",
    "Flow",
    "Goal",
    "HalfSpace",
    "Handle",
    "Input",
    "InputDerivative",
    "InputError",
    "Inputs",
    "Linearisation",
    "Marionette",
    "MissingLibraryError",
    "Mode",
    "Modes",
    "Partials",
    "Passage",
    "Performance",
    "PlanResult",
    "PlanStatus",
    "Problem",
    "Puppet",
    "PuppetError",
    "Recording",
    "ReductionReport",
    "Sensitivity",
    "SimulationError",
    "State",
    "StateError",
    "Status",
    "StepLinearisation",
    "Stepper",
    "StoreError",
    "SweepResult",
    "SweepStopped",
    "Trajectories",
    "Trajectory",
    "Trial",
    "UnknownNameError",
    "World",
    "__version__",
    "load",
    "load_problem",
    "loads",
    "plan",
    "puppets",
    "sensitivity",
    "show",
    "simulate",
    "solve",
    "sweep",
    "validate_reduction",
]
