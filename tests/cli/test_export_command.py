"""fantoccini export: files are complete, and nothing is overwritten by accident."""

from __future__ import annotations

import pytest
from tests.cli.command import fantoccini, mistake

from fantoccini.kernel import codegen


def test_files_are_written_into_a_new_folder(tmp_path) -> None:
    folder = tmp_path / "c"
    result = fantoccini("export", "string_pendulum", folder)
    assert result.exit_code == 0
    names = sorted(file.name for file in folder.iterdir())
    assert {".c", ".h"} <= {name[-2:] for name in names}
    assert sorted(result.stdout.split()) == [str(folder / name) for name in names]
    assert list(tmp_path.iterdir()) == [folder]


def test_an_empty_folder_is_filled(tmp_path) -> None:
    assert fantoccini("export", "--quiet", "string_pendulum", tmp_path).stdout == ""
    assert list(tmp_path.glob("*.h"))


def test_a_folder_that_is_not_empty_is_refused_without_force(tmp_path) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    assert "is not empty; use --force" in mistake("export", "string_pendulum", tmp_path)
    assert list(tmp_path.iterdir()) == [precious]
    assert fantoccini("export", "--force", "string_pendulum", tmp_path).exit_code == 0
    assert precious.read_text() == "mine"
    assert list(tmp_path.glob("*.h"))


def test_a_file_is_no_folder(tmp_path) -> None:
    file = tmp_path / "x"
    file.write_text("mine")
    assert "is a file, not a folder" in mistake("export", "string_pendulum", file)
    assert file.read_text() == "mine"


@pytest.mark.parametrize("there", [True, False])
def test_a_failure_leaves_no_files(tmp_path, monkeypatch, there) -> None:
    monkeypatch.setattr(codegen, "c99_files", lambda _: {"a.c": "int a;", "no/b.c": "int b;"})
    folder = tmp_path / "c"
    if there:
        folder.mkdir()
    result = fantoccini("export", "string_pendulum", folder)
    assert result.exit_code == 1
    assert "cannot write" in result.stderr
    assert list(tmp_path.rglob("*")) == ([folder] if there else [])
