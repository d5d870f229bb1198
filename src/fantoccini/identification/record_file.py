"""Record files: YAML beside a CSV. Every mistake is reported with its location."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from fantoccini import puppets
from fantoccini.arrays import Array
from fantoccini.errors import FileError, Mistake, StateError, nearest
from fantoccini.identification.channels import Marker
from fantoccini.identification.marking import Mark, find, marked
from fantoccini.identification.record import Record, Unknown
from fantoccini.identification.schema import ColumnFile, RecordFile
from fantoccini.marionette import Marionette, link_index
from fantoccini.motion import Input
from fantoccini.puppet.located import Located, read_file, shown, validate
from fantoccini.puppet.refusals import Refusals

_MAX_BYTES = 256_000_000
_TIMES = ("time", "t")
_UNITS = {"deg": np.pi / 180.0, "mm": 1e-3}


def load_record(
    path: str | os.PathLike[str], *, progress: Callable[[str], None] | None = None
) -> Record:
    """Reads a record file and the files that it names.

    Args:
        path: of the YAML file.
        progress: called with a description of each slow step.

    Raises:
        FileError: with every mistake found and its location.
    """
    located = read_file(path)
    file = validate(RecordFile, located)
    check = Refusals(located)
    puppet = _puppet_file(file.puppet, located)
    marks: dict[Mark, float] = {}
    unknown = []
    for label, given in file.unknown.items():
        spot = ("unknown", label)
        mark = check(spot, lambda label=label: find(puppet.data, label))
        if mark is None:
            continue
        about = given.about if given is not None else None
        value = mark.value if about is None else about
        if value is None:
            check(spot, lambda: _refuse("the puppet's file leaves it out; needed: about"))
            continue
        marks[mark] = value
        known = None if given is None else given.known
        unknown.append(Unknown(mark.parameter, about, known, mark.label, mark.positive))
    check.refuse()
    made = check.need(("puppet",), lambda: Marionette(marked(puppet, marks), progress))
    for name, one in file.markers.items():
        check(("markers", name, "body"), lambda one=one: link_index(made.model, one.body))
    scalars = [made.coordinates.v_K[v] for _, v in made.coordinates.scalars_K]
    for i, name in enumerate(file.offsets):
        if name not in scalars:
            text = f"{shown(name)} is no scalar driven coordinate{nearest(name, scalars)}"
            check(("offsets", i), lambda text=text: _refuse(text))
    columns = check.need(("samples",), lambda: _samples(file.samples, located))
    time = next((name for name in _TIMES if name in columns), None)
    if time is None:
        found = ", ".join(columns)
        check(("samples",), lambda: _refuse(f"no column is called time; found: {found}"))
        check.refuse()
    assert time is not None
    t = columns.pop(time)
    inputs = check.need(("inputs",), lambda: _inputs(file, located, made, t, columns))
    values = _measured(file, made, columns, check)
    check.refuse()
    markers = [Marker(name, one.body, one.at, one.find) for name, one in file.markers.items()]
    record = check.need((), lambda: Record(
        made, inputs, t, values, markers, unknown, file.offsets, file.delay == "find",
        0.0 if file.delay == "find" else float(file.delay), file.noise, file.start, file.record,
    ))  # fmt: skip
    source = Path(puppet.folder) / Path(puppet.file).name
    return replace(record, marks=tuple(marks), puppet_file=source)


def _refuse(text: str) -> None:
    raise StateError(text)


def _puppet_file(name: str, located: Located) -> Located:
    """The puppet file that a record names."""
    beside = located.beside(name)
    if beside is not None:
        return read_file(beside)
    if name in puppets.names():
        return read_file(puppets.path(name))
    hint = nearest(name, puppets.names())
    message = f"found {shown(name)}: no file in this one's folder and no bundled puppet{hint}"
    raise located.error([(("puppet",), message)], FileError)


def _samples(name: str, located: Located) -> dict[str, Array]:
    """The columns of a CSV file; empty cells are NaN."""
    path = located.beside(name)
    if path is None:
        raise StateError(f"found {shown(name)}: no file in this one's folder")
    if path.stat().st_size > _MAX_BYTES:
        raise StateError(f"{name} is larger than {_MAX_BYTES / 1e6:g} MB, the most that is read")
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise StateError(f"{name} is not UTF-8") from None
    reader = csv.reader(io.StringIO(text, newline=""))
    header: list[str] = []
    rows: list[list[float]] = []
    mistakes: list[Mistake] = []
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        if not header:
            header = [cell.strip() for cell in cells]
            if twice := sorted({one for one in header if header.count(one) > 1}):
                text = f"two columns are called {shown(twice[0])}"
                raise FileError([Mistake(name, reader.line_num, "", text)])
            continue
        if len(cells) != len(header):
            text = f"found {len(cells)} columns; the header has {len(header)}"
            mistakes.append(Mistake(name, reader.line_num, "", text))
            continue
        row = [_cell(cell) for cell in cells]
        for column, cell, number in zip(header, cells, row, strict=True):
            if number is None:
                text = f"found {shown(cell)}; needed: a number, or nothing in a gap"
                mistakes.append(Mistake(name, reader.line_num, column, text))
        rows.append([np.nan if number is None else number for number in row])
    if mistakes:
        raise FileError(mistakes[:20])
    if not rows:
        raise StateError(f"{name} has no samples")
    return dict(zip(header, np.array(rows).T, strict=True))


def _cell(text: str) -> float | None:
    """A number, NaN for an empty cell, None for anything else."""
    if not text.strip():
        return float("nan")
    try:
        number = float(text)
    except ValueError:
        return None
    return number if abs(number) < 1e9 or np.isnan(number) else None


def _inputs(
    file: RecordFile, located: Located, marionette: Marionette, t: Array, columns: dict[str, Array]
) -> Input:
    """The inputs that were played; their columns are taken out."""
    table = marionette.coordinates
    whole = {f"{name[: -len('rotation')]}{part}" for name in table.rotations
             for part in ("qw", "qx", "qy", "qz")}  # fmt: skip
    known = {*table.q_K, *table.commands, *whole}
    given = {name: columns.pop(name) for name in sorted(known & set(columns))}
    if file.inputs is not None:
        path = located.beside(file.inputs)
        if path is None:
            raise StateError(f"found {shown(file.inputs)}: no file in this one's folder")
        return Input.load(marionette, path)
    if not given:
        return Input.hold(marionette, float(t[-1] - t[0])).shifted(float(t[0]))
    there = np.all([np.isfinite(x) for x in given.values()], axis=0)
    return Input.samples(marionette, t[there], {name: x[there] for name, x in given.items()})


def _measured(
    file: RecordFile, marionette: Marionette, columns: dict[str, Array], check: Refusals
) -> dict[str, Array]:
    """The measured columns under their names, in SI units."""
    table, out = marionette.coordinates, {}
    axes = {f"{name}.{axis}" for name in file.markers for axis in "xyz"}
    scalars = {table.q_D[q] for q, _ in table.scalars_D}
    strings = {f"{one.name}.tension" for one in marionette.tree.strings}
    for name in file.markers:
        if not any(f"{name}.{axis}" in columns for axis in "xyz"):
            check(("markers", name), lambda name=name: _refuse(
                f"the samples have none of the columns {name}.x, {name}.y and {name}.z"
            ))  # fmt: skip
    for name in file.columns:
        if name not in columns:
            hint = nearest(name, tuple(columns))
            check(("columns", name), lambda hint=hint: _refuse(f"no column is called so{hint}"))
    for name, values in columns.items():
        given: ColumnFile | None = file.columns.get(name)
        if given is not None:
            own = given.coordinate or f"{given.tension}.tension"
            out[own] = _UNITS.get(given.unit or "", 1.0) * values
        elif name in axes:
            out[name] = _UNITS.get(file.unit, 1.0) * values
        elif name in scalars or name in strings:
            out[name] = values
        else:
            known = (*axes, *scalars, *strings)
            text = f"the column {shown(name)} is no marker, coordinate or tension"
            text += f"{nearest(name, known)}; name it under columns"
            check(("samples",), lambda text=text: _refuse(text))
    return out
