"""A record: measurements of a puppet under known inputs, and the unknowns to estimate.

A channel is a measured number over time: a coordinate of a marker, a joint coordinate or a tension.
q_K are the driven coordinates, the ends and lengths of strings. In names, D stands for dynamic
coordinates, which move by the equations of motion. A winch changes the length of a string.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, ShortRepr, StateError, UnknownNameError, check_positive
from fantoccini.base.documents import read_file
from fantoccini.dynamics.compiled import refuse_contact
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.identification.channels import Channels, Marker
from fantoccini.lab.identification.fit import MARGIN
from fantoccini.lab.identification.marking import FileNumber, missing_files
from fantoccini.model.tree import measure, path_lengths
from fantoccini.motion import Input, State

MIN_SAMPLES = 8
"""Smallest number of samples of a record."""
POSITION_SCALE = 0.01
"""Scale of unknown positions and offsets, to which their errors are compared [m or rad]."""
DELAY_SCALE = 0.01
"""Scale of an unknown delay, to which its error is compared [s]."""
MAX_CONSTANT_RANGE = 1e-9
"""Largest range of an input that counts as constant [m or rad]."""
N_INSTANTS = 500
"""Number of times at which the range of an input is evaluated."""
MAX_BEYOND_SHARE = 0.5
"""Largest share of samples outside the time of the inputs, which are constant there."""


@dataclass(frozen=True)
class Unknown:
    """An unknown parameter of the puppet.

    Attributes:
        name: name of the parameter.
        about: initial value; the puppet's own value by default.
        known: standard deviation of ``about``, if it was measured beforehand.
        label: its name in reports; the parameter's name by default.
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


def check_overlap(t: Array, inputs: Input, share: float) -> None:
    """Raises if more than a share of the samples lie outside the time of the inputs.

    Args:
        t: (N,) times of the samples by the inputs' clock [s].
        inputs: the inputs.
        share: largest allowed share, 0 to 1.
    """
    is_outside = (t < inputs.start - MARGIN) | (t > inputs.end + MARGIN)
    if np.mean(is_outside) > share:
        raise StateError(
            f"the samples, less the delay, last from {t[0]:.6g} s to {t[-1]:.6g} s, the inputs "
            f"from {inputs.start:.6g} s to {inputs.end:.6g} s; samples may lie at most "
            f"{MARGIN:.2g} s outside. Correct the clock, leave samples out, or extend the inputs"
        )


MAX_MARKER_DISTANCE = 20.0
"""Largest ratio of the markers' median coordinate to the puppet's reach; above, units differ."""


@dataclass(frozen=True, eq=False, repr=False)
class Record(ShortRepr):
    """Measurements of a puppet in motion, and its unknowns.

    Attributes:
        marionette: the puppet, with known or guessed numbers.
        inputs: the commanded motion.
        t: (N,) times of the samples by the record's clock, rising [s].
        columns: name -> (N,) numbers, NaN in gaps: ``marker.x``, ``.y`` and ``.z`` [m], scalar
            dynamic coordinates [rad or m], ``string.tension`` [N].
        markers: points of bodies measured in ``columns``.
        unknown: unknown parameters, by name or as :class:`Unknown`.
        offsets: scalar driven coordinates whose commands are off by an unknown constant, because
            a string was tied or a winch zeroed elsewhere.
        find_delay: whether the delay is unknown.
        delay: delay of the record's clock, which shows t + delay when the inputs' clock shows t
            [s]. An unknown delay is searched within 0.25 s of it.
        noise: standard deviations by marker or column; estimated by default.
        start: values for ``rest`` of the pose in which the puppet hangs when the record
            begins.
        name: name of the record.
        file_numbers: unknown numbers of ``puppet_file``.
        puppet_file: the puppet's file, for writing it with the estimates.

    Raises:
        UnknownNameError: a parameter, coordinate, marker or column that does not exist.
        StateError: the puppet has contact or slipping winches, more than half of the samples lie
            beyond the inputs, times do not increase, a column has another length or infinite
            numbers, markers are in another unit, something is unknown twice, or nothing is.
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
    file_numbers: tuple[FileNumber, ...] = ()
    puppet_file: Path | None = None

    def __post_init__(self) -> None:
        marionette = self.marionette
        refuse_contact(marionette, "identification")
        if np.any(np.isfinite(self.marionette.winches[:, 0])):
            raise StateError(
                f"{marionette.name} has slipping winches, which identification cannot handle; "
                "leave max_tension out of its file"
            )
        t = np.asarray(self.t, dtype=float)
        object.__setattr__(self, "t", t)
        if t.ndim != 1 or len(t) < MIN_SAMPLES:
            raise StateError(f"found {t.size} samples; a record has at least {MIN_SAMPLES}")
        if not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0.0):
            raise StateError("the times of the samples must be finite and increase")
        if not np.isfinite(self.delay):
            raise ValueError(f"delay is {self.delay!r}; it must be a finite number")
        for unknown in self.unknowns:
            if unknown.name not in marionette.parameter_index:
                parameter_names = tuple(marionette.parameter_index)
                raise UnknownNameError("parameter", unknown.name, parameter_names)
        scalars = driven_scalars(self.marionette)
        for name in self.offsets:
            if name not in scalars:
                raise UnknownNameError("scalar driven coordinate", name, scalars)
        channel_names = (*self.channels.groups, *self.channels.names)
        for name in self.noise:
            if name not in channel_names:
                raise UnknownNameError("marker or column", name, channel_names)
        check_positive(**{f"noise of {name}": level for name, level in self.noise.items()})
        names = [unknown.name for unknown in self.unknowns]
        names += self.offsets
        if duplicates := sorted({name for name in names if names.count(name) > 1}):
            raise StateError(f"{duplicates[0]} is unknown twice; leave one out")
        if not self.labels:
            raise StateError(
                "nothing is unknown; name parameters, offsets, markers with `find`, or the delay"
            )
        for unknown, initial_value in zip(self.unknowns, self.initial_values, strict=False):
            if unknown.positive and not initial_value > 0.0:
                raise StateError(
                    f"{unknown.name} has the initial value {initial_value:g} and must stay "
                    "positive; give one above 0 (about), or allow negative values (positive: false)"
                )
        if not marionette.coordinates.n_vD:
            raise StateError(
                f"{marionette.name} has no dynamic coordinates, so its motion depends on no number"
            )
        self._check_times()
        self._check_units()

    def _check_units(self) -> None:
        """Raises if the markers are so far from the puppet that their unit must be another one."""
        coordinates = np.abs(self.values[:, : 3 * len(self.markers)])
        if not np.any(np.isfinite(coordinates)):
            return
        tree, number = self.marionette.tree, self.marionette.number
        bounding_box = measure(tree, number)
        paths = path_lengths(tree, bounding_box.poses, number).values()
        puppet_reach = float(np.max(np.abs([bounding_box.lower, bounding_box.upper]))) + max(
            paths, default=0.0
        )
        q_K_at_ends = self.inputs.evaluate(np.array([self.inputs.start, self.inputs.end]))[0]
        puppet_reach += float(np.max(np.abs(np.nan_to_num(q_K_at_ends)), initial=0.0))
        median_distance = float(np.nanmedian(coordinates[np.any(np.isfinite(coordinates), axis=1)]))
        if median_distance > MAX_MARKER_DISTANCE * puppet_reach:
            raise StateError(
                f"coordinates of markers are {median_distance:.4g} m (median); the puppet on "
                f"its strings reaches {puppet_reach:.3g} m: are they in mm? Then the "
                "record's file has `unit: mm`"
            )

    def _check_times(self) -> None:
        times = self.t[np.any(np.isfinite(self.values), axis=1)]
        check_overlap(times - self.delay, self.inputs, MAX_BEYOND_SHARE)

    @cached_property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The unknown parameters."""
        return tuple(Unknown(x) if isinstance(x, str) else x for x in self.unknown)

    @cached_property
    def channels(self) -> Channels:
        """The channels that the columns measure."""
        axes = {f"{marker.name}.{axis}" for marker in self.markers for axis in "xyz"}
        other_columns = [name for name in self.columns if name not in axes]
        tensions = [name for name in other_columns if name.endswith(".tension")]
        coordinates = [name for name in other_columns if name not in tensions]
        strings = [name.removesuffix(".tension") for name in tensions]
        return Channels(self.marionette, self.markers, coordinates, strings)

    @cached_property
    def values(self) -> Array:
        """(N, channels) the samples in the channels' order; NaN in gaps."""
        empty = np.full(len(self.t), np.nan)
        rows = []
        for name in self.channels.names:
            column = np.asarray(self.columns.get(name, empty), dtype=float)
            if column.shape != self.t.shape:
                raise StateError(
                    f"the column {name} has the shape {column.shape}; needed: {self.t.shape}, as t"
                )
            rows.append(column)
        values = np.stack(rows, axis=1)
        if np.any(np.isinf(values)):
            name = self.channels.names[int(np.argwhere(np.isinf(values))[0, 1])]
            raise StateError(f"the column {name} has infinite numbers; gaps are NaN")
        if not np.any(np.isfinite(values)):
            raise StateError("the record has no numbers")
        return values

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of all unknowns, in the order of results."""
        positions = [f"{m.name}.at.{axis}" for m in self.markers if m.find for axis in "xyz"]
        return (
            *(unknown.label or unknown.name for unknown in self.unknowns),
            *(f"{name} offset" for name in self.offsets),
            *positions,
            *(("delay",) if self.find_delay else ()),
        )

    @cached_property
    def initial_values(self) -> Array:
        """(P,) initial values of the unknowns."""
        marionette = self.marionette
        values = [
            marionette.p[marionette.parameter_index[unknown.name]]
            if unknown.about is None
            else unknown.about
            for unknown in self.unknowns
        ]
        positions = [x for marker in self.markers if marker.find for x in marker.at]
        delay = [self.delay] if self.find_delay else []
        return np.array([*values, *([0.0] * len(self.offsets)), *positions, *delay])

    @cached_property
    def scales(self) -> Array:
        """(P,) scales of the unknowns at their initial values, to which errors are compared."""
        return self.scales_at(self.initial_values)

    def scales_at(self, values: Array) -> Array:
        """(P,) scales at values (P,): for positive unknowns, the larger of initial value and value.

        The initial value is included so that an estimate of 0 can count as determined.
        """
        magnitudes = np.maximum(np.abs(self.initial_values), np.abs(values))
        sizes = [
            value if unknown.positive and value else POSITION_SCALE
            for unknown, value in zip(self.unknowns, magnitudes, strict=False)
        ]
        n_positions = len(self.labels) - len(sizes) - int(self.find_delay)
        return np.array(
            [*sizes, *([POSITION_SCALE] * n_positions), *([DELAY_SCALE] if self.find_delay else [])]
        )

    def check_folder(self, folder: Path) -> None:
        """Raises if a folder for the puppet's file lacks a file that it names, such as a mesh."""
        if self.puppet_file is None:
            return
        if missing := missing_files(read_file(self.puppet_file).data, folder):
            raise StateError(
                f"the puppet names {', '.join(missing)}, which are not in {folder}; write its "
                f"file beside {self.puppet_file}, or copy them"
            )

    @property
    def constant_inputs(self) -> tuple[str, ...]:
        """Names of scalar driven coordinates that the inputs do not move."""
        table, n = self.marionette.coordinates, N_INSTANTS
        q_K = self.inputs.evaluate(np.linspace(self.inputs.start, self.inputs.end, n))[0]
        return tuple(
            table.q_K[q] for q, _ in table.scalars_K if np.ptp(q_K[:, q]) < MAX_CONSTANT_RANGE
        )

    @cached_property
    def initial_puppet(self) -> Marionette:
        """The puppet with the initial values of its unknown parameters."""
        values = zip(self.unknowns, self.initial_values, strict=False)
        return self.marionette.with_parameters({unknown.name: float(x) for unknown, x in values})

    def start_state(self, inputs: Input | None = None, t: float = 0.0) -> State:
        """The hanging pose at the inputs' first values, or at those of other inputs at time t."""
        x0 = self.initial_puppet.rest({**self.inputs.first_values(), **self.start})
        if inputs is None:
            return x0
        q_K = inputs.evaluate(t)[0]
        is_same = np.allclose(q_K, x0.q_K, rtol=0.0, atol=1e-9)
        return x0 if is_same else self.initial_puppet.rest(x0.replace(q_K=q_K))
