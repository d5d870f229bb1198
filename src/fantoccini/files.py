"""Files that appear whole or not at all."""

from __future__ import annotations

import csv
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name in the folder of ``path``; renamed to ``path`` when the block succeeds.

    The temporary name ends in ``.part``, so that nobody who lists ``*.npz`` reads it half-written.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path} cannot be written: there is no folder {path.parent}")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_table(columns: Mapping[str, Sequence[Any] | np.ndarray], path: str | Path) -> None:
    """Writes columns of the same length as CSV, under a line with their names.

    Numbers read back to the same bits; flags are 0 and 1.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    lists = [_plain(values) for values in columns.values()]
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*lists, strict=True))


def _plain(values: Sequence[Any] | np.ndarray) -> Sequence[Any]:
    if not isinstance(values, np.ndarray):
        return values
    listed: list[Any] = (values.astype(int) if values.dtype == bool else values).tolist()
    return listed
