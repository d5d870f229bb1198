"""Stepper: a run that is advanced piece by piece, for feedback and live control.

q_D are the dynamic coordinates and q_K the driven ones (ends and lengths of strings, driven
joints); acc_K are the driven accelerations, and a row is a string or a joint limit. The ledger is
the table of energies and work.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from fantoccini.base import (
    ARRIVED,
    Array,
    SimulationError,
    Status,
    UnknownNameError,
    check_positive,
)
from fantoccini.dynamics.compiled import (
    CompiledPuppet,
    Method,
    MethodName,
    as_method,
    bind_input,
    check_samples,
    check_start,
    check_step,
    checked_end,
    vector,
)
from fantoccini.dynamics.steppers.determinacy import ForceSamples, undetermined
from fantoccini.dynamics.steppers.parting import separated
from fantoccini.dynamics.steppers.prescribed import (
    measuring_times,
    overlap_events,
    prescribed_overlaps,
)
from fantoccini.dynamics.steppers.redundant import (
    CONTRADICTION_STATUSES,
    Contradiction,
    contradiction,
)
from fantoccini.dynamics.steppers.running_ledgers import RunningLedger
from fantoccini.dynamics.steppers.verdict import decide
from fantoccini.kernel.contract import EVENT_AT
from fantoccini.kernel.runtime import HeldInput, Piece, Run, RunOptions, contact_points
from fantoccini.motion import Input, State

Accelerations = Array | Mapping[str, float]
FeedbackLaw = Callable[[State], Accelerations]


class Stepper:
    """Advances a puppet piece by piece; the inputs of each piece are chosen during the run.

    The input of Eq. 12 (Johnson and Murphey 2007) is the acceleration of the driven
    coordinates, u_L. It is constant over a piece, so that their velocity is continuous.

    ``copy.copy``, ``copy.deepcopy`` and ``pickle`` give an independent stepper that continues with
    identical bits. A pickle loaded with another compiled library of the puppet continues from the
    state alone: energy balance, lost steps and extrapolated velocity terms are reset.

    Attributes:
        state: the present state.
        tension: (n_rows,) forces of strings and limits at ``state`` [N or N m].
        samples: (n, width) samples of the last advance, with the columns of
            ``marionette.sample_layout``; before the first advance, the start.
        events: (n, 5) events of the last advance: time, kind, row, impulse, speed.
        contacts: (n, width) contact points of the last advance, with the columns of ``CONTACT`` in
            :mod:`fantoccini.kernel.contract`.
        contradiction: inconsistent lengths of redundant strings, if the status is
            ``REDUNDANT_STRINGS``.

    Args:
        marionette: the puppet.
        x0: start state.
        method: name of the method.
        options: options of the run; the bound on memory applies to one advance.
    """

    def __init__(
        self, marionette: CompiledPuppet, x0: State, method: MethodName, options: RunOptions
    ):
        self.marionette = marionette
        self.method = method
        self.state, self._end = x0.replace(coordinates=marionette.coordinates), x0.t
        self._overlaps_measured_until, self._max_overlap = x0.t, 0.0
        self._options, self._run, self._held_input = options, *self._new_run(options)
        piece = self._run.present()
        self.samples, self.events, self.contacts = piece.samples[-1:], *piece[1:]
        self._ledger = self._new_ledger(self.samples)
        self.tension = self.samples[0, marionette.sample_layout.columns["tension"]]
        self.contradiction: Contradiction | None = None

    @classmethod
    def from_state(
        cls, marionette: CompiledPuppet, x0: State, method: Method | MethodName
    ) -> Stepper:
        """A stepper, after checking its start and step; see :meth:`Marionette.stepper`."""
        method = as_method(method)
        if method.name == "event":
            x0 = separated(marionette, x0)
        check_start(marionette, x0, method.name)
        options = marionette.run_options(**method.options)
        check_step(marionette, method.name, x0.q_D, x0.q_K, options.dt)
        return cls(marionette, x0, method.name, options)

    def _new_run(self, options: RunOptions) -> tuple[Run, HeldInput]:
        """A run from the present state with constant driven velocities, and its inputs."""
        marionette = self.marionette
        library = marionette.libraries.library_of(self.method)
        constant_input = held_input(marionette, self.state, options.dt, None, None)
        arguments = options, self.state, marionette.p, marionette.winches, constant_input
        return Run(library, self.method, *arguments), constant_input

    def __getstate__(self) -> dict[str, Any]:
        # The run belongs to the library, which returns it as bytes.
        return {
            name: x for name, x in vars(self).items() if name not in ("_run", "_held_input")
        } | {
            "_status": int(self._run.status),
            "_memory": (self._run.library.key, self._run.checkpoint()),
        }

    def __setstate__(self, pickled: dict[str, Any]) -> None:
        pickled = dict(pickled)
        status, (library, memory) = pickled.pop("_status"), pickled.pop("_memory")
        self.__dict__.update(pickled)
        self._run, self._held_input = self._new_run(self._options)
        current = self._run.present()
        if self._run.library.key == library:
            self._run.restore(memory)
            self._ledger = copy.copy(self._ledger)
        else:
            self._ledger = self._new_ledger(current.samples[-1:])
        self._run.status = Status(status)

    @property
    def status(self) -> Status:
        """Status of the run so far.

        The run continues after ``LOST_STEPS`` or ``RUNAWAY`` (a drive was too weak) and after
        ``OVERSTEPPED``, ``GAINED_ENERGY`` or ``UNBALANCED`` (the fixed steps are too long).
        """
        ledger = self._ledger
        if ledger is None:
            return self.reported
        return decide(self.reported, None, [lambda: (ledger.status(self.violation), "")]).status

    @property
    def reported(self) -> Status:
        """Status of the steps, without the checks of energy and violations."""
        return self._run.status

    @property
    def attribution(self) -> Array:
        """(n_rows + n_watched,) shares of rows and drives in the cause of the status, 0 to 1."""
        return self._run.attribution

    @property
    def violation(self) -> float:
        """Largest violation h of all rows since the start, for fixed steps [m, rad or 1].

        For all methods, it includes the overlap of solids with prescribed motion.
        """
        return max(float(self._run.progress.violation), self._max_overlap)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of strings and driven velocities whose tensions or efforts are not determined."""
        marionette = self.marionette
        columns = marionette.sample_layout.split(self.samples[-1:])
        n_s, contact = len(marionette.tree.strings), None
        if marionette.contacts is not None:
            rows = self.contacts[self.contacts[:, 0] == len(self.samples) - 1]  # a copy
            rows[:, 0] = 0.0
            contact = contact_points(rows, marionette.contacts.names)
        samples = ForceSamples(
            q_D=columns["q_D"],
            v_D=columns["v_D"],
            q_K=columns["q_K"],
            v_K=columns["v_K"],
            force=columns["tension"],
            taut=np.asarray(columns["taut"][:, :n_s], dtype=bool),
            slip=columns["slip"],
            method=self.method,
            contact=contact,
        )
        flags = undetermined(marionette, samples)
        return tuple(name for name in flags.names if flags[name][0])

    def __repr__(self) -> str:
        return (
            f"<Stepper {self.marionette.name}: {self.method}, t = {self.state.t:g} s, "
            f"{self.status.name}>"
        )

    @property
    def arrived(self) -> bool:
        """Whether the last advance reached its end, even with lost steps."""
        status = self.reported
        return status is Status.DONE or (status in ARRIVED and self.state.t >= self._end)

    def advance(
        self,
        duration: float,
        acc_K: Accelerations | None = None,
        *,
        inputs: Input | None = None,
        u_D: Array | None = None,
        throw: bool = True,
    ) -> State:
        """Advances by ``duration`` [s].

        Args:
            duration: duration of the piece, > 0 and finite.
            acc_K: (n_vK,) accelerations of the driven coordinates, or name -> value (others 0);
                constant over the piece. The driven velocities are continuous.
            inputs: alternative to acc_K: inputs in absolute time from the present configuration.
            u_D: (n_vD,) user forces, constant over the piece (not together with ``inputs``).
            throw: whether to raise :class:`SimulationError` if the run cannot continue. Lost steps
                of stepper motors and wrong energies of fixed steps do not end it: see ``status``
                and ``events``.

        Ctrl-C leaves the stepper in the state reached, from which it can be advanced again.

        Returns:
            The state reached.
        """
        check_positive(duration=duration)
        end = self.state.t + duration
        check_samples(self.marionette, self.method, self._options, self.state.t, end)
        if inputs is not None and (acc_K is not None or u_D is not None):
            raise ValueError(
                "inputs include motion and forces; give either inputs, or acc_K and u_D"
            )
        if inputs is None:
            self._hold(duration, acc_K, u_D)
            piece_inputs: Input | HeldInput = self._held_input
        else:
            t = self.state.t
            piece_inputs = bind_input(
                self.marionette, inputs, self.state.q_K, self.state.v_K, t, end
            )
        self._run.set_input(piece_inputs)
        pieces: list[Piece] = []
        self._end = end
        try:
            pieces.extend(self._run.advance(end))
        except BaseException:
            pieces.append(self._run.present())
            raise
        finally:
            self._store(pieces)
        self._add_prescribed_touches(piece_inputs)
        self._diagnose()
        if not self.arrived and throw:
            message = f"at t = {self.state.t:.6g} s"
            if self.contradiction:
                message += f": {self.contradiction}"
            raise SimulationError(self.status, message)
        return self.state

    def run(
        self, t_end: float, law: FeedbackLaw, rate: float, *, throw: bool = True
    ) -> list[State]:
        """Advances to ``t_end`` [s] under a feedback law that is called ``rate`` times a second.

        Args:
            t_end: end of the run [s].
            law: state -> accelerations of the driven coordinates, as in :meth:`advance`; never
                None.
            rate: frequency of the calls [1/s].
            throw: whether to raise :class:`SimulationError` if the run cannot continue; see also
                ``status``.

        Returns:
            The states at which the law was called, and the last one.

        Raises:
            TypeError: the law returned nothing.
        """
        check_positive(rate=rate)
        t_end = checked_end(t_end, self.state.t)
        states = [self.state]
        n = max(1, round((t_end - self.state.t) * rate))
        times = np.linspace(self.state.t, t_end, n + 1)
        for t in times[1:]:
            acc_K = law(self.state)
            if acc_K is None:
                raise TypeError(
                    f"the law returned None at t = {self.state.t:g} s; it must return the "
                    "accelerations of the driven coordinates, an array or {name: value}. Does it "
                    "lack a return statement?"
                )
            self.advance(t - self.state.t, acc_K, throw=throw)
            states.append(self.state)
            if not self.arrived:
                break
        return states

    def _store(self, pieces: list[Piece]) -> None:
        """Stores the pieces of an advance; the last sample becomes the state."""
        self.samples, self.events, self.contacts = Piece.joined(pieces)
        if not len(self.samples):
            return
        layout, last = self.marionette.sample_layout, self.samples[-1]
        self.state = layout.state(last)
        self.tension = last[layout.columns["tension"]]
        if self._ledger is not None:
            self._ledger.add_samples(self.samples)

    def _new_ledger(self, sample: Array) -> RunningLedger | None:
        """Energy balance that begins with a sample (1, width); None for method ``event``."""
        if self.method == "event":
            return None
        return RunningLedger(self.marionette, self.method, self._options.dt, self.state, sample)

    def _add_prescribed_touches(self, inputs: Input | HeldInput) -> None:
        """Adds events of solids with prescribed motion that touch or separate."""
        marionette = self.marionette
        if marionette.prescribed is None or not self.state.t > self._overlaps_measured_until:
            return

        def motion(t: Array) -> Array:
            return inputs.evaluate(t)[0] if isinstance(inputs, Input) else inputs.evaluate(t)

        if isinstance(inputs, Input):
            times = measuring_times(inputs.breaks, self._overlaps_measured_until, self.state.t)
        else:  # constant acceleration
            times = np.linspace(self._overlaps_measured_until, self.state.t, 3)
        overlaps = prescribed_overlaps(marionette, motion, times)
        events = overlap_events(marionette, overlaps, self._overlaps_measured_until)
        self._overlaps_measured_until = self.state.t
        self._max_overlap = max([self._max_overlap, *(overlap.depth for overlap in overlaps)])
        if len(events):
            all_events = np.concatenate([self.events, events])
            self.events = all_events[np.argsort(all_events[:, EVENT_AT["t"]], kind="stable")]

    def _diagnose(self) -> None:
        """Sets status and contradiction if redundant strings may have stopped the run."""
        if self.reported not in CONTRADICTION_STATUSES or not len(self.samples):
            return
        acc_K = self.marionette.sample_layout.split(self.samples[-1:])["acc_K"][0]
        self.contradiction = contradiction(self.marionette, self.state, acc_K)
        self._run.status = decide(self.reported, self.contradiction).status

    def _hold(self, duration: float, acc_K: Accelerations | None, u_D: Array | None) -> None:
        """Sets the held input to constant accelerations and forces from the present state."""
        table = self.marionette.coordinates
        if isinstance(acc_K, Mapping):
            acc_by_name, acc_K = acc_K, np.zeros(table.n_vK)
            for name, value in acc_by_name.items():
                if name not in table.v_K:
                    raise UnknownNameError("driven velocity", name, table.v_K)
                acc_K[table.v_K.index(name)] = value
        _fill_held_input(self._held_input, self.marionette, self.state, duration, acc_K, u_D)


def held_input(
    marionette: CompiledPuppet, x: State, duration: float, acc_K: Array | None, u_D: Array | None
) -> HeldInput:
    """Inputs from a state, with constant accelerations (n_vK,) and forces (n_vD,)."""
    constant_input = HeldInput(marionette.coordinates)
    _fill_held_input(constant_input, marionette, x, duration, acc_K, u_D)
    return constant_input


def _fill_held_input(
    held: HeldInput,
    marionette: CompiledPuppet,
    x: State,
    duration: float,
    acc_K: Array | None,
    u_D: Array | None,
) -> None:
    table = marionette.coordinates
    acc = vector("acc_K", acc_K, table.n_vK)
    force = None if u_D is None else vector("u_D", u_D, table.n_vD)
    # Slightly longer than the piece, so that its last instant lies within the input.
    held.fill(x.t, x.t + (1.0 + 1e-6) * duration, x.q_K, x.v_K, acc, force)
