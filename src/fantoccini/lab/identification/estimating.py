"""``identify``: least-squares estimates of a puppet's unknown parameters from a record.

A record is measurements of a puppet in motion under known inputs. Its segments are simulated
separately; the jump between two of them is allowed a standard deviation, the drift. In names, D
stands for dynamic coordinates, which move by the equations of motion, and K for driven ones: ends
and lengths of strings, driven joints.
"""

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
from fantoccini.lab.identification.fit import Fit, continuous_point
from fantoccini.lab.identification.reattaching import reattach
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.result import IdentificationResult
from fantoccini.lab.identification.search_point import Layout, Weights
from fantoccini.lab.identification.searching import SearchResult, search

INITIAL_NOISE = {"marker": 5e-3, "coordinate": 0.03, "tension": 0.3}
"""Noise levels with which the search begins [m, rad or m, N]."""
MIN_NOISE = {"marker": 1e-6, "coordinate": 1e-6, "tension": 1e-4}
MAD_FACTOR = 1.4826
"""Standard deviation of normal noise, relative to the median of its magnitude."""


@dataclass(frozen=True)
class Stage:
    """A stage of the search.

    Attributes:
        name: name for the progress callback.
        drift_factor: factor on the drift, 1 in the final stage.
        max_iterations: maximum number of iterations, unless the cost still falls steeply.
        tolerance: relative fall of the cost in an iteration below which the stage ends.
        extrapolated: whether predictions are extrapolated to a time step of 0.
        states_only: whether the unknowns stay fixed.
        final: whether all samples count, with Cauchy's loss.
    """

    name: str
    drift_factor: float
    max_iterations: int
    tolerance: float
    extrapolated: bool = True
    states_only: bool = False
    final: bool = False


DEFAULT_DRIFT = (5e-4, 5e-3)
"""Standard deviations of the jumps of configurations and velocities between segments [rad or m, and
per second]. Time steps have errors of this size when strings come taut, so stages before the final
one use no smaller drift."""
THINNING_FACTOR = 3
"""Every third sample counts, except in the final stage."""
STAGES = (
    Stage("states near the record", 50.0, 3, 0.1, False, True),
    Stage("first estimates", 50.0, 12, 0.05, False),
    Stage("segments joined", 4.0, 8, 0.01),
    Stage("segments joined closely", 1.0, 6, 1e-4),
    Stage("all samples", 1.0, 3, 2e-5, final=True),
)
"""Segments are joined loosely at first, so that each of them can approach the record."""


def identify(
    record: Record,
    *,
    segment: float = 0.25,
    dt: float = 0.005,
    drift: tuple[float, float] = DEFAULT_DRIFT,
    threads: int | None = None,
    progress: OnProgress | None = None,
) -> IdentificationResult:
    """Estimates a record's unknowns and their errors; names combinations it does not determine.

        min  sum rho((y_i - y(t_i - delay; x_s, theta)) / noise)
             + sum |x_s+1 - x(T_s+1; x_s, theta)|^2 / drift^2

    over the unknowns theta and the first states x_s of all segments (multiple shooting), by
    Levenberg and Marquardt with exact derivatives of the time steps. Residuals are extrapolated to
    a time step of 0. rho is Huber's loss, and Cauchy's in the final stage, so that outliers count
    little.

    Args:
        record: the record.
        segment: duration of a segment [s].
        dt: step of the time-stepper [s].
        drift: standard deviations of the jumps between segments, of configuration and velocity [m
            or rad, and per second]; they stand for effects that the model leaves out.
        threads: number of threads; all processors by default.
        progress: called with the stage, and with the lowest cost as ``best`` (None when a stage
            begins).

    Raises:
        StateError: the puppet has no hanging pose or cannot follow the inputs with the initial
            values, or the search broke down.
    """
    check_positive(segment=segment, dt=dt, configuration=drift[0], velocity=drift[1])
    start_time = time.perf_counter()
    with one_blas_thread(), _explain_singular():
        fit = make_fit(record, segment, dt, threads)
        positive = np.zeros(len(record.labels), dtype=bool)
        positive[: len(record.unknowns)] = [unknown.positive for unknown in record.unknowns]
        noise = NoiseLevels.from_record(record)
        first_point = point = continuous_point(
            fit, record.start_state(fit.inputs, float(fit.starts[0]))
        )
        levels, result, saved_jacobians = noise.guess, None, None
        thinned_fit = _thin(fit)
        for stage in STAGES:
            loose_drift = (
                stage.drift_factor * max(drift[0], DEFAULT_DRIFT[0]),
                stage.drift_factor * max(drift[1], DEFAULT_DRIFT[1]),
            )
            weights = Weights(levels, drift if stage.final else loose_drift, stage.final)
            stage_fit = fit if stage.final else thinned_fit
            cost = Cost(stage_fit, first_point, weights)
            if stage.drift_factor == 1.0 and result is not None:
                loose_cost = replace(cost, weights=replace(weights, drift=loose_drift))
                point = reattach(replace(loose_cost, fit=thinned_fit), result.point)
                saved_jacobians = replace(
                    result.saved_jacobians,
                    stale=result.saved_jacobians.stale | result.point.changed_segments(point),
                )
                # Other segments have an order of events that the puppet did not have.
                trusted = loose_cost.explained_segments(
                    point, stage_fit.predict(point, extrapolated=True)
                )
                if stage.final:
                    well_predicted = trusted & ~result.poorly_predicted
                    trusted = (
                        well_predicted if 2 * np.sum(well_predicted) > np.sum(trusted) else trusted
                    )
                cost = replace(cost, trusted=trusted)
            stage_progress = None
            if progress is not None:
                stage_progress = _with_stage_name(progress, stage.name)
                progress(Progress(stage.name))
            result = search(
                cost,
                point,
                positive,
                None if stage.final else saved_jacobians,
                max_iterations=stage.max_iterations,
                tolerance=stage.tolerance,
                extrapolated=stage.extrapolated,
                states_only=stage.states_only,
                progress=stage_progress,
            )
            # A search with fixed unknowns does not check whether their derivatives still hold.
            point = result.point
            saved_jacobians = None if stage.states_only else result.saved_jacobians
            if not stage.states_only:
                levels = noise.estimate(stage_fit, result)
        assert result is not None
        cost = replace(cost, weights=Weights(levels, drift, final=True))
        equations = cost.normal_equations(point, result.prediction, fit.jacobians(point))
        seconds = time.perf_counter() - start_time
        return IdentificationResult.from_search(record, cost, result, equations, seconds)


def _thin(fit: Fit) -> Fit:
    """The fit to every third row; to every third sample in columns that would keep too few."""
    is_present = np.isfinite(fit.y)
    rows = (np.arange(len(fit.y)) % THINNING_FACTOR == 0)[:, None] & is_present
    by_column = (np.cumsum(is_present, axis=0) % THINNING_FACTOR == 1) & is_present
    too_few = 2 * THINNING_FACTOR * np.sum(rows, axis=0) < np.sum(is_present, axis=0)
    is_kept = np.where(too_few, by_column, rows)
    has_samples = np.any(is_kept, axis=1)
    return replace(fit, t=fit.t[has_samples], y=np.where(is_kept, fit.y, np.nan)[has_samples])


def _with_stage_name(progress: OnProgress, name: str) -> OnProgress:
    return lambda event: progress(replace(event, what=name))


def make_fit(record: Record, segment: float, dt: float, threads: int | None) -> Fit:
    """The least-squares problem of a record; the arguments are those of :func:`identify`."""
    marionette, coordinates = record.marionette, record.marionette.coordinates
    p = marionette.p.copy()
    indices = [marionette.parameter_index[unknown.name] for unknown in record.unknowns]
    p[indices] = record.initial_values[: len(indices)]
    marionette = marionette.with_p(p)
    x0 = record.start_state()
    commanded = record.inputs
    inputs = bind_input(marionette, commanded, x0.q_K, x0.v_K, commanded.start, commanded.end)
    layout = Layout(
        tuple(indices),
        tuple(coordinates.v_K.index(name) for name in record.offsets),
        tuple(i for i, marker in enumerate(record.markers) if marker.find),
        record.find_delay,
    )
    prior_std = np.full(len(record.labels), np.inf)
    for i, unknown in enumerate(record.unknowns):
        if unknown.known is not None:
            prior_std[i] = unknown.known
    has_samples = np.any(np.isfinite(record.values), axis=1)
    t, y = record.t[has_samples], record.values[has_samples]
    time_range = (t[0] - record.delay, t[-1] - record.delay)
    return Fit(
        marionette,
        inputs,
        record.channels,
        t,
        y,
        layout,
        record.initial_values,
        record.delay,
        prior_std,
        segment,
        segment / max(1, round(segment / dt)),
        default_threads() if threads is None else threads,
        time_range,
        record.channels.depend_on(x0.q_D, x0.q_K, p, indices),
    )


@dataclass(frozen=True, eq=False)
class NoiseLevels:
    """Noise levels of channels; the channels of a group share one.

    Attributes:
        given: (n_c,) known levels; NaN where they are estimated.
        guess: (n_c,) levels with which the search begins.
        min_level: (n_c,) lower limits of the estimates.
        groups: (n_c,) names of the groups.
    """

    given: Array
    guess: Array
    min_level: Array
    groups: tuple[str, ...]

    @classmethod
    def from_record(cls, record: Record) -> NoiseLevels:
        channels = record.channels
        kinds = ["marker"] * (3 * len(channels.markers))
        kinds += ["coordinate"] * len(channels.coordinates) + ["tension"] * len(channels.tensions)
        noise = np.array(
            [
                record.noise.get(name, record.noise.get(group, np.nan))
                for name, group in zip(channels.names, channels.groups, strict=True)
            ]
        )
        guess = np.array([INITIAL_NOISE[kind] for kind in kinds])
        return cls(
            noise,
            np.where(np.isfinite(noise), np.maximum(noise, guess), guess),
            np.array([MIN_NOISE[kind] for kind in kinds]),
            channels.groups,
        )

    def estimate(self, fit: Fit, result: SearchResult) -> Array:
        """(n_c,) levels from the median of the residuals, which outliers hardly change."""
        r = np.abs(result.prediction.y - fit.y)
        levels = np.empty(len(self.groups))
        for group in set(self.groups):
            is_member = np.array([name == group for name in self.groups])
            residuals = r[:, is_member][np.isfinite(r[:, is_member])]
            levels[is_member] = MAD_FACTOR * np.median(residuals) if len(residuals) else np.nan
        levels = np.where(np.isfinite(self.given), self.given, np.maximum(levels, self.min_level))
        return np.where(np.isfinite(levels), levels, self.guess)


@contextmanager
def _explain_singular() -> Iterator[None]:
    """Turns the error of singular equations into one that says what to do."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise StateError(
            f"the search broke down: {error}. Errors grow too much within a segment; take shorter "
            "segments, or better initial values"
        ) from error


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limits BLAS to one thread, as the matrices are small."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield
