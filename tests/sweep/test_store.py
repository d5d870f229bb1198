"""A sweep's folder: resuming after Ctrl-C and kill -9, refused folders, repeated cases."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan

SRC = Path(__file__).resolve().parents[2] / "src"

SCRIPT = """
import sys, time
import fantoccini as fan

def study(case):
    time.sleep(0.05)
    return {"x": case.rng.random(), "k": case["n"] ** 2}

result = fan.sweep(study, {"n": range(24)}, workers=2, store="kept")
print(result["x"].tobytes().hex(), result["k"].sum())
"""


_ran: list[int] = []
"""Cases that were run, in the order of their beginnings."""


def numbered(case):
    _ran.append(case["n"])
    return {"x": case.rng.random(4), "name": f"case {case['n']}"}


@pytest.fixture
def study():
    _ran.clear()
    return numbered


def files(store: Path) -> list[Path]:
    return sorted(store.glob("cases/*/*.npz"))


def test_a_finished_sweep_is_read_back_to_the_same_bits(study, tmp_path):
    store = tmp_path / "deep" / "kept"
    first = fan.sweep(study, {"n": range(6)}, store=store, seeds=2)
    assert len(files(store)) == 12 and len(_ran) == 12
    second = fan.sweep(study, {"n": range(6)}, store=store, seeds=2)
    assert len(_ran) == 12
    assert np.array_equal(first["x"], second["x"]) and np.array_equal(first["name"], second["name"])
    assert np.array_equal(first.seconds, second.seconds)


def test_a_larger_sweep_runs_only_new_cases(study, tmp_path):
    fan.sweep(study, {"n": range(4)}, store=tmp_path / "s")
    assert sorted(_ran) == [0, 1, 2, 3]
    grown = fan.sweep(study, {"n": [5, 3, 1, 6]}, store=tmp_path / "s", seeds=1)
    assert sorted(_ran[4:]) == [5, 6]
    assert grown["name"][:, 0].tolist() == ["case 5", "case 3", "case 1", "case 6"]


def test_an_interrupted_sweep_goes_on(study, tmp_path):
    def interrupt(at):
        if at.done == 7:
            raise KeyboardInterrupt

    asked = {"over": {"n": range(20)}, "store": tmp_path / "s", "workers": 2}
    with pytest.raises(
        fan.errors.SweepStopped, match="run the same sweep again to resume"
    ) as caught:
        fan.sweep(study, **asked, progress=interrupt)
    n_cases = len(files(tmp_path / "s"))
    assert n_cases == 7 == caught.value.result.done.sum()
    first = set(_ran)
    time.sleep(0.1)
    _ran.clear()
    whole = fan.sweep(study, **asked)
    assert len(_ran) == 13 and first | set(_ran) == set(range(20))
    assert np.array_equal(whole["x"], fan.sweep(study, {"n": range(20)})["x"])


def test_a_killed_process_leaves_whole_cases_and_the_sweep_goes_on(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(SRC)}
    command = [sys.executable, str(script)]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment)
    try:
        deadline = time.monotonic() + 60
        while len(files(tmp_path / "kept")) < 5 and time.monotonic() < deadline:
            time.sleep(0.005)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    times = {file: file.stat().st_mtime_ns for file in files(tmp_path / "kept")}
    assert 5 <= len(times) < 24
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert len(files(tmp_path / "kept")) == 24
    assert all(file.stat().st_mtime_ns == then for file, then in times.items())

    def study(case):
        return {"x": case.rng.random()}

    bits, total = done.stdout.split()
    assert bytes.fromhex(bits) == fan.sweep(study, {"n": range(24)})["x"].tobytes()
    assert int(total) == sum(n**2 for n in range(24))


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "text", "other"])
def test_a_damaged_case_is_run_again(study, tmp_path, damage):
    first = fan.sweep(study, {"n": range(3)}, store=tmp_path)
    victim, other, _ = files(tmp_path)
    content = victim.read_bytes()
    flipped = bytearray(content)
    flipped[content.index("case ".encode("utf-32-le")) + 4] ^= 1
    victim.write_bytes(
        {
            "cut": content[: len(content) // 2],
            "empty": b"",
            "flipped": bytes(flipped),
            "text": b"not an archive",
            "other": other.read_bytes(),
        }[damage]
    )
    _ran.clear()
    two = fan.sweep(study, {"n": range(3)}, store=tmp_path)
    assert len(_ran) == 1
    assert np.array_equal(first["x"], two["x"])


def test_no_pickle_is_read(study, tmp_path):
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    (file,) = files(tmp_path)
    with np.load(file) as held:
        arrays = dict(held)
    np.savez(file, **{**arrays, "figure:0": np.array([print], dtype=object)})
    _ran.clear()
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    assert _ran == [0]


def test_failures_are_stored_and_repeated_on_request(tmp_path):
    ill = tmp_path / "ill"
    ill.touch()

    def study(case):
        _ran.append(case["n"])
        if case["n"] == 1 and Path(case["marker"]).exists():
            raise ValueError("ill")
        return {"x": 1.0}

    asked = {"over": {"n": range(3), "marker": [str(ill)]}, "store": tmp_path / "s"}
    _ran.clear()
    first = fan.sweep(study, **asked)
    second = fan.sweep(study, **asked)
    assert len(_ran) == 3
    assert [str(f) for f in second.failures] == [str(f) for f in first.failures]
    assert second.failures[0].failure.trace == first.failures[0].failure.trace
    ill.unlink()
    third = fan.sweep(study, **asked, retry=True)
    assert _ran[3:] == [1] and third.done.all()


def test_another_sweeps_store_is_refused(study, tmp_path):
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    def other(case):
        return {"x": 1.0}

    for changed, said in (
        ({"study": other}, "study is"),
        ({"seed": 1}, "seed is 0 there and 1 here"),
        ({"over": {"m": [0]}}, "values is"),
        ({"version": "2"}, "version is None there and '2' here"),
    ):
        asked = {"study": study, "over": {"n": [0]}, "store": tmp_path, **changed}
        with pytest.raises(fan.errors.StoreError, match=f"holds another sweep.*{said}"):
            fan.sweep(**asked)
    assert {f: f.read_bytes() for f in tmp_path.rglob("*") if f.is_file()} == before


def test_a_study_with_changed_code_is_refused_unless_its_version_is_the_same(tmp_path):
    def make(text):
        names = {"__name__": "study"}
        exec(text, names)
        return names["study"]

    study = make("def study(case):\n    return {'x': 1.0}\n")
    moved = make("\n\n# a remark\ndef study(case):\n    return {'x': 1.0}\n")
    two = make("def study(case):\n    return {'x': 2.0}\n")
    fan.sweep(study, store=tmp_path / "a")
    fan.sweep(moved, store=tmp_path / "a")
    with pytest.raises(fan.errors.StoreError, match="code or the settings"):
        fan.sweep(two, store=tmp_path / "a")
    fan.sweep(study, store=tmp_path / "b", version="1")
    assert fan.sweep(two, store=tmp_path / "b", version="1")["x"] == 1.0

    class Callable:
        def __call__(self, case):
            return {}

    with pytest.raises(ValueError, match="version='1'"):
        fan.sweep(Callable(), store=tmp_path / "c")


def test_a_trial_with_other_settings_is_another_study(tmp_path):
    arm = fan.puppets.arm2d()
    trials = [fan.lab.Trial(t_end=t, method="timestepping") for t in (0.01, 0.02)]
    fan.sweep(trials[0], puppet=arm, store=tmp_path)
    with pytest.raises(fan.errors.StoreError, match="code or the settings"):
        fan.sweep(trials[1], puppet=arm, store=tmp_path)


def test_a_folder_with_other_things_is_left_alone(study, tmp_path):
    (tmp_path / "thesis.tex").write_text("all my work")
    with pytest.raises(fan.errors.StoreError, match="not empty and holds no sweep"):
        fan.sweep(study, {"n": [0]}, store=tmp_path)
    assert [f.name for f in tmp_path.iterdir()] == ["thesis.tex"]
    (tmp_path / "thesis.tex").unlink()
    for text in ("nonsense", "[1]", json.dumps({"format": "later"})):
        (tmp_path / "sweep.json").write_text(text)
        with pytest.raises(fan.errors.StoreError):
            fan.sweep(study, {"n": [0]}, store=tmp_path)
    with pytest.raises(fan.errors.StoreError, match="cannot be used"):
        fan.sweep(study, {"n": [0]}, store=tmp_path / "sweep.json")
