"""Seeded damage to npz files, as by disks, networks and attackers."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fantoccini.base.errors import FileError

_ODD = (
    np.zeros(3),
    np.zeros((0, 3)),
    np.full((4, 4), np.nan),
    np.array(-1.0),
    np.arange(5),
    np.array(True),
    np.array(["x"]),
    np.frombuffer(b'{"format": 1}', dtype=np.uint8),
)
"""Arrays that do not belong into such a file."""
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)


def stored(array: np.ndarray) -> bytes:
    """An entry of an npz file."""
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def entries(raw: bytes) -> dict[str, bytes]:
    """The entries of an npz file."""
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(content: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    """An npz file of entries."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    return out.getvalue()


def _flipped(data: bytes, rng: random.Random, first: int = 0, last: int | None = None) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        place = rng.randrange(first, min(len(data), last or len(data)))
        changed[place] = rng.randrange(256)
    return bytes(changed)


def damaged(raw: bytes, rng: random.Random) -> bytes:
    """An npz file with bytes flipped, its end cut off, or entries swapped, removed or changed."""
    kind = rng.randrange(8)
    if kind == 0:
        return _flipped(raw, rng)
    if kind == 1:
        return raw[: rng.randrange(len(raw))]
    content = entries(raw)
    name, other = rng.choice(list(content)), rng.choice(list(content))
    if kind == 2:
        content[name], content[other] = content[other], content[name]
    elif kind == 3:
        content[name] = _flipped(content[name], rng, 10, 128)
    elif kind == 4:
        content[name] = _flipped(content[name], rng)
    elif kind == 5:
        del content[name]
    elif kind == 6:
        content[name] = stored(rng.choice(_ODD))
    else:
        text = bytearray(content["about.npy"]) if "about.npy" in content else bytearray(129)
        for old, new in ((b"0", b"9"), (b"[", b"{"), (b'"', b"'"), (b"null", b"true")):
            place = text.find(old, rng.randrange(128, len(text)))
            if place > 0 and rng.random() < 0.4:
                text[place : place + len(old)] = new
        content["about.npy"] = bytes(text)
    return packed(content, rng.choice(_COMPRESSIONS))


def fuzz(load: Callable[[Path], object], whole: Path, n: int, seed: int) -> int:
    """Load a file with `n` kinds of damage; each is either read or refused by the file's name.

    Returns:
        Number of refused files.
    """
    raw, rng, refused = whole.read_bytes(), random.Random(seed), 0
    place = whole.with_name("damaged" + whole.suffix)
    for _ in range(n):
        place.write_bytes(damaged(raw, rng))
        try:
            load(place)
        except FileError as error:
            refused += 1
            assert all(problem.file == str(place) for problem in error.mistakes)
    return refused
