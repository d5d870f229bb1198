"""sensitivity: derivatives of a whole run by its start, its parameters and its inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.arrays import Array, Indices, Times, check_positive
from fantoccini.errors import InputError, Mistake, StateError
from fantoccini.marionette import Marionette, bind_input
from fantoccini.marionette.contact_rows import PointMode
from fantoccini.motion import EventKind, Input, InputDerivative, Inputs, State, Trajectory
from fantoccini.motion.binding import check_same_puppet
from fantoccini.simulation.catch import Catch, Passage
from fantoccini.simulation.contact_pieces import Change, ContactPieces, key_of, stacked
from fantoccini.simulation.impact import Impact
from fantoccini.simulation.input_piece import InputChanges, InputPiece, InputVariation
from fantoccini.simulation.run import simulate
from fantoccini.simulation.variation import Variation


@dataclass(frozen=True)
class Tolerances:
    """Decisions about the pieces of a run."""

    jump: float = 1e-9
    """Change of velocity at a catch, relative to 1 or the largest velocity: above rounding."""
    stop: float = 1e-8
    """Likewise, up to which a point of contact that slides is brought to rest where it stops."""
    time: float = 1e-12  # Distance of times that are one [s]
    rotation: float = 1e-12  # 1 - |cos(angle / 2)| of orientations that are one: rounding


TOLERANCES = Tolerances()


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of the state of an event-driven run, at some of its times.

    A record is d(dq_D, dv_D) at ``t``, with tangent vectors dq_D: a scalar adds, an orientation
    turns in the body's frame. Between two records at one time lies an event.

    Attributes:
        run: the run itself.
        t: (T,) times [s].
        x0: (T, 2 n_vD, 2 n_vD) by (dq_D, dv_D) at the start. A change that would stretch or slacken
            taut rows there stands for the nearest one that does not, in the metric of M_DD.
        p: (T, 2 n_vD, n_p) by the parameters; the start moves to keep its taut strings.
        toward: (T, 2 n_vD, m) by s, with inputs + s (other - inputs), for each of the other inputs.
        along: (T, 2 n_vD, m) by s, with inputs + s dq_K/ds, for each of the derivatives of inputs.
        passages: the catches and impacts of the run, and where points of contact stop.
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
        """Whether the derivative exists: nothing was caught, struck or stopped at once by chance.

        Nor did anything just touch.
        """
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
    """dx(t)/dx0, dx(t)/dp and along changes of the inputs, through releases, catches and contact.

    The run is that of ``fan.simulate`` with its default tolerances. The derivative holds for
    neighbours with the same sequence of events.

    Args:
        marionette: the puppet.
        x0: where the run starts.
        inputs: motion of the driven coordinates; they hold still when not given.
        t_end: end of the run [s]; the end of the inputs when not given.
        toward: other inputs; they may begin elsewhere. Rotations must be the same in all. For
            derivatives by waypoints use ``along``: moves through them are not linear in them.
        along: derivatives of the inputs, as ``InputDerivative.of_waypoints`` gives them by the
            values of waypoints.
        save_at: (n,) times to write besides the start, the end and both sides of every event [s].
        rtol, atol: of the integration of state and derivatives.

    Raises:
        StateError: a winch slips, bounces of solids accumulate, or the motion depends on how
            redundant points that slide share their force: there is no derivative here.
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
    ends = [event.t for event in run.events if event.kind is EventKind.ACCUMULATION]
    if ends and run.contact is not None and len(run.contact):
        raise StateError(
            f"bounces accumulate at t = {ends[0]:.6g} s: infinitely many impacts have no "
            "derivative. Let the run end earlier; what springs back, and does not rock, may be "
            "given restitution 0"
        )
    t_end = inputs.end if t_end is None else float(t_end)
    bound = bind_input(marionette.model, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    others = _bound(marionette, toward, bound, x0) if toward else None
    _check_along(marionette, along)
    changes = InputChanges(marionette, bound, others, along)
    saved = np.zeros(0) if save_at is None else np.unique(np.asarray(save_at, dtype=float))
    outside = saved[~((saved >= run.t[0]) & (saved <= run.t[-1]))]
    if len(outside):
        raise ValueError(
            f"save_at has {outside[0]:g} s; it must lie between {run.t[0]:g} s and {run.t[-1]:g} s"
        )
    pieces = _Pieces(marionette, run, bound, changes, Variation(marionette, rtol, atol))
    records = list(pieces.records(saved))
    n, n_p = marionette.coordinates.n_vD, len(marionette.p)
    Z = np.array([Z for _, Z in records])
    last = 2 * n + n_p + len(toward)
    return Sensitivity(
        run=run,
        t=np.array([t for t, _ in records]),
        x0=Z[:, :, : 2 * n],
        p=Z[:, :, 2 * n : 2 * n + n_p],
        toward=Z[:, :, 2 * n + n_p : last],
        along=Z[:, :, last:],
        passages=tuple(pieces.passages),
    )


def _bound(
    marionette: Marionette, toward: Sequence[Input], inputs: Input, x0: State
) -> Inputs:
    """Other inputs, each bound at its own start; coordinates that it does not name are held."""
    table, others = marionette.coordinates, Inputs.of(toward)
    check_same_puppet([table, others.coordinates])
    q_K, start = np.tile(x0.q_K, (len(others), 1)), others.evaluate(x0.t)[0]
    for q, v in table.scalars_K:
        q_K[:, q] = np.where(others.named[:, v], start[:, q], q_K[:, q])
    others = others.bound(q_K, x0.t)
    if not table.rotations:
        return others
    for i in range(len(others)):
        other = others[i]
        times = np.union1d(inputs.breaks, other.breaks)
        times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        for name, (q, _) in table.rotations.items():
            ours, theirs = (x.evaluate(times)[0][:, q : q + 4] for x in (inputs, other))
            if np.max(np.abs(np.abs(np.sum(ours * theirs, axis=1)) - 1.0)) > TOLERANCES.rotation:
                text = "differs from the run's; only scalar coordinates may differ in `toward`"
                raise InputError([Mistake("toward", None, name, text)])
    return others


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
            raise InputError([Mistake("along", None, f"[{i}]", text)])


class _Pieces:
    """The smooth pieces of a run, and the events between them."""

    def __init__(
        self,
        marionette: Marionette,
        run: Trajectory,
        inputs: Input,
        changes: InputChanges,
        variation: Variation,
    ):
        self.marionette, self.run = marionette, run
        self._inputs, self._changes = inputs, changes
        self._variation = variation
        self.passages: list[Passage] = []
        self._contacts = ContactPieces(marionette, run)

    def records(self, saved: Times) -> Iterator[tuple[float, Array]]:
        """(time, changes) at the start, at the times to save, around every event, at the end."""
        run, n = self.run, self.marionette.coordinates.n_vD
        columns = self._changes.columns
        Z, by_input = np.eye(2 * n, columns), InputVariation.none(self.marionette, columns)
        edges = np.flatnonzero(np.diff(run.t) == 0.0)
        firsts = np.concatenate([[0], edges + 1])
        lasts = np.concatenate([edges, [len(run.t) - 1]])
        before: tuple[PointMode, ...] = ()
        for first, last in zip(firsts, lasts, strict=True):
            groups = self._contacts.groups(first, last)
            if first > 0:
                after = groups[0][2] if groups else ()
                Z = self._across(first - 1, Z, by_input, (before, after))
            if first == last:
                yield run.t[first], Z
                continue
            for a, b, points in groups:
                if a > first:
                    Z = self._changed(a, Z, by_input, (a, a), (before, points))
                    if run.t[a] in saved:
                        yield run.t[a], Z
                before = points
                x, held = run.state(a), self._held(first)
                pieces = self._between(run.t[a], run.t[b])
                Z = self._variation.projected(x, held, Z, pieces[0].variation(x.t), points)
                if a == first:
                    yield x.t, Z
                for piece in pieces:
                    inside = saved[(saved > piece.start) & (saved < piece.end)]
                    times = np.append(inside, piece.end)
                    states, changes = self._variation.along(x, held, Z, piece, times, points)
                    yield from zip(inside, changes[:-1], strict=True)
                    Z = changes[-1]
                    q_D, v_D = np.split(states[-1], [len(x.q_D)])
                    q_K, v_K, *_ = piece.at(piece.end)
                    x = x.replace(t=piece.end, q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K)
                    if piece is not pieces[-1] and piece.end in saved:
                        yield piece.end, Z
                self._variation.check(states[-1], run.state(b))
                by_input = pieces[-1].variation(x.t)
            yield run.t[last], Z

    def _across(
        self,
        i: int,
        Z: Array,
        by_input: InputVariation,
        points: tuple[Sequence[PointMode], Sequence[PointMode]],
    ) -> Array:
        """The changes after the event between sample i and the next."""
        run = self.run
        before, after = run.state(i), run.state(i + 1)
        size = max(1.0, np.max(np.abs(before.v_D), initial=0.0))
        stops = self._contacts.touches(i) and not self._struck(i)
        most = TOLERANCES.stop if stops else TOLERANCES.jump
        if np.max(np.abs(after.v_D - before.v_D), initial=0.0) <= most * size:
            return self._changed(i, Z, by_input, (i, i + 1), points)
        held = self._held(i), self._held(i + 1)
        acc, acc_K = (run.acc_D[i], run.acc_D[i + 1]), run.acc_K[i]
        if self._contacts.touches(i) or self._contacts.touches(i + 1) or self._struck(i, False):
            impact = Impact(self.marionette, before, after, held)
            self.passages.append(impact.passage(acc, acc_K, Z))
            return impact.carried(Z, by_input, acc, acc_K)
        catch = Catch(self.marionette, before, after, held)
        Z, passage = catch.across(Z, by_input, acc, acc_K)
        self.passages.append(passage)
        return Z

    def _struck(self, i: int, catches: bool = True) -> bool:
        """Whether solids strike, or with ``catches`` rows, at the time of sample i."""
        kinds = (EventKind.TOUCH, EventKind.CATCH) if catches else (EventKind.TOUCH,)
        return any(e.kind in kinds and e.t == self.run.t[i] for e in self.run.events)

    def _changed(
        self,
        i: int,
        Z: Array,
        by_input: InputVariation,
        samples: tuple[int, int],
        points: tuple[Sequence[PointMode], Sequence[PointMode]],
    ) -> Array:
        """The changes after a change of contacts' modes at sample i, at which velocities stay."""
        if key_of(points[0]) == key_of(points[1]) and not self._contacts.stops(i, points[0]):
            return Z
        run, model = self.run, self.marionette.model
        if np.min(np.abs(self._inputs.breaks - run.t[i])) <= TOLERANCES.time:
            return Z  # at a time that stays
        x, u_D = run.state(i), self._force(run.t[i])
        before, after = (
            (self._held(k), these) for k, these in zip(samples, points, strict=True)
        )
        D = stacked(np.concatenate([Z, np.eye(len(Z))], axis=1), by_input.widened(len(Z)))
        change = Change.of(self.marionette, x, run.acc_K[i], u_D, before, after, D)
        if change is None:
            return Z
        n, m = model.coordinates.n_vD, Z.shape[1]
        jump = np.eye(2 * n)
        jump[n:] += np.outer(change.jump, change.late[0, m:])
        self.passages.append(Passage(float(run.t[i]), change.names, 0.0, jump, change.sharp))
        return np.concatenate([Z[:n], Z[n:] + np.outer(change.jump, change.late[0, :m])])

    def _force(self, t: float) -> Array:
        """(n_vD,) user forces up to a time."""
        inside = min(max(t, self._inputs.start), self._inputs.end)
        return np.array(self._inputs.evaluate_force(inside))

    def _held(self, i: int) -> Indices:
        """The rows that are taut from sample i on."""
        run = self.run
        holds = np.concatenate([run.taut.values[i], run.limit_force.values[i] > 0.0])
        return np.flatnonzero(holds | self.marionette.model.two_sided)

    def _between(self, start: float, end: float) -> list[InputPiece]:
        """The smooth pieces of the inputs from one time to another."""
        inner = self._changes.breaks
        inner = inner[(inner > start + TOLERANCES.time) & (inner < end - TOLERANCES.time)]
        times = np.concatenate([[start], inner, [end]])
        return [self._changes.piece(a, b) for a, b in pairwise(times)]
