"""Derivatives along an event-driven run: over its smooth pieces, and through events.

A change is here a derivative, as of the state with respect to a parameter. q_D and v_D are the
dynamic coordinates and velocities, q_K and v_K the driven ones. At a catch, a slack string becomes
taut. Slip is the length of string that a winch lets out at its largest tension. Breaks are the
times at which the pieces of an input meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from fantoccini.base import Array, Indices, StateError, Times
from fantoccini.dynamics.derivatives import PointMode
from fantoccini.dynamics.simulation.catch import catch_at
from fantoccini.dynamics.simulation.contact_pieces import (
    Change,
    ContactPieces,
    modes_key,
    state_and_input_changes,
)
from fantoccini.dynamics.simulation.impact import impact_at
from fantoccini.dynamics.simulation.input_piece import InputPiece, InputVariation
from fantoccini.dynamics.simulation.saltation import Passage
from fantoccini.dynamics.simulation.variation import Variation
from fantoccini.motion import EventKind, Input, Trajectory


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the pieces of a run."""

    jump: float = 1e-9
    """Smallest change of velocity that counts as an impulse, relative to max(1, |v|)."""
    stop: float = 1e-8
    """Largest change of velocity at the stop of a sliding point, relative to max(1, |v|)."""
    time: float = 1e-12  # Largest distance of times that count as equal [s]


TOLERANCES = Tolerances()


def check_differentiable(run: Trajectory) -> None:
    """Raises StateError if a winch slips, or bounces of solids accumulate."""
    if run.slip is not None and np.any(run.slip.values > 0.0):
        names = [name for name, slip in run.slip.items() if np.any(slip > 0.0)]
        raise StateError(
            f"the winch of {', '.join(names)} slips in this run; sensitivities support releases "
            "and catches only: raise max_tension, or let the run end earlier"
        )
    ends = [event.t for event in run.events if event.kind is EventKind.ACCUMULATION]
    if ends and run.contact is not None and len(run.contact):
        raise StateError(
            f"bounces accumulate at t = {ends[0]:.6g} s: infinitely many impacts have no "
            "derivative. Let the run end earlier, or set restitution 0 for solids that do not "
            "rock"
        )


class DrivenChanges(Protocol):
    """Inputs of a run and their changes.

    Attributes:
        inputs: inputs of the run.
        breaks: times at which inputs or their changes are not smooth [s].
        columns: number m of changes: of the state, the parameters and the inputs together.
    """

    inputs: Input
    breaks: Times
    columns: int

    def piece(self, start: float, end: float) -> InputPiece:
        """Piece between two times with no break between them [s]."""
        ...


class RunChanges:
    """Small changes along a run.

    Args:
        run: event-driven run; with contact it must have all samples.
        changes: changes of its inputs.
        variation: variational equations of its puppet.

    Attributes:
        passages: events so far.
    """

    def __init__(self, run: Trajectory, changes: DrivenChanges, variation: Variation):
        self.marionette, self.run = variation.marionette, run
        self._inputs, self._changes = changes.inputs, changes
        self._variation = variation
        self.passages: list[Passage] = []
        self._contacts = ContactPieces(self.marionette, run)
        self._times = {
            kind: {event.t for event in run.events if event.kind is kind}
            for kind in (EventKind.TOUCH, EventKind.CATCH)
        }

    def samples(
        self, saved: Times, start: int = 0, end: int | None = None
    ) -> Iterator[tuple[float, Array]]:
        """Times [s] and changes (2 n_vD, m) at the start, times to save, events and the end.

        Args:
            saved: times to save [s].
            start, end: samples of the run; by default its first and last.
        """
        run, n = self.run, self.marionette.coordinates.n_vD
        columns = self._changes.columns
        Z, input_change = np.eye(2 * n, columns), InputVariation.zeros(self.marionette, columns)
        end = len(run.t) - 1 if end is None else end
        event_samples = start + np.flatnonzero(np.diff(run.t[start : end + 1]) == 0.0)
        segment_starts = np.concatenate([[start], event_samples + 1])
        segment_ends = np.concatenate([event_samples, [end]])
        before: tuple[PointMode, ...] = ()
        for first, last in zip(segment_starts, segment_ends, strict=True):
            mode_ranges = self._contacts.mode_ranges(first, last)
            if first > start:
                after = mode_ranges[0][2] if mode_ranges else ()
                Z = self._after_event(first - 1, Z, input_change, (before, after))
            if first == last:
                yield run.t[first], Z
                continue
            for range_start, range_end, points in mode_ranges:
                if range_start > first:
                    Z = self._after_mode_change(
                        range_start, Z, input_change, (range_start, range_start), (before, points)
                    )
                    if run.t[range_start] in saved:
                        yield run.t[range_start], Z
                before = points
                x, held_rows = run.state(range_start), self._taut_rows(first)
                pieces = self._input_pieces(run.t[range_start], run.t[range_end])
                Z = self._variation.projected(x, held_rows, Z, pieces[0].variation(x.t), points)
                if range_start == first:
                    yield x.t, Z
                for piece in pieces:
                    saved_times = saved[(saved > piece.start) & (saved < piece.end)]
                    times = np.append(saved_times, piece.end)
                    states, changes = self._variation.integrated(
                        x, held_rows, Z, piece, times, points
                    )
                    yield from zip(saved_times, changes[:-1], strict=True)
                    Z = changes[-1]
                    if piece is pieces[-1]:
                        break
                    q_D, v_D = np.split(states[-1], [len(x.q_D)])
                    q_K, v_K, *_ = piece.at(piece.end)
                    x = x.replace(t=piece.end, q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K)
                    if piece.end in saved:
                        yield piece.end, Z
                self._variation.check(
                    states[-1], run.t[range_end], run.q_D[range_end], run.v_D[range_end]
                )
                input_change = pieces[-1].variation(pieces[-1].end)
            yield run.t[last], Z

    def _after_event(
        self,
        i: int,
        Z: Array,
        input_change: InputVariation,
        points: tuple[Sequence[PointMode], Sequence[PointMode]],
    ) -> Array:
        """Changes after the event between sample i and the next."""
        run = self.run
        speed_scale = max(1.0, np.max(np.abs(run.v_D[i]), initial=0.0))
        is_stop = self._contacts.touches(i) and not self._is_struck(i)
        tolerance = TOLERANCES.stop if is_stop else TOLERANCES.jump
        if np.max(np.abs(run.v_D[i + 1] - run.v_D[i]), initial=0.0) <= tolerance * speed_scale:
            return self._after_mode_change(i, Z, input_change, (i, i + 1), points)
        before, after = run.state(i), run.state(i + 1)
        held_rows = self._taut_rows(i), self._taut_rows(i + 1)
        acc, acc_K = (run.acc_D[i], run.acc_D[i + 1]), run.acc_K[i]
        if self._contacts.touches(i) or self._contacts.touches(i + 1) or self._is_struck(i, False):
            impulse = impact_at(self.marionette, before, after, held_rows)
        else:
            impulse = catch_at(self.marionette, before, after, held_rows)
        Z, passage = impulse.across_impulse(Z, input_change, acc, acc_K)
        self.passages.append(passage)
        return Z

    def _is_struck(self, i: int, catches: bool = True) -> bool:
        """Whether solids touch, or with ``catches`` strings become taut, at sample i."""
        t = float(self.run.t[i])
        return t in self._times[EventKind.TOUCH] or (catches and t in self._times[EventKind.CATCH])

    def _after_mode_change(
        self,
        i: int,
        Z: Array,
        input_change: InputVariation,
        samples: tuple[int, int],
        points: tuple[Sequence[PointMode], Sequence[PointMode]],
    ) -> Array:
        """Changes after contacts change modes at sample i with continuous velocities."""
        if modes_key(points[0]) == modes_key(points[1]) and not self._contacts.is_stopping(
            i, points[0]
        ):
            return Z
        run, marionette = self.run, self.marionette
        if np.min(np.abs(self._inputs.breaks - run.t[i])) <= TOLERANCES.time:
            return Z  # the inputs determine this time
        x, u_D = run.state(i), self._force(run.t[i])
        before, after = (
            (self._taut_rows(k), held_points)
            for k, held_points in zip(samples, points, strict=True)
        )
        widened_changes = state_and_input_changes(
            np.concatenate([Z, np.eye(len(Z))], axis=1), input_change.widened(len(Z))
        )
        change = Change.between_modes(
            self.marionette, x, run.acc_K[i], u_D, before, after, widened_changes
        )
        if change is None:
            return Z
        n, m = marionette.coordinates.n_vD, Z.shape[1]
        jump = np.eye(2 * n)
        jump[n:] += np.outer(change.jump, change.time_change[0, m:])
        self.passages.append(
            Passage(float(run.t[i]), change.names, 0.0, jump, change.differentiable)
        )
        return np.concatenate([Z[:n], Z[n:] + np.outer(change.jump, change.time_change[0, :m])])

    def _force(self, t: float) -> Array:
        """User forces (n_vD,) at a time [s]."""
        clipped = min(max(t, self._inputs.start), self._inputs.end)
        return np.array(self._inputs.evaluate_force(clipped))

    def _taut_rows(self, i: int) -> Indices:
        """Indices of the rows that are taut just after sample i."""
        run = self.run
        is_taut = np.concatenate([run.taut.values[i], run.limit_force.values[i] > 0.0])
        return np.flatnonzero(is_taut | self.marionette.two_sided)

    def _input_pieces(self, start: float, end: float) -> list[InputPiece]:
        """Smooth pieces of the inputs from one time to another [s]."""
        inner_breaks = self._changes.breaks
        inner_breaks = inner_breaks[
            (inner_breaks > start + TOLERANCES.time) & (inner_breaks < end - TOLERANCES.time)
        ]
        times = np.concatenate([[start], inner_breaks, [end]])
        return [self._changes.piece(a, b) for a, b in pairwise(times)]
