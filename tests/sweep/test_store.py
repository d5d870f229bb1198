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

SOURCES = Path(__file__).resolve().parents[2] / "src"

SCRIPT = """
import sys, time
import fantoccini as fan

def study(case):
    time.sleep(0.05)
    return {"x": case.rng.random(), "k": case["n"] ** 2}

result = fan.sweep(study, {"n": range(24)}, workers=2, store="kept")
print(result["x"].tobytes().hex(), result["k"].sum())
"""


_cases_run: list[int] = []
"""Cases that were run, in the order of their beginnings."""


def numbered_study(case):
    _cases_run.append(case["n"])
    return {"x": case.rng.random(4), "name": f"case {case['n']}"}


@pytest.fixture
def study():
    _cases_run.clear()
    return numbered_study


def case_files(store: Path) -> list[Path]:
    return sorted(store.glob("cases/*/*.npz"))


def test_a_finished_sweep_is_read_back_to_the_same_bits(study, tmp_path):
    store = tmp_path / "deep" / "kept"
    first = fan.sweep(study, {"n": range(6)}, store=store, seeds=2)
    assert len(case_files(store)) == 12 and len(_cases_run) == 12
    second = fan.sweep(study, {"n": range(6)}, store=store, seeds=2)
    assert len(_cases_run) == 12
    assert np.array_equal(first["x"], second["x"]) and np.array_equal(first["name"], second["name"])
    assert np.array_equal(first.seconds, second.seconds)


def test_a_larger_sweep_runs_only_new_cases(study, tmp_path):
    fan.sweep(study, {"n": range(4)}, store=tmp_path / "s")
    assert sorted(_cases_run) == [0, 1, 2, 3]
    grown = fan.sweep(study, {"n": [5, 3, 1, 6]}, store=tmp_path / "s", seeds=1)
    assert sorted(_cases_run[4:]) == [5, 6]
    assert grown["name"][:, 0].tolist() == ["case 5", "case 3", "case 1", "case 6"]


def test_an_interrupted_sweep_goes_on(study, tmp_path):
    def interrupt(progress):
        if progress.done == 7:
            raise KeyboardInterrupt

    arguments = {"over": {"n": range(20)}, "store": tmp_path / "s", "workers": 2}
    with pytest.raises(
        fan.errors.SweepStopped, match="run the same sweep again to resume"
    ) as caught:
        fan.sweep(study, **arguments, progress=interrupt)
    n_cases = len(case_files(tmp_path / "s"))
    assert n_cases == 7 == caught.value.result.done.sum()
    first_cases = set(_cases_run)
    time.sleep(0.1)
    _cases_run.clear()
    resumed = fan.sweep(study, **arguments)
    assert len(_cases_run) == 13 and first_cases | set(_cases_run) == set(range(20))
    assert np.array_equal(resumed["x"], fan.sweep(study, {"n": range(20)})["x"])


def test_a_killed_process_leaves_whole_cases_and_the_sweep_goes_on(tmp_path):
    script = tmp_path / "run.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(SOURCES)}
    command = [sys.executable, str(script)]
    process = subprocess.Popen(command, cwd=tmp_path, env=environment)
    try:
        deadline = time.monotonic() + 60
        while len(case_files(tmp_path / "kept")) < 5 and time.monotonic() < deadline:
            time.sleep(0.005)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    times = {file: file.stat().st_mtime_ns for file in case_files(tmp_path / "kept")}
    assert 5 <= len(times) < 24
    process_again = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert len(case_files(tmp_path / "kept")) == 24
    assert all(file.stat().st_mtime_ns == mtime for file, mtime in times.items())

    def study(case):
        return {"x": case.rng.random()}

    hex_bytes, total = process_again.stdout.split()
    assert bytes.fromhex(hex_bytes) == fan.sweep(study, {"n": range(24)})["x"].tobytes()
    assert int(total) == sum(n**2 for n in range(24))


@pytest.mark.parametrize("damage", ["cut", "empty", "flipped", "text", "other"])
def test_a_damaged_case_is_run_again(study, tmp_path, damage):
    first = fan.sweep(study, {"n": range(3)}, store=tmp_path)
    damaged_file, other_file, _ = case_files(tmp_path)
    content = damaged_file.read_bytes()
    flipped = bytearray(content)
    flipped[content.index("case ".encode("utf-32-le")) + 4] ^= 1
    damaged_file.write_bytes(
        {
            "cut": content[: len(content) // 2],
            "empty": b"",
            "flipped": bytes(flipped),
            "text": b"not an archive",
            "other": other_file.read_bytes(),
        }[damage]
    )
    _cases_run.clear()
    repaired = fan.sweep(study, {"n": range(3)}, store=tmp_path)
    assert len(_cases_run) == 1
    assert np.array_equal(first["x"], repaired["x"])


def test_no_pickle_is_read(study, tmp_path):
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    (file,) = case_files(tmp_path)
    with np.load(file) as archive:
        arrays = dict(archive)
    np.savez(file, **{**arrays, "figure:0": np.array([print], dtype=object)})
    _cases_run.clear()
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    assert _cases_run == [0]


def test_failures_are_stored_and_repeated_on_request(tmp_path):
    marker = tmp_path / "ill"
    marker.touch()

    def study(case):
        _cases_run.append(case["n"])
        if case["n"] == 1 and Path(case["marker"]).exists():
            raise ValueError("ill")
        return {"x": 1.0}

    arguments = {"over": {"n": range(3), "marker": [str(marker)]}, "store": tmp_path / "s"}
    _cases_run.clear()
    first = fan.sweep(study, **arguments)
    second = fan.sweep(study, **arguments)
    assert len(_cases_run) == 3
    assert [str(f) for f in second.failures] == [str(f) for f in first.failures]
    assert second.failures[0].failure.trace == first.failures[0].failure.trace
    marker.unlink()
    third = fan.sweep(study, **arguments, retry=True)
    assert _cases_run[3:] == [1] and third.done.all()


def test_another_sweeps_store_is_refused(study, tmp_path):
    fan.sweep(study, {"n": [0]}, store=tmp_path)
    contents = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}

    def other_study(case):
        return {"x": 1.0}

    for change, message in (
        ({"study": other_study}, "study is"),
        ({"seed": 1}, "seed is 0 there and 1 here"),
        ({"over": {"m": [0]}}, "values is"),
        ({"version": "2"}, "version is None there and '2' here"),
    ):
        arguments = {"study": study, "over": {"n": [0]}, "store": tmp_path, **change}
        with pytest.raises(fan.errors.StoreError, match=f"holds another sweep.*{message}"):
            fan.sweep(**arguments)
    assert {f: f.read_bytes() for f in tmp_path.rglob("*") if f.is_file()} == contents


def test_a_study_with_changed_code_is_refused_unless_its_version_is_the_same(tmp_path):
    def define_study(text):
        namespace = {"__name__": "study"}
        exec(text, namespace)
        return namespace["study"]

    study = define_study("def study(case):\n    return {'x': 1.0}\n")
    with_moved_lines = define_study("\n\n# a remark\ndef study(case):\n    return {'x': 1.0}\n")
    with_other_result = define_study("def study(case):\n    return {'x': 2.0}\n")
    fan.sweep(study, store=tmp_path / "a")
    fan.sweep(with_moved_lines, store=tmp_path / "a")
    with pytest.raises(fan.errors.StoreError, match="code or the settings"):
        fan.sweep(with_other_result, store=tmp_path / "a")
    fan.sweep(study, store=tmp_path / "b", version="1")
    assert fan.sweep(with_other_result, store=tmp_path / "b", version="1")["x"] == 1.0

    class CallableStudy:
        def __call__(self, case):
            return {}

    with pytest.raises(ValueError, match="version='1'"):
        fan.sweep(CallableStudy(), store=tmp_path / "c")


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
