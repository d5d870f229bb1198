"""identify: the numbers of a puppet that explain a record best."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import Array, OnProgress, Progress, StateError, check_positive
from fantoccini.dynamics.compiled import bind_input
from fantoccini.kernel.runtime import default_threads
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import Fit, chained
from fantoccini.lab.identification.point import Layout, Weights
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.result import Identified
from fantoccini.lab.identification.searching import Found, search
from fantoccini.lab.identification.untangling import untangled

_GUESS = {"marker": 5e-3, "coordinate": 0.03, "tension": 0.3}
"""Noise levels before anything is known of them [m, rad or m, N]."""
_LEAST_NOISE = {"marker": 1e-6, "coordinate": 1e-6, "tension": 1e-4}
_MAD = 1.4826
"""Standard deviation over the median of |r|, of normal noise."""


@dataclass(frozen=True)
class Stage:
    """Part of a search.

    Attributes:
        name: for the progress callback.
        drift: factor of the drift that is allowed at the end.
        moves: at most, but while the cost falls steeply.
        tolerance: relative fall of the cost that ends it.
        extrapolated: whether the steps' length is extrapolated to none.
        states_only: whether the unknowns stay as they are.
        final: whether all samples count, and those far off ever less, not by their size.
    """

    name: str
    drift: float
    moves: int
    tolerance: float
    extrapolated: bool = True
    states_only: bool = False
    final: bool = False


DRIFT = (5e-4, 5e-3)
"""Of configurations and velocities, from a segment to the next [rad or m, and per second]. Time
steps err by as much at catches, so that whether segments are joined is never judged by less.
"""
_RARE = 3
"""Of so many samples one counts, but in the last stage."""
STAGES = (
    Stage("states near the record", 50.0, 3, 0.1, False, True),
    Stage("first numbers", 50.0, 12, 0.05, False),
    Stage("segments joined", 4.0, 8, 0.01),
    Stage("segments joined closely", 1.0, 6, 1e-4),
    Stage("all samples", 1.0, 3, 2e-5, final=True),
)
"""Segments are loosely joined at first, so that none of them has to be right before the others."""


def identify(
    record: Record,
    *,
    segment: float = 0.25,
    dt: float = 0.005,
    drift: tuple[float, float] = DRIFT,
    threads: int | None = None,
    progress: OnProgress | None = None,
) -> Identified:
    """The numbers that explain a record best, with their errors and what it cannot tell apart.

        min  sum rho((y_i - y(t_i - delay; x_s, theta)) / noise)
             + sum |x_s+1 - x(T_s+1; x_s, theta)|^2 / drift^2

    over the unknowns theta and the first states x_s of all segments (multiple shooting), by
    Levenberg and Marquardt with exact derivatives of the time steps; residuals are extrapolated to
    steps of no length. rho is Huber's, and Cauchy's in the end, so that outliers count little.

    Args:
        record: what was measured.
        segment: duration of a segment [s].
        dt: step of the time-stepper [s].
        drift: how far a segment may begin from where the one before ends, as standard deviations
            of configuration and velocity [m or rad, and per second]: what the model leaves out.
        threads: all processors when not given.
        progress: called with the stage, and the cost as ``best``; None where a stage begins.

    Raises:
        StateError: the search cannot begin, as there is no hanging pose or the puppet cannot follow
            the inputs; or it broke down.
    """
    check_positive(segment=segment, dt=dt, configuration=drift[0], velocity=drift[1])
    began = time.perf_counter()
    with one_blas_thread(), _solvable():
        fit = fit_of(record, segment, dt, threads)
        positive = np.zeros(len(record.labels), dtype=bool)
        positive[: len(record.unknowns)] = [one.positive for one in record.unknowns]
        noise = Noise.of(record)
        first = at = chained(fit, record.start_state(fit.inputs, float(fit.starts[0])))
        levels, found, kept = noise.guess, None, None
        rare = _thinned(fit)
        for stage in STAGES:
            wide = (stage.drift * max(drift[0], DRIFT[0]), stage.drift * max(drift[1], DRIFT[1]))
            weights = Weights(levels, drift if stage.final else wide, stage.final)
            some = fit if stage.final else rare
            cost = Cost(some, first, weights)
            if stage.drift == 1.0 and found is not None:
                judged = replace(cost, weights=replace(weights, drift=wide))
                at = untangled(replace(judged, fit=rare), found.at)
                kept = replace(found.kept, stale=found.kept.stale | found.at.differs(at))
                trusted = judged.explained(at, some.predict(at, extrapolated=True))
                if stage.final:
                    smooth = trusted & ~found.odd
                    trusted = smooth if 2 * np.sum(smooth) > np.sum(trusted) else trusted
                cost = replace(cost, trusted=trusted)
            report = None
            if progress is not None:
                report = _reporting(progress, stage.name)
                progress(Progress(stage.name))
            found = search(
                cost,
                at,
                positive,
                None if stage.final else kept,
                moves=stage.moves,
                tolerance=stage.tolerance,
                extrapolated=stage.extrapolated,
                states_only=stage.states_only,
                progress=report,
            )
            # Derivatives by the unknowns are not tried while these stay.
            at, kept = found.at, None if stage.states_only else found.kept
            if not stage.states_only:
                levels = noise.estimated(some, found)
        assert found is not None
        cost = replace(cost, weights=Weights(levels, drift, final=True))
        normal = cost.normal(at, found.predicted, fit.jacobians(at))
        spent = time.perf_counter() - began
        return Identified.of(record, cost, found, normal, spent)


def _thinned(fit: Fit) -> Fit:
    """The fit of every third sample: of rows, or of a column's own where rows would leave few."""
    there = np.isfinite(fit.y)
    rows = (np.arange(len(fit.y)) % _RARE == 0)[:, None] & there
    own = (np.cumsum(there, axis=0) % _RARE == 1) & there
    few = 2 * _RARE * np.sum(rows, axis=0) < np.sum(there, axis=0)
    kept = np.where(few, own, rows)
    some = np.any(kept, axis=1)
    return replace(fit, t=fit.t[some], y=np.where(kept, fit.y, np.nan)[some])


def _reporting(progress: OnProgress, name: str) -> OnProgress:
    return lambda at: progress(replace(at, what=name))


def fit_of(record: Record, segment: float, dt: float, threads: int | None) -> Fit:
    """The record as a problem of least squares."""
    marionette, table = record.marionette, record.marionette.coordinates
    p = marionette.p.copy()
    places = [marionette.parameter_index[one.name] for one in record.unknowns]
    p[places] = record.begin[: len(places)]
    marionette = marionette.with_p(p)
    x0 = record.start_state()
    given = record.inputs
    inputs = bind_input(marionette, given, x0.q_K, x0.v_K, given.start, given.end)
    layout = Layout(
        tuple(places),
        tuple(table.v_K.index(name) for name in record.offsets),
        tuple(i for i, one in enumerate(record.markers) if one.find),
        record.find_delay,
    )
    prior = np.full(len(record.labels), np.inf)
    for i, one in enumerate(record.unknowns):
        if one.known is not None:
            prior[i] = one.known
    there = np.any(np.isfinite(record.values), axis=1)
    t, y = record.t[there], record.values[there]
    begin = record.begin
    span = (t[0] - record.delay, t[-1] - record.delay)
    return Fit(
        marionette,
        inputs,
        record.channels,
        t,
        y,
        layout,
        begin,
        record.delay,
        prior,
        segment,
        segment / max(1, round(segment / dt)),
        default_threads() if threads is None else threads,
        span,
        record.channels.depends(x0.q_D, x0.q_K, p, places),
    )


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise levels of channels; those of one group share one.

    Attributes:
        given: (n_c,) NaN where they are to be estimated.
        guess: (n_c,) before anything is known.
        least: (n_c,) of estimates.
        groups: (n_c,) names.
    """

    given: Array
    guess: Array
    least: Array
    groups: tuple[str, ...]

    @classmethod
    def of(cls, record: Record) -> Noise:
        channels = record.channels
        kinds = ["marker"] * (3 * len(channels.markers))
        kinds += ["coordinate"] * len(channels.coordinates) + ["tension"] * len(channels.tensions)
        given = np.array(
            [
                record.noise.get(name, record.noise.get(group, np.nan))
                for name, group in zip(channels.names, channels.groups, strict=True)
            ]
        )
        guess = np.array([_GUESS[kind] for kind in kinds])
        return cls(
            given,
            np.where(np.isfinite(given), np.maximum(given, guess), guess),
            np.array([_LEAST_NOISE[kind] for kind in kinds]),
            channels.groups,
        )

    def estimated(self, fit: Fit, found: Found) -> Array:
        """(n_c,) levels from the residuals of a point, by their median, which outliers spare."""
        r = np.abs(found.predicted.y - fit.y)
        out = np.empty(len(self.groups))
        for group in set(self.groups):
            own = np.array([one == group for one in self.groups])
            some = r[:, own][np.isfinite(r[:, own])]
            out[own] = _MAD * np.median(some) if len(some) else np.nan
        out = np.where(np.isfinite(self.given), self.given, np.maximum(out, self.least))
        return np.where(np.isfinite(out), out, self.guess)


@contextmanager
def _solvable() -> Iterator[None]:
    """A search whose equations cannot be solved ends in an error that says what to do."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise StateError(
            f"the search broke down: {error}. Errors grow too much within a segment; take shorter "
            "segments, or begin nearer to the truth"
        ) from error


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keeps BLAS to one thread: matrices here are small, and many threads only wait."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield
