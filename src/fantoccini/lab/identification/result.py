"""What a record told: values, their errors, and what it cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from fantoccini.base import Array, MaskRows, StateError, UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.identification.blocks import Normal
from fantoccini.lab.identification.cost import Cost
from fantoccini.lab.identification.fit import REACH
from fantoccini.lab.identification.marking import write_numbers
from fantoccini.lab.identification.record import Record
from fantoccini.lab.identification.searching import LEAST_DAMPING, Found

UNTOLD = 1.0
"""Standard deviation of a combination, relative to the sizes of what it combines, from which on
the record does not tell it."""
_LEFT = 1.0
"""Standard deviations by which one more step may still move a number of a search that ended."""
_SHARE = 0.05
"""Part of a combination below which a number is left out of its words."""
_SURE = 1.959964
"""Standard deviations of a 95 % interval."""
LISTED = 4.0
"""Residual, over the noise, of a sample that is listed as an outlier."""


@dataclass(frozen=True)
class Combination:
    """Numbers that the record cannot tell apart.

    Attributes:
        parts: name -> share; relative changes, or steps of 1 cm and 10 ms, in this proportion leave
            what was measured as it is.
        deviation: standard deviation along it, relative.
    """

    parts: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        terms = [f"{share:+.2f} {name}" for name, share in self.parts.items()]
        if len(terms) == 1:
            return f"{next(iter(self.parts))} is not told"
        return "only together: " + " ".join(terms)


@dataclass(frozen=True)
class Outlier:
    """A sample far from what the model says.

    Attributes:
        t: time by the record's clock [s].
        column: its name.
        residual: sample less prediction, over the noise.
    """

    t: float
    column: str
    residual: float


@dataclass(frozen=True, eq=False)
class Identified:
    """What a record told of a puppet.

    Attributes:
        record: it.
        names: (P,) what was looked for.
        values: (P,) estimates.
        deviations: (P,) standard deviations; infinite where the record does not tell.
        correlation: (P, P) of the errors, 0 for what is not told.
        information: (P, P) Fisher information of the unknowns, the states being unknown, too.
        combinations: that the record cannot tell apart.
        noise: column -> standard deviation that was given or estimated.
        chi2: mean square of the residuals over the noise, of samples that count, each cut off at
            that of an outlier; 1 where noise is all that is left.
        drift: median of the gaps between segments over the drift that was allowed; far below 1
            where the model leaves nothing out.
        outliers: samples that count and are more than 4 standard deviations off.
        lost: where segments begin that do not count, by the inputs' clock [s]: the model does not
            explain them, or its derivatives do not tell what small moves of them do.
        t: (N,) times of the samples [s].
        counts: (N,) bool, samples in segments that count.
        residuals: (N, columns) samples less predictions; NaN in gaps.
        predicted: (N, columns) what the puppet with these numbers does, in gaps, too.
        starts: (S,) where segments begin, by the inputs' clock [s].
        jumps: (S - 1, 2 n_vD) first configurations and velocities of segments less the ends before
            them, over the drift that was allowed; 0 behind segments that do not count.
        allowed: that drift, of configurations and velocities [m or rad, and per second].
        left: largest move that one more step would make, over the standard deviations.
        seconds: that it took.
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
    lost: tuple[float, ...]
    t: Array
    counts: MaskRows
    residuals: Array
    predicted: Array
    starts: Array
    jumps: Array
    allowed: tuple[float, float]
    left: float
    seconds: float

    @property
    def converged(self) -> bool:
        """Whether the search came to its end: one more step would move no number far.

        A delay at the end of its range may lie beyond it.
        """
        return self.left < _LEFT and not self.at_bound

    @property
    def at_bound(self) -> bool:
        """Whether the delay came to the end of its range, 0.25 s from where the search began."""
        far = abs(self.values[-1] - self.record.delay) if self.record.find_delay else 0.0
        return bool(far > 0.999 * REACH)

    @property
    def delay(self) -> float:
        """Of the record's clock, found or given [s]."""
        return float(self.values[-1]) if self.record.find_delay else self.record.delay

    @classmethod
    def of(
        cls, record: Record, cost: Cost, found: Found, normal: Normal, seconds: float
    ) -> Identified:
        """From the end of a search."""
        fit, weights, F = cost.fit, cost.weights, normal.information()
        deviations, correlation, combinations = told(F, record.sizes(found.at.theta), record.labels)
        residuals = fit.y - found.predicted.y
        trusted = np.ones(len(fit.starts), dtype=bool) if cost.trusted is None else cost.trusted
        counts = trusted[fit.segments(found.at.theta)]
        r = np.where(counts[:, None], residuals / weights.noise, np.nan)
        listed = [
            Outlier(float(fit.t[i]), record.channels.names[j], float(r[i, j]))
            for i, j in np.argwhere(np.abs(r) > LISTED)
        ]
        lost = tuple(fit.starts[~trusted].tolist())
        gaps = cost.gaps(found.at, found.predicted)
        counted = gaps[trusted[:-1]]
        return cls(
            record,
            record.labels,
            found.at.theta.copy(),
            deviations,
            correlation,
            F,
            combinations,
            dict(zip(record.channels.names, weights.noise.tolist(), strict=True)),
            float(np.nanmean(np.minimum(np.abs(r), LISTED) ** 2)),
            float(np.sqrt(np.median(counted**2))) if len(counted) else 0.0,
            tuple(listed),
            lost,
            fit.t,
            counts,
            residuals,
            found.predicted.y,
            fit.starts,
            gaps,
            weights.drift,
            _left(normal, deviations),
            seconds,
        )

    def __repr__(self) -> str:
        return f"<Identified {self.record.name or self.record.marionette.name}: {self.summary()}>"

    def __getitem__(self, name: str) -> float:
        """The estimate of a name."""
        return float(self.values[self._index(name)])

    def deviation(self, name: str) -> float:
        """The standard deviation of a name."""
        return float(self.deviations[self._index(name)])

    def interval(self, name: str) -> tuple[float, float]:
        """The 95 % interval of a name."""
        i = self._index(name)
        half = _SURE * self.deviations[i]
        return float(self.values[i] - half), float(self.values[i] + half)

    def _index(self, name: str) -> int:
        if name not in self.names:
            raise UnknownNameError("identified number", name, self.names)
        return self.names.index(name)

    @cached_property
    def marionette(self) -> Marionette:
        """The puppet with the numbers found; those that are not told keep their first values."""
        unknowns = self.record.unknowns
        begin = self.record.begin
        return self.record.marionette.with_parameters(
            {
                one.name: float(x if np.isfinite(d) else b)
                for one, x, b, d in zip(unknowns, self.values, begin, self.deviations, strict=False)
            }
        )

    def save_puppet(self, path: str | Path) -> None:
        """Writes the puppet's file with the numbers found; the rest of its text stays.

        Numbers that are not told are left as they were. Offsets of driven coordinates, places of
        markers and the delay are no part of a puppet's file.

        Raises:
            StateError: the record was not read from a file, or the folder lacks a file that the
                puppet names.
            FileNotFoundError: the folder does not exist.
        """
        source = self.record.puppet_file
        if source is None:
            raise StateError(
                "the puppet was not read from a file beside a record file; "
                "`marionette` is the puppet with the numbers found"
            )
        numbers = {
            mark: float(x)
            for mark, x, d in zip(self.record.marks, self.values, self.deviations, strict=False)
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
        """What was found, in a few lines."""
        lines = [
            f"{name} = {x:.6g} +- {d:.2g}" if np.isfinite(d) else f"{name} is not told"
            for name, x, d in zip(self.names, self.values, self.deviations, strict=True)
        ]
        lines += [str(one) for one in self.combinations]
        lines.append(
            f"chi2 {self.chi2:.3g}, {len(self.outliers)} outliers, {self.seconds:.1f} s"
            + ("" if self.converged else "; the search was cut short")
        )
        if self.at_bound:
            lines.append(f"the delay is {REACH:g} s from where it began, the most; begin nearer")
        return "\n".join(lines)


def _left(normal: Normal, deviations: Array) -> float:
    """The largest part of a standard deviation by which one more step would move a number."""
    _, step = normal.step(np.full(len(normal.g), LEAST_DAMPING), 0.0)
    clear = np.isfinite(deviations) & (deviations > 0.0)
    return float(np.max(np.abs(step[clear]) / deviations[clear], initial=0.0))


def told(
    information: Array, scales: Array, names: tuple[str, ...]
) -> tuple[Array, Array, tuple[Combination, ...]]:
    """Standard deviations, correlations, and combinations that are not told.

    The eigenvectors of the information, scaled by the sizes of the numbers, are combinations with
    errors that do not depend on one another: 1 / sqrt(eigenvalue).
    """
    F = information * np.outer(scales, scales)
    values, vectors = np.linalg.eigh(0.5 * (F + F.T))
    dark = values < 1.0 / UNTOLD**2
    clear = np.where(dark, 0.0, 1.0 / np.maximum(values, 1e-300))
    covariance = (vectors * clear) @ vectors.T
    hidden = np.sqrt(np.sum(vectors[:, dark] ** 2, axis=1)) > _SHARE
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(spread > 0.0, spread, 1.0)
    correlation = covariance / np.outer(safe, safe)
    correlation[hidden] = correlation[:, hidden] = 0.0
    found = []
    for value, vector in zip(values[dark], vectors[:, dark].T, strict=True):
        biggest = vector[np.argmax(np.abs(vector))]
        shares = vector / biggest
        parts = {
            name: float(share)
            for name, share in zip(names, shares, strict=True)
            if abs(share) > _SHARE
        }
        found.append(Combination(parts, float(1.0 / np.sqrt(max(value, 1e-300)))))
    return np.where(hidden, np.inf, spread * scales), correlation, tuple(found)
