"""Cache folders are private; a private temporary folder replaces one that cannot be written."""

from __future__ import annotations

import errno
import os
import warnings
from pathlib import Path

import pytest
from tests.build.entries import answer, never

from fantoccini.base.errors import BuildError
from fantoccini.kernel import build
from fantoccini.kernel.build import folders


def stand_in_of(entry: Path, key: str) -> Path:
    assert entry.name == key
    return entry.parent.parent


def test_a_cache_that_cannot_be_made_has_a_private_stand_in(tmp_path, key, source, monkeypatch):
    """The chosen folder would lie inside a regular file, so not even root can create it."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(RuntimeWarning, match="the cache folder is not used") as warned:
        entry = build.obtain(key, source)
    assert len(warned) == 1
    refuge = stand_in_of(entry, key)
    assert refuge == tmp_path / "temporary" / f"fantoccini-{os.geteuid()}"
    assert refuge.stat().st_mode & 0o777 == 0o700
    with pytest.warns(RuntimeWarning):
        assert build.obtain(key, never) == entry


@pytest.mark.parametrize("code", [errno.EROFS, errno.EACCES, errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("call", ["mkdir", "write", "rename"])
def test_a_read_only_or_full_disk_has_a_private_stand_in(
    cache, key, source, monkeypatch, code, call
):
    """The disk fails when a folder is created, a file written, or at the last rename."""
    where = {"mkdir": "mkdir", "write": "write_text", "rename": "rename"}[call]
    real = getattr(Path, where)

    def failing(self, *arguments, **options):
        if cache in (self, *self.parents):
            raise OSError(code, os.strerror(code))
        return real(self, *arguments, **options)

    monkeypatch.setattr(Path, where, failing)
    derived = []
    with pytest.warns(RuntimeWarning, match=os.strerror(code)) as warned:
        entry = build.obtain(key, lambda: derived.append(1) or source())
    assert len(warned) == 1
    assert answer(entry) == 7
    assert cache not in entry.parents
    assert len(derived) == 1
    assert not list(cache.glob("*/tmp-*"))


def test_a_disk_that_fills_while_compiling_has_a_private_stand_in(
    cache, key, source, monkeypatch, program
):
    """The compiler itself finds the disk full, but only in the cache folder."""
    full = program(
        "full",
        f'case "$PWD" in {cache}*) [ "$1" = --version ] || '
        '{ echo "as: error: No space left on device" >&2; exit 1; };; esac\n'
        'exec g++ "$@"',
    )
    monkeypatch.setenv("FANTOCCINI_CXX", str(full))
    with pytest.warns(RuntimeWarning, match="No space left on device"):
        entry = build.obtain(key, source)
    assert answer(entry) == 7
    assert not list(cache.glob("*/tmp-*"))


def test_without_a_writable_folder_there_is_an_error(tmp_path, key, source, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "file" / "temporary"))
    with pytest.raises(BuildError, match="no folder can store the compiled puppet"):
        build.obtain(key, source)


def test_an_error_of_the_derivation_is_not_mistaken_for_a_full_disk(key):
    def produce():
        raise OSError(errno.ENOSPC, "in the derivation")

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(OSError, match="in the derivation"):
            build.obtain(key, produce)


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_folder_that_others_can_write_is_refused(cache, key, source, mode):
    cache.mkdir()
    cache.chmod(mode)
    with pytest.warns(RuntimeWarning, match="written by other users"):
        entry = build.obtain(key, source)
    assert cache not in entry.parents
    with pytest.raises(BuildError, match="not cleared"):
        build.clear()


def test_a_folder_of_another_user_is_refused(cache, key, source, monkeypatch):
    cache.mkdir(mode=0o700)
    os.chown(cache, 12345, -1) if os.geteuid() == 0 else monkeypatch.setattr(
        folders.os, "geteuid", lambda: 12345
    )
    assert "another user" in folders.reason_for_distrust(cache)


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_subfolder_that_others_can_write_to_is_refused(cache, key, source, mode):
    """The folder is refused even if its entries exist and nothing would be written."""
    build.obtain(key, source)
    (cache / key[:2]).chmod(mode)
    with pytest.warns(RuntimeWarning, match="written by other users"):
        entry = build.obtain(key, source)
    assert cache not in entry.parents


@pytest.mark.parametrize("what", ["", build.LIBRARY, build.INFO, "complete.json"])
@pytest.mark.parametrize("trouble", ["writable", "foreign", "link"])
def test_an_entry_that_others_may_have_written_is_compiled_again(
    tmp_path, cache, key, source, what, trouble
):
    """An entry is compiled again if another user may have written it or one of its files."""
    path = build.obtain(key, lambda: source(1)) / what
    match trouble:
        case "writable":
            path.chmod(path.stat().st_mode | 0o022)
            expected_reason = "written by other users"
        case "foreign":
            if os.geteuid() != 0:
                pytest.skip("only the superuser can give a file away")
            os.chown(path, 12345, -1)
            expected_reason = "belongs to another user"
        case "link":
            path.rename(tmp_path / "elsewhere")
            path.symlink_to(tmp_path / "elsewhere")
            expected_reason = "is not a f"
    with pytest.warns(RuntimeWarning, match=expected_reason):
        entry = build.obtain(key, lambda: source(2))
    assert entry == cache / key[:2] / key
    assert not entry.is_symlink()
    assert "return 2" in (entry / "model.cpp").read_text()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert build.obtain(key, never) == entry


def test_files_of_an_entry_are_private_whatever_the_umask(key, source):
    """Files are private even with a umask of 0, which lets everybody write."""
    old = os.umask(0)
    try:
        entry = build.obtain(key, source)
    finally:
        os.umask(old)
    for name in (build.LIBRARY, build.INFO, "complete.json"):
        assert (entry / name).stat().st_mode & 0o077 == 0
    assert build.obtain(key, never) == entry


@pytest.mark.parametrize("what", ["link", "pipe"])
def test_a_lock_is_a_file_and_not_a_link(tmp_path, cache, key, source, what):
    """The target of a lock that is a link is not emptied; a pipe is not waited for."""
    lock = cache / key[:2] / f"{key}.lock"
    cache.mkdir(mode=0o700)
    lock.parent.mkdir(mode=0o700)
    precious = tmp_path / "precious"
    precious.write_text("kept")
    lock.symlink_to(precious) if what == "link" else os.mkfifo(lock)
    with pytest.warns(RuntimeWarning, match="is a link" if what == "link" else "is not a file"):
        entry = build.obtain(key, source)
    assert cache not in entry.parents
    assert precious.read_text() == "kept"


@pytest.mark.parametrize("occupant", ["open folder", "link", "file"])
def test_a_stand_in_prepared_by_another_user_is_refused(tmp_path, occupant):
    """Anybody may create a folder of the private folder's known name; then a fresh one is used."""
    place = tmp_path / "temporary" / f"fantoccini-{os.geteuid()}"
    match occupant:
        case "open folder":
            place.mkdir()
            place.chmod(0o755)
        case "link":
            (tmp_path / "elsewhere").mkdir(mode=0o700)
            place.symlink_to(tmp_path / "elsewhere")
        case "file":
            place.write_text("")
    folder = folders.private_folder()
    assert folder != place
    assert folder.stat().st_mode & 0o777 == 0o700
    assert folders.private_folder() == folder


def test_new_folders_are_private_whatever_the_umask(cache, key, source):
    old = os.umask(0)
    try:
        entry = build.obtain(key, source)
    finally:
        os.umask(old)
    for folder in (cache, entry.parent, entry):
        assert folder.stat().st_mode & 0o777 == 0o700
