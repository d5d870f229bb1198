"""Performance: a live puppet and the hands that hold it."""

from __future__ import annotations

from collections.abc import Mapping
from threading import RLock

import numpy as np

from fantoccini.base import Array, ConfigK, Quaternion, StateError, Status, Vec3, check_positive
from fantoccini.dynamics.compiled import check_start
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import contact_points
from fantoccini.motion import ContactPoints, State
from fantoccini.theatre.perform import change
from fantoccini.theatre.perform.grip import TOLERANCES, Holding, gripped
from fantoccini.theatre.perform.handle import Handle, Place, place_of, wanted
from fantoccini.theatre.perform.hands import Hands
from fantoccini.theatre.perform.outside import forces_of
from fantoccini.theatre.perform.player import Player
from fantoccini.theatre.perform.playing import Playing
from fantoccini.theatre.perform.recording import Recorder, Recording
from fantoccini.theatre.perform.reports import Reports

SPEED = 1.5
"""Default bound on the speed of handles and winches [m/s]: a brisk hand."""
ACCELERATION = 10.0
"""Default bound on their acceleration [m/s^2]: about that of gravity."""
STEP = 0.0005
"""Default time step [s]; with twice as much, a limb that whirls at 100 rad/s gains energy."""
_NO_POSES = np.zeros((0, 3, 4))
_ROUNDED_TICKS = 1e-6
"""Part of a tick that a duration may miss by rounding and still complete the tick."""


class Performance(Playing):
    """A puppet in somebody's hands: targets go in, the state comes out, tick by tick.

    The hands follow their targets in the least time that bounded speed and acceleration allow
    (``perform/reach.py``); the driven velocities are continuous. No string pulls harder than
    ``grip``: a hand that pulls where the puppet cannot follow slips and is held back
    (``perform/grip.py``). No target makes it raise, explode or start anew. Other threads may set
    targets while it advances.

    Attributes:
        marionette: the puppet as given; ``performed`` has the winches in use.
        handles: what can be held.
        lengths: string with a driven length -> shortest and longest [m].
        tick: time over which the hands' accelerations are constant [s].
        dt: time step, a whole part of a tick [s].
        speed, acceleration: bounds of handles and winches [m/s, m/s^2].
        grip: largest tension of a string [N].

    Args:
        marionette: the puppet.
        x0: the start state; hanging at rest when not given.
        dt: longest time step [s].
        tick: [s].
        speed: bound on the speed of handles and winches [m/s]; a rotation is as fast
            as the motion 0.4 m off its axis.
        acceleration: bound on their acceleration [m/s^2], likewise.
        grip: [N]; 20 times the puppet's weight when not given.

    Raises:
        StateError: ``x0`` breaks a string or limit.
    """

    def __init__(
        self,
        marionette: Marionette,
        x0: State | None = None,
        *,
        dt: float = STEP,
        tick: float = 1 / 120,
        speed: float = SPEED,
        acceleration: float = ACCELERATION,
        grip: float | None = None,
    ):
        check_positive(dt=dt, tick=tick, speed=speed, acceleration=acceleration)
        if grip is not None:
            check_positive(grip=grip)
        self._lock = RLock()
        self.speed, self.acceleration, self._given_grip = speed, acceleration, grip
        self.tick = float(tick)
        self._steps = max(1, int(np.ceil(tick / dt - 1e-9)))
        self.dt = self.tick / self._steps
        self._recorder: Recorder | None = None
        self._ended: tuple[Recording | None, str] | None = None
        self._remainder = 0.0
        self._reports = Reports()
        self._law, self._pushes = None, {}
        x0 = change.hanging(marionette) if x0 is None else x0
        check_start(marionette.model, x0, "timestepping")
        change.check_steps(marionette, x0, self.dt)
        self._take(marionette, x0)
        self._x0: State | None = x0

    def __repr__(self) -> str:
        return f"<Performance of {self.marionette.name} at {self.t:.3f} s>"

    # -- state ------------------------------------------------------------------------------

    @property
    def handles(self) -> tuple[Handle, ...]:
        """What can be held."""
        return self._hands.handles

    @property
    def lengths(self) -> dict[str, tuple[float, float]]:
        """String with a driven length -> shortest and longest [m]."""
        return dict(self._hands.lengths)

    @property
    def state(self) -> State:
        """The present state, with the time of the performance."""
        with self._lock:
            return self._stepper.state.replace(t=self.t)

    @property
    def t(self) -> float:
        """Time of the performance [s]."""
        with self._lock:
            return self._since + self._stepper.state.t

    @property
    def tension(self) -> Array:
        """(n_strings,) [N]."""
        with self._lock:
            return self._stepper.tension[: len(self.marionette.tree.strings)].copy()

    @property
    def slip(self) -> Array:
        """(n_strings,) lengths let out by slipping winches [m]."""
        with self._lock:
            return np.array(self._stepper.state.slip)

    @property
    def contact(self) -> ContactPoints | None:
        """What touches what at the end of the last tick; None for a puppet without contact."""
        with self._lock:
            stepper, known = self._stepper, self._stepper.model.contacts
            if known is None:
                return None
            found = contact_points(stepper.contacts, known.names)
            return found.at(len(stepper.samples) - 1)

    @property
    def performed(self) -> Marionette:
        """The puppet with the winches in use."""
        return Marionette(self._stepper.model)

    @property
    def lagging(self) -> dict[str, str]:
        """Handles and strings that cannot follow their targets, and why."""
        with self._lock:
            found = self._holding.messages(self.slip)
            return self._reports.added(found, self.t, self._hands.names)

    # -- hands -------------------------------------------------------------------------------

    def place(self, name: str) -> Place:
        """A handle's position (3,) [m] and orientation (w, x, y, z) in the world."""
        with self._lock:
            return self._place(self._hands.handle(name), self._x.q_K)

    def target(self, name: str) -> Place:
        """A handle's target, as :meth:`place`."""
        with self._lock:
            return self._there(name, self._wanted)

    def aim(self, name: str) -> Place:
        """Where a handle is to be now: its target with what is played on top, as :meth:`place`."""
        with self._lock:
            return self._there(name, self._aimed())

    def move(self, name: str, position: Vec3 | None = None, wxyz: Quaternion | None = None) -> None:
        """Sets the target of a handle; parts that its joint cannot reach are projected away.

        A joint that drives move in part moves as a whole by the handle of its body or string end;
        ``bar.carriage1`` and so on are handles of its parts. A target on a moving body moves with
        the body.

        Args:
            name: of the handle.
            position: (3,) in the world [m]; unchanged when not given.
            wxyz: (4,) orientation in the world; likewise.

        Raises:
            UnknownNameError: no handle is called that.
            StateError: a position or orientation that is none, or a law moves the hands.
        """
        with self._lock:
            self._refuse_targets()
            handle, found = self._hands.handle(name), []
            for h in (*self._hands.carriers(handle), handle):
                about = self._wanted[h.q], self._poses(h), position, wxyz
                found.append((h.q, wanted(self.marionette, h, *about)))
            for q, there in found:
                self._wanted[q] = there

    def wind(self, string: str, length: float) -> None:
        """Sets the target length of a driven string [m], clipped to its range.

        Raises:
            UnknownNameError: no string with a driven length is called that.
            StateError: the length is not a finite number, or a law moves the hands.
        """
        with self._lock:
            self._refuse_targets()
            place = self._hands.length_place(string)
            if not np.isfinite(length):
                raise StateError(f"{string}: found {length}; a length is a finite number")
            self._wanted[place] = np.clip(length, *self._hands.lengths[string])

    def length(self, string: str) -> float:
        """The present length of a driven string [m]."""
        with self._lock:
            return float(self._x.q_K[self._hands.length_place(string)])

    def wanted_length(self, string: str) -> float:
        """The target length of a driven string [m]."""
        with self._lock:
            return float(self._wanted[self._hands.length_place(string)])

    # -- time --------------------------------------------------------------------------------

    def advance(self, duration: float) -> State:
        """Advances by the whole ticks in ``duration`` [s]; the remainder counts the next time."""
        if not (np.isfinite(duration) and duration >= 0):
            raise ValueError(f"duration is {duration}; it must be 0 or more")
        self._remainder += duration / self.tick
        n = int(np.floor(self._remainder + _ROUNDED_TICKS))
        self._remainder -= n
        for _ in range(n):
            self._tick()
        return self.state

    def step(self) -> State:
        """Advances by one tick."""
        self._tick()
        return self.state

    def reset(self) -> None:
        """Returns to the start, with the hands there and at rest."""
        with self._lock:
            self._end_recording("the puppet was set back to its start")
            self._remainder = 0.0
            self._reports.clear()
            self._take(self.marionette, self._start())

    def _start(self) -> State:
        if self._x0 is None:
            self._x0 = change.hanging(self.marionette)
        return self._x0

    def _go_to(self, x: State) -> None:
        self._end_recording("a take was begun")
        x = change.permitted(self._performed, x)
        self._take(self.marionette, x.replace(t=self.t), self._hands.lengths)

    # -- another puppet ----------------------------------------------------------------------

    def set_parameters(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Continues with other values of the puppet's parameters.

        Returns:
            Messages about what could not be kept.

        Raises:
            UnknownNameError, StateError, PuppetError: a value that the puppet cannot have; nothing
                changes then.
        """
        marionette = self.marionette.with_parameters(values)
        with self._lock:
            lost = self._replace(marionette, self.state, "parameters were changed")
            self._x0 = None  # computed by reset
        return lost

    def replace(self, marionette: Marionette) -> tuple[str, ...]:
        """Continues with a changed puppet; coordinates that keep their names keep their values.

        What is played goes on if all driven coordinates do.

        Args:
            marionette: the puppet from now on.

        Returns:
            Messages about what could not be kept.

        Raises:
            BuildError, PuppetError, StateError: it cannot be compiled, or the steps are too long
                for its chains; nothing changes then.
        """
        marionette.compile()
        start = change.hanging(marionette)
        with self._lock:
            return self._replace(marionette, start, "the puppet was changed")

    def _replace(self, marionette: Marionette, start: State, why: str) -> tuple[str, ...]:
        change.check_steps(marionette, start, self.dt)
        self._end_recording(why)
        before, lengths, wanted_before = self.marionette, self._hands.lengths, self._wanted
        x, lost = change.carried(before, self.state, marionette, start)
        x = change.permitted(gripped(marionette, self._grip_of(marionette)), x)
        player, ended = self._player.carried(before, marionette)
        self._take(marionette, x, Hands.ranges_of(marionette, start, self.dt) | lengths, player)
        places = {name: i for i, name in enumerate(before.coordinates.q_K)}
        for i, name in enumerate(marionette.coordinates.q_K):
            if name in places:
                self._wanted[i] = wanted_before[places[name]]
        self._x0 = start
        return lost + ended

    # -- recording ---------------------------------------------------------------------------

    @property
    def recording(self) -> bool:
        """Whether what happens is recorded."""
        return self._recorder is not None

    def record(self) -> None:
        """Starts a recording; drops an earlier one that :meth:`stop` has not returned."""
        with self._lock:
            self._pushes.clear()  # a recording keeps none
            x = change.permitted(self.performed, self._x.replace(t=0.0))
            self._restart(x)
            self._recorder = Recorder(self._stepper, self.tick)
            self._ended = None

    def stop(self) -> Recording:
        """Ends and returns the recording, also if it has ended by itself.

        Raises:
            StateError: nothing was recorded.
        """
        with self._lock:
            if self._recorder is not None and not len(self._recorder):
                self._tick()
            self._end_recording("")
            made, why = self._ended or (None, "")
            self._ended = None
        if made is None:
            raise StateError(f"nothing was recorded{': ' + why if why else ''}")
        return made

    # -- inside ------------------------------------------------------------------------------

    @property
    def _x(self) -> State:
        return self._stepper.state

    def _place(self, handle: Handle, q_K: ConfigK) -> Place:
        return place_of(self.marionette, handle, q_K, self._poses(handle))

    def _there(self, name: str, q_K: ConfigK) -> Place:
        """The place of a handle at wanted coordinates."""
        handle = self._hands.handle(name)
        r, wxyz = self._place(handle, q_K)
        if parts := self._hands.carriers(handle):
            poses = self.marionette.poses(self._x.q_D, self._x.q_K)
            ways = [self._place(h, q_K)[0] - poses[h.link, :, 3] for h in parts]
            r = r + np.sum(ways, axis=0)
        return r, wxyz

    def _poses(self, handle: Handle) -> Array:
        """(n_links, 3, 4) of the links; empty where nothing moves the handle's joint."""
        if handle.base is not None:
            return _NO_POSES
        return self.marionette.poses(self._x.q_D, self._x.q_K)

    def _grip_of(self, marionette: Marionette) -> float:
        return self._given_grip or TOLERANCES.max_tension * (marionette.weight or 1.0)

    def _take(
        self,
        marionette: Marionette,
        x: State,
        lengths: dict[str, tuple[float, float]] | None = None,
        player: Player | None = None,
    ) -> None:
        """Continues from a state of a puppet, with targets where the hands are.

        Args:
            marionette: the puppet.
            x: the state.
            lengths: string -> its range [m]; by default about the lengths of the state.
            player: goes on with what it plays; otherwise nothing is played.
        """
        self.marionette = marionette
        self._reports.forget_motors()
        self.let(None)
        self._pushes.clear()
        self.grip = self._grip_of(marionette)
        self._performed = gripped(marionette, self.grip)
        lengths = Hands.ranges_of(marionette, x, self.dt) if lengths is None else lengths
        self._hands = Hands.of(marionette, x, self.speed, self.acceleration, lengths)
        self._holding = Holding(self._performed, self._hands, self.grip)
        most = np.array([list(bound.values()) for bound in self._hands.each()[1:]])
        self._player = player or Player(most, self.tick)
        self._player.bound(most)
        self._wanted = np.array(x.q_K)
        self._since = x.t
        self._restart(x.replace(t=0.0), keep=False)

    def _restart(self, x: State, keep: bool = True) -> None:
        """Makes a stepper from a state with t = 0; the time of the performance goes on."""
        if keep:
            self._since = self.t
        options = self._performed.model.run_options(dt=self.dt, save_every=self._steps)
        self._stepper = Stepper(self._performed.model, x, "timestepping", options)

    def _tick(self) -> None:
        """Advances by a tick; if the stepper fails, stops the hands and starts a new one."""
        with self._lock:
            x, stepper = self._x, self._stepper
            if self._law is None:
                velocity = self._velocity(x)
            else:
                asked = self._law.acceleration(x.replace(t=self.t))
                velocity = self._hands.bounded(x.v_K + self.tick * asked)
                self._wanted = np.array(x.q_K)
            velocity = self._holding.hold(x, stepper.tension, velocity)
            acc_K = self._hands.bounded_acceleration(velocity, x.v_K, self.tick)
            u_D = forces_of(self.marionette, x, self._pushes)
            stepper.advance(self.tick, acc_K, u_D=u_D, throw=False)
            if stepper.arrived:
                if self._recorder is not None:
                    self._recorder.add(acc_K, stepper)
                self._reports.note_motors(self.t, self.marionette.tree, stepper)
                return
            self._stop_hands(stepper.status)

    def _stop_hands(self, status: Status) -> None:
        """Continues from the last accepted state with the hands at rest."""
        self._reports.stop(self.t, status.message)
        self._end_recording(f"the hands were stopped: {status.message}")
        still = self._x.replace(v_K=np.zeros_like(self._x.v_K))
        for x in (change.permitted(self._performed, still), still.replace(v_D=0.0 * still.v_D)):
            self._restart(x.replace(t=0.0))
            self._stepper.advance(self.tick, throw=False)
            if self._stepper.arrived:
                return
        # Not even that works: the puppet stays where it is.
        self._restart(still.replace(t=0.0, v_D=0.0 * still.v_D))
        self._since += self.tick

    def _end_recording(self, why: str) -> None:
        if self._recorder is not None:
            self._ended = (self._recorder.finished(self._steps, why), why)
            self._recorder = None
