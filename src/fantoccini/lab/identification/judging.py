"""Whether what was found is to be believed: what is left of a record, beside what noise leaves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array
from fantoccini.lab.identification.result import LISTED, Identified
from fantoccini.lab.identification.unit_names import channel_units

_ALIKE = 0.2
"""Correlation of neighbouring residuals from which on they are no noise."""
_LEANING, _SURE = 0.3, 4.0
"""Mean jump, over the drift and over its own standard deviation, that is the model's."""
_LARGE = 0.5
"""Median jump, over the drift, from which on the drift that is allowed is too small."""
_MANY, _LOST = 0.02, 0.25
"""Shares of outliers, and of segments that do not count, from which on they are many."""
_NOISY, _QUIET = 1.5, 0.67
"""Residuals over a noise level that was given."""
_MAD = 1.4826
"""Standard deviation over the median of |r|, of normal noise."""
_APART = 3.0
"""Times the usual step between a column's samples, from which on two are no neighbours."""
_FEW = 50
"""Neighbours below which their correlation is not looked at."""
_SURPRISE = 3.0
"""Standard deviations from what was known beforehand that are too many."""
_MOST = 3
"""Names in a sentence."""


@dataclass(frozen=True)
class ColumnFit:
    """What is left of a column.

    Attributes:
        name: of the column.
        unit: of it.
        samples: number.
        rms: root mean square of the residuals.
        spread: their standard deviation without outliers, by the median.
        noise: standard deviation that was given or estimated.
        given: whether it was given.
        within: share of the residuals within two standard deviations; 95 % of normal noise.
        neighbours: correlation of a residual with the next one about 0, where it is for noise;
            NaN of few samples.
        outliers: samples beyond 4 standard deviations.
    """

    name: str
    unit: str
    samples: int
    rms: float
    spread: float
    noise: float
    given: bool
    within: float
    neighbours: float
    outliers: int

    @property
    def alike(self) -> bool:
        """Whether residuals resemble the next ones, which noise does not."""
        return self.neighbours > _ALIKE

    @property
    def doubtful(self) -> bool:
        """Whether the residuals are not as the noise is."""
        return self.alike or (self.given and not _QUIET < self.spread / self.noise < _NOISY)


def columns(found: Identified) -> tuple[ColumnFit, ...]:
    """What is left of every column that has samples."""
    channels, units, out = found.record.channels, channel_units(found.record), []
    for j, (name, group) in enumerate(zip(channels.names, channels.groups, strict=True)):
        r, noise = np.where(found.counts, found.residuals[:, j], np.nan), found.noise[name]
        there = np.isfinite(r)
        if np.any(there):
            z = np.abs(r[there]) / noise
            rms = float(np.sqrt(np.mean(r[there] ** 2)))
            spread = float(_MAD * np.median(z) * noise)
            given = name in found.record.noise or group in found.record.noise
            out.append(
                ColumnFit(
                    name,
                    units[j],
                    int(np.sum(there)),
                    rms,
                    spread,
                    noise,
                    given,
                    float(np.mean(z <= 2.0)),
                    _neighbours(found.t, r / noise),
                    int(np.sum(z > LISTED)),
                )
            )
    return tuple(out)


def _neighbours(t: Array, z: Array) -> float:
    """Correlation of a column's neighbours, outliers cut off; NaN of few.

    It is taken about 0, not about the mean, so that a bias counts as well.
    """
    there = np.isfinite(z)
    t, z = t[there], np.clip(z[there], -LISTED, LISTED)
    near = np.diff(t) < _APART * np.median(np.diff(t)) if len(t) > 1 else np.zeros(0, dtype=bool)
    a, b = z[:-1][near], z[1:][near]
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if len(a) >= _FEW and size > 0.0 else float("nan")


@dataclass(frozen=True)
class Leaning:
    """A configuration or velocity that jumps to one side all the time.

    Attributes:
        name: of it.
        mean: jump between segments, over the drift.
        acceleration: that is missing, of a velocity; 0 of a configuration.
        unit: of it.
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


def leaning(found: Identified) -> tuple[Leaning, ...]:
    """What jumps to one side between segments, the largest first."""
    counts = ~np.isin(found.starts[:-1], found.lost)
    jumps = np.clip(found.jumps[counts], -LISTED, LISTED)
    table = found.record.marionette.coordinates
    if len(jumps) < 2:
        return ()
    mean, n, names = np.mean(jumps, axis=0), table.n_vD, jump_names(found)
    sure = np.abs(mean) > _SURE * np.std(jumps, axis=0) / np.sqrt(len(jumps))
    units = {row.name: row.unit for row in table.rows}
    span, out = found.starts[1] - found.starts[0], []
    for k in np.argsort(-np.abs(mean)):
        if sure[k] and abs(mean[k]) > _LEANING:
            rate = 0.0 if k < n else found.allowed[1] / span
            unit = f"{units.get(table.v_D[k % n], 'rad')}/s²"
            out.append(Leaning(names[k], float(mean[k]), float(mean[k] * rate), unit))
    return tuple(out)


def jump_names(found: Identified) -> tuple[str, ...]:
    """(2 n_vD,) names of the columns of ``jumps``: configurations, then velocities."""
    names = found.record.marionette.coordinates.v_D
    return (*names, *(f"velocity of {name}" for name in names))


def from_before(found: Identified) -> dict[str, float]:
    """Unknown that was known beforehand -> the part of what is known now that was known then.

    1 where the record told nothing.
    """
    out = {}
    for name, one, d in zip(
        found.names, found.record.unknowns, found.deviations.tolist(), strict=False
    ):
        if one.known is not None:
            out[name] = min(1.0, (d / one.known) ** 2) if np.isfinite(d) else 1.0
    return out


def doubts(found: Identified) -> tuple[str, ...]:
    """Reasons not to believe what was found, in words; none where only noise is left.

    A model that is wrong but bends to the record leaves no trace: a mass that was given too large
    makes the others too large.
    """
    return tuple(_doubts(found))


def _doubts(found: Identified) -> Iterator[str]:
    if found.at_bound:
        yield "The delay came to the end of its range; begin nearer: delay: {about: ...}."
    elif not found.converged:
        yield (
            f"The search was cut short: one more step would move a number by {found.left:.2g} "
            "standard deviations."
        )
    if found.combinations:
        untold = [n for n, d in zip(found.names, found.deviations, strict=True) if np.isinf(d)]
        yield f"The record does not tell {_listed(untold)}."
    for name, x, one in zip(
        found.names, found.values.tolist(), found.record.unknowns, strict=False
    ):
        begin = found.record.begin[found.names.index(name)]
        if one.known is not None and abs(x - begin) > _SURPRISE * one.known:
            yield (
                f"{name} is {abs(x - begin) / one.known:.1f} standard deviations from what was "
                "known of it beforehand."
            )
    fits = columns(found)
    alike = sorted((f for f in fits if f.alike), key=lambda f: -f.neighbours)
    if alike:
        yield (
            f"Residuals of {_listed([f.name for f in alike])} are like those just before "
            f"(correlation up to {alike[0].neighbours:.2f}), which noise is not: the model, the "
            "place of a marker or a camera's axes are off, or the samples were smoothed."
        )
    for text, some in (
        ("more than", [f for f in fits if f.given and f.spread > _NOISY * f.noise]),
        ("less than", [f for f in fits if f.given and f.spread < _QUIET * f.noise]),
    ):
        if some:
            yield f"Residuals of {_listed([f.name for f in some])} are {text} the noise given."
    lean = leaning(found)
    if lean:
        yield (
            "Jumps between segments go to one side all the time: "
            f"{_listed([one.name for one in lean])}, by {abs(lean[0].mean):.2g} of the drift. A "
            "force or a place is missing or wrong."
        )
    if found.drift > _LARGE:
        yield f"Jumps between segments are {found.drift:.2g} of the drift; the model is not enough."
    n, many = sum(f.samples for f in fits), len(found.outliers)
    if many > _MANY * n:
        yield f"{many} of {n} samples are outliers."
    if len(found.lost) > _LOST * len(found.starts):
        yield (
            f"{len(found.lost)} of {len(found.starts)} segments are not explained and do not "
            "count: strings may have been caught in another order, or samples are far off."
        )


def _listed(names: list[str]) -> str:
    more = len(names) - _MOST
    return ", ".join(names[:_MOST]) + (f" and {more} more" if more > 0 else "")
