"""A record: what was measured of a puppet under known inputs, and what is to be found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError, check_positive
from fantoccini.base.documents import read_file
from fantoccini.dynamics.compiled import refuse_contact
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.identification.channels import Channels, Marker
from fantoccini.lab.identification.fit import MARGIN
from fantoccini.lab.identification.marking import Mark, missing_files
from fantoccini.motion import Input, State

_LEAST_SAMPLES = 8
_POSITION = 0.01
"""Size of an unknown place or length error, for what counts as found [m or rad]."""
_TIME = 0.01
"""Likewise of a delay [s]."""
_STILL, _INSTANTS = 1e-9, 500
"""Range below which an input stands still [m or rad], and instants at which it is looked at."""
_HELD = 0.5
"""Share of the samples that may lie beyond the inputs, which are held there."""


@dataclass(frozen=True)
class Unknown:
    """A parameter of the puppet that is looked for.

    Attributes:
        name: of the parameter.
        about: where the search begins; the puppet's own value when not given.
        known: standard deviation of ``about`` that was measured beforehand; None for nothing known.
        label: how it is called in reports; the name when not given.
        positive: whether it stays above 0.
    """

    name: str
    about: float | None = None
    known: float | None = None
    label: str | None = None
    positive: bool = True

    def __post_init__(self) -> None:
        if self.about is not None and not np.isfinite(self.about):
            raise ValueError(f"about of {self.name} is {self.about!r}; it must be a finite number")
        if self.known is not None:
            check_positive(**{f"known of {self.name}": self.known})


def driven_scalars(marionette: Marionette) -> list[str]:
    """Names of the scalar driven coordinates."""
    table = marionette.coordinates
    return [table.v_K[v] for _, v in table.scalars_K]


def check_span(t: Array, inputs: Input, share: float) -> None:
    """Refuses samples, at times by the inputs' clock, of which more than a share lie beyond it."""
    beyond = (t < inputs.start - MARGIN) | (t > inputs.end + MARGIN)
    if np.mean(beyond) > share:
        raise StateError(
            f"the samples, less the delay, go from {t[0]:.6g} s to {t[-1]:.6g} s, the inputs from "
            f"{inputs.start:.6g} s to {inputs.end:.6g} s; samples may lie at most {MARGIN:.2g} s "
            "beyond. Correct the clock, leave samples out, or add to the inputs where they stay"
        )


@dataclass(frozen=True, eq=False)
class Record:
    """What was measured of a puppet, and what is not known of it.

    Attributes:
        marionette: the puppet, with the numbers that are known or guessed.
        inputs: that it was moved by, as commanded.
        t: (N,) times of the samples by the record's clock, rising [s].
        columns: name -> (N,) numbers, NaN in gaps: ``marker.x``, ``.y`` and ``.z`` [m], scalar
            dynamic coordinates [rad or m], ``string.tension`` [N].
        markers: points of bodies that ``columns`` have.
        unknown: parameters that are looked for, by name or with what is known of them.
        offsets: scalar driven coordinates whose commands are off by an unknown constant: where a
            string was tied, where a winch was zeroed.
        find_delay: whether the delay is looked for.
        delay: of the record: its clock shows t + delay when the inputs' shows t [s]. Where the
            search begins, if it is looked for; it ends within 0.25 s of that.
        noise: standard deviations by marker or column; estimated where not given.
        start: values of the pose that the puppet hangs in when the record begins, for ``rest``.
        name: of the record.
        marks: numbers of ``puppet_file`` that are looked for, as of :class:`Mark`.
        puppet_file: the puppet's file, for writing it with other numbers.

    Raises:
        UnknownNameError: of a parameter, coordinate, marker or column.
        StateError: the puppet has contact or slipping winches, more than half of the samples lie
            beyond the inputs, times do not rise, a column has another length or infinite numbers,
            something is looked for twice, or nothing is.
        ValueError: a delay that is not finite, or a noise level that is not above 0.
    """

    marionette: Marionette
    inputs: Input
    t: Array
    columns: Mapping[str, Array]
    markers: Sequence[Marker] = ()
    unknown: Sequence[Unknown | str] = ()
    offsets: Sequence[str] = ()
    find_delay: bool = False
    delay: float = 0.0
    noise: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    marks: tuple[Mark, ...] = ()
    puppet_file: Path | None = None

    def __post_init__(self) -> None:
        marionette = self.marionette
        refuse_contact(marionette, "identification")
        if np.any(np.isfinite(self.marionette.winches[:, 0])):
            raise StateError(
                f"{marionette.name} has slipping winches, which identification does not know; "
                "leave max_tension out of its file"
            )
        t = np.asarray(self.t, dtype=float)
        object.__setattr__(self, "t", t)
        if t.ndim != 1 or len(t) < _LEAST_SAMPLES:
            raise StateError(f"found {t.size} samples; a record has at least {_LEAST_SAMPLES}")
        if not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0.0):
            raise StateError("the times of the samples must be finite and rise")
        if not np.isfinite(self.delay):
            raise ValueError(f"delay is {self.delay!r}; it must be a finite number")
        for one in self.unknowns:
            if one.name not in marionette.parameter_index:
                raise UnknownNameError("parameter", one.name, tuple(marionette.parameter_index))
        scalars = driven_scalars(self.marionette)
        for name in self.offsets:
            if name not in scalars:
                raise UnknownNameError("scalar driven coordinate", name, scalars)
        known = (*self.channels.groups, *self.channels.names)
        for name in self.noise:
            if name not in known:
                raise UnknownNameError("marker or column", name, known)
        check_positive(**{f"noise of {name}": level for name, level in self.noise.items()})
        names = [one.name for one in self.unknowns]
        names += self.offsets
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise StateError(f"{twice[0]} is looked for twice; leave one out")
        if not self.labels:
            raise StateError(
                "nothing is looked for; name what is unknown: parameters, offsets, markers with "
                "`find`, or the delay"
            )
        for one, begin in zip(self.unknowns, self.begin, strict=False):
            if one.positive and not begin > 0.0:
                raise StateError(
                    f"{one.name} begins at {begin:g} and is to stay positive; let it begin above 0 "
                    "(about), or let it be negative (positive: false)"
                )
        if not marionette.coordinates.n_vD:
            raise StateError(
                f"{marionette.name} has no dynamic coordinates; its motion tells nothing"
            )
        self._check_times()

    def _check_times(self) -> None:
        there = self.t[np.any(np.isfinite(self.values), axis=1)]
        check_span(there - self.delay, self.inputs, _HELD)

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The parameters that are looked for."""
        return tuple(Unknown(one) if isinstance(one, str) else one for one in self.unknown)

    @cached_property
    def channels(self) -> Channels:
        """What the columns are."""
        axes = {f"{one.name}.{axis}" for one in self.markers for axis in "xyz"}
        others = [name for name in self.columns if name not in axes]
        tensions = [name for name in others if name.endswith(".tension")]
        coordinates = [name for name in others if name not in tensions]
        strings = [name.removesuffix(".tension") for name in tensions]
        return Channels(self.marionette, self.markers, coordinates, strings)

    @cached_property
    def values(self) -> Array:
        """(N, channels) the numbers in the channels' order; NaN where there is none."""
        empty = np.full(len(self.t), np.nan)
        rows = []
        for name in self.channels.names:
            column = np.asarray(self.columns.get(name, empty), dtype=float)
            if column.shape != self.t.shape:
                raise StateError(
                    f"the column {name} has the shape {column.shape}; needed: {self.t.shape}, as t"
                )
            rows.append(column)
        found = np.stack(rows, axis=1)
        if np.any(np.isinf(found)):
            name = self.channels.names[int(np.argwhere(np.isinf(found))[0, 1])]
            raise StateError(f"the column {name} has infinite numbers; gaps are NaN")
        if not np.any(np.isfinite(found)):
            raise StateError("the record has no numbers")
        return found

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all that is looked for, in the order of results."""
        places = [f"{one.name}.at.{axis}" for one in self.markers if one.find for axis in "xyz"]
        return (
            *(one.label or one.name for one in self.unknowns),
            *(f"{name} offset" for name in self.offsets),
            *places,
            *(("delay",) if self.find_delay else ()),
        )

    @cached_property
    def begin(self) -> Array:
        """(P,) where the search begins."""
        marionette = self.marionette
        values = [
            marionette.p[marionette.parameter_index[one.name]] if one.about is None else one.about
            for one in self.unknowns
        ]
        places = [x for one in self.markers if one.find for x in one.at]
        delay = [self.delay] if self.find_delay else []
        return np.array([*values, *([0.0] * len(self.offsets)), *places, *delay])

    @cached_property
    def scales(self) -> Array:
        """(P,) sizes against which errors are small or large, at first."""
        return self.sizes(self.begin)

    def sizes(self, values: Array) -> Array:
        """(P,) likewise at values (P,): those of positive numbers, or where the search began.

        The larger one counts, since a number that is found to be 0 was told.
        """
        larger = np.maximum(np.abs(self.begin), np.abs(values))
        sizes = [
            value if one.positive and value else _POSITION
            for one, value in zip(self.unknowns, larger, strict=False)
        ]
        rest = len(self.labels) - len(sizes) - int(self.find_delay)
        return np.array([*sizes, *([_POSITION] * rest), *([_TIME] if self.find_delay else [])])

    def check_folder(self, folder: Path) -> None:
        """Refuses a folder for the puppet's file that lacks a file, such as a mesh, it names."""
        if self.puppet_file is None:
            return
        if missing := missing_files(read_file(self.puppet_file).data, folder):
            raise StateError(
                f"the puppet names {', '.join(missing)}, which {folder} does not have; write its "
                f"file beside {self.puppet_file}, or copy them"
            )

    @property
    def still(self) -> tuple[str, ...]:
        """Scalar driven coordinates that the inputs do not move."""
        table, n = self.marionette.coordinates, _INSTANTS
        q_K = self.inputs.evaluate(np.linspace(self.inputs.start, self.inputs.end, n))[0]
        return tuple(table.q_K[q] for q, _ in table.scalars_K if np.ptp(q_K[:, q]) < _STILL)

    @cached_property
    def guessed(self) -> Marionette:
        """The puppet with the first values of what is unknown."""
        values = zip(self.unknowns, self.begin, strict=False)
        return self.marionette.with_parameters({one.name: float(x) for one, x in values})

    def start_state(self, inputs: Input | None = None, t: float = 0.0) -> State:
        """Where the puppet hangs at the inputs' first values, or at those of other inputs at t."""
        x0 = self.guessed.rest({**self.inputs.first_values(), **self.start})
        if inputs is None:
            return x0
        q_K = inputs.evaluate(t)[0]
        same = np.allclose(q_K, x0.q_K, rtol=0.0, atol=1e-9)
        return x0 if same else self.guessed.rest(x0.replace(q_K=q_K))
