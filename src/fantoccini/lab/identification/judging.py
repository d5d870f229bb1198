"""Reasons to doubt an identification: residuals and jumps, compared with those of noise.

A column is a measured number of the record over time, and its residuals are measurements minus
predictions. A segment is a piece of the record that is simulated on its own; a jump is the
difference of two segments where they meet. In names, D stands for dynamic coordinates, which move
by the equations of motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.lab.identification.result import OUTLIER_RESIDUAL, IdentificationResult
from fantoccini.lab.identification.unit_names import channel_units

MAX_NOISE_CORRELATION = 0.2
"""Correlation of neighbouring residuals above which they are not noise."""
MIN_MEAN_JUMP, MEAN_JUMP_DEVIATIONS = 0.3, 4.0
"""A mean jump above both limits means that the model is wrong: relative to the drift, and to the
standard deviation of the mean."""
MAX_MEDIAN_JUMP = 0.5
"""Median jump, relative to the drift, above which the model is doubtful."""
MAX_OUTLIER_SHARE, MAX_LOST_SHARE = 0.02, 0.25
"""Share of outliers, and share of segments left out, above which the result is doubtful."""
NOISY_RATIO, QUIET_RATIO = 1.5, 0.67
"""Range of the residuals' spread, relative to a given noise level, that is plausible."""
MAD_FACTOR = 1.4826
"""Standard deviation of normal noise, relative to the median of its magnitude."""
MAX_NEIGHBOUR_STEP = 3.0
"""Largest time between neighbouring samples, relative to the column's median interval."""
MIN_NEIGHBOURS = 50
"""Smallest number of pairs of neighbours for which a correlation is computed."""
MAX_PRIOR_DEVIATIONS = 3.0
"""Largest plausible deviation from prior knowledge [standard deviations]."""
MAX_LISTED_NAMES = 3
"""Largest number of names in a sentence."""


@dataclass(frozen=True)
class ColumnFit:
    """Residuals of a column.

    Attributes:
        name: name of the column.
        unit: unit of the column.
        samples: number of samples.
        rms: root mean square of the residuals.
        spread: standard deviation of the residuals without outliers, from their median.
        noise: given or estimated standard deviation of the noise.
        given: whether the noise was given.
        within_two: share of the residuals within two standard deviations; 95 % for normal noise.
        correlation: correlation of each residual with the next one, about 0 for noise; NaN if there
            are few samples.
        outliers: number of samples beyond 4 standard deviations.
    """

    name: str
    unit: str
    samples: int
    rms: float
    spread: float
    noise: float
    given: bool
    within_two: float
    correlation: float
    outliers: int

    @property
    def is_correlated(self) -> bool:
        """Whether neighbouring residuals are correlated, unlike noise."""
        return self.correlation > MAX_NOISE_CORRELATION

    @property
    def doubtful(self) -> bool:
        """Whether the residuals differ from noise."""
        return self.is_correlated or (
            self.given and not QUIET_RATIO < self.spread / self.noise < NOISY_RATIO
        )


def column_fits(result: IdentificationResult) -> tuple[ColumnFit, ...]:
    """Residuals of every column that has samples."""
    channels, units, fits = result.record.channels, channel_units(result.record), []
    for j, (name, group) in enumerate(zip(channels.names, channels.groups, strict=True)):
        r, noise = (np.where(result.accepted, result.residuals[:, j], np.nan), result.noise[name])
        present = np.isfinite(r)
        if np.any(present):
            z = np.abs(r[present]) / noise
            rms = float(np.sqrt(np.mean(r[present] ** 2)))
            spread = float(MAD_FACTOR * np.median(z) * noise)
            is_given = name in result.record.noise or group in result.record.noise
            fits.append(
                ColumnFit(
                    name,
                    units[j],
                    int(np.sum(present)),
                    rms,
                    spread,
                    noise,
                    is_given,
                    float(np.mean(z <= 2.0)),
                    _neighbour_correlation(result.t, r / noise),
                    int(np.sum(z > OUTLIER_RESIDUAL)),
                )
            )
    return tuple(fits)


def _neighbour_correlation(t: Array, z: Array) -> float:
    """Correlation of a column's neighbouring residuals, outliers clipped; NaN if there are few.

    The mean is not subtracted, so that a bias counts as well.
    """
    is_present = np.isfinite(z)
    t, z = t[is_present], np.clip(z[is_present], -OUTLIER_RESIDUAL, OUTLIER_RESIDUAL)
    adjacent = (
        np.diff(t) < MAX_NEIGHBOUR_STEP * np.median(np.diff(t))
        if len(t) > 1
        else np.zeros(0, dtype=bool)
    )
    residuals, next_residuals = z[:-1][adjacent], z[1:][adjacent]
    norm = float(np.sqrt(np.sum(residuals**2) * np.sum(next_residuals**2)))
    return (
        float(np.sum(residuals * next_residuals)) / norm
        if len(residuals) >= MIN_NEIGHBOURS and norm > 0.0
        else float("nan")
    )


@dataclass(frozen=True)
class BiasedJump:
    """A coordinate or velocity whose jumps between segments have a mean far from 0.

    Attributes:
        name: name of the coordinate or velocity.
        mean: mean jump between segments, relative to the drift.
        acceleration: acceleration that the model lacks, for a velocity; 0 for a coordinate.
        unit: unit of the acceleration.
    """

    name: str
    mean: float
    acceleration: float
    unit: str

    def __str__(self) -> str:
        text = f"{self.name}: {self.mean:+.2f} of the drift, on average"
        if self.acceleration:
            text += f", as if {self.acceleration:+.2g} {self.unit} were missing"
        return text


def biased_jumps(result: IdentificationResult) -> tuple[BiasedJump, ...]:
    """Coordinates and velocities that jump mostly to one side, the largest mean first."""
    is_counted = ~np.isin(result.starts[:-1], result.rejected)
    jumps = np.clip(result.jumps[is_counted], -OUTLIER_RESIDUAL, OUTLIER_RESIDUAL)
    table = result.record.marionette.coordinates
    if len(jumps) < 2:
        return ()
    mean, n, names = np.mean(jumps, axis=0), table.n_vD, jump_names(result)
    significant = np.abs(mean) > MEAN_JUMP_DEVIATIONS * np.std(jumps, axis=0) / np.sqrt(len(jumps))
    units = {row.name: row.unit for row in table.rows}
    duration, biased = result.starts[1] - result.starts[0], []
    for k in np.argsort(-np.abs(mean)):
        if significant[k] and abs(mean[k]) > MIN_MEAN_JUMP:
            rate = 0.0 if k < n else result.allowed[1] / duration
            unit = f"{units.get(table.v_D[k % n], 'rad')}/s²"
            biased.append(BiasedJump(names[k], float(mean[k]), float(mean[k] * rate), unit))
    return tuple(biased)


def jump_names(result: IdentificationResult) -> tuple[str, ...]:
    """(2 n_vD,) names of the columns of ``jumps``: configurations, then velocities."""
    names = result.record.marionette.coordinates.v_D
    return (*names, *(f"velocity of {name}" for name in names))


def prior_shares(result: IdentificationResult) -> dict[str, float]:
    """Unknown -> share of its prior in the estimate; 1 if the record adds nothing to it."""
    shares = {}
    for name, unknown, deviation in zip(
        result.names, result.record.unknowns, result.deviations.tolist(), strict=False
    ):
        if unknown.known is not None:
            shares[name] = (
                min(1.0, (deviation / unknown.known) ** 2) if np.isfinite(deviation) else 1.0
            )
    return shares


def doubts(result: IdentificationResult) -> tuple[str, ...]:
    """Reasons to doubt an identification, as sentences; none if the residuals look like noise.

    A wrong model that still fits the record is not detected: if a given mass is too large, the
    estimated ones are too large.
    """
    return tuple(_doubts(result))


def _doubts(result: IdentificationResult) -> Iterator[str]:
    if result.at_bound:
        yield "The delay reached the end of its range; give a better initial value: {about: ...}."
    elif not result.converged:
        yield (
            "The search did not converge: one more step would change a number by "
            f"{result.remaining_move:.2g} standard deviations."
        )
    if result.combinations:
        undetermined = [
            n for n, d in zip(result.names, result.deviations, strict=True) if np.isinf(d)
        ]
        yield f"The record does not determine {_names_text(undetermined)}."
    for name, x, unknown in zip(
        result.names, result.values.tolist(), result.record.unknowns, strict=False
    ):
        prior_value = result.record.initial_values[result.names.index(name)]
        deviation = abs(x - prior_value)
        if unknown.known is not None and deviation > MAX_PRIOR_DEVIATIONS * unknown.known:
            yield (
                f"{name} is {deviation / unknown.known:.1f} standard deviations from the "
                "value known beforehand."
            )
    fits = column_fits(result)
    correlated = sorted((f for f in fits if f.is_correlated), key=lambda f: -f.correlation)
    if correlated:
        yield (
            f"Neighbouring residuals of {_names_text([f.name for f in correlated])} are correlated "
            f"(up to {correlated[0].correlation:.2f}), unlike noise: the model, the position of a "
            "marker or a camera's axes are wrong, or the samples were smoothed."
        )
    for text, doubtful_fits in (
        ("more than", [f for f in fits if f.given and f.spread > NOISY_RATIO * f.noise]),
        ("less than", [f for f in fits if f.given and f.spread < QUIET_RATIO * f.noise]),
    ):
        if doubtful_fits:
            fit_names = _names_text([f.name for f in doubtful_fits])
            yield f"Residuals of {fit_names} are {text} the noise given."
    biased = biased_jumps(result)
    if biased:
        names = [jump.name for jump in biased]
        yield (
            f"Jumps between segments go mostly to one side: {_names_text(names)}, by "
            f"{abs(biased[0].mean):.2g} of the drift. A force or a position is missing or wrong."
        )
    if result.drift > MAX_MEDIAN_JUMP:
        yield (
            f"Jumps between segments are {result.drift:.2g} of the drift, in the median; the model "
            "is too simple or the drift too small."
        )
    n, n_outliers = sum(f.samples for f in fits), len(result.outliers)
    if n_outliers > MAX_OUTLIER_SHARE * n:
        yield f"{n_outliers} of {n} samples are outliers."
    if len(result.rejected) > MAX_LOST_SHARE * len(result.starts):
        yield (
            f"{len(result.rejected)} of {len(result.starts)} segments do not fit and were left "
            "out: strings may have come taut in another order, or samples are far off."
        )


def _names_text(names: list[str]) -> str:
    n_more = len(names) - MAX_LISTED_NAMES
    return ", ".join(names[:MAX_LISTED_NAMES]) + (f" and {n_more} more" if n_more > 0 else "")
