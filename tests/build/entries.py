"""Cache entries for tests: a library with a known return value, and an unused source."""

from __future__ import annotations

import ctypes
from pathlib import Path

from fantoccini.kernel import build


def answer(entry: Path) -> int:
    return ctypes.CDLL(str(entry / build.LIBRARY)).answer()


def never() -> build.Source:
    raise AssertionError("derived again although the library is there")
