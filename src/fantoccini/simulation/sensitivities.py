"""sensitivity: how a whole run answers small changes of its start, its parameters, its inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.errors import InputError, Problem, StateError
from fantoccini.marionette import Marionette, check_positive, ready
from fantoccini.motion import Input, InputDerivative, State, Trajectory
from fantoccini.simulation.catch import Catch, Passage
from fantoccini.simulation.driving import Driving, Outside
from fantoccini.simulation.run import simulate
from fantoccini.simulation.variation import Variation

_JUMP = 1e-9
"""Change of velocity that counts as a catch, relative to 1 or the largest velocity."""
_BREAK = 1e-12
"""Times [s] nearer than that are one."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of the state of an event-driven run, at some of its times.

    A row holds d(dq_D, dv_D) at ``t``, with tangent vectors dq_D: a scalar adds, an orientation
    turns in the body's frame. Between two rows at one time lies an event.

    Attributes:
        run: the run itself.
        t: (T,) times [s].
        x0: (T, 2 n_vD, 2 n_vD) by (dq_D, dv_D) at the start. A change that would stretch or slacken
            what is taut there stands for the nearest one that does not, in the metric of M_DD.
        p: (T, 2 n_vD, n_p) by the parameters; the start moves by what its taut strings ask for.
        toward: (T, 2 n_vD, m) by s, with inputs + s (other - inputs), for each of the other inputs.
        along: (T, 2 n_vD, m) by s, with inputs + s dq_K/ds, for each of the derivatives of inputs.
        passages: the catches on the way.
    """

    run: Trajectory
    t: Times
    x0: Array
    p: Array
    toward: Array
    along: Array
    passages: tuple[Passage, ...]

    @property
    def sharp(self) -> bool:
        """Whether the derivative exists: no two strings were caught at once, none just touched."""
        return all(passage.sharp for passage in self.passages)


def sensitivity(
    marionette: Marionette,
    x0: State,
    inputs: Input | None = None,
    t_end: float | None = None,
    *,
    toward: Sequence[Input] = (),
    along: Sequence[InputDerivative] = (),
    save_at: Times | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-10,
) -> Sensitivity:
    """dx(t)/dx0, dx(t)/dp and along changes of the inputs, through releases and catches.

    The run is that of ``fan.simulate`` with its default tolerances. The order of its events is
    kept: the derivative is that of all neighbours with the same one.

    Args:
        marionette: the puppet.
        x0: where the run starts.
        inputs: what the driven coordinates do; they hold still when not given.
        t_end: end of the run [s]; the end of the inputs when not given.
        toward: other inputs; they may begin elsewhere. Rotations must be the same in all. Waypoints
            changed a little are no such direction, for moves through them are not linear in them.
        along: derivatives of the inputs, as ``InputDerivative.of_waypoints`` gives them by the
            values of waypoints.
        save_at: (n,) times to write, next to the start, the end and both sides of every event [s].
        rtol, atol: of the integration of state and derivatives.

    Raises:
        StateError: a slipping winch let a string out, which has no derivative here.
        SimulationError: the run stopped.
    """
    check_positive(rtol=rtol, atol=atol)
    marionette.model.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    run = simulate(marionette, x0, inputs, t_end, effort=False)
    if run.slip is not None and np.any(run.slip.values > 0.0):
        names = [name for name, slip in run.slip.items() if np.any(slip > 0.0)]
        raise StateError(
            f"the winch of {', '.join(names)} slips in this run; sensitivities go through releases "
            "and catches only: raise max_tension, or let the run end earlier"
        )
    t_end = inputs.end if t_end is None else float(t_end)
    bound = ready(marionette.model, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    others = [_bound(marionette, other, bound, x0) for other in toward]
    _check_along(marionette, along)
    asked = np.zeros(0) if save_at is None else np.unique(np.asarray(save_at, dtype=float))
    outside = asked[~((asked >= run.t[0]) & (asked <= run.t[-1]))]
    if len(outside):
        raise ValueError(
            f"save_at has {outside[0]:g} s; it must lie between {run.t[0]:g} s and {run.t[-1]:g} s"
        )
    course = _Course(marionette, run, bound, others, along, Variation(marionette, rtol, atol))
    rows = list(course.rows(asked))
    n, n_p = marionette.coordinates.n_vD, len(marionette.p)
    Z = np.array([Z for _, Z in rows])
    last = 2 * n + n_p + len(others)
    return Sensitivity(
        run=run,
        t=np.array([t for t, _ in rows]),
        x0=Z[:, :, : 2 * n],
        p=Z[:, :, 2 * n : 2 * n + n_p],
        toward=Z[:, :, 2 * n + n_p : last],
        along=Z[:, :, last:],
        passages=tuple(course.passages),
    )


def _bound(marionette: Marionette, other: Input, inputs: Input, x0: State) -> Input:
    """Other inputs with what they do not name held at the start; they may start elsewhere."""
    table, q_K = marionette.coordinates, np.array(x0.q_K)
    start = other.evaluate(x0.t)[0]
    for q, v in table.scalars_K:
        if other.named[v]:
            q_K[q] = start[q]
    other = other.bound(q_K, x0.t)
    times = np.union1d(inputs.breaks, other.breaks)
    times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
    for name, (q, _) in table.rotations.items():
        ours, theirs = (x.evaluate(times)[0][:, q : q + 4] for x in (inputs, other))
        if np.max(np.abs(np.abs(np.sum(ours * theirs, axis=1)) - 1.0)) > 1e-12:
            text = "differs from that of the run; only scalar coordinates may differ in `toward`"
            raise InputError([Problem("toward", None, name, text)])
    return other


def _check_along(marionette: Marionette, along: Sequence[InputDerivative]) -> None:
    """Raises InputError unless derivatives of inputs are this puppet's."""
    own = marionette.coordinates
    for i, one in enumerate(along):
        if one.coordinates.v_K != own.v_K:
            text = (
                "was made for a puppet with the driven velocities "
                f"{', '.join(one.coordinates.v_K) or 'none'}; {marionette.name} has "
                f"{', '.join(own.v_K) or 'none'}"
            )
            raise InputError([Problem("along", None, f"[{i}]", text)])


class _Course:
    """A run cut into smooth stretches and what lies between them."""

    def __init__(
        self,
        marionette: Marionette,
        run: Trajectory,
        inputs: Input,
        toward: Sequence[Input],
        along: Sequence[InputDerivative],
        variation: Variation,
    ):
        self.marionette, self.run = marionette, run
        self._inputs, self._variation = inputs, variation
        self._toward, self._along = toward, along
        self.passages: list[Passage] = []

    def rows(self, asked: Times) -> Iterator[tuple[float, Array]]:
        """(time, changes) at the start, at the times asked for, around every event, at the end."""
        run, n = self.run, self.marionette.coordinates.n_vD
        columns = 2 * n + len(self.marionette.p) + len(self._toward) + len(self._along)
        Z, outside = np.eye(2 * n, columns), Outside.none(self.marionette, columns)
        edges = np.flatnonzero(np.diff(run.t) == 0.0)
        firsts = np.concatenate([[0], edges + 1])
        lasts = np.concatenate([edges, [len(run.t) - 1]])
        for first, last in zip(firsts, lasts, strict=True):
            if first > 0:
                Z = self._across(first - 1, Z, outside)
            if first == last:
                yield run.t[first], Z
                continue
            x, held = run.state(first), self._held(first)
            driving = self._driving(run.t[first], run.t[last])
            Z = self._variation.projected(x, held, Z, driving[0].outside(x.t))
            yield x.t, Z
            for piece in driving:
                inside = asked[(asked > piece.start) & (asked < piece.end)]
                times = np.append(inside, piece.end)
                states, changes = self._variation.along(x, held, Z, piece, times)
                yield from zip(inside, changes[:-1], strict=True)
                Z = changes[-1]
                q_D, v_D = np.split(states[-1], [len(x.q_D)])
                q_K, v_K, *_ = piece.at(piece.end)
                x = x.replace(t=piece.end, q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K)
                if piece is not driving[-1] and piece.end in asked:
                    yield piece.end, Z
            self._variation.check(states[-1], run.state(last))
            outside = driving[-1].outside(x.t)
            yield run.t[last], Z

    def _across(self, row: int, Z: Array, outside: Outside) -> Array:
        """The changes after the event between a row and the next."""
        run = self.run
        before, after = run.state(row), run.state(row + 1)
        size = max(1.0, np.max(np.abs(before.v_D), initial=0.0))
        if np.max(np.abs(after.v_D - before.v_D), initial=0.0) <= _JUMP * size:
            return Z
        catch = Catch(self.marionette, before, after, (self._held(row), self._held(row + 1)))
        acc, acc_K = (run.acc_D[row], run.acc_D[row + 1]), run.acc_K[row]
        self.passages.append(catch.passage(acc, acc_K))
        return catch.carried(Z, outside, acc, acc_K)

    def _held(self, row: int) -> Array:
        """Indices of the rows that are taut from a row of the run on."""
        run = self.run
        holds = np.concatenate([run.taut.values[row], run.limit_force.values[row] > 0.0])
        return np.flatnonzero(holds | self.marionette.model.two_sided)

    def _driving(self, start: float, end: float) -> list[Driving]:
        """The smooth pieces of the inputs from one time to another."""
        breaks = [inputs.breaks for inputs in (self._inputs, *self._toward, *self._along)]
        inner = np.unique(np.concatenate(breaks))
        inner = inner[(inner > start + _BREAK) & (inner < end - _BREAK)]
        times = np.concatenate([[start], inner, [end]])
        return [
            Driving(self.marionette, self._inputs, self._toward, self._along, a, b)
            for a, b in pairwise(times)
        ]
