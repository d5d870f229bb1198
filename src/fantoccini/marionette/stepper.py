"""Stepper: a run that is advanced piece by piece, for everything that happens on line."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, SimulationError, Status, UnknownNameError
from fantoccini.marionette.checks import check_rows, ready
from fantoccini.marionette.model import Model
from fantoccini.marionette.redundant import STOPPED_BY, Contradiction, contradiction
from fantoccini.marionette.vectors import check_positive, vector
from fantoccini.motion import Input, State
from fantoccini.motion.pieces import constant_acceleration
from fantoccini.motion.polynomial import N_COEF
from fantoccini.runtime import Run, RunOptions
from fantoccini.tree import CoordinateTable

Law = Callable[[State], "Array | Mapping[str, float]"]


class Stepper:
    """Advances a puppet under inputs that are decided on the way.

    The input of the paper's Eq. 12 is the acceleration of the driven coordinates, u_L: held
    constant over a piece, it keeps their velocity continuous whatever is asked for.

    ``copy.copy``, ``copy.deepcopy`` and ``pickle`` give a stepper that goes on by itself, to the
    same bits as this one. A pickle that is loaded beside another compiled library of the puppet
    goes on from the state alone: books, lost steps and velocity products begin anew.

    Attributes:
        state: where the puppet is now.
        tension: (n_rows,) forces of strings and limits at ``state`` [N or N m].
        rows: (n, width) what the last advance wrote, laid out as ``model.row_layout`` says;
            before the first one, the start.
        events: (n, 5) that it met: time, kind, row, impulse, speed.
        contradiction: what redundant strings asked for where the status is ``REDUNDANT_STRINGS``,
            else None.

    Args:
        model: the puppet.
        x0: where it starts.
        method: ``timestepping``, ``variational`` or ``event``.
        options: numbers that steer the run; its bound on memory is that of one advance.
    """

    def __init__(
        self,
        model: Model,
        x0: State,
        method: Literal["timestepping", "variational", "event"],
        options: RunOptions,
    ):
        self.model = model
        self.method = method
        self.state, self._end = x0.replace(coordinates=model.coordinates), x0.t
        self._options, self._run = options, self._begun(options)
        rows, self.events = self._run.present()
        self.rows = rows[-1:]
        self.tension = model.row_layout.split(self.rows)["tension"][0]
        self.contradiction: Contradiction | None = None

    def _begun(self, options: RunOptions) -> Run:
        """A run from the present state, with the driven velocities that it has."""
        m, x = self.model, self.state
        times = np.array([x.t, x.t + options.dt])
        still = np.zeros((1, len(x.v_K)))
        coasts = Input(
            m.coordinates, times, *constant_acceleration(m.coordinates, times, x.q_K, x.v_K, still),
            np.ones(len(x.v_K), dtype=bool),
        )  # fmt: skip
        return Run(
            m.compiled.library_of(self.method), self.method, options, x, m.p, m.winches, coasts
        )

    def __getstate__(self) -> dict[str, Any]:
        # What is underway lives in the library, which gives it as bytes.
        return {name: x for name, x in vars(self).items() if name != "_run"} | {
            "_status": int(self.status),
            "_memory": (self._run.library.key, self._run.checkpoint()),
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        kept = dict(kept)
        status, (library, memory) = Status(kept.pop("_status")), kept.pop("_memory")
        self.__dict__.update(kept)
        self._run = self._begun(self._options)
        self._run.present()
        if self._run.library.key == library:
            self._run.restore(memory)
        if status not in (Status.DONE, Status.RUNNING):
            self._run.status = status

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
            duration: > 0 and finite.
            acc_K: (n_vK,) accelerations of the driven coordinates, or by name (the others 0);
                constant over the piece. The driven velocities go on from where they are.
            inputs: instead: inputs in absolute time that start where the puppet is.
            u_D: (n_vD,) user forces, constant over the piece (not together with ``inputs``).
            throw: raise :class:`SimulationError` when the run cannot go on. Steps that steppers
                lose do not end it: ``status`` and ``events`` tell of them.

        Ctrl-C leaves the stepper in the state reached, from which it can be advanced again.

        Returns:
            The state reached.
        """
        if not 0 < duration < np.inf:
            raise ValueError(f"duration is {duration}; it must be positive and finite")
        end = self.state.t + duration
        check_rows(self.model, self.method, self._options, self.state.t, end)
        if inputs is not None and (acc_K is not None or u_D is not None):
            raise ValueError("inputs carry their own motion and forces: give them or acc_K and u_D")
        if inputs is None:
            chosen = self._piece(duration, acc_K, u_D)
        else:
            t = self.state.t
            chosen = ready(self.model, inputs, self.state.q_K, self.state.v_K, t, end)
        self._run.set_input(chosen)
        written, self._end = [], end
        try:
            written.extend(self._run.advance(end))
        except BaseException:
            written.append(self._run.present())
            raise
        finally:
            self._take(written)
        self._diagnose()
        if not self.arrived and throw:
            where = f"at t = {self.state.t:.6g} s"
            if self.contradiction:
                where += f": {self.contradiction}"
            raise SimulationError(self.status, where)
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
        check_positive(rate=rate)
        if not t_end > self.state.t:
            raise ValueError(f"t_end is {t_end}; it must be later than now, {self.state.t:g} s")
        states = [self.state]
        n = max(1, round((t_end - self.state.t) * rate))
        times = np.linspace(self.state.t, t_end, n + 1)
        for t in times[1:]:
            self.advance(t - self.state.t, law(self.state))
            states.append(self.state)
        return states

    def _take(self, written: list[tuple[Array, Array]]) -> None:
        """Makes pieces (rows, events) the last advance's, and their last row the state."""
        self.rows = np.concatenate([rows for rows, _ in written])
        self.events = np.concatenate([events for _, events in written])
        if not len(self.rows):
            return
        split = self.model.row_layout.split(self.rows[-1:])
        motion = {name: split[name][0] for name in ("q_D", "v_D", "q_K", "v_K", "slip")}
        self.state = State(
            float(split["t"][0]), taut=split["taut"][0] > 0, **motion,
            coordinates=self.model.coordinates,
        )  # fmt: skip
        self.tension = split["tension"][0]

    def _diagnose(self) -> None:
        """Says so where redundant strings stopped the run."""
        if self.status not in STOPPED_BY or not len(self.rows):
            return
        acc_K = self.model.row_layout.split(self.rows[-1:])["acc_K"][0]
        self.contradiction = contradiction(self.model, self.state, acc_K)
        if self.contradiction:
            self._run.status = Status.REDUNDANT_STRINGS

    def _piece(self, duration: float, acc_K, u_D: Array | None) -> Input:
        table = self.model.coordinates
        if isinstance(acc_K, Mapping):
            named, acc_K = acc_K, np.zeros(table.n_vK)
            for name, value in named.items():
                acc_K[_driven_velocity(table, name)] = value
        acc, x = vector("acc_K", acc_K, table.n_vK), self.state
        # A trace longer than the piece, so that its last instant still lies within the input.
        times = x.t + np.array([0.0, (1.0 + 1e-6) * duration])
        made = Input.segments(table, times, x.q_K, x.v_K, acc[None])
        if u_D is None:
            return made
        force = np.zeros((1, table.n_vD, N_COEF))
        force[0, :, 0] = vector("u_D", u_D, table.n_vD)
        return dataclasses.replace(made, force=force)


def _driven_velocity(table: CoordinateTable, name: str) -> int:
    """Place of a driven velocity in v_K."""
    if name not in table.v_K:
        raise UnknownNameError("driven velocity", name, table.v_K)
    return table.v_K.index(name)
