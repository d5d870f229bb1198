"""Record files: YAML beside a CSV. Every mistake is reported with its location."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from fantoccini.base import Array, FileError, OnProgress, StateError, nearest
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
from fantoccini.lab.identification.marking import Mark, find, marked
from fantoccini.lab.identification.record import Record, Unknown, check_span, driven_scalars
from fantoccini.lab.identification.schema import ColumnFile, DelayFile, RecordFile
from fantoccini.model.puppet import named_file
from fantoccini.motion import Input, csv_columns

_MAX_NUMBER = 1e9
"""Largest size of a number in the samples [s, m, rad or N]."""
_TIMES = ("time", "t")
_KINDS = {"deg": "rad", "rad": "rad", "mm": "m", "m": "m", "N": "N"}


def load_record(path: str | os.PathLike[str], *, progress: OnProgress | None = None) -> Record:
    """Reads a record file and the files that it names.

    Args:
        path: of the YAML file.
        progress: called as each slow step begins; ``what`` describes it.

    Raises:
        FileError: with every mistake found and its location.
    """
    file = read_document(path, RecordFile)
    located = file.located
    check = Mistakes(located)
    puppet_path = named_file(file.puppet, located)
    if has_key(puppet_path, "scene"):
        text = f"found {shown(file.puppet)}, which is a scene; needed: the file of a puppet"
        raise located.error([(("puppet",), text)], FileError)
    puppet = read_file(puppet_path)
    marks: dict[Mark, float] = {}
    unknown = []
    for label, given in file.unknown.items():
        spot = ("unknown", label)
        taken = [one.parameter for one in marks]
        mark = check(spot, lambda label=label, taken=taken: find(puppet.data, label, taken))
        if mark is None:
            continue
        same = next((one for one in marks if set(one.places) & set(mark.places)), None)
        if same is not None:
            text = f"the same number as {same.label}; leave one out"
            check(spot, lambda text=text: _refuse(text))
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
        check(("markers", name, "body"), lambda one=one: made.link_index(one.body))
    scalars = driven_scalars(made)
    for i, name in enumerate(file.offsets):
        if name not in scalars:
            text = f"{shown(name)} is no scalar driven coordinate{nearest(name, scalars)}"
            check(("offsets", i), lambda text=text: _refuse(text))
    for name, pose in file.start.items():
        check(("start", name), lambda name=name, pose=pose: made.state({name: pose}))
    t, cells = check.need(("samples",), lambda: _samples(file.samples, located))
    columns = _named(file, made, cells, check)
    find_delay = file.delay == "find" or isinstance(file.delay, DelayFile)
    delay = file.delay.about if isinstance(file.delay, DelayFile) else file.delay
    delay = 0.0 if delay == "find" else float(delay)
    played = ("samples",) if file.inputs is None else ("inputs",)
    inputs = check.need(played, lambda: _inputs(file, located, made, t - delay, t, columns))
    values = _measured(file, made, columns, check)
    markers = [Marker(name, one.body, one.at, one.find) for name, one in file.markers.items()]
    noise = _noise(file, values, check)
    check.refuse()
    if values:
        seen = t[np.any(np.isfinite(list(values.values())), axis=0)]
        if len(seen):
            check(played, lambda: check_span(seen - delay, inputs, 0.0))
            check.refuse()
    record = check.need(
        (),
        lambda: Record(
            made,
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
    return replace(record, marks=tuple(marks), puppet_file=source)


def record_files(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The record file itself, and the files beside it that it names.

    Raises:
        FileError: the file cannot be read.
    """
    file = read_document(path, RecordFile)
    names = [file.puppet, file.samples, *([] if file.inputs is None else [file.inputs])]
    beside = [file.located.beside(name) for name in names]
    return (Path(path), *(one for one in beside if one is not None))


def _refuse(text: str) -> None:
    raise StateError(text)


def _samples(name: str, located: Located) -> tuple[Array, dict[str, Array]]:
    """The times and the other columns of a CSV file; empty cells are NaN."""
    columns, lines = csv_columns(located.required(name), gaps=True, name=name)
    clock = next((column for column in _TIMES if column in columns), None)
    if clock is None:
        raise lines.error(
            [((), f"no column is called time; found: {', '.join(columns)}")], FileError
        )
    t = columns.pop(clock)
    if not len(t):
        raise StateError(f"{name} has no samples")
    found: list[Finding] = []
    last = -np.inf
    for k, now in enumerate(t):
        if not now > last:
            text = "found no time" if np.isnan(now) else f"found {now:.12g} after {last:.12g}"
            found.append(((clock, k), text if np.isnan(now) else f"{text}; times must rise"))
        else:
            last = now
    for column, values in {clock: t, **columns}.items():
        large = np.flatnonzero(np.abs(values) > _MAX_NUMBER)
        text = f"needed: a number of at most {_MAX_NUMBER:g} in size"
        found += [((column, int(k)), f"found {values[k]:g}; {text}") for k in large[:1]]
    if found:
        raise lines.error(found, FileError)
    return t, columns


def _named(
    file: RecordFile, marionette: Marionette, columns: dict[str, Array], check: Mistakes
) -> dict[str, Array]:
    """The columns under the names of what they are, in SI units."""
    table, out = marionette.coordinates, {}
    axes = {f"{name}.{axis}" for name in file.markers for axis in "xyz"}
    scalars = [*(table.q_D[q] for q, _ in table.scalars_D), *_driven(marionette)]
    strings = [f"{one.name}.tension" for one in marionette.tree.strings]
    kinds = {row.name: row.unit for row in table.rows} | dict.fromkeys(axes, "m")
    kinds |= dict.fromkeys(strings, "N")
    for name, given in file.columns.items():
        spot = ("columns", name)
        if name not in columns:
            text = f"no column is called so{nearest(name, tuple(columns))}"
            check(spot, lambda text=text: _refuse(text))
            continue
        if given.coordinate is not None and given.coordinate not in scalars:
            text = f"found no scalar coordinate {shown(given.coordinate)}"
            text += nearest(given.coordinate, scalars)
            check((*spot, "coordinate"), lambda text=text: _refuse(text))
        own = _own(name, given)
        if given.tension is not None and own not in strings:
            text = f"found no string {shown(given.tension)}"
            text += nearest(own, strings).replace(".tension", "")
            check((*spot, "tension"), lambda text=text: _refuse(text))
        kind = _KINDS.get(given.unit or "", "")
        if kind and kinds.get(own, kind) != kind:
            text = f"found {given.unit}; {own} is in {kinds[own]}"
            check((*spot, "unit"), lambda text=text: _refuse(text))
    for name, values in columns.items():
        one = file.columns.get(name)
        own = _own(name, one)
        if own in out:
            first = next(other for other in columns if _own(other, file.columns.get(other)) == own)
            key = name if one is not None else first
            text = f"the columns {first} and {name} are both {own}; leave one out"
            check(("columns", key), lambda text=text: _refuse(text))
        unit = one.unit if one is not None else None
        size = {**LENGTHS, **ANGLES}.get(unit or (file.unit if own in axes else ""), 1.0)
        out[own] = size * values
    return out


def _own(name: str, given: ColumnFile | None) -> str:
    """The name of what a column is."""
    if given is None:
        return name
    return given.coordinate or (name if given.tension is None else f"{given.tension}.tension")


def _driven(marionette: Marionette) -> list[str]:
    table = marionette.coordinates
    return [*table.q_K, *table.commands]


def _noise(file: RecordFile, values: Mapping[str, Array], check: Mistakes) -> dict[str, float]:
    """Noise levels under the names of what the columns are."""
    out = {}
    known = [*file.markers, *values, *file.columns]
    for name, level in file.noise.items():
        own = name if name in file.markers else _own(name, file.columns.get(name))
        if own not in file.markers and own not in values:
            text = f"{shown(name)} is no marker or column{nearest(name, known)}"
            check(("noise", name), lambda text=text: _refuse(text))
        out[own] = level
    return out


def _inputs(
    file: RecordFile,
    located: Located,
    marionette: Marionette,
    clock: Array,
    t: Array,
    columns: dict[str, Array],
) -> Input:
    """The inputs that were played; their columns are taken out.

    Args:
        file: the record.
        located: it.
        marionette: the puppet.
        clock: (N,) times of the samples by the inputs' clock [s].
        t: (N,) of what was commanded [s].
        columns: of the samples.
    """
    table = marionette.coordinates
    whole = {
        f"{name[: -len('rotation')]}{part}"
        for name in table.rotations
        for part in ("qw", "qx", "qy", "qz")
    }
    known = {*_driven(marionette), *whole}
    given = {name: columns.pop(name) for name in sorted(known & set(columns))}
    if file.inputs is not None:
        return Input.load(marionette, located.required(file.inputs))
    if not given:
        return Input.hold(marionette, float(clock[-1] - clock[0])).shifted(float(clock[0]))
    there = np.all([np.isfinite(x) for x in given.values()], axis=0)
    return Input.samples(marionette, t[there], {name: x[there] for name, x in given.items()})


def _measured(
    file: RecordFile, marionette: Marionette, columns: dict[str, Array], check: Mistakes
) -> dict[str, Array]:
    """The measured columns."""
    table, out = marionette.coordinates, {}
    axes = {f"{name}.{axis}" for name in file.markers for axis in "xyz"}
    scalars = {table.q_D[q] for q, _ in table.scalars_D}
    strings = {f"{one.name}.tension" for one in marionette.tree.strings}
    for name in file.markers:
        if not any(f"{name}.{axis}" in columns for axis in "xyz"):
            check(
                ("markers", name),
                lambda name=name: _refuse(
                    f"the samples have none of the columns {name}.x, {name}.y and {name}.z"
                ),
            )
    for name, values in columns.items():
        if name in axes or name in scalars or name in strings:
            out[name] = values
        else:
            known = (*axes, *scalars, *strings)
            text = f"the column {shown(name)} is no marker, coordinate or tension"
            text += f"{nearest(name, known)}; name it under columns"
            check(("samples",), lambda text=text: _refuse(text))
    return out
