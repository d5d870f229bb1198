"""Result of an identification: estimates, their errors, and undetermined combinations.

A record is measurements of a puppet in motion. A combination of unknowns is undetermined if the
record fits as well when they change together. In names, D stands for dynamic coordinates, which
move by the equations of motion. A segment is a piece of the record that is simulated from its own
first state.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fantoccini.base import Array, MaskRows, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.identification.blocks import NormalEquations
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import DELAY_RANGE
from fantoccini.lab.identification.marking import write_numbers
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.searching import MIN_DAMPING, SearchResult

MAX_DEVIATION = 1.0
"""Standard deviation above which a combination counts as undetermined, relative to the sizes of its
numbers."""
MAX_REMAINING_MOVE = 1.0
"""Largest change of a number in one more step of a converged search [standard deviations]."""
MIN_SHARE = 0.05
"""Smallest share of a number that is listed in a combination."""
INTERVAL_DEVIATIONS = 1.959964
"""Half width of a 95 % interval, in standard deviations."""
OUTLIER_RESIDUAL = 4.0
"""Residual, relative to the noise, above which a sample counts as an outlier."""


@dataclass(frozen=True)
class Combination:
    """A combination of numbers that the record does not determine.

    Attributes:
        parts: name -> share. Changes in this proportion do not change the measured channels:
            relative ones of parameters, or in units of 1 cm and 10 ms.
        deviation: relative standard deviation of the combination.
    """

    parts: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        terms = [f"{share:+.2f} {name}" for name, share in self.parts.items()]
        if len(terms) == 1:
            return f"{next(iter(self.parts))} is not determined"
        return "only together: " + " ".join(terms)


@dataclass(frozen=True)
class Outlier:
    """A sample far from the model's prediction.

    Attributes:
        t: time by the record's clock [s].
        column: name of the column.
        residual: sample minus prediction, relative to the noise.
    """

    t: float
    column: str
    residual: float


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """Estimates of a puppet's unknown numbers from a record.

    Attributes:
        record: the record.
        names: (P,) names of the unknowns.
        values: (P,) estimates.
        deviations: (P,) standard deviations; infinite for numbers that are not determined.
        correlation: (P, P) correlations of the errors; 0 for numbers that are not determined.
        information: (P, P) Fisher information of the unknowns, with the states eliminated.
        combinations: combinations of numbers that the record does not determine.
        noise: column -> given or estimated standard deviation.
        chi2: mean square of the residuals relative to the noise, without omitted segments, each
            clipped at the limit of outliers; 1 if only noise remains.
        drift: median of the jumps between segments, relative to the allowed drift; far below 1 for
            a complete model.
        outliers: samples more than 4 standard deviations off, without omitted segments.
        rejected: start times of omitted segments, by the inputs' clock [s]: the model does not fit
            them, or its derivatives do not predict small changes.
        t: (N,) times of the samples [s].
        accepted: (N,) bool, samples outside of the omitted segments.
        residuals: (N, columns) samples minus predictions; NaN in gaps.
        predicted: (N, columns) predictions with the estimates, also in gaps.
        starts: (S,) start times of the segments, by the inputs' clock [s].
        jumps: (S - 1, 2 n_vD) configurations and velocities at the start of segments minus those
            at the end of the previous ones, relative to the allowed drift; 0 after omitted
            segments.
        allowed: the allowed drift, of configurations and velocities [m or rad, and per second].
        remaining_move: largest change by one more step of the search [standard deviations].
        seconds: computing time [s].
    """

    record: Record
    names: tuple[str, ...]
    values: Array
    deviations: Array
    correlation: Array
    information: Array
    combinations: tuple[Combination, ...]
    noise: dict[str, float]
    chi2: float
    drift: float
    outliers: tuple[Outlier, ...]
    rejected: tuple[float, ...]
    t: Array
    accepted: MaskRows
    residuals: Array
    predicted: Array
    starts: Array
    jumps: Array
    allowed: tuple[float, float]
    remaining_move: float
    seconds: float

    @property
    def converged(self) -> bool:
        """Whether the search converged: one more step would hardly change any number.

        It is false if the delay is at the end of its range, beyond which it may lie.
        """
        return self.remaining_move < MAX_REMAINING_MOVE and not self.at_bound

    @property
    def at_bound(self) -> bool:
        """Whether the delay reached the end of its range, 0.25 s from its initial value."""
        change = abs(self.values[-1] - self.record.delay) if self.record.find_delay else 0.0
        return bool(change > 0.999 * DELAY_RANGE)

    @property
    def delay(self) -> float:
        """Delay of the record's clock, estimated or given [s]."""
        return float(self.values[-1]) if self.record.find_delay else self.record.delay

    @classmethod
    def from_search(
        cls,
        record: Record,
        cost: Cost,
        result: SearchResult,
        normal: NormalEquations,
        seconds: float,
    ) -> IdentificationResult:
        """The estimates at the end of a search."""
        fit, weights, F = cost.fit, cost.weights, normal.information()
        deviations, correlation, combinations = error_analysis(
            F, record.scales_at(result.point.theta), record.labels
        )
        residuals = fit.y - result.prediction.y
        trusted = np.ones(len(fit.starts), dtype=bool) if cost.trusted is None else cost.trusted
        accepted = trusted[fit.segments(result.point.theta)]
        r = np.where(accepted[:, None], residuals / weights.noise, np.nan)
        outliers = [
            Outlier(float(fit.t[i]), record.channels.names[j], float(r[i, j]))
            for i, j in np.argwhere(np.abs(r) > OUTLIER_RESIDUAL)
        ]
        rejected = tuple(fit.starts[~trusted].tolist())
        jumps = cost.jumps(result.point, result.prediction)
        counted_jumps = jumps[trusted[:-1]]
        return cls(
            record,
            record.labels,
            result.point.theta.copy(),
            deviations,
            correlation,
            F,
            combinations,
            dict(zip(record.channels.names, weights.noise.tolist(), strict=True)),
            float(np.nanmean(np.minimum(np.abs(r), OUTLIER_RESIDUAL) ** 2)),
            float(np.sqrt(np.median(counted_jumps**2))) if len(counted_jumps) else 0.0,
            tuple(outliers),
            rejected,
            fit.t,
            accepted,
            residuals,
            result.prediction.y,
            fit.starts,
            jumps,
            weights.drift,
            _remaining_move(normal, deviations),
            seconds,
        )

    def __repr__(self) -> str:
        name = self.record.name or self.record.marionette.name
        return f"<IdentificationResult {name}: {self.summary()}>"

    def __getitem__(self, name: str) -> float:
        """The estimate of an unknown, by its name."""
        return float(self.values[self._index(name)])

    def deviation(self, name: str) -> float:
        """The standard deviation of an unknown, by its name."""
        return float(self.deviations[self._index(name)])

    def interval(self, name: str) -> tuple[float, float]:
        """The 95 % interval of an unknown, by its name."""
        i = self._index(name)
        half = INTERVAL_DEVIATIONS * self.deviations[i]
        return float(self.values[i] - half), float(self.values[i] + half)

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise UnknownNameError("identified number", name, self.names)
        return self.names.index(name)

    @cached_property
    def marionette(self) -> Marionette:
        """The puppet with the estimates; undetermined numbers keep their initial values."""
        unknowns = self.record.unknowns
        initial_values = self.record.initial_values
        return self.record.marionette.with_parameters(
            {
                unknown.name: float(x if np.isfinite(deviation) else initial)
                for unknown, x, initial, deviation in zip(
                    unknowns, self.values, initial_values, self.deviations, strict=False
                )
            }
        )

    def save_puppet(self, path: str | Path) -> None:
        """Writes the puppet's file with the estimates; the rest of its text stays unchanged.

        Undetermined numbers are not changed. Offsets of driven coordinates, positions of markers
        and the delay are not part of a puppet's file.

        Raises:
            StateError: the record was not read from a file, or the folder lacks a file that the
                puppet names.
            FileNotFoundError: the folder does not exist.
        """
        source = self.record.puppet_file
        if source is None:
            raise StateError(
                "the puppet was not read from a file beside a record file; "
                "`marionette` is the puppet with the estimates"
            )
        numbers = {
            mark: float(x)
            for mark, x, d in zip(
                self.record.file_numbers, self.values, self.deviations, strict=False
            )
            if np.isfinite(d)
        }
        self.record.check_folder(Path(path).parent)
        write_numbers(source.read_bytes().decode("utf-8-sig"), numbers, path)

    def rms(self) -> dict[str, float]:
        """Column -> root mean square of the residuals; columns without samples are left out."""
        return {
            name: float(np.sqrt(np.nanmean(r**2)))
            for name, r in zip(self.record.channels.names, self.residuals.T, strict=True)
            if np.any(np.isfinite(r))
        }

    def summary(self) -> str:
        """The estimates in a few lines."""
        lines = [
            f"{name} = {x:.6g} +- {d:.2g}" if np.isfinite(d) else f"{name} is not determined"
            for name, x, d in zip(self.names, self.values, self.deviations, strict=True)
        ]
        lines += [str(combination) for combination in self.combinations]
        lines.append(
            f"chi2 {self.chi2:.3g}, {len(self.outliers)} outliers, {self.seconds:.1f} s"
            + ("" if self.converged else "; the search did not converge")
        )
        if self.at_bound:
            lines.append(
                f"the delay is {DELAY_RANGE:g} s from its initial value, the largest change; give "
                "a better initial value"
            )
        return "\n".join(lines)


def _remaining_move(normal: NormalEquations, deviations: Array) -> float:
    """Largest change of a number in one more step of the search [standard deviations]."""
    _, step = normal.step(np.full(len(normal.g), MIN_DAMPING), 0.0)
    is_determined = np.isfinite(deviations) & (deviations > 0.0)
    return float(np.max(np.abs(step[is_determined]) / deviations[is_determined], initial=0.0))


def error_analysis(
    information: Array, scales: Array, names: tuple[str, ...]
) -> tuple[Array, Array, tuple[Combination, ...]]:
    """Standard deviations, correlations, and undetermined combinations.

    The eigenvectors of the information, scaled by the sizes of the numbers, are combinations with
    independent errors, whose standard deviations are 1 / sqrt(eigenvalue).
    """
    F = information * np.outer(scales, scales)
    values, vectors = np.linalg.eigh(0.5 * (F + F.T))
    is_undetermined = values < 1.0 / MAX_DEVIATION**2
    variances = np.where(is_undetermined, 0.0, 1.0 / np.maximum(values, 1e-300))
    covariance = (vectors * variances) @ vectors.T
    in_undetermined = np.sqrt(np.sum(vectors[:, is_undetermined] ** 2, axis=1)) > MIN_SHARE
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    divisors = np.where(deviations > 0.0, deviations, 1.0)
    correlation = covariance / np.outer(divisors, divisors)
    correlation[in_undetermined] = correlation[:, in_undetermined] = 0.0
    combinations = []
    for value, vector in zip(values[is_undetermined], vectors[:, is_undetermined].T, strict=True):
        largest = vector[np.argmax(np.abs(vector))]
        shares = vector / largest
        parts = {
            name: float(share)
            for name, share in zip(names, shares, strict=True)
            if abs(share) > MIN_SHARE
        }
        combinations.append(Combination(parts, float(1.0 / np.sqrt(max(value, 1e-300)))))
    return np.where(in_undetermined, np.inf, deviations * scales), correlation, tuple(combinations)
