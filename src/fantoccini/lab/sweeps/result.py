"""The result of a sweep: figures shaped like the grid, a table, and the failures.

A case is one combination of values; its figures are the numbers that the study returned for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, UnknownNameError, write_table
from fantoccini.lab.sweeps.case import PUPPET_KEY, Case
from fantoccini.lab.sweeps.design import Design
from fantoccini.lab.sweeps.outcome import Failure, Outcome


@dataclass(frozen=True)
class FailedCase:
    """A case that failed.

    Attributes:
        index: number of the case, 0-based.
        values: name -> label of the value.
        repeat: number of the repetition, 0-based.
        failure: the exception: ``error``, ``message`` and ``trace``.
    """

    index: int
    values: dict[str, Any]
    repeat: int
    failure: Failure

    def __str__(self) -> str:
        values = ", ".join(f"{name}={value}" for name, value in self.values.items())
        return f"case {self.index} ({values or 'no values'}; repeat {self.repeat}): {self.failure}"


class SweepResult:
    """The cases of a sweep and their figures.

    ``result["peak"]`` is a figure or a value as an array shaped like the sweep. If a case failed
    or was not run, its numbers and flags are NaN and its texts are empty.

    Attributes:
        design: the cases.
        outcomes: one per case; None if it was not run.
    """

    def __init__(self, design: Design, outcomes: list[Outcome | None]):
        self.design = design
        self.outcomes = tuple(outcomes)

    def __repr__(self) -> str:
        shape = " x ".join(f"{len(a.labels)} {a.name}" for a in self.design.axes) or "1"
        missing = len(self) - int(self.done.sum()) - len(self.failures)
        counts = f"{len(self.failures)} failed" + (f", {missing} not run" if missing else "")
        return f"<SweepResult {shape}: {len(self)} cases, {counts}; {', '.join(self.names)}>"

    def __len__(self) -> int:
        return len(self.outcomes)

    def __getitem__(self, name: str) -> Array:
        column = self._column(name)
        return column.reshape((*self.shape, *column.shape[1:]))

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes: those of ``over`` in order, then the repetitions."""
        return self.design.shape

    @property
    def axes(self) -> dict[str, Array]:
        """Axis name -> (n,) its labels; numbers and texts are their own labels."""
        return {axis.name: np.array(axis.labels) for axis in self.design.axes}

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the figures, in order of first appearance."""
        return tuple(
            dict.fromkeys(name for outcome in self.outcomes if outcome for name in outcome.figures)
        )

    @cached_property
    def done(self) -> Array:
        """(n_cases,) bool: finished without a failure."""
        return np.array(
            [outcome is not None and outcome.failure is None for outcome in self.outcomes],
            dtype=bool,
        )

    @property
    def seconds(self) -> Array:
        """(n_cases,) duration of each case [s]; NaN if it was not run."""
        return np.array(
            [np.nan if outcome is None else outcome.seconds for outcome in self.outcomes]
        )

    @cached_property
    def failures(self) -> tuple[FailedCase, ...]:
        """The cases that failed, in order."""
        return tuple(
            FailedCase(k, self.design.labels[k], self.design.cases[k].repeat, outcome.failure)
            for k, outcome in enumerate(self.outcomes)
            if outcome is not None and outcome.failure is not None
        )

    def case(self, *place: int) -> Case:
        """A case as its study received it, to run it again: ``study(result.case(3, 0))``.

        Args:
            place: index along every axis, or the number of the case.
        """
        index = place[0] if len(place) == 1 else int(np.ravel_multi_index(place, self.shape))
        case = self.design.cases[index]
        label = case.values.get(PUPPET_KEY)
        return case.with_marionette(None if label is None else self.design.puppets[label])

    def columns(self) -> dict[str, Array]:
        """The whole table, name -> (n_cases, ...): values, repetitions, figures and ``error``.

        ``pandas.DataFrame(result.columns())`` works if every figure is one number or text.
        """
        columns = {name: self._column(name) for name in self.design.names}
        if any(axis.name == "repeat" for axis in self.design.axes):
            columns["repeat"] = np.array([case.repeat for case in self.design.cases])
        columns |= {name: self._column(name) for name in self.names}
        errors = {f.index: str(f.failure) for f in self.failures}
        columns["error"] = np.array([errors.get(k, "") for k in range(len(self))])
        return columns

    def records(self) -> Iterator[dict[str, Any]]:
        """The table case by case, each a dict: name -> value."""
        columns = self.columns()
        for k in range(len(self)):
            yield {name: column[k] for name, column in columns.items()}

    def to_csv(self, path: str | Path) -> None:
        """Writes :meth:`columns`; an array is spread over columns ``name[0]``, ``name[1]``, ...

        Raises:
            ValueError: the arrays of a figure differ in shape.
        """
        flat: dict[str, list[Any]] = {}
        for name, column in self.columns().items():
            if column.dtype == object:
                raise ValueError(f"the arrays of {name} differ in shape; they cannot be columns")
            for array_index in np.ndindex(column.shape[1:]):
                suffix = f"[{','.join(map(str, array_index))}]" if array_index else ""
                flat[name + suffix] = column[(slice(None), *array_index)].tolist()
        write_table(flat, path)

    def _column(self, name: str) -> Array:
        """A value or a figure, (n_cases, ...)."""
        if name in self.design.names:
            return _stack([np.array(labels[name]) for labels in self.design.labels])
        if name not in self.names:
            raise UnknownNameError("value or figure", name, (*self.design.names, *self.names))
        return _stack([outcome.figures.get(name) if outcome else None for outcome in self.outcomes])


def _stack(figures: list[np.ndarray | None]) -> Array:
    """Arrays along a new first axis, NaN or "" for None; of dtype object if they do not match."""
    present = [x for x in figures if x is not None]
    shapes, dtype_kinds = {x.shape for x in present}, {x.dtype.kind for x in present}
    if len(shapes) > 1 or ("U" in dtype_kinds and len(dtype_kinds) > 1):
        ragged = np.empty(len(figures), dtype=object)
        for k, x in enumerate(figures):
            ragged[k] = x
        return ragged
    if len(present) == len(figures):
        return np.stack(present)
    missing_value = np.full(present[0].shape, "" if "U" in dtype_kinds else np.nan)
    return np.stack([missing_value if x is None else x for x in figures])
