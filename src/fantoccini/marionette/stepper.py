"""Stepper: a run that is advanced piece by piece, for everything that happens on line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, SimulationError, Status
from fantoccini.marionette.checks import check_inputs, check_speed
from fantoccini.motion import Input, State
from fantoccini.runtime import Run, RunOptions

if TYPE_CHECKING:
    from fantoccini.marionette.handle import Marionette

Law = Callable[[State], "Array | Mapping[str, float]"]


class Stepper:
    """Advances a puppet under inputs that are decided on the way.

    The input of the paper's Eq. 12 is the acceleration of the driven coordinates, u_L: held
    constant over a piece, it keeps their velocity continuous whatever is asked for.

    Attributes:
        state: where the puppet is now.
        tension: (n_rows,) forces of strings and limits at ``state`` [N or N m].
        rows: (n, width) what the last advance wrote, laid out as ``marionette.row_layout`` says;
            before the first one, the start.
        events: (n, 5) that it met: time, kind, row, impulse, speed.

    Args:
        marionette: the puppet.
        x0: where it starts.
        method: ``timestepping``, ``variational`` or ``event``.
        options: numbers that steer the run.
    """

    def __init__(
        self,
        marionette: Marionette,
        x0: State,
        method: Literal["timestepping", "variational", "event"],
        options: RunOptions,
    ):
        self.marionette = marionette
        self.method = method
        self.state, self._end = x0, x0.t
        hold = Input.hold(marionette).bound(x0.q_K).shifted(x0.t)
        self._run = Run(
            marionette.library_of(method), method, options, x0, marionette.p, marionette.winches,
            hold,
        )  # fmt: skip
        rows, self.events = self._run.present()
        self.rows = rows[-1:]
        self.tension = marionette.row_layout.split(self.rows)["tension"][0]

    @property
    def status(self) -> Status:
        """How the last advance ended; ``LOST_STEPS`` or ``RUNAWAY`` once a drive was too weak."""
        return self._run.status

    @property
    def arrived(self) -> bool:
        """Whether the last advance got as far as it should, be it with lost steps."""
        status = self._run.status
        return status is Status.DONE or (status in ARRIVED and self.state.t >= self._end)

    def advance(
        self,
        duration: float,
        acc_K: Array | Mapping[str, float] | None = None,
        *,
        inputs: Input | None = None,
        u_D: Array | None = None,
        throw: bool = True,
    ) -> State:
        """Advances by ``duration`` [s].

        Args:
            duration: > 0.
            acc_K: (n_vK,) accelerations of the driven coordinates, or by name (the others 0);
                constant over the piece. The driven velocities go on from where they are.
            inputs: instead: inputs in absolute time that start where the puppet is.
            u_D: (n_vD,) user forces, constant over the piece (not together with ``inputs``).
            throw: raise :class:`SimulationError` when the run cannot go on. Steps that steppers
                lose do not end it: ``status`` and ``events`` tell of them.

        Returns:
            The state reached.
        """
        if not duration > 0:
            raise ValueError(f"duration is {duration}; it must be positive")
        if inputs is not None and (acc_K is not None or u_D is not None):
            raise ValueError("inputs carry their own motion and forces: give them or acc_K and u_D")
        if inputs is None:
            chosen = self._piece(duration, acc_K, u_D)
        else:
            t = self.state.t
            check_inputs(self.marionette, inputs, t, t + duration)
            chosen = inputs.bound(self.state.q_K, t)
            check_speed(self.marionette, self.state, chosen)
        self._run.set_input(chosen)
        self._end = self.state.t + duration
        written = list(self._run.advance(self._end))
        self.rows = np.concatenate([rows for rows, _ in written])
        self.events = np.concatenate([events for _, events in written])
        if len(self.rows):
            split = self.marionette.row_layout.split(self.rows[-1:])
            motion = {name: split[name][0] for name in ("q_D", "v_D", "q_K", "v_K", "slip")}
            self.state = State(float(split["t"][0]), taut=split["taut"][0] > 0, **motion)
            self.tension = split["tension"][0]
        if not self.arrived and throw:
            raise SimulationError(self.status, f"at t = {self.state.t:.6g} s")
        return self.state

    def run(self, t_end: float, law: Law, rate: float) -> list[State]:
        """Advances to ``t_end``, asking a feedback law ``rate`` times a second.

        Args:
            t_end: [s].
            law: state -> accelerations of the driven coordinates, as in :meth:`advance`.
            rate: [1/s].

        Returns:
            The states at which the law was asked, and the last one.
        """
        states = [self.state]
        n = max(1, round((t_end - self.state.t) * rate))
        times = np.linspace(self.state.t, t_end, n + 1)
        for t in times[1:]:
            self.advance(t - self.state.t, law(self.state))
            states.append(self.state)
        return states

    def _piece(self, duration: float, acc_K, u_D: Array | None) -> Input:
        table = self.marionette.coordinates
        acc = np.zeros(table.n_vK)
        if isinstance(acc_K, Mapping):
            for name, value in acc_K.items():
                acc[self.marionette.driven_velocity(name)] = value
        elif acc_K is not None:
            if np.shape(acc_K) != acc.shape:
                raise ValueError(f"acc_K has the shape {np.shape(acc_K)}; it must be {acc.shape}")
            acc[:] = acc_K
        x = self.state
        # A trace longer than the piece, so that its last instant still lies within the input.
        times = x.t + np.array([0.0, (1.0 + 1e-6) * duration])
        made = Input.segments(table, times, x.q_K, x.v_K, acc[None])
        if u_D is not None:
            forces = {
                name: [(times[0], force), (times[1], force)]
                for name, force in zip(table.v_D, u_D, strict=True)
            }
            made = made.with_forces(forces)
        return made
