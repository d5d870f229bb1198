"""Arrays kept in the cache folder: to the bit, whole or not at all, within a size."""

from __future__ import annotations

import os

import numpy as np
import pytest

from fantoccini.kernel import build
from fantoccini.kernel.build.kept import PIECES, RESULTS, ArrayStore, kept_arrays

ARRAYS = [np.array([0.1, np.nan, -0.0]), np.zeros((0, 3)), np.array([True, False])]
OTHER = "cd" * 32


@pytest.fixture(params=[PIECES, RESULTS], ids=["pieces", "results"])
def store(request) -> ArrayStore:
    return request.param


def test_arrays_are_read_to_the_bit(store, key):
    assert store.read(key) is None
    store.write(key, ARRAYS)
    for before, after in zip(ARRAYS, store.read(key), strict=True):
        assert before.dtype == after.dtype and before.tobytes() == after.tobytes()
    assert store.read(OTHER) is None


def test_a_damaged_file_counts_as_missing(store, key):
    store.write(key, ARRAYS)
    (file,) = store.files()
    file.write_bytes(file.read_bytes()[:-40])
    assert store.read(key) is None
    store.write(key, ARRAYS)
    assert store.read(key) is not None


def test_objects_are_not_unpickled(store, key):
    store.write(key, ARRAYS)
    (file,) = store.files()
    np.savez(file, arr_0=np.array([{"code": print}], dtype=object))
    assert store.read(key) is None


def test_files_that_others_can_write_are_not_read(store, key):
    store.write(key, ARRAYS)
    (file,) = store.files()
    file.chmod(0o666)
    assert store.read(key) is None
    file.chmod(0o600)
    file.parent.chmod(0o777)
    assert store.read(key) is None


def test_a_folder_that_cannot_be_used_keeps_nothing(cache, key):
    cache.write_text("a file")
    RESULTS.write(key, ARRAYS)
    assert RESULTS.read(key) is None
    assert len(kept_arrays(key, lambda: ARRAYS)) == len(ARRAYS)


def test_the_files_used_least_recently_are_removed():
    keys = [f"{k:02}" * 32 for k in range(4)]
    for age, key in enumerate(keys):
        RESULTS.write(key, [np.zeros(1000)])
        os.utime(RESULTS.folder / key[:2] / f"{key}.npz", (1e9 - age, 1e9 - age))
    RESULTS.read(keys[3])  # the oldest, and now the one used last
    RESULTS.trim(2.5 * 8300)
    assert [RESULTS.read(key) is not None for key in keys] == [True, False, False, True]


def test_clear_and_contents_know_of_them(cache, key):
    PIECES.write(key, ARRAYS)
    RESULTS.write(key, ARRAYS)
    (cache / "results" / "notes.txt").write_text("kept")
    counts = {kind: n for kind, (n, _) in build.contents().items()}
    assert counts == {"compiled libraries": 0, "meshes in convex pieces": 1, "results of plays": 1}
    build.clear()
    assert [path.name for path in cache.rglob("*") if path.is_file()] == ["notes.txt"]


def test_the_fingerprint_of_results_covers_flags_and_libraries(monkeypatch):
    first = build.results_fingerprint()
    assert build.results_fingerprint() == first
    with monkeypatch.context() as patch:
        patch.setenv("FANTOCCINI_CXXFLAGS", "-O3")
        assert build.results_fingerprint() != first
    version = "fantoccini.kernel.build.key.version_of"
    with monkeypatch.context() as patch:
        patch.setattr(version, lambda name: "0.1" if name == "scipy" else "1.0")
        other = build.results_fingerprint()
        patch.setattr(version, lambda name: "0.2" if name == "scipy" else "1.0")
        assert build.results_fingerprint() != other
    with monkeypatch.context() as patch:
        patch.setattr("fantoccini.kernel.build.key.package_hash", lambda: "other code")
        assert build.results_fingerprint() != first
