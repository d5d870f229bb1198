"""Run of a puppet that hands move, tick by tick; it continues after any motion of the hands."""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, VecD, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import contact_points
from fantoccini.motion import ContactPoints, State
from fantoccini.theatre.perform import change
from fantoccini.theatre.perform.grip import HandLimiter
from fantoccini.theatre.perform.hands import Hands


class TickRun:
    """Run of a puppet that hands move, tick by tick.

    Attributes:
        performed: puppet as it is simulated, with its present winches.
        tick: duration of a tick [s].
        stepper: present stepper; :meth:`restart` creates another one.

    Args:
        performed: puppet with winches that slip at the grip.
        hands: hands of the puppet.
        x: state; its time is that of the run's start.
        grip: largest tension of a string [N].
        tick: duration of a tick [s].
        steps: number of time steps in a tick.
    """

    def __init__(
        self, performed: Marionette, hands: Hands, x: State, grip: float, tick: float, steps: int
    ):
        self.performed = performed
        self.tick, self._hands, self._steps = tick, hands, steps
        self._limiter = HandLimiter(performed, hands, grip)
        self._since = x.t
        self.stepper = self._stepper_from(x)

    @property
    def x(self) -> State:
        """State, at the stepper's time."""
        return self.stepper.state

    @property
    def t(self) -> float:
        """Time of the run [s]."""
        return self._since + self.stepper.state.t

    @property
    def tension(self) -> Array:
        """(n_strings,) tensions [N]."""
        return self.stepper.tension[: len(self.performed.tree.strings)].copy()

    @property
    def contact(self) -> ContactPoints | None:
        """Contact points at the end of the last tick; None for a puppet without contact."""
        stepper, known = self.stepper, self.stepper.marionette.contacts
        if known is None:
            return None
        points = contact_points(stepper.contacts, known.names)
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
        self._since = self.t
        self.stepper = self._stepper_from(x)

    def stop_hands(self) -> None:
        """Continues from the last accepted state with the hands at rest."""
        still = self.x.replace(v_K=np.zeros_like(self.x.v_K))
        for x in (change.permitted(self.performed, still), still.replace(v_D=0.0 * still.v_D)):
            self.restart(x)
            self.stepper.advance(self.tick, throw=False)
            if self.stepper.arrived:
                return
        # If that fails too, the puppet stays where it is.
        self.restart(still.replace(v_D=0.0 * still.v_D))
        self._since += self.tick

    def _stepper_from(self, x: State) -> Stepper:
        marionette = self.performed
        options = marionette.run_options(dt=self.tick / self._steps, save_every=self._steps)
        return Stepper(marionette, x.replace(t=0.0), "timestepping", options)
