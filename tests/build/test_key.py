"""The key changes with everything that can change the library, and only with that."""

from __future__ import annotations

from pathlib import Path

import pytest

from fantoccini.kernel import build
from fantoccini.kernel.build import key as key_module

ARGUMENTS = ("puppet", "generator 1", ("-O2",))


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cpp"
    (folder / "fantoccini").mkdir(parents=True)
    (folder / "fantoccini" / "strings.hpp").write_text("int strings;  // so many\n")
    monkeypatch.setattr(key_module, "runtime_folder", lambda: folder)
    return folder


def test_the_key_is_hexadecimal_and_repeatable(runtime):
    key = build.fingerprint(*ARGUMENTS)
    assert len(key) == 64
    assert set(key) <= set("0123456789abcdef")
    assert build.fingerprint(*ARGUMENTS) == key


def test_the_key_changes_with_each_argument(runtime):
    keys = {
        build.fingerprint("puppet", "generator 1", ("-O2",)),
        build.fingerprint("puppet ", "generator 1", ("-O2",)),
        build.fingerprint("puppet", "generator 2", ("-O2",)),
        build.fingerprint("puppet", "generator 1", ("-O1",)),
        build.fingerprint("puppet", "generator 1", ("-O2", "-DLANES=8")),
        build.fingerprint("puppet", "generator 1", ()),
    }
    assert len(keys) == 6


def test_the_key_changes_with_the_runtime(runtime):
    """A header's code, name, folder and presence count; its comments do not."""
    keys = [build.fingerprint(*ARGUMENTS)]
    header = runtime / "fantoccini" / "strings.hpp"
    header.write_text("int strings;  // in other words\n")
    assert build.fingerprint(*ARGUMENTS) == keys[0]
    header.write_text("long strings;\n")
    keys.append(build.fingerprint(*ARGUMENTS))
    header = header.rename(runtime / "fantoccini" / "cords.hpp")
    keys.append(build.fingerprint(*ARGUMENTS))
    header.rename(runtime / "cords.hpp")
    keys.append(build.fingerprint(*ARGUMENTS))
    (runtime / "empty.hpp").write_text("")
    keys.append(build.fingerprint(*ARGUMENTS))
    assert len(set(keys)) == 5


@pytest.mark.parametrize("ingredient", ["casadi_version", "processor"])
def test_the_key_changes_with_casadi_and_the_processor(runtime, monkeypatch, ingredient):
    before = build.fingerprint(*ARGUMENTS)
    monkeypatch.setattr(key_module, ingredient, lambda: "another")
    assert build.fingerprint(*ARGUMENTS) != before


@pytest.mark.parametrize(
    "other",
    [
        build.Compiler(("g++",), "gcc", "g++ 13"),
        build.Compiler(("g++",), "clang", "g++ 12"),
        build.Compiler(("c++",), "gcc", "g++ 12"),
        build.Compiler(("g++", "-m32"), "gcc", "g++ 12"),
    ],
)
def test_the_key_changes_with_the_compiler(runtime, monkeypatch, other):
    monkeypatch.setattr(
        key_module, "find_compiler", lambda: build.Compiler(("g++",), "gcc", "g++ 12")
    )
    before = build.fingerprint(*ARGUMENTS)
    monkeypatch.setattr(key_module, "find_compiler", lambda: other)
    assert build.fingerprint(*ARGUMENTS) != before


def test_the_key_changes_with_the_standard_flags(runtime, monkeypatch):
    before = build.fingerprint(*ARGUMENTS)
    monkeypatch.setattr(key_module, "BASE_FLAGS", ("-std=c++20",))
    assert build.fingerprint(*ARGUMENTS) != before


def test_the_processors_features_are_a_set(tmp_path):
    """The order of the flags, the clock rate and the flags of other cores do not matter."""
    first, second = tmp_path / "one", tmp_path / "two"
    first.write_text("cpu MHz\t: 2600\nflags\t\t: avx2 fma sse2\n\nflags\t\t: none\n")
    second.write_text("cpu MHz\t: 1200\nflags\t\t: sse2 avx2 fma\n")
    assert key_module.processor(first) == key_module.processor(second) == "avx2 fma sse2"


def test_the_runtime_folder_is_inside_the_package():
    assert build.runtime_folder().parent == Path(build.__file__).resolve().parent.parent
