"""The cache: entries are compiled once, complete or absent, and private."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.build.entries import answer, never

from fantoccini.kernel import build
from fantoccini.kernel.build import cache as cache_module

pytestmark = pytest.mark.medium


def test_an_entry_holds_the_library_the_info_and_the_sources(cache, key, source):
    messages = []
    entry = build.obtain(
        key, lambda: source(42, n_operations=3), progress=lambda at: messages.append(at.what)
    )
    assert entry == cache / key[:2] / key
    assert answer(entry) == 42
    assert json.loads((entry / build.INFO).read_text()) == {"n_operations": 3}
    assert (entry / "model.cpp").is_file()
    assert not list(cache.glob("*/tmp-*"))
    assert messages[0].startswith("deriving")
    assert messages[1].startswith("compiling")


def test_a_second_call_neither_derives_nor_compiles(key, source, monkeypatch):
    first = build.obtain(key, source)
    monkeypatch.setenv("FANTOCCINI_CXX", "no-such-compiler")
    assert build.obtain(key, never) == first


def test_flags_may_be_chosen_by_the_source(key):
    """The number comes from a flag that the function reads from the source's info."""
    text = 'extern "C" __attribute__((visibility("default"))) int answer() { return VALUE; }\n'
    wanted = build.Source({"model.cpp": text}, "model.cpp", {"value": 11})
    entry = build.obtain(key, lambda: wanted, flags=lambda s: (f"-DVALUE={s.info['value']}",))
    assert answer(entry) == 11
    entry = build.obtain("cd" * 32, lambda: wanted, flags=("-DVALUE=12",))
    assert answer(entry) == 12


@pytest.mark.parametrize("name", ["../up.cpp", "a/b.cpp", "", "model.so", "complete.json", ".x"])
def test_source_files_have_plain_names(name):
    with pytest.raises(ValueError, match="name of a source file"):
        build.Source({name: ""}, name)


@pytest.mark.parametrize("key", ["../../x", "short", "ZZ" * 32, ""])
def test_a_key_is_hexadecimal(key):
    with pytest.raises(ValueError, match="not a key"):
        build.obtain(key, never)


@pytest.mark.parametrize("damage", ["missing", "truncated", "changed", "no seal", "bad seal"])
def test_a_damaged_entry_is_made_again(cache, key, source, damage):
    library = build.obtain(key, source) / build.LIBRARY
    content = library.read_bytes()
    seal = library.parent / "complete.json"
    match damage:
        case "missing":
            library.unlink()
        case "truncated":
            library.write_bytes(content[: len(content) // 2])
        case "changed":
            library.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
        case "no seal":
            seal.unlink()
        case "bad seal":
            seal.write_text('["half')
    entry = build.obtain(key, source)
    assert (entry / build.LIBRARY).stat().st_size == len(content)
    assert answer(entry) == 7
    assert not list(cache.glob("*/tmp-*"))


def test_an_entry_that_would_not_load_can_be_made_afresh(key, source):
    build.obtain(key, lambda: source(1))
    entry = build.obtain(key, lambda: source(2), rebuild=True)
    assert "return 2" in (entry / "model.cpp").read_text()
    assert answer(entry) == 2


def test_a_build_killed_half_way_leaves_only_a_temporary_folder(cache, key, source, program):
    """A process whose compiler never returns is killed; the next one does the work."""
    hanging = program("hanging", 'if [ "$1" = --version ]; then echo g++; else sleep 5; fi')
    script = (
        "from fantoccini.kernel import build\n"
        f"build.obtain({key!r}, lambda: build.Source({{'model.cpp': ''}}, 'model.cpp'))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        env={**os.environ, "FANTOCCINI_CXX": str(hanging), "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    deadline = time.monotonic() + 20
    while not list(cache.glob("*/tmp-*/model.cpp")) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    process.wait()
    (left,) = cache.glob("*/tmp-*")
    assert not (cache / key[:2] / key).exists()
    assert answer(build.obtain(key, source)) == 7
    assert left.exists()


def test_leftovers_go_when_they_are_old(cache, key, source):
    """A temporary folder after an hour, the sources of a failure after a week."""
    group = cache / key[:2]
    ages = {"tmp-young": 600, "tmp-old": 4000, "failed-young": 4000, "failed-old": 8 * 86400}
    cache.mkdir(mode=0o700)
    group.mkdir(mode=0o700)
    for name, age in ages.items():
        (group / name).mkdir()
        os.utime(group / name, (time.time() - age, time.time() - age))
    build.obtain(key, source)
    assert {f.name for f in group.iterdir()} >= {"tmp-young", "failed-young"}
    assert not (group / "tmp-old").exists()
    assert not (group / "failed-old").exists()


RACE = """
import sys, time
from pathlib import Path
from fantoccini.kernel import build
from fantoccini.kernel.build import cache
if {unlocked}:
    cache.fcntl = None
def produce():
    with open({log!r}, "a") as log:
        log.write("derived\\n")
    time.sleep(0.3)
    text = 'extern "C" __attribute__((visibility("default"))) int answer() {{ return 7; }}'
    return build.Source({{"model.cpp": text}}, "model.cpp")
print("ready", flush=True)
while not Path({start!r}).exists():
    time.sleep(0.005)
print(build.obtain({key!r}, produce), flush=True)
"""


@pytest.mark.parametrize("unlocked", [False, True])
def test_processes_that_build_the_same_at_once(tmp_path, cache, key, unlocked):
    """Locks let one process derive while the others wait; without, one of the results remains."""
    log, start = tmp_path / "log", tmp_path / "start"
    script = RACE.format(unlocked=unlocked, log=str(log), start=str(start), key=key)
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", script],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        for _ in range(3)
    ]
    assert [racer.stdout.readline() for racer in racers] == 3 * ["ready\n"]
    start.touch()
    said = [racer.communicate(timeout=60)[0].strip() for racer in racers]
    assert [racer.returncode for racer in racers] == [0, 0, 0]
    assert set(said) == {str(cache / key[:2] / key)}
    assert answer(Path(said[0])) == 7
    assert len(log.read_text().splitlines()) == (3 if unlocked else 1)
    assert not list(cache.glob("*/tmp-*"))


def test_the_wait_for_another_process_ends(key, source, monkeypatch, cache):
    """A lock that is never released delays a build and does not prevent it."""
    group = cache / key[:2]
    cache.mkdir(mode=0o700)
    group.mkdir(mode=0o700)
    monkeypatch.setattr(cache_module, "LOCK_SECONDS", 0.2)
    with open(group / f"{key}.lock", "w") as held:
        cache_module.fcntl.flock(held, cache_module.fcntl.LOCK_EX)
        progress = []
        assert answer(build.obtain(key, source, progress=lambda at: progress.append(at.what))) == 7
    assert progress[0].startswith("waiting")


def test_the_default_folder_is_the_users_cache(monkeypatch):
    monkeypatch.delenv("FANTOCCINI_CACHE")
    assert build.cache_folder().name == "fantoccini"
    monkeypatch.setenv("FANTOCCINI_CACHE", "~/elsewhere")
    assert build.cache_folder() == Path.home() / "elsewhere"


def test_clear_removes_only_cache_entries(cache, key, source):
    """A user may have named a folder with other files."""
    build.obtain(key, source)
    other = cache / "ad" / "advertisement.txt"
    other.parent.mkdir()
    other.write_text("kept")
    assert build.clear() == 1
    assert other.read_text() == "kept"
    assert not (cache / key[:2]).exists()
    assert build.clear() == 0


def test_describe_names_the_compiler_and_the_cache(cache, key, source):
    build.obtain(key, source)
    facts = build.describe()
    assert facts["compiler"].startswith(build.find_compiler().version)
    assert facts["cache"] == str(cache)
    assert facts["compiled libraries"].startswith("1 ")
    assert facts["results of plays"].startswith("0 ")
    assert "problem" not in facts


def test_describe_names_the_failure(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FANTOCCINI_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setenv("FANTOCCINI_CXX", "no-such-compiler")
    facts = build.describe()
    assert facts["compiler"] == "none"
    assert "no-such-compiler" in facts["problem"]
    assert "is not used" in facts["problem"]


SHARED = """
#define FAN_TOUCH_EXTERNAL
#include "fantoccini/collision/touch.hpp"
extern "C" __attribute__((visibility("default"))) int answer() {
  fan::PlacedSolid ball{};
  ball.kind = fan::SEGMENT;
  ball.radius = 1.0;
  fan::Touch found[fan::max_touches];
  return 10 * fan::touches(ball, ball, 1.0, found) + VALUE;
}
"""


@pytest.mark.filterwarnings("ignore:.*compiled again")
@pytest.mark.parametrize("damaged", [False, True])
def test_a_shared_unit_is_compiled_once_for_several_libraries(cache, damaged):
    """Contact geometry is linked into each library; a damaged object file is compiled again."""

    def compiled_units(value: int) -> int:
        files, messages = {"main.cpp": SHARED.replace("VALUE", str(value))}, []
        source = build.Source(files, "main.cpp", shared_units=("collision/touch_unit",))
        entry = build.obtain(
            str(value) * 64,
            lambda: source,
            flags=("-O0",),
            progress=lambda at: messages.append(at.what),
        )
        assert answer(entry) == 10 + value
        assert {file.suffix for file in entry.iterdir()} == {".cpp", ".json", ".so"}
        return sum("touch_unit" in text for text in messages)

    assert compiled_units(1) == 1
    if damaged:
        (unit,) = (file.parent for file in cache.glob("*/*/unit.cpp"))
        (unit / build.LIBRARY).write_bytes(b"no object")
    assert compiled_units(2) == int(damaged)
