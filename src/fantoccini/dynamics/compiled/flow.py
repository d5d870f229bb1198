"""Flow: a puppet's motion between two events as an ordinary differential equation.

y consists of the dynamic coordinates q_D, their velocities v_D and the slip of winches, the lengths
that they have let out; the driven coordinates q_K are functions of t. A taut string pulls, a slack
one does not.
"""

from __future__ import annotations

import numpy as np

from fantoccini.base import Array, SimulationError, Status
from fantoccini.dynamics.compiled.checks import bind_input, check_start, refuse_contact
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.kernel.runtime import FrozenFlow
from fantoccini.motion import Input, State

_HOLD_TIME = 1e9
"""Time for which the driven coordinates hold still without inputs [s]."""


class Flow:
    """Motion ydot = f(t, y), Eqs. 10-12, with strings and limits taut at the start held taut.

    A smooth ordinary differential equation in y = (q_D, v_D, work, loss, slip loss), for any
    integrator::

        flow = arm.flow(x0, inputs)
        solution = scipy.integrate.solve_ivp(flow.rate, (flow.t0, 0.3), flow.y0, method="Radau")
        x = flow.state(solution.t[-1], solution.y[:, -1])

    It equals the puppet's motion until one of :meth:`guards` turns positive, at most until
    :attr:`t_end`; ``fan.simulate`` continues across events. It must not be shared by threads.

    Attributes:
        t0: time of the start [s].
        t_end: time at which the inputs' next piece begins, or a winch that rewinds begins to brake
            or stops; inf without one [s].
        y0: (n_y,) q_D [rad, m or 1] and v_D [rad/s or m/s] at the start, work of the inputs, loss
            to damping and drag, loss of slipping winches, 0 at the start [J].
        rows: names of the strings and limits, in the order of the guards.
        taut: (n_rows,) mask of the held rows.

    Args:
        marionette: the puppet.
        x0: start state; no string may be longer than its length.
        inputs: motion of the driven coordinates; by default they hold still.
    """

    def __init__(self, marionette: CompiledPuppet, x0: State, inputs: Input | None = None):
        refuse_contact(marionette, "the flow for external integrators")
        check_start(marionette, x0)
        inputs_or_hold = (
            Input.hold(marionette, _HOLD_TIME).shifted(x0.t) if inputs is None else inputs
        )
        self._inputs = bind_input(marionette, inputs_or_hold, x0.q_K, x0.v_K, x0.t, x0.t)
        self._run = FrozenFlow(
            marionette.library,
            marionette.run_options(),
            x0,
            marionette.p,
            marionette.winches,
            self._inputs,
        )
        if self._run.status is not Status.RUNNING:
            raise SimulationError(self._run.status, f"at t = {x0.t:.6g} s")
        table = marionette.coordinates
        self._table, self._n_qD, self._n_vD = table, table.n_qD, table.n_vD
        end = self._run.smooth_until(np.inf)
        self.t_end = np.inf if inputs is None and end >= inputs_or_hold.end else end
        self.t0, self.y0 = self._run.t, self._run.y
        self.rows = marionette.tree.row_names
        self.taut = self._run.active_set != 0

    def rate(self, t: float, y: Array) -> Array:
        """Derivative ydot (n_y,) at a time [s] and y (n_y,)."""
        return self._run.rate(t, y)

    def guards(self, t: float, y: Array) -> Array:
        """Functions (n_rows + n_watched,), above 0 where a string or limit would catch or release.

        For a slack row, h divided by the string's length, or a limit's h; for a taut one, minus its
        tension, or the tension beyond its winch's largest, divided by the puppet's weight. The last
        functions belong to the drives that may lose a step or run away.
        """
        return self._run.guards(t, y)

    def state(self, t: float, y: Array) -> State:
        """The state at a time [s] and y (n_y,)."""
        q_K, v_K, _ = self._inputs.evaluate(t)
        q_D, v_D = y[: self._n_qD], y[self._n_qD : self._n_qD + self._n_vD]
        slip = self._run.slip(t, y)
        return State(t, q_D, v_D, q_K, v_K, self.taut, slip, self._table)
