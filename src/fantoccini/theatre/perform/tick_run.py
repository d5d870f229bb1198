"""Run of a puppet that hands move, tick by tick; it continues after any motion of the hands.

A tick is the interval at which a performance advances. v_D and v_K are the dynamic and the driven
velocities, acc_K the accelerations of the hands; the grip is the tension at which a hand lets a
string slip.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, VecD, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import contact_points
from fantoccini.motion import ContactPoints, State
from fantoccini.theatre.perform import state_transfer
from fantoccini.theatre.perform.grip import HandLimiter
from fantoccini.theatre.perform.hands import Hands


class TickRun:
    """Run of a puppet that hands move, tick by tick.

    Attributes:
        marionette: puppet as it is simulated, with its present winches.
        tick: duration of a tick [s].
        stepper: present stepper; :meth:`restart` creates another one.

    Args:
        marionette: puppet with winches that slip at the grip.
        hands: hands of the puppet.
        x: state; its time is that of the run's start.
        grip: largest tension of a string [N].
        tick: duration of a tick [s].
        steps_per_tick: number of time steps in a tick.
    """

    def __init__(
        self,
        marionette: Marionette,
        hands: Hands,
        x: State,
        grip: float,
        tick: float,
        steps_per_tick: int,
    ):
        self.marionette = marionette
        self.tick, self._hands, self._steps_per_tick = tick, hands, steps_per_tick
        self._limiter = HandLimiter(marionette, hands, grip)
        self._start_time = x.t
        self.stepper = self._stepper_from(x)

    @property
    def x(self) -> State:
        """State, at the stepper's time."""
        return self.stepper.state

    @property
    def t(self) -> float:
        """Time of the run [s]."""
        return self._start_time + self.stepper.state.t

    @property
    def tension(self) -> Array:
        """(n_strings,) tensions [N]."""
        return self.stepper.tension[: len(self.marionette.tree.strings)].copy()

    @property
    def contact(self) -> ContactPoints | None:
        """Contact points at the end of the last tick; None for a puppet without contact."""
        stepper, contacts = self.stepper, self.stepper.marionette.contacts
        if contacts is None:
            return None
        points = contact_points(stepper.contacts, contacts.names)
        return points.at_sample(len(stepper.samples) - 1)

    def lagging(self) -> dict[str, list[str]]:
        """Reasons why handles and strings lag, by name."""
        return self._limiter.messages(self.x.slip)

    def advance(self, velocity: VecK, u_D: VecD | None) -> VecK:
        """Advances by a tick; returns the accelerations (n_vK,) of the driven coordinates.

        ``stepper.arrived`` is False after a failure; :meth:`stop_hands` then continues.

        Args:
            velocity: (n_vK,) wanted velocities at the end of the tick.
            u_D: (n_vD,) generalised forces.
        """
        x = self.x
        velocity = self._limiter.limited(x, self.stepper.tension, velocity)
        acc_K = self._hands.bounded_acceleration(velocity, x.v_K, self.tick)
        self.stepper.advance(self.tick, acc_K, u_D=u_D, throw=False)
        return acc_K

    def restart(self, x: State) -> None:
        """Continues from a state, with a stepper that begins at t = 0."""
        self._start_time = self.t
        self.stepper = self._stepper_from(x)

    def stop_hands(self) -> None:
        """Continues from the last accepted state with the hands at rest."""
        resting = self.x.replace(v_K=np.zeros_like(self.x.v_K))
        for x in (
            state_transfer.feasible_state(self.marionette, resting),
            resting.replace(v_D=0.0 * resting.v_D),
        ):
            self.restart(x)
            self.stepper.advance(self.tick, throw=False)
            if self.stepper.arrived:
                return
        # If that fails too, the puppet stays where it is.
        self.restart(resting.replace(v_D=0.0 * resting.v_D))
        self._start_time += self.tick

    def _stepper_from(self, x: State) -> Stepper:
        marionette = self.marionette
        options = marionette.run_options(
            dt=self.tick / self._steps_per_tick, save_every=self._steps_per_tick
        )
        return Stepper(marionette, x.replace(t=0.0), "timestepping", options)
