"""Inputs files: YAML waypoints, CSV or npz samples, recordings.

Driven coordinates q_K are given by the inputs: ends and lengths of strings, driven joints; v_K and
acc_K are their velocities and accelerations. A waypoint is a time and a value that an input passes
through.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, WithJsonSchema

from fantoccini.base import (
    Array,
    ConfigK,
    InputError,
    Mistake,
    StateError,
    Times,
    VecK,
    decoded,
    npz,
)
from fantoccini.base.documents import (
    ANGLES,
    Document,
    Kind,
    Located,
    Mistakes,
    Positive,
    document_schema,
    quantity_schema,
    read_document,
    shown,
)
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import pieces, reading
from fantoccini.motion.archive import RECORDING_FORMAT, RECORDING_FORMATS
from fantoccini.motion.channel import Channel, Points

MAX_BYTES = npz.MAX_BYTES
"""Largest size of a file of samples, and of its arrays [bytes]."""

_DECIMAL = re.compile(r"\s*[-+]?\d*,\d*([eE][-+]?\d+)?\s*")
"""Number with a decimal comma."""
_SEPARATOR = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
"""First line of tables from Excel that names the character between columns."""

_PAIR = {"type": "array", "prefixItems": [{"type": "number"}], "minItems": 2, "maxItems": 2}
_ROTATION = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 4}


def _points_schema(*values: dict[str, Any]) -> dict[str, Any]:
    pair = {**_PAIR, "prefixItems": [{"type": "number"}, {"anyOf": [*values]}]}
    return {"type": "array", "items": pair, "minItems": 1}


# `reading` checks the lists, with the puppet's coordinates.
_Waypoints = Annotated[Any, WithJsonSchema(_points_schema(quantity_schema(ANGLES), _ROTATION))]
_Forces = Annotated[Any, WithJsonSchema(_points_schema({"type": "number"}))]


class InputsFile(Document):
    """Waypoints of driven coordinates; unnamed coordinates hold still."""

    kind: ClassVar = Kind(
        "inputs", "an inputs file has the keys `coordinates` and `forces`", error=InputError
    )

    name: str = ""
    """Name of the performance."""
    duration: Positive | None = None
    """Time until which the last waypoints are held [s]."""
    coordinates: dict[str, _Waypoints] = Field(default_factory=dict)
    """Driven coordinate -> list of [time s, value]; a rotation (`bar.rotation`) as a quaternion
    [w, x, y, z] or a rotation vector [x, y, z] in rad."""
    forces: dict[str, _Forces] = Field(default_factory=dict)
    """Dynamic velocity -> list of [time s, force N or N m], linear between them."""


@dataclass(frozen=True)
class Waypoints:
    """Contents of a file of waypoints or samples, before its lengths are checked.

    Attributes:
        channels: motion of the coordinates that the file names.
        mistakes: mistakes found so far.
        place: path of the key with the coordinates.
        forces: (times [s], forces [N or N m]) by dynamic velocity.
        duration: time until which the last waypoints are held [s].
        name: name of the performance.
    """

    channels: Mapping[str, Channel]
    mistakes: Mistakes
    place: tuple[str, ...] = ()
    forces: Mapping[str, Points] = field(default_factory=dict)
    duration: float | None = None
    name: str = ""


@dataclass(frozen=True)
class Segments:
    """The motion of the driven coordinates in a recording: arguments of :meth:`Input.segments`."""

    t: Times
    q_K: ConfigK
    v_K: VecK
    acc_K: Array


def inputs_schema() -> dict[str, Any]:
    """JSON Schema of a YAML inputs file, for editors."""
    return document_schema(InputsFile)


def read_inputs(table: CoordinateTable, path: Path) -> Waypoints | Segments:
    """Reads an inputs file, in the format of its ending: .yaml, .yml, .csv or .npz.

    Raises:
        InputError: every mistake in the file.
    """
    readers = {".yaml": _read_yaml, ".yml": _read_yaml, ".csv": _read_csv, ".npz": _read_npz}
    read = readers.get(path.suffix.lower())
    if read is None:
        raise _file_error(path, f"has the ending {path.suffix!r}; allowed: {', '.join(readers)}")
    try:
        return read(table, path)
    except OSError as error:
        raise _file_error(path, f"cannot be read: {error.strerror or error}") from None
    except ValueError as error:  # a name that no file can have
        raise _file_error(path, f"cannot be read: {error}") from None


def _read_yaml(table: CoordinateTable, path: Path) -> Waypoints:
    file = read_document(path, InputsFile)
    mistakes = Mistakes(file.located, InputError)
    points = reading.waypoints(table, file.coordinates, mistakes, ("coordinates",))
    forces = reading.forces(table, file.forces, mistakes, ("forces",))
    last = max((t[-1] for t, _ in (*points.values(), *forces.values())), default=0.0)
    if file.duration is not None and file.duration < last:
        mistakes.add(
            ("duration",), f"found {file.duration:g} s, before the last waypoint at {last:g} s"
        )
    channels = pieces.through_waypoints(table, points)
    place = ("coordinates",)
    duration = file.duration or 0.0
    return Waypoints(channels, mistakes, place, forces, duration, file.name)


def _from_columns(table: CoordinateTable, columns: dict[str, Array], located: Located) -> Waypoints:
    if "t" not in columns:
        raise located.error([((), "the column t (time in s) is missing")], InputError)
    mistakes = Mistakes(located, InputError)
    values_by_name = {name: values for name, values in columns.items() if name != "t"}
    points = reading.samples(table, columns["t"], values_by_name, mistakes)
    mistakes.raise_if_any()
    return Waypoints(pieces.through_samples(table, points), mistakes)


class _SampleLines(Located):
    """A CSV file, one line for each sample."""

    def line(self, path: Sequence[str | int]) -> int | None:
        """The line of a sample; for a whole column, the line of the header."""
        sample = path[-1] if path and isinstance(path[-1], int) else None
        return 1 if sample is None else self.data[sample]


def _read_csv(table: CoordinateTable, path: Path) -> Waypoints:
    return _from_columns(table, *csv_columns(path))


def csv_columns(
    path: Path, *, gaps: bool = False, name: str | None = None
) -> tuple[dict[str, Array], Located]:
    """The columns of a CSV file by their names, and the lines of the samples.

    Args:
        path: path of the file.
        gaps: whether cells may be empty; they become NaN. Empty columns without a name are left
            out in any case.
        name: name of the file in messages; by default its path.

    Raises:
        InputError: every mistake in the file.
        OSError: the file cannot be read.
    """
    shown_as = Path(name or path)
    content = path.read_bytes() if path.stat().st_size <= MAX_BYTES else None
    if content is None:
        raise _file_error(shown_as, f"is larger than {MAX_BYTES / 1e6:g} MB, the largest allowed")
    try:
        is_utf16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
        text = decoded(content) if is_utf16 else content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        message = f"found the byte 0x{content[error.start]:02x}; the file must be UTF-8"
        raise _file_error(shown_as, message, line) from None
    header: list[str] = []
    lines: list[int] = []
    located = _SampleLines(data=lines, file=str(shown_as), folder=path.parent)
    numbers, mistakes = array("d"), Mistakes(located, InputError)
    reader = csv_reader(text)
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            if not header:
                header = [cell.strip() for cell in cells]
                continue
            numbers.extend(_row_numbers(header, cells, len(lines), mistakes, gaps))
            lines.append(reader.line_num)
    except StateError as error:
        raise _file_error(shown_as, str(error), reader.line_num) from None
    if not header:
        raise _file_error(shown_as, "the file is empty", 1)
    columns = np.array([]) if mistakes else np.array(numbers).reshape(-1, len(header)).T
    if len(lines) and not mistakes:
        titled = [
            i for i, values in enumerate(columns) if header[i] or not np.all(np.isnan(values))
        ]
        header, columns = [header[i] for i in titled], columns[titled]
    for title in sorted({title for title in header if header.count(title) > 1}):
        mistakes.add((title,), "two columns have this name")
    if "" in header:
        mistakes.add((), f"column {header.index('') + 1} has no name")
    mistakes.raise_if_any()
    return dict(zip(header, columns, strict=True)), located


def csv_reader(text: str) -> CsvRows:
    """The rows of a CSV text, with commas, semicolons or tabs between columns."""
    first_line = next((line for line in text.splitlines() if line.strip()), "")
    if separator := _SEPARATOR.fullmatch(first_line.strip(" ")):
        return CsvRows(text.replace(first_line, "", 1), separator[1])
    # A header of a single column has no delimiter.
    return CsvRows(text, max(",;\t", key=first_line.count))


class CsvRows:
    """Rows of a CSV text, as cells without decimal commas.

    With semicolons or tabs between columns, a comma in a number is a decimal comma.

    Attributes:
        delimiter: character between columns.

    Raises:
        StateError: a row is not CSV.
    """

    def __init__(self, text: str, delimiter: str):
        self.delimiter = delimiter
        self._rows = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)

    @property
    def line_num(self) -> int:
        """Line of the last row that was read."""
        return self._rows.line_num

    def __iter__(self) -> Iterator[list[str]]:
        try:
            for cells in self._rows:
                yield cells if self.delimiter == "," else [_with_point(cell) for cell in cells]
        except csv.Error as error:
            raise StateError(f"is not CSV: {error}") from None


def _with_point(cell: str) -> str:
    """A cell with its decimal comma replaced by a point."""
    return cell.replace(",", ".") if _DECIMAL.fullmatch(cell) else cell


def _count_message(count: int, needed: int) -> str:
    """Error message for a row whose number of columns differs from the header's."""
    text = f"found {count} columns; the header has {needed}"
    if count > needed:
        text += ": write numbers with a decimal point, or put ; between columns"
    return text


def _row_numbers(
    header: list[str], cells: list[str], sample: int, mistakes: Mistakes, gaps: bool
) -> list[float]:
    n_titled = max((i + 1 for i, title in enumerate(header) if title), default=0)
    if len(cells) >= n_titled and not any(cell.strip() for cell in cells[len(header) :]):
        cells = (cells + [""] * len(header))[: len(header)]
    if len(cells) != len(header):
        mistakes.add(("", sample), _count_message(len(cells), len(header)))
        return []
    is_gap = [
        not cell.strip() and (gaps or not name) for name, cell in zip(header, cells, strict=True)
    ]
    cells = ["nan" if is_missing else cell for is_missing, cell in zip(is_gap, cells, strict=True)]
    try:
        return [float(cell) for cell in cells]
    except ValueError:
        needed = "a number, or nothing in a gap" if gaps else "a number"
        for name, cell in zip(header, cells, strict=True):
            try:
                float(cell)
            except ValueError:
                mistakes.add((name, sample), f"found {shown(cell)}; needed: {needed}")
        return []


def _read_npz(table: CoordinateTable, path: Path) -> Waypoints | Segments:
    columns = npz.read(path, max_bytes=MAX_BYTES, error=InputError)
    if "about" in columns:
        return _read_recording(table, columns, path)
    return _from_columns(table, columns, Located(file=str(path), folder=path.parent))


def _read_recording(table: CoordinateTable, arrays: dict[str, Array], path: Path) -> Segments:
    """The motion of the driven coordinates in a recorded performance."""
    try:
        about = npz.about_of(arrays)
        file_format = str(about["format"])
    except npz.UNREADABLE as error:
        raise _file_error(path, f"its `about` cannot be read: {error}") from None
    if file_format not in RECORDING_FORMATS:
        message = (
            f"has the format {file_format!r}; needed: samples, or a recording ({RECORDING_FORMAT})"
        )
        raise _file_error(path, message)
    try:
        q_K, v_K = (npz.finite(arrays, f"start_{name}", (None,)) for name in ("q_K", "v_K"))
        acc_K = npz.finite(arrays, "acc_K", (None, len(v_K)))
        coordinates = npz.texts(about["coordinates"], "coordinates")
        start, tick = (float(npz.finite(arrays, name, ())) for name in ("t", "tick"))
    except npz.UNREADABLE as error:
        raise _file_error(path, f"is a damaged recording: {error}") from None
    names = coordinates[-len(q_K) :] if len(q_K) else ()
    if names != table.q_K:
        raise _file_error(
            path, f"was recorded with another puppet: {_coordinates_message(names, table.q_K)}"
        )
    end = start + tick * len(acc_K)
    max_magnitude = max(
        abs(start), abs(end), *(np.abs(x).max(initial=0.0) for x in (q_K, v_K, acc_K))
    )
    is_valid = len(v_K) == table.n_vK and len(acc_K) and tick > 0.0 and start < end
    if not is_valid or not max_magnitude <= reading.LIMITS.max_number:
        raise _file_error(path, "is a damaged recording: its shapes or numbers are wrong")
    times: Times = start + tick * np.arange(len(acc_K) + 1, dtype=float)
    return Segments(times, q_K, v_K, acc_K)


def _coordinates_message(recorded: tuple[str, ...], needed: tuple[str, ...]) -> str:
    """Error message for a recording whose driven coordinates differ from those of a puppet."""
    parts = [
        f"{place}: {', '.join(names[:6])}{', ...' if len(names) > 6 else ''}"
        for names, place in (
            ([name for name in recorded if name not in needed], "driven in the recording only"),
            ([name for name in needed if name not in recorded], "driven in the puppet only"),
        )
        if names
    ]
    return "; ".join(parts) or "its driven coordinates have another order"


def _file_error(path: Path, message: str, line: int | None = None) -> InputError:
    return InputError([Mistake(str(path), line, "", message)])
