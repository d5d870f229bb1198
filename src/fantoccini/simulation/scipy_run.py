"""The event-driven run with any of SciPy's integrators.

Between events the active set is fixed and the motion is a smooth ordinary differential equation
(Sec. III-C: any numeric integrator will do). SciPy's solver makes the steps; events, samples and
projections are the runtime's.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import integrate

from fantoccini.arrays import Array
from fantoccini.errors import ARRIVED, Status
from fantoccini.motion import Input, State
from fantoccini.runtime import ExternalRun, Library, Piece, RunOptions
from fantoccini.simulation.checks import INTEGRATORS
from fantoccini.simulation.step import Step

_EXPLICIT = (integrate.RK23, integrate.RK45, integrate.DOP853)
_ONE_STEP = (*_EXPLICIT, integrate.Radau)
"""Methods without memory: after a restart they continue with the step size they planned."""


@dataclass(frozen=True)
class Bounds:
    """When a solver is restarted, and how long an event is searched."""

    drift: float = 1e-3
    """Drift from the strings, over the tolerance, at which an explicit one-step method restarts;
    it loses nothing by that."""
    drift_with_memory: float = 100.0
    """The same for the others, which lose their order or their Jacobian; their global error is no
    smaller over such a drift. With 1, BDF and LSODA never leave their first order: 21,000 restarts
    instead of 16 on a second of ``arm2d``."""
    event_rounds: int = 60  # States tried to meet a guard: bisection to rounding, and more


BOUNDS = Bounds()


def solver_class(integrator: str | type[integrate.OdeSolver]) -> type[integrate.OdeSolver]:
    """The class of a SciPy method.

    Raises:
        ValueError: there is no such method.
    """
    if isinstance(integrator, type) and issubclass(integrator, integrate.OdeSolver):
        return integrator
    if integrator not in INTEGRATORS:
        names = ", ".join(map(repr, INTEGRATORS))
        raise ValueError(
            f"integrator is {integrator!r}; it must be {names}, a subclass of "
            "scipy.integrate.OdeSolver, or None for the compiled one"
        )
    return getattr(integrate, integrator)


def _options_of(solver: type[integrate.OdeSolver]) -> set[str]:
    """Names of the options that a class takes, or passes on to its base."""
    names: set[str] = set()
    for cls in solver.__mro__:
        if "__init__" in vars(cls):
            found = inspect.signature(vars(cls)["__init__"]).parameters
            names |= set(found)
            if not any(p.kind is p.VAR_KEYWORD for p in found.values()):
                break
    return names


class ScipyRun(ExternalRun):
    """One event-driven simulation in progress, with SciPy's steps.

    Args:
        integrator: a name of :data:`INTEGRATORS`, or a subclass of SciPy's ``OdeSolver``. Of rtol,
            atol, max_step and first_step it is given those that it takes by name.
        library, options, x0, p, winches, inputs, save_at: as of :class:`ExternalRun`.
    """

    def __init__(
        self,
        integrator: str | type[integrate.OdeSolver],
        library: Library,
        options: RunOptions,
        x0: State,
        p: Array,
        winches: Array,
        inputs: Input,
        save_at: Array | None = None,
    ):
        self._class = solver_class(integrator)
        one_step = issubclass(self._class, _ONE_STEP)
        # After a release h grows as the third power of time; methods that start with tiny steps of
        # low order make larger errors.
        noise = 0.0 if one_step else options.rtol
        afield = BOUNDS.drift_with_memory * options.rtol
        super().__init__(library, options, x0, p, winches, inputs, save_at, noise, afield)
        self._rtol, self._atol = options.rtol, np.full(len(self.y), options.atol)
        self._atol[-3:] *= options.energy_scale
        given = {"rtol": self._rtol, "atol": self._atol, "max_step": options.max_step}
        self._takes = _options_of(self._class)
        self._given = {name: value for name, value in given.items() if name in self._takes}
        explicit = issubclass(self._class, _EXPLICIT)
        self._drift = BOUNDS.drift if explicit else BOUNDS.drift_with_memory
        self._step = options.first_step if one_step else None
        self._save_at = np.zeros(0) if save_at is None else np.asarray(save_at, dtype=float)
        self._next_save = int(np.searchsorted(self._save_at, self.t, side="right"))
        self._solver: integrate.OdeSolver | None = None
        self._pieces: list[Piece] = []

    def advance(self, t_end: float) -> Iterator[Piece]:
        """As :meth:`Run.advance`."""
        self._taken_bytes = 0.0
        yield self._taken()
        if self.status in ARRIVED:
            self.status = Status.RUNNING
        n_steps = 0
        while self.status is Status.RUNNING and self.t < t_end:
            if self._is_full:
                self.status = Status.TOO_MANY_SAMPLES
                break
            self._advance_once(t_end)
            n_steps += 1
            if n_steps % self.steps_per_piece == 0:
                self._pieces.append(self._taken())
            while self._pieces:
                yield self._pieces.pop(0)
        if self.status is Status.RUNNING:
            self.status = self.verdict(t_end)
        yield self._taken()

    def present(self) -> Piece:
        """As :meth:`Run.present`, with the pieces not yet yielded."""
        pieces, self._pieces = [*self._pieces, super().present()], []
        return Piece.joined(pieces)

    def _advance_once(self, t_end: float) -> None:
        """One step, up to the first event within it, and the event."""
        end = self.stretch(t_end)
        if self.status is not Status.RUNNING or self.t >= end:
            return
        if self._solver is None or self._solver.t_bound != end:
            self._solver = self._new_solver(self.t, self.y, end, self._step)
        solver, active_set = self._solver, self.active_set
        solver.step()
        if solver.status == "failed":
            self.status = Status.STEP_TOO_SMALL
            return
        self._plan_next(solver)
        y = self.settled(solver.t, solver.y)
        # Where the strings can no longer be met, an event may still lie before.
        step = Step.of(self, solver, solver.y if y is None else y)
        event = self._first_event(step)
        t, y = (step.times[-1], step.y1) if event is None else event
        saved = self._save_before(t, step)
        self.accept(t, y)
        if self.status is Status.RUNNING:
            self.status = saved
        if event is not None and self.status is Status.RUNNING:
            self.react()
        while self._next_save < len(self._save_at) and self._save_at[self._next_save] <= self.t:
            self._next_save += 1
        self._make_room()
        drift = np.max(np.abs(self.y - solver.y) / (self._atol + self._rtol * np.abs(self.y)))
        if event is not None or np.any(self.active_set != active_set) or drift > self._drift:
            self._solver = None

    def _new_solver(
        self, t: float, y: Array, t_bound: float, first_step: float | None
    ) -> integrate.OdeSolver:
        given = dict(self._given)
        if first_step is not None and "first_step" in self._takes:
            given["first_step"] = min(first_step, t_bound - t)
        return self._class(self.rate, t, y, t_bound, **given)

    def _plan_next(self, solver: integrate.OdeSolver) -> None:
        """Keeps the step size that a one-step method planned, unless a break cut the step short."""
        if self._step is not None:
            cut = solver.t == solver.t_bound
            self._step = max(self._step, solver.h_abs) if cut else solver.h_abs

    def _reached(self, t: float, y: Array, t_end: float) -> Array | None:
        """The state at ``t_end`` that the integrator reaches from (t, y); None when it fails."""
        if not t_end > t:
            return y  # SciPy takes no step of length 0
        # SciPy's LSODA allows one solver at a time.
        self._solver = None
        solver = self._new_solver(t, y, t_end, t_end - t)
        while solver.status == "running":
            solver.step()
        return None if solver.status == "failed" else self.settled(t_end, solver.y)

    def _save_before(self, t: float, step: Step) -> Status:
        """Writes the samples to save within the step, before ``t``; the status of the last one."""
        while self._next_save < len(self._save_at) and self._save_at[self._next_save] < t:
            at = self._save_at[self._next_save]
            status = self.save(at, step.dense(at))
            if status is not Status.RUNNING:
                return status
            self._next_save += 1
            self._make_room()
        return Status.RUNNING

    def _make_room(self) -> None:
        if self.nearly_full:
            self._pieces.append(self._taken())

    # -- events ------------------------------------------------------------------------------

    def _first_event(self, step: Step) -> tuple[float, Array] | None:
        """Time and state at which a guard first turns positive within a step."""
        for t in step.suspects():
            y = step.y1 if t == step.times[-1] else self._reached(step.times[0], step.y0, t)
            if y is not None and np.any(self.guards(t, y)[0] > 0.0):
                return self._earliest(step, t, y)
        return None

    def _earliest(self, step: Step, t: float, y: Array) -> tuple[float, Array]:
        """The earliest root among the guards that are positive at (t, y), and the state there."""
        for _ in range(step.guards.shape[1] + 1):
            guard, met = self.guards(t, y)
            beyond = np.flatnonzero(guard > met)
            if not len(beyond):
                break
            before = t
            roots = [step.root(int(row), t) for row in beyond]
            first = int(np.argmin(roots))
            row = int(beyond[first])
            t, y = self._meet(step, row, roots[first], (t, y, guard[row]))
            if t == before:
                break
        return t, y

    def _meet(
        self, step: Step, row: int, t: float, found: tuple[float, Array, float]
    ) -> tuple[float, Array]:
        """Time and state at which the guard of ``row`` has just turned positive, near ``t``.

        Steps of different lengths differ by the integrator's tolerance, but the guard must be met
        to rounding: so the last piece is integrated from a state shortly before the event.

        Args:
            step: the step in which it does.
            row: of the guard.
            t: estimate from the dense output [s].
            found: time, state and guard somewhere beyond.
        """
        start = step.times[0], step.y0, min(step.guards[0, row], 0.0)
        lo, hi, slope = start, found, step.slope(row, t)
        for i in range(BOUNDS.event_rounds):
            y = self._reached(lo[0], lo[1], t)
            if y is None:
                break
            guard, met = (part[row] for part in self.guards(t, y))
            if guard > 0.0:
                hi = t, y, guard
            else:
                lo = t, y, guard
            resolved = hi[0] - lo[0] <= 4.0 * np.spacing(max(1.0, abs(t)))
            if 0.0 < guard <= met or resolved:
                break
            if guard > 0.0 and lo is not start:
                slope = (hi[2] - lo[2]) / (hi[0] - lo[0])
            middle = 0.5 * (lo[0] + hi[0])
            if not slope > 0.0 or i % 6 == 5:
                t = middle
            elif lo is start:
                t -= 2.0 * guard / slope
            else:
                t = lo[0] + max((0.5 * met - lo[2]) / slope, np.spacing(max(1.0, abs(t))))
            if not lo[0] < t:
                t = middle
            t = min(t, found[0])
        return hi[:2]
