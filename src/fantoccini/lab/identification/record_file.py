"""Record files: YAML beside a CSV. Every mistake is reported with its location.

A quantity is a marker, coordinate or tension; a record contains its samples. Driven coordinates are
the ends and lengths of strings, which the inputs moved. In names, D stands for dynamic coordinates,
which move by the equations of motion, and K for driven ones: ends and lengths of strings, driven
joints.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from fantoccini.base import Array, FileError, OnProgress, StateError, did_you_mean
from fantoccini.base.documents import (
    ANGLES,
    LENGTHS,
    Finding,
    Located,
    Mistakes,
    has_key,
    read_document,
    read_file,
    shown,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.identification.channels import Marker
from fantoccini.lab.identification.marking import FileNumber, find_number, puppet_with_parameters
from fantoccini.lab.identification.record import Record, Unknown, check_overlap, driven_scalars
from fantoccini.lab.identification.schema import ColumnEntry, DelayEntry, RecordFile
from fantoccini.model.puppet import named_file
from fantoccini.motion import Input, csv_columns

MAX_SAMPLE = 1e9
"""Largest size of a number in the samples [s, m, rad or N]."""
TIME_COLUMNS = ("time", "t")
SI_UNITS = {"deg": "rad", "rad": "rad", "mm": "m", "m": "m", "N": "N"}


def load_record(path: str | os.PathLike[str], *, progress: OnProgress | None = None) -> Record:
    """Reads a record file and the files that it names.

    Args:
        path: path of the YAML file.
        progress: called as each slow step begins; ``what`` describes it.

    Raises:
        FileError: the file has mistakes; all are listed with their locations.
    """
    file = read_document(path, RecordFile)
    located = file.located
    check = Mistakes(located)
    puppet_path = named_file(file.puppet, located)
    if has_key(puppet_path, "scene"):
        text = f"found {shown(file.puppet)}, which is a scene; needed: the file of a puppet"
        raise located.error([(("puppet",), text)], FileError)
    puppet = read_file(puppet_path)
    numbers: dict[FileNumber, float] = {}
    unknown = []
    for label, entry in file.unknown.items():
        location = ("unknown", label)
        used_names = [m.parameter for m in numbers]
        number = check(
            location,
            lambda label=label, used_names=used_names: find_number(puppet.data, label, used_names),
        )
        if number is None:
            continue
        duplicate = next((m for m in numbers if set(m.paths) & set(number.paths)), None)
        if duplicate is not None:
            text = f"the same number as {duplicate.label}; leave one out"
            check(location, lambda text=text: _raise_error(text))
            continue
        about = entry.about if entry is not None else None
        value = number.value if about is None else about
        if value is None:
            check(location, lambda: _raise_error("the puppet's file leaves it out; needed: about"))
            continue
        numbers[number] = value
        known = None if entry is None else entry.known
        unknown.append(Unknown(number.parameter, about, known, number.label, number.positive))
    check.raise_if_any()
    marionette = check.need(
        ("puppet",), lambda: Marionette(puppet_with_parameters(puppet, numbers), progress)
    )
    for name, marker in file.markers.items():
        check(("markers", name, "body"), lambda marker=marker: marionette.link_index(marker.body))
    scalars = driven_scalars(marionette)
    for i, name in enumerate(file.offsets):
        if name not in scalars:
            text = f"{shown(name)} is no scalar driven coordinate{did_you_mean(name, scalars)}"
            check(("offsets", i), lambda text=text: _raise_error(text))
    for name, pose in file.start.items():
        check(("start", name), lambda name=name, pose=pose: marionette.state({name: pose}))
    t, cells = check.need(("samples",), lambda: _read_samples(file.samples, located))
    columns = _columns_by_quantity(file, marionette, cells, check)
    find_delay = file.delay == "find" or isinstance(file.delay, DelayEntry)
    delay = file.delay.about if isinstance(file.delay, DelayEntry) else file.delay
    delay = 0.0 if delay == "find" else float(delay)
    inputs_location = ("samples",) if file.inputs is None else ("inputs",)
    inputs = check.need(
        inputs_location, lambda: _read_inputs(file, located, marionette, t - delay, t, columns)
    )
    values = _measured_columns(file, marionette, columns, check)
    markers = [
        Marker(name, marker.body, marker.at, marker.find) for name, marker in file.markers.items()
    ]
    noise = _noise_levels(file, values, check)
    check.raise_if_any()
    if values:
        measured_t = t[np.any(np.isfinite(list(values.values())), axis=0)]
        if len(measured_t):
            check(inputs_location, lambda: check_overlap(measured_t - delay, inputs, 0.0))
            check.raise_if_any()
    record = check.need(
        (),
        lambda: Record(
            marionette,
            inputs,
            t,
            values,
            markers,
            unknown,
            file.offsets,
            find_delay,
            delay,
            noise,
            file.start,
            file.record,
        ),
    )
    source = Path(puppet.folder) / Path(puppet.file).name
    return replace(record, file_numbers=tuple(numbers), puppet_file=source)


def record_files(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The record file itself, and the files beside it that it names.

    Raises:
        FileError: the file cannot be read.
    """
    file = read_document(path, RecordFile)
    names = [file.puppet, file.samples, *([] if file.inputs is None else [file.inputs])]
    paths = [file.located.file_in_folder(name) for name in names]
    return (Path(path), *(path for path in paths if path is not None))


def _raise_error(text: str) -> None:
    raise StateError(text)


def _read_samples(name: str, located: Located) -> tuple[Array, dict[str, Array]]:
    """Times and other columns of a CSV file; empty cells are NaN."""
    columns, lines = csv_columns(located.required(name), gaps=True, name=name)
    time_column = next((column for column in TIME_COLUMNS if column in columns), None)
    if time_column is None:
        raise lines.error(
            [((), f"there is no column time; found: {', '.join(columns)}")], FileError
        )
    t = columns.pop(time_column)
    if not len(t):
        raise StateError(f"{name} has no samples")
    mistakes: list[Finding] = []
    previous_time = -np.inf
    for k, time in enumerate(t):
        if not time > previous_time:
            text = (
                "found no time"
                if np.isnan(time)
                else f"found {time:.12g} after {previous_time:.12g}"
            )
            mistakes.append(
                ((time_column, k), text if np.isnan(time) else f"{text}; times must increase")
            )
        else:
            previous_time = time
    for column, values in {time_column: t, **columns}.items():
        too_large = np.flatnonzero(np.abs(values) > MAX_SAMPLE)
        text = f"needed: a number of at most {MAX_SAMPLE:g} in size"
        mistakes += [((column, int(k)), f"found {values[k]:g}; {text}") for k in too_large[:1]]
    if mistakes:
        raise lines.error(mistakes, FileError)
    return t, columns


def _columns_by_quantity(
    file: RecordFile, marionette: Marionette, columns: dict[str, Array], check: Mistakes
) -> dict[str, Array]:
    """Columns by the quantity that they hold, in SI units."""
    table, column_of_quantity = marionette.coordinates, {}
    axes = {f"{name}.{axis}" for name in file.markers for axis in "xyz"}
    scalars = [*(table.q_D[q] for q, _ in table.scalars_D), *_driven_names(marionette)]
    strings = [f"{string.name}.tension" for string in marionette.tree.strings]
    unit_of_quantity = {row.name: row.unit for row in table.rows} | dict.fromkeys(axes, "m")
    unit_of_quantity |= dict.fromkeys(strings, "N")
    for name, column in file.columns.items():
        location = ("columns", name)
        if name not in columns:
            text = f"there is no such column{did_you_mean(name, tuple(columns))}"
            check(location, lambda text=text: _raise_error(text))
            continue
        if column.coordinate is not None and column.coordinate not in scalars:
            text = f"found no scalar coordinate {shown(column.coordinate)}"
            text += did_you_mean(column.coordinate, scalars)
            check((*location, "coordinate"), lambda text=text: _raise_error(text))
        quantity = _quantity(name, column)
        if column.tension is not None and quantity not in strings:
            text = f"found no string {shown(column.tension)}"
            text += did_you_mean(quantity, strings).replace(".tension", "")
            check((*location, "tension"), lambda text=text: _raise_error(text))
        si_unit = SI_UNITS.get(column.unit or "", "")
        if si_unit and unit_of_quantity.get(quantity, si_unit) != si_unit:
            text = f"found {column.unit}; {quantity} is in {unit_of_quantity[quantity]}"
            check((*location, "unit"), lambda text=text: _raise_error(text))
    for name, values in columns.items():
        entry = file.columns.get(name)
        quantity = _quantity(name, entry)
        if quantity in column_of_quantity:
            first_name = next(
                column_name
                for column_name in columns
                if _quantity(column_name, file.columns.get(column_name)) == quantity
            )
            key = name if entry is not None else first_name
            text = f"the columns {first_name} and {name} are both {quantity}; leave one out"
            check(("columns", key), lambda text=text: _raise_error(text))
        unit = entry.unit if entry is not None else None
        size = {**LENGTHS, **ANGLES}.get(unit or (file.unit if quantity in axes else ""), 1.0)
        column_of_quantity[quantity] = size * values
    return column_of_quantity


def _quantity(name: str, column: ColumnEntry | None) -> str:
    """Name of the quantity in a column."""
    if column is None:
        return name
    return column.coordinate or (name if column.tension is None else f"{column.tension}.tension")


def _driven_names(marionette: Marionette) -> list[str]:
    table = marionette.coordinates
    return [*table.q_K, *table.commands]


def _noise_levels(
    file: RecordFile, values: Mapping[str, Array], check: Mistakes
) -> dict[str, float]:
    """Noise levels by marker or quantity."""
    levels = {}
    names = [*file.markers, *values, *file.columns]
    for name, level in file.noise.items():
        quantity = name if name in file.markers else _quantity(name, file.columns.get(name))
        if quantity not in file.markers and quantity not in values:
            text = f"{shown(name)} is no marker or column{did_you_mean(name, names)}"
            check(("noise", name), lambda text=text: _raise_error(text))
        levels[quantity] = level
    return levels


def _read_inputs(
    file: RecordFile,
    located: Located,
    marionette: Marionette,
    input_times: Array,
    t: Array,
    columns: dict[str, Array],
) -> Input:
    """The inputs that were played; their columns are removed.

    Args:
        file: the record.
        located: the record's file, for the lines of mistakes.
        marionette: the puppet.
        input_times: (N,) times of the samples by the inputs' clock [s].
        t: (N,) times of the commands [s].
        columns: columns of the samples.
    """
    table = marionette.coordinates
    rotation_parts = {
        f"{name[: -len('rotation')]}{part}"
        for name in table.rotations
        for part in ("qw", "qx", "qy", "qz")
    }
    driven = {*_driven_names(marionette), *rotation_parts}
    commands = {name: columns.pop(name) for name in sorted(driven & set(columns))}
    if file.inputs is not None:
        return Input.load(marionette, located.required(file.inputs))
    if not commands:
        return Input.hold(marionette, float(input_times[-1] - input_times[0])).shifted(
            float(input_times[0])
        )
    is_complete = np.all([np.isfinite(x) for x in commands.values()], axis=0)
    return Input.samples(
        marionette, t[is_complete], {name: x[is_complete] for name, x in commands.items()}
    )


def _measured_columns(
    file: RecordFile, marionette: Marionette, columns: dict[str, Array], check: Mistakes
) -> dict[str, Array]:
    """The measured columns."""
    table, measured = marionette.coordinates, {}
    axes = {f"{name}.{axis}" for name in file.markers for axis in "xyz"}
    scalars = {table.q_D[q] for q, _ in table.scalars_D}
    strings = {f"{string.name}.tension" for string in marionette.tree.strings}
    for name in file.markers:
        if not any(f"{name}.{axis}" in columns for axis in "xyz"):
            check(
                ("markers", name),
                lambda name=name: _raise_error(
                    f"the samples have none of the columns {name}.x, {name}.y and {name}.z"
                ),
            )
    for name, values in columns.items():
        if name in axes or name in scalars or name in strings:
            measured[name] = values
        else:
            names = (*axes, *scalars, *strings)
            text = f"the column {shown(name)} is no marker, coordinate or tension"
            text += f"{did_you_mean(name, names)}; name it under columns"
            check(("samples",), lambda text=text: _raise_error(text))
    return measured
