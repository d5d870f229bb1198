"""Live performance: a simulated puppet and the hands that move it.

A tick is the interval at which it advances; a take is a recording of a performance for editing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import wraps
from threading import RLock
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np

from fantoccini.base import Array, StateError, Status, Vec3, check_positive
from fantoccini.dynamics.compiled import check_start
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import ContactPoints, State, check_same_puppet
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.perform import state_transfer
from fantoccini.theatre.perform.grip import TOLERANCES, with_slipping_winches
from fantoccini.theatre.perform.handle import Handle
from fantoccini.theatre.perform.hands import HandBounds, Hands
from fantoccini.theatre.perform.influences import HandLaw, Influences, Push, make_push
from fantoccini.theatre.perform.lanes import lane_names, without_lanes
from fantoccini.theatre.perform.live_recorder import LiveRecorder
from fantoccini.theatre.perform.player import MotionPlayer
from fantoccini.theatre.perform.recording import Recording
from fantoccini.theatre.perform.reports import Reports
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.perform.targets import Targets
from fantoccini.theatre.perform.tick_run import TickRun

DEFAULT_SPEED = 1.5
"""Default bound on the speed of handles and winches [m/s]: that of a quick hand."""
DEFAULT_ACCELERATION = 10.0
"""Default bound on the acceleration of handles and winches [m/s^2]: about that of gravity."""
DEFAULT_TIME_STEP = 0.0005
"""Default time step [s]; with twice as much, a limb that spins at 100 rad/s gains energy."""
_TICK_TOLERANCE = 1e-6
"""Share of a tick that a duration may lack, by rounding, to complete the tick."""

_Params = ParamSpec("_Params")
_Result = TypeVar("_Result")


def _delegated_to_targets(
    method: Callable[Concatenate[Targets, _Params], _Result],
) -> Callable[Concatenate[Performance, _Params], _Result]:
    """Method of a performance that delegates to its targets, under the performance's lock."""

    @wraps(method)
    def locked(self: Performance, /, *args: _Params.args, **kwargs: _Params.kwargs) -> _Result:
        with self._lock:
            return method(self._targets, *args, **kwargs)

    return locked


class Performance:
    """Live puppet whose hands follow targets; it advances tick by tick.

    The hands reach their targets in the least time that bounded speed and acceleration allow
    (``perform/reach.py``); the driven velocities are continuous. No string pulls harder than
    ``grip``: where the puppet cannot follow, its winches slip and the hand slows down
    (``perform/grip.py``). No target causes an error, divergence or a restart. Other threads may set
    targets while it advances.

    Attributes:
        marionette: puppet as given; ``performed`` has the winches in use.
        handles: parts that can be held.
        lengths: string with a driven length -> shortest and longest [m].
        tick: interval over which the hands' accelerations are constant [s].
        dt: time step, a whole fraction of a tick [s].
        speed, acceleration: bounds of handles and winches [m/s, m/s^2].
        grip: largest tension of a string [N].

    Args:
        marionette: puppet.
        x0: start state; hanging at rest by default.
        dt: longest time step [s].
        tick: duration of a tick [s].
        speed: bound on the speed of handles and winches [m/s]; for a rotation, on the speed 0.4 m
            from its axis.
        acceleration: bound on their acceleration [m/s^2], likewise.
        grip: largest tension of a string [N]; 20 times the puppet's weight by default.

    Raises:
        StateError: ``x0`` violates a string or limit.
    """

    def __init__(
        self,
        marionette: Marionette,
        x0: State | None = None,
        *,
        dt: float = DEFAULT_TIME_STEP,
        tick: float = 1 / 120,
        speed: float = DEFAULT_SPEED,
        acceleration: float = DEFAULT_ACCELERATION,
        grip: float | None = None,
    ):
        check_positive(dt=dt, tick=tick, speed=speed, acceleration=acceleration)
        if grip is not None:
            check_positive(grip=grip)
        self._lock = RLock()
        self.speed, self.acceleration, self._user_grip = speed, acceleration, grip
        self.tick = float(tick)
        self._steps_per_tick = max(1, int(np.ceil(tick / dt - 1e-9)))
        self.dt = self.tick / self._steps_per_tick
        self._recorder = LiveRecorder(self.tick, self._steps_per_tick)
        self._remainder = 0.0
        self._reports = Reports()
        self._influences = Influences()
        x0 = state_transfer.initial_state(marionette) if x0 is None else x0
        check_start(marionette, x0, "timestepping")
        state_transfer.check_steps(marionette, x0, self.dt)
        self._set_puppet(marionette, x0)
        self._x0: State | None = x0

    def __repr__(self) -> str:
        return f"<Performance of {self.marionette.name} at {self.t:.3f} s>"

    # -- state ------------------------------------------------------------------------------

    @property
    def handles(self) -> tuple[Handle, ...]:
        """Handles that can be held."""
        return self._hands.handles

    @property
    def lengths(self) -> dict[str, tuple[float, float]]:
        """String with a driven length -> shortest and longest [m]."""
        return dict(self._hands.lengths)

    @property
    def bounds(self) -> HandBounds:
        """Bounds of each driven coordinate."""
        return self._hands.coordinate_bounds()

    @property
    def state(self) -> State:
        """Present state, with the time of the performance."""
        with self._lock:
            return self._run.x.replace(t=self._run.t)

    @property
    def t(self) -> float:
        """Time of the performance [s]."""
        with self._lock:
            return self._run.t

    @property
    def tension(self) -> Array:
        """(n_strings,) tensions [N]."""
        with self._lock:
            return self._run.tension

    @property
    def slip(self) -> Array:
        """(n_strings,) lengths let out by slipping winches [m]."""
        with self._lock:
            return np.array(self._run.x.slip)

    @property
    def contact(self) -> ContactPoints | None:
        """Contact points at the end of the last tick; None for a puppet without contact."""
        with self._lock:
            return self._run.contact

    @property
    def status(self) -> Status:
        """Status of the steps since the last start, reset, recording or stop of the hands."""
        with self._lock:
            return self._run.stepper.status

    @property
    def performed(self) -> Marionette:
        """Puppet with the winches in use."""
        return self._run.marionette

    @property
    def lagging(self) -> dict[str, str]:
        """Handles and strings that cannot follow their targets -> reason."""
        with self._lock:
            return self._reports.with_reports(self._run.lagging(), self._run.t, self._hands.names)

    # -- hands -------------------------------------------------------------------------------

    place = _delegated_to_targets(Targets.place)
    target = _delegated_to_targets(Targets.target)
    aim = _delegated_to_targets(Targets.aim)
    move = _delegated_to_targets(Targets.move)
    wind = _delegated_to_targets(Targets.wind)
    length = _delegated_to_targets(Targets.length)
    target_length = _delegated_to_targets(Targets.target_length)
    hold = _delegated_to_targets(Targets.hold)

    def go_home(self) -> None:
        """Returns from all gestures; if there are none, the hands return to their start."""
        with self._lock:
            self._targets.go_home(self._start())

    # -- gestures, takes and scores ----------------------------------------------------------

    play = _delegated_to_targets(Targets.play)
    stop_repeating = _delegated_to_targets(Targets.stop_repeating)
    stop_take = _delegated_to_targets(Targets.stop_take)
    play_score = _delegated_to_targets(Targets.play_score)
    stop_score = _delegated_to_targets(Targets.stop_score)
    leave_lanes = _delegated_to_targets(Targets.leave_lanes)

    @property
    def playing(self) -> tuple[str, ...]:
        """Names of the gestures that move or wait."""
        with self._lock:
            return self._targets.player.playing

    @property
    def lanes(self) -> tuple[str, ...]:
        """Names of lanes for an overdub: strings and joints with driven coordinates."""
        return lane_names(self.marionette.coordinates)

    @property
    def take_time(self) -> float | None:
        """Time within the take [s]; None without one."""
        with self._lock:
            return self._targets.player.take_time

    def play_take(
        self, take: Recording, *, armed: Collection[str] = (), repeat: bool = False
    ) -> None:
        """Sets the puppet to the start of a take, and moves the hands as the take does.

        With :meth:`record` this is an overdub: armed lanes follow the hands, the others repeat the
        take. At its end the hands stay where they are.

        Args:
            take: take of this puppet.
            armed: lanes that the take does not move.
            repeat: whether to repeat it, joined by state, until :meth:`stop_take`.

        Raises:
            StateError: a law moves the hands, or the take turns a driven body by nearly 180
                degrees or more.
            UnknownNameError: no lane has this name.
            ValueError: the take is of another puppet.
        """
        check_same_puppet([self.marionette.coordinates, take.marionette.coordinates])
        motion = without_lanes(Gesture.from_input(take.inputs, name="take"), armed)
        with self._lock:
            self._targets.check_no_law()
            self._recorder.end("a take was begun")
            x = state_transfer.feasible_state(self.performed, take.start).replace(t=self.t)
            self._set_puppet(self.marionette, x, self._hands.lengths)
            self._targets.player.play_take(motion, take.start.v_K, repeat)

    @property
    def score(self) -> ScoreVoice | None:
        """Score that is played or paused, or None."""
        return self._targets.player.score

    def lead_back(self, lanes: Collection[str]) -> None:
        """Returns lanes from the present place of the hands to the score's motion, within bounds.

        The targets of the hands are then those at the start.

        Raises:
            StateError: no score is played, or a law moves the hands.
            UnknownNameError: no lane has this name.
        """
        with self._lock:
            self._targets.lead_back(lanes, self._start())

    # -- a law and pushes --------------------------------------------------------------------

    @property
    def law(self) -> HandLaw | None:
        """Law that moves the hands instead of their targets; None if there is none."""
        return self._influences.law

    def set_hand_law(self, law: HandLaw | None) -> None:
        """Sets a law that moves the hands, such as a :class:`Balance`, within bounds and grip.

        None lets the hands follow targets again, initially their present places. A reset or
        another puppet ends the law, too.
        """
        self._influences.end_law()  # without the lock, which its thread may wait for
        with self._lock:
            if law is not None:
                self._targets.player.clear()
            self._influences.law = law

    @property
    def pushes(self) -> dict[str, Push]:
        """Pushes on bodies, by name."""
        with self._lock:
            return dict(self._influences.pushes)

    def push(self, body: str, force: Vec3 | None, at: Vec3 | None = None) -> None:
        """Applies a force to a body, until the next call.

        Args:
            body: name of the body.
            force: (3,) force in the world [N]; None ends the push.
            at: (3,) point in the body's frame [m]; the centre of mass by default.

        Raises:
            UnknownNameError: no body has this name.
            StateError: a vector does not consist of three finite numbers, or a recording is in
                progress, which cannot contain pushes.
        """
        push = make_push(self.marionette, body, np.zeros(3) if force is None else force, at)
        with self._lock:
            if force is None:
                self._influences.pushes.pop(body, None)
                return
            if self.recording:
                raise StateError("a recording cannot contain pushes; stop it first")
            self._influences.pushes[body] = push

    # -- time --------------------------------------------------------------------------------

    def advance(self, duration: float) -> State:
        """Advances by the whole ticks in ``duration`` [s]; the remainder is added to the next."""
        if not (np.isfinite(duration) and duration >= 0):
            raise ValueError(f"duration is {duration}; it must be 0 or more")
        self._remainder += duration / self.tick
        n_ticks = int(np.floor(self._remainder + _TICK_TOLERANCE))
        self._remainder -= n_ticks
        for _ in range(n_ticks):
            self._tick()
        return self.state

    def step(self) -> State:
        """Advances by one tick."""
        self._tick()
        return self.state

    def reset(self) -> None:
        """Returns to the start, with the hands there at rest."""
        with self._lock:
            self._recorder.end("the puppet was set back to its start")
            self._remainder = 0.0
            self._reports.clear()
            self._set_puppet(self.marionette, self._start())

    def _start(self) -> State:
        if self._x0 is None:
            self._x0 = state_transfer.initial_state(self.marionette)
        return self._x0

    # -- another puppet ----------------------------------------------------------------------

    def set_parameters(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Continues with changed values of the puppet's parameters.

        Returns:
            Messages about lost coordinates and gestures.

        Raises:
            UnknownNameError, StateError, PuppetError: the puppet cannot have a value; nothing
                changes then.
        """
        marionette = self.marionette.with_parameters(values)
        with self._lock:
            messages = self._replace(marionette, self.state, "parameters were changed")
            self._x0 = None  # computed by reset
        return messages

    def replace(self, marionette: Marionette) -> tuple[str, ...]:
        """Continues with a changed puppet; coordinates that exist in both keep their values.

        Gestures, takes and scores continue if all driven coordinates do.

        Args:
            marionette: changed puppet.

        Returns:
            Messages about lost and new coordinates, and about lost gestures.

        Raises:
            BuildError, PuppetError, StateError: it cannot be compiled, or the steps are too long
                for its chains; nothing changes then.
        """
        marionette.compile()
        start = state_transfer.initial_state(marionette)
        with self._lock:
            return self._replace(marionette, start, "the puppet was changed")

    def _replace(self, marionette: Marionette, start: State, reason: str) -> tuple[str, ...]:
        state_transfer.check_steps(marionette, start, self.dt)
        self._recorder.end(reason)
        old_marionette, old_targets = self.marionette, self._targets
        x, messages = state_transfer.transfer_state(old_marionette, self.state, marionette, start)
        simulated = with_slipping_winches(marionette, self._grip_of(marionette))
        x = state_transfer.feasible_state(simulated, x)
        player, ended_messages = old_targets.player.transferred(old_marionette, marionette)
        ranges = Hands.default_ranges(marionette, start, self.dt) | self._hands.lengths
        self._set_puppet(marionette, x, ranges, player)
        self._targets.copy_targets(old_targets)
        self._x0 = start
        return messages + ended_messages

    # -- recording ---------------------------------------------------------------------------

    @property
    def recording(self) -> bool:
        """Whether a recording is in progress."""
        return self._recorder.is_recording

    def record(self) -> None:
        """Starts a recording; drops an earlier one that :meth:`stop` has not returned."""
        with self._lock:
            self._influences.pushes.clear()  # a recording cannot contain pushes
            self._run.restart(state_transfer.feasible_state(self.performed, self._run.x))
            self._recorder.start(self._run.marionette, self._run.stepper)

    def stop(self) -> Recording:
        """Ends the recording, unless it has ended by itself, and returns it.

        Raises:
            StateError: nothing was recorded.
        """
        with self._lock:
            if self._recorder.is_empty:
                self._tick()
            return self._recorder.take()

    # -- internal ----------------------------------------------------------------------------

    def _grip_of(self, marionette: Marionette) -> float:
        return self._user_grip or TOLERANCES.max_tension * (marionette.weight or 1.0)

    def _set_puppet(
        self,
        marionette: Marionette,
        x: State,
        ranges: dict[str, tuple[float, float]] | None = None,
        player: MotionPlayer | None = None,
    ) -> None:
        """Sets the puppet at a state, with targets at the present places of the hands.

        Args:
            marionette: puppet.
            x: state.
            ranges: string -> its range [m]; by default around the lengths of the state.
            player: player that continues; by default nothing is played.
        """
        self.marionette = marionette
        self._reports.forget_motors()
        self._influences.clear()
        self.grip = self._grip_of(marionette)
        ranges = Hands.default_ranges(marionette, x, self.dt) if ranges is None else ranges
        self._hands = Hands.for_puppet(marionette, x, self.speed, self.acceleration, ranges)
        performed = with_slipping_winches(marionette, self.grip)
        self._run = TickRun(performed, self._hands, x, self.grip, self.tick, self._steps_per_tick)
        self._targets = Targets(self._hands, self._run, self._influences, player)

    def _tick(self) -> None:
        """Advances by a tick; if the stepper fails, stops the hands and starts a new stepper."""
        with self._lock:
            run = self._run
            u_D = self._influences.forces(self.marionette, run.x)
            acc_K = run.advance(self._targets.velocity(), u_D)
            if run.stepper.arrived:
                self._recorder.add(acc_K, run.stepper)
                self._reports.note_motors(run.t, self.marionette.tree, run.stepper)
                return
            reason = run.stepper.status.message
            self._reports.stop(run.t, reason)
            self._recorder.end(f"the hands were stopped: {reason}")
            run.stop_hands()
