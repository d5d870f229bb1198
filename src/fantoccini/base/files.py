"""Files that are written whole or not at all, and text files in any encoding."""

from __future__ import annotations

import codecs
import csv
import os
import re
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

_BYTE_ORDER_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
"""Byte order mark -> encoding."""
_KANA = re.compile("[\u3041-\u30fe]")
"""Japanese characters; text in other encodings, read as Shift-JIS, contains none."""


def decoded(content: bytes) -> str:
    """Text of a file in UTF-8, UTF-16 with its byte order mark, Shift-JIS or Latin-1.

    The mark is left out. Different names stay different in every encoding.
    """
    bom = next((bom for bom in _BYTE_ORDER_MARKS if content.startswith(bom)), b"")
    content, encoding = content.removeprefix(bom), _BYTE_ORDER_MARKS.get(bom, "utf-8")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        pass
    try:
        text = content.decode("cp932")
    except UnicodeDecodeError:
        text = ""
    return text if _KANA.search(text) else content.decode("latin-1")


def lines_of(text: str) -> list[str]:
    """Lines of a text, separated by LF, CR LF or CR only."""
    lines = re.split(r"\r\n?|\n", text)
    return lines if lines[-1] else lines[:-1]


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name in the folder of ``path``; renamed to ``path`` when the block succeeds.

    The temporary name ends in ``.part``, so that a search for ``*.npz`` does not find it.

    Raises:
        FileNotFoundError: the folder does not exist.
    """
    path = Path(path)
    if not os.path.isdir(path.parent):
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
    lists = [_as_list(values) for values in columns.values()]
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*lists, strict=True))


def _as_list(values: Sequence[Any] | np.ndarray) -> Sequence[Any]:
    if not isinstance(values, np.ndarray):
        return values
    numbers: list[Any] = (values.astype(int) if values.dtype == bool else values).tolist()
    return numbers
