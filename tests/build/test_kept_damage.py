"""Damaged files of stored arrays are computed again."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini.kernel.build import kept


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04", b"\x93NUMPY\x01\x00"])
def test_a_damaged_file_is_computed_again(tmp_path, monkeypatch, damage):
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path))
    key = "ab" * 32
    assert kept.kept_arrays(key, lambda: [np.arange(3.0)])[0].tolist() == [0.0, 1.0, 2.0]
    (file,) = tmp_path.rglob(f"{key}.npz")
    file.write_bytes(damage)
    assert kept.kept_arrays(key, lambda: [np.ones(2)])[0].tolist() == [1.0, 1.0]


def test_a_file_with_another_compression_is_computed_again(tmp_path, monkeypatch):
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path))
    key = "cd" * 32
    kept.kept_arrays(key, lambda: [np.arange(3.0)])
    (file,) = tmp_path.rglob(f"{key}.npz")
    data = file.read_bytes()
    at = data.rindex(b"PK\x01\x02") + 10
    file.write_bytes(data[:at] + b"\x63\x00" + data[at + 2 :])
    assert kept.kept_arrays(key, lambda: [np.ones(2)])[0].tolist() == [1.0, 1.0]
