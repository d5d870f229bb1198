"""Search for the compiler, the remedy for its absence, and the text of its failures."""

from __future__ import annotations

import ctypes
import json
import shutil
import sys
import time
from pathlib import Path

import pytest

from fantoccini.base.errors import BuildError
from fantoccini.kernel import build
from fantoccini.kernel.build import compiler as compiler_module
from fantoccini.kernel.build.compiler import (
    BASE_FLAGS,
    OPTIMISATION,
    Compilers,
    first_build_notice,
    run_compiler,
)

VERSION = 'if [ "$1" = --version ]; then echo "fake g++ 1.0"; exit 0; fi\n'


def test_the_systems_compiler_is_found():
    compiler = build.find_compiler()
    assert compiler.kind in ("gcc", "clang", "zig")
    assert compiler.version
    assert shutil.which(compiler.command[0])


def test_no_compiler_names_the_command_that_installs_one(monkeypatch, tmp_path, program):
    """Only apt-get is on the path, and Python has no ziglang."""
    program("apt-get", "exit 0")
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setattr(sys, "executable", str(program("python", "exit 1")))
    install_commands = r"pip install 'fantoccini\[compiler\]'  or:  .*apt-get install -y g\+\+"
    with pytest.raises(BuildError, match=rf"no C\+\+ compiler was found.*{install_commands}"):
        build.find_compiler()


def test_the_first_build_with_zig_is_announced(monkeypatch, tmp_path):
    """It is announced only while zig's cache, with the C++ standard library, is missing."""
    zig = build.Compiler(("python", "-m", "ziglang", "c++"), "zig", "clang version 20")
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(tmp_path / "zig"))
    assert "zig first builds its C++ standard library" in first_build_notice(zig)
    assert not first_build_notice(build.Compiler(("g++",), "gcc", "g++ 12"))
    (tmp_path / "zig").mkdir()
    assert not first_build_notice(zig)


def test_a_compiler_installed_after_a_failure_is_found(monkeypatch, tmp_path, program):
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setattr(sys, "executable", str(program("python", "exit 1")))
    with pytest.raises(BuildError):
        build.find_compiler()
    program("g++", VERSION)
    assert build.find_compiler().version == "fake g++ 1.0"


def test_the_order_of_search(monkeypatch, tmp_path, program):
    """FANTOCCINI_CXX, CXX, g++, c++, clang++, in this order; one that does not run is skipped."""
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    program("clang++", 'echo "fake clang version 3"')
    assert build.find_compiler().kind == "clang"
    program("c++", 'echo "c++ (fake) 2"')
    program("g++", "exit 1")
    assert build.find_compiler().version == "c++ (fake) 2"
    program("g++", 'echo "g++ (fake) 1"')
    assert build.find_compiler().version == "g++ (fake) 1"
    monkeypatch.setenv("CXX", str(program("mine", 'echo "mine $1"')) + " --first 'a b'")
    assert build.find_compiler().version == "mine --first"
    assert build.find_compiler().command[1:] == ("--first", "a b")
    monkeypatch.setenv("FANTOCCINI_CXX", str(program("ours", "echo ours")))
    assert build.find_compiler().version == "ours"


@pytest.mark.parametrize("value", ["no-such-compiler", "no-such-compiler; touch x", "'unclosed"])
def test_a_named_compiler_that_does_not_run_is_an_error(monkeypatch, value):
    """The user's choice is not silently replaced by another compiler."""
    monkeypatch.setenv("FANTOCCINI_CXX", value)
    with pytest.raises(BuildError, match="FANTOCCINI_CXX"):
        build.find_compiler()


def test_a_failing_compiler_is_quoted(monkeypatch, program, source, cache, key):
    """Command, exit code, the first 20 lines of its output, and the folder of the sources."""
    body = VERSION + "i=0; while [ $i -lt 50 ]; do echo line $i >&2; i=$((i+1)); done; exit 3"
    monkeypatch.setenv("FANTOCCINI_CXX", str(program("failing", body)))
    with pytest.raises(BuildError) as caught:
        build.obtain(key, source)
    message = str(caught.value)
    assert "exit code 3" in message
    assert "-std=c++17" in message
    assert "line 19\n" in message
    assert "line 20" not in message
    assert "30 lines more" in message
    sources = Path(message.rsplit("the sources are in ", 1)[1])
    assert (sources / "model.cpp").read_text() == source().files["model.cpp"]
    assert not (cache / key[:2] / key).exists()
    assert not list(cache.glob("*/tmp-*"))


def test_the_next_build_replaces_a_failure(monkeypatch, program, source, key):
    monkeypatch.setenv("FANTOCCINI_CXX", str(program("failing", VERSION + "exit 1")))
    with pytest.raises(BuildError, match="it printed nothing"):
        build.obtain(key, source)
    monkeypatch.delenv("FANTOCCINI_CXX")
    assert (build.obtain(key, source) / build.LIBRARY).is_file()


def test_a_source_that_does_not_compile_shows_its_line(key):
    broken = build.Source({"model.cpp": "int x = ;\n"}, "model.cpp")
    with pytest.raises(BuildError, match=r"model\.cpp:1"):
        build.obtain(key, lambda: broken)


def test_a_compiler_that_hangs_is_stopped_with_its_children(tmp_path, program):
    """The grandchild would touch the file after 2 s."""
    late = tmp_path / "late"
    hanging = program("hanging", f"(sleep 2; touch {late}) & wait")
    with pytest.raises(BuildError, match=r"stopped after 0\.2 s"):
        run_compiler([str(hanging)], tmp_path, seconds=0.2)
    time.sleep(2.2)
    assert not late.exists()


def test_a_library_without_output_is_an_error(monkeypatch, program, source, key):
    """The compiler reports success and writes no library."""
    monkeypatch.setenv("FANTOCCINI_CXX", str(program("lazy", VERSION + "exit 0")))
    with pytest.raises(BuildError, match=r"has not written model\.so"):
        build.obtain(key, source)


def parts(second: str) -> build.Source:
    """A main file that calls functions of two units."""
    main = "int one(); int two();\n"
    main += 'extern "C" __attribute__((visibility("default"))) int answer();\n'
    main += "int answer() { return one() + two(); }\n"
    main += '#ifndef FAN_APART\n#include "one.cpp"\n#include "two.cpp"\n#endif\n'
    files = {"main.cpp": main, "one.cpp": "int one() { return 3; }\n", "two.cpp": second}
    return build.Source(files, "main.cpp", units=("one.cpp", "two.cpp"))


def test_units_are_compiled_separately_and_linked(key):
    entry = build.obtain(key, lambda: parts("int two() { return 4; }\n"))
    assert ctypes.CDLL(str(entry / build.LIBRARY)).answer() == 7
    commands = json.loads((entry / "complete.json").read_text())["commands"]
    outputs = [command[-1] for command in commands]
    assert outputs == [build.LIBRARY, "one.o", "two.o", build.LIBRARY]  # main's object comes first
    assert not list(entry.glob("*.o"))


def test_the_main_file_is_compiled_once_for_libraries_whose_units_differ(key):
    """A puppet with other numbers compiles only its numbers."""

    def compiled(number: int) -> list[str]:
        entry = build.obtain(f"{number:064x}", lambda: parts(f"int two() {{ return {number}; }}\n"))
        assert ctypes.CDLL(str(entry / build.LIBRARY)).answer() == 3 + number
        commands = json.loads((entry / "complete.json").read_text())["commands"]
        return [command[-1] for command in commands]

    assert compiled(5) == [build.LIBRARY, "one.o", "two.o", build.LIBRARY]
    assert compiled(6) == ["one.o", "two.o", build.LIBRARY]


def test_early_objects_are_compiled_while_the_source_is_derived(key, cache):
    whole, waited = parts("int two() { return 4; }\n"), []

    def derived() -> build.Source:
        deadline = time.monotonic() + 60.0
        while not list(cache.glob(f"*/tmp-*/{build.LIBRARY}")) and time.monotonic() < deadline:
            time.sleep(0.01)
        waited.append(time.monotonic() < deadline)
        return whole

    entry = build.obtain(key, derived, early=whole.shared_objects)
    assert waited == [True]
    assert ctypes.CDLL(str(entry / build.LIBRARY)).answer() == 7
    commands = json.loads((entry / "complete.json").read_text())["commands"]
    outputs = [command[-1] for command in commands]
    assert outputs == [build.LIBRARY, "one.o", "two.o", build.LIBRARY], "main.cpp only once"


def test_an_early_object_of_another_text_is_compiled_again(key):
    whole = parts("int two() { return 4; }\n")
    other = {"main.o": build.Source({"main.cpp": "int unused;\n"}, "main.cpp")}
    entry = build.obtain(key, lambda: whole, early=lambda: other)
    assert ctypes.CDLL(str(entry / build.LIBRARY)).answer() == 7


def test_a_failed_derivation_ends_the_compilers_of_early_objects(
    key, cache, program, tmp_path, monkeypatch
):
    late, begun = tmp_path / "late", tmp_path / "begun"
    slow = program("slow", VERSION + f"touch {begun}; sleep 3; touch {late}")
    monkeypatch.setenv("FANTOCCINI_CXX", str(slow))

    def derived() -> build.Source:
        while not begun.exists():
            time.sleep(0.01)
        raise ValueError("the mass matrix is singular")

    with pytest.raises(ValueError, match="singular"):
        build.obtain(key, derived, early=parts("").shared_objects)
    assert not list(cache.glob("*/tmp-*"))
    time.sleep(3.2)
    assert not late.exists()


def test_a_unit_that_does_not_compile_shows_its_line(key, cache):
    with pytest.raises(BuildError, match=r"two\.cpp:2(.|\n)*the sources are in"):
        build.obtain(key, lambda: parts("int two() {\n  return four;\n}\n"))
    assert not (cache / key[:2] / key).exists()


def test_a_failing_compiler_ends_the_others(tmp_path, program):
    failing, late = program("failing", "exit 1"), tmp_path / "late"
    hanging = program("hanging", f"(sleep 3; touch {late}) & wait")
    with pytest.raises(BuildError, match="exit code 1"), Compilers() as compilers:
        compilers.start([str(failing), "a.o"], tmp_path)
        compilers.start([str(hanging), "b.o"], tmp_path)
        compilers.wait()
    time.sleep(3.2)
    assert not late.exists()


def test_a_unit_must_be_among_the_files():
    with pytest.raises(ValueError, match=r"'other\.cpp' is not among the files"):
        build.Source({"main.cpp": ""}, "main.cpp", units=("other.cpp",))


@pytest.mark.parametrize("kind", ["gcc", "clang", "zig"])
@pytest.mark.parametrize("machine", ["x86_64", "aarch64", "arm64"])
def test_no_flag_lets_the_compiler_break_arithmetic(kind, machine, monkeypatch):
    monkeypatch.setattr(compiler_module.platform, "machine", lambda: machine)
    flags = (*BASE_FLAGS, *build.compile_flags(build.Compiler(("c++",), kind, "1")))
    assert "-ffp-contract=fast" in flags
    assert not {"-ffast-math", "-Ofast", "-funsafe-math-optimizations"} & set(flags)
    assert sum(flag.endswith("=native") for flag in flags) == 1


def test_a_level_of_optimisation_of_the_user_replaces_the_flags_of_the_level(monkeypatch):
    """-Og would otherwise keep passes that make compilation slow."""
    monkeypatch.delenv("FANTOCCINI_CXXFLAGS", raising=False)
    gcc, clang = (build.Compiler(("c++",), kind, "1") for kind in ("gcc", "clang"))
    assert build.compile_flags(gcc)[: len(OPTIMISATION)] == OPTIMISATION
    assert build.compile_flags(clang)[0] == "-O2"
    monkeypatch.setenv("FANTOCCINI_CXXFLAGS", "-g -Og")
    flags = build.compile_flags(gcc)
    assert flags[-2:] == ("-g", "-Og") and not set(OPTIMISATION) & set(flags)


def test_the_users_flags_come_last(monkeypatch):
    """17.E: code for another processor than this machine's has its own place in the cache."""
    compiler = build.Compiler(("g++",), "gcc", "g++ 12")
    monkeypatch.delenv("FANTOCCINI_CXXFLAGS", raising=False)
    plain, key = build.compile_flags(compiler), build.fingerprint("puppet", "1")
    monkeypatch.setenv("FANTOCCINI_CXXFLAGS", "-march=x86-64 -ffp-contract=off")
    assert build.compile_flags(compiler) == (*plain, "-march=x86-64", "-ffp-contract=off")
    assert build.fingerprint("puppet", "1") != key
    monkeypatch.setenv("FANTOCCINI_CXXFLAGS", "'-march=x86-64")
    with pytest.raises(BuildError, match="FANTOCCINI_CXXFLAGS"):
        build.compile_flags(compiler)
