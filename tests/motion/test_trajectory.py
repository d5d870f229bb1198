"""Trajectories: saved to the same bits, resampled at high order, correct at impacts."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest

from fantoccini.base import rotation
from fantoccini.base.errors import FileError, StateError, Status, UnknownNameError
from fantoccini.model.puppet import loads
from fantoccini.motion import Columns, EventKind, EventRecord, Trajectory
from fantoccini.motion.trajectory import LEDGER

pytestmark = pytest.mark.own_puppets

HEAD_AXIS = np.array([0.3, -0.5, 0.8])


def analytic_motion(t):
    """q_D, v_D, acc_D of an analytic motion at times t; the rotation vector follows a curve."""
    sin, cos = np.sin(t), np.cos(t)
    phi = np.stack([0.5 * sin, 0.4 * cos, 0.3 * t], axis=-1)
    rate = np.stack([0.5 * cos, -0.4 * sin, 0.3 + 0 * t], axis=-1)
    curve = np.stack([-0.5 * sin, -0.4 * cos, 0 * t], axis=-1)
    w, wdot = rotation.body_motion(phi, rate, curve)
    first = np.stack([sin, cos, -sin], axis=0)
    second = np.stack([np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)], axis=0)
    q = np.concatenate([first[0][:, None], rotation.exp(phi), second[0][:, None]], axis=-1)
    v = np.concatenate([first[1][:, None], w, second[1][:, None]], axis=-1)
    acc = np.concatenate([first[2][:, None], wdot, second[2][:, None]], axis=-1)
    return q, v, acc


def run_of(table, t, **changes) -> Trajectory:
    q, v, acc = analytic_motion(t)
    held = np.tile(np.nan_to_num(table.start_K, nan=0.8), (len(t), 1))
    zero = np.zeros((len(t), table.n_vK))
    fields = {
        "t": t,
        "q_D": q,
        "v_D": v,
        "acc_D": acc,
        "q_K": held,
        "v_K": zero,
        "acc_K": zero,
        "tension": Columns(("hand", "knee"), np.stack([1 + t, 2 * t], axis=-1), "string"),
        "limit_force": Columns(("elbow.upper",), np.zeros((len(t), 1)), "limit"),
        "taut": Columns(("hand", "knee"), np.stack([t < 1, t >= 0], axis=-1), "string"),
        "ledger": Columns(LEDGER, np.outer(t, np.arange(len(LEDGER))), "entry"),
        "events": (
            EventRecord(1.0, EventKind.CATCH, "hand", 0.25, 0.5),
            EventRecord(1.5, "breakpoint"),
        ),
        "status": Status.DONE,
        "method": "event",
        "coordinates": table,
    }
    return Trajectory(**{**fields, **changes})


@pytest.fixture
def run(table):
    return run_of(table, np.concatenate([np.linspace(0, 1, 11), np.linspace(1, 2, 11)]))


# -- interpolation -----------------------------------------------------------------------------


def test_resampling_converges_at_order_six(table):
    times = np.linspace(0, 2, 317)
    q, v, acc = analytic_motion(times)

    def worst(n):
        resampled = run_of(table, np.linspace(0, 2, n)).resample(times)
        return np.array(
            [
                np.max(np.abs(resampled.q_D[:, [0, 5]] - q[:, [0, 5]])),
                np.max(np.abs(rotation.between(q[:, 1:5], resampled.q_D[:, 1:5]))),
                np.max(np.abs(resampled.v_D - v)),
                np.max(np.abs(resampled.acc_D - acc)),
            ]
        )

    order = np.log2(worst(9) / worst(17))
    assert np.all(order > [5.5, 5.5, 4.5, 3.5])


def test_rows_are_resampled_to_the_same_bits(table, run):
    same = run.resample(np.unique(run.t))
    rows = np.concatenate([np.arange(10), np.arange(11, 22)])
    assert np.array_equal(same.q_D, run.q_D[rows])
    assert np.array_equal(same.v_D, run.v_D[rows])
    assert np.array_equal(same.tension.values, run.tension.values[rows])


def test_an_impact_has_two_sides(table):
    t = np.array([0.0, 1.0, 1.0, 2.0])
    _, v, _ = analytic_motion(t)
    v[2:] = 0.0
    tension = Columns(("hand",), np.array([[0.0], [0.0], [7.0], [9.0]]), "string")
    taut = Columns(("hand",), np.array([[False], [False], [True], [True]]), "string")
    run = run_of(table, t, v_D=v, tension=tension, taut=taut)
    right, left = run.at(1.0), run.at(1.0, side="left")
    assert not right.v_D.any() and right.taut.tolist() == [True, False]
    assert np.array_equal(left.v_D, v[1]) and left.taut.tolist() == [False, False]
    assert run.resample([1.0, 1.5]).tension["hand"].tolist() == [7.0, 8.0]
    assert run.resample([0.0, 1.0], side="left").tension["hand"].tolist() == [0.0, 0.0]
    assert run.impulse["hand"].tolist() == [0.0, 0.0, 0.25, 0.0]


def test_an_impact_at_either_end(table):
    t = np.array([0.0, 0.0, 1.0, 1.0])
    run = run_of(table, t, tension=Columns(("hand",), np.arange(4.0)[:, None]))
    assert run.resample([0.0, 1.0]).tension["hand"].tolist() == [1.0, 3.0]
    assert run.resample([0.0, 1.0], side="left").tension["hand"].tolist() == [0.0, 2.0]


def test_ledger_is_linear_between_rows(run):
    assert np.allclose(run.resample([0.33]).ledger.values[0], 0.33 * np.arange(len(LEDGER)))


def test_a_single_row_is_a_run(table):
    run = run_of(table, np.array([0.5]))
    assert run.duration == 0.0
    assert np.array_equal(run.at(0.5).q_D, run.q_D[0])


def test_times_outside_of_the_run_are_refused(run):
    with pytest.raises(StateError, match=r"t = 2\.1 s is outside of the run, 0 s to 2 s"):
        run.at(2.1)
    with pytest.raises(StateError):
        run.at(np.nan)


# -- files -------------------------------------------------------------------------------------


def test_npz_is_read_to_the_same_bits(run, tmp_path):
    path = tmp_path / "lift.npz"
    run.save(path)
    loaded = Trajectory.load(path)
    assert [p.name for p in tmp_path.iterdir()] == ["lift.npz"]
    for name in ("t", "q_D", "v_D", "acc_D", "q_K", "v_K", "acc_K"):
        assert getattr(loaded, name).tobytes() == getattr(run, name).tobytes()
    for name in ("tension", "limit_force", "taut", "ledger"):
        ours, theirs = getattr(loaded, name), getattr(run, name)
        assert ours.names == theirs.names and ours.noun == theirs.noun
        assert ours.values.dtype == theirs.values.dtype
        assert ours.values.tobytes() == theirs.values.tobytes()
    assert loaded.events == run.events and loaded.events[0].kind is EventKind.CATCH
    assert loaded.status is Status.DONE and loaded.method == "event"
    assert loaded.coordinates.rows == run.coordinates.rows
    assert loaded.coordinates.rotations == run.coordinates.rotations
    assert np.array_equal(loaded.coordinates.start_K, run.coordinates.start_K, equal_nan=True)
    assert np.array_equal(loaded.resample([0.3]).q_D, run.resample([0.3]).q_D)


def test_slip_and_attribution_are_saved(table, run, tmp_path):
    slip = Columns(("hand", "knee"), np.stack([0.1 * run.t, 0 * run.t], axis=-1), "string")
    events = (EventRecord(0.5, "slip", "hand", 0.0, 0.1), EventRecord(1.5, "grip", "hand"))
    stopped = run_of(
        table,
        run.t,
        slip=slip,
        causes=("hand", "elbow.upper"),
        events=events,
        status=Status.IMPOSSIBLE_INPUT,
    )
    stopped.save(tmp_path / "a.npz")
    loaded = Trajectory.load(tmp_path / "a.npz")
    assert loaded.slip.names == slip.names
    assert loaded.slip.values.tobytes() == slip.values.tobytes()
    assert loaded.causes == ("hand", "elbow.upper")
    assert loaded.events == events
    assert loaded.status is Status.IMPOSSIBLE_INPUT
    assert loaded.state(-1).slip.tolist() == [0.1 * run.t[-1], 0.0]
    columns = stopped.columns()
    assert columns["slip:hand"].tolist() == slip["hand"].tolist()
    stopped.to_csv(tmp_path / "a.csv")
    assert "slip:knee" in (tmp_path / "a.csv").read_text().splitlines()[0].split(",")
    # Runs saved without either, as those of earlier versions.
    run.save(tmp_path / "b.npz")
    loaded = Trajectory.load(tmp_path / "b.npz")
    assert loaded.slip is None and loaded.causes == ()
    assert not [name for name in run.columns() if name.startswith("slip:")]


def test_a_run_without_events_is_saved(table, tmp_path):
    run_of(table, np.linspace(0, 1, 3), events=()).save(tmp_path / "a.npz")
    assert Trajectory.load(tmp_path / "a.npz").events == ()


def test_the_puppet_is_saved(table, run, tmp_path):
    puppet = loads(
        "puppet: bob\nbodies: [{name: bob, joint: {type: free}, mass: 1, inertia: [1, 1, 1]}]\n"
    )
    run_of(table, run.t, puppet=puppet).save(tmp_path / "a.npz")
    assert Trajectory.load(tmp_path / "a.npz").puppet == puppet


def test_meshes_are_saved_with_the_puppet(table, run, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    folder = tmp_path / "puppet"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(folder / "meshes" / "box.stl")
    text = (
        "puppet: bob\nbodies:\n- name: bob\n  joint: {type: free}\n"
        "  shapes: [{type: mesh, file: meshes/box.stl, density: 500}]\n"
    )
    puppet = loads(text, folder=folder)
    run_of(table, run.t, puppet=puppet).save(tmp_path / "a.npz")
    before = puppet.canonical()
    shutil.rmtree(folder)
    assert Trajectory.load(tmp_path / "a.npz").puppet.canonical() == before


def test_a_failed_save_leaves_the_old_file(run, tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    path.write_bytes(b"old")

    def full(*args, **kwargs):
        raise OSError("no space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match="no space"):
        run.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04junk", None])
def test_files_without_a_trajectory_are_refused(tmp_path, content):
    path = tmp_path / "a.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=r"a\.npz"):
        Trajectory.load(path)


def test_a_damaged_file_is_refused_or_read_but_never_a_crash(run, tmp_path):
    path = tmp_path / "a.npz"
    run.save(path)
    whole, rng = path.read_bytes(), np.random.default_rng(5)
    for _ in range(100):
        raw = bytearray(whole)
        for place in rng.integers(len(raw), size=3):
            raw[place] = rng.integers(256)
        path.write_bytes(raw)
        try:
            Trajectory.load(path)
        except FileError:
            continue


def test_objects_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, about=np.array([{"a": 1}], dtype=object))
    with pytest.raises(FileError, match=r"a\.npz: about: is not a plain array: holds object"):
        Trajectory.load(path)


def test_csv_reads_back_to_the_same_bits(run, tmp_path):
    path = tmp_path / "a.csv"
    run.to_csv(path)
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == list(run.columns())
    read = np.array(rows, dtype=float)
    for name, values in run.columns().items():
        assert np.array_equal(read[:, header.index(name)], values.astype(float))


def test_columns_are_of_one_length_and_to_dict_is_json(run):
    columns = run.columns()
    assert {x.shape for x in columns.values()} == {run.t.shape}
    assert json.loads(json.dumps(run.to_dict()))["tension:hand"][3] == run.tension["hand"][3]
    pandas = pytest.importorskip("pandas")
    assert list(pandas.DataFrame(columns).columns) == list(columns)


# -- reading -----------------------------------------------------------------------------------


def test_columns_are_found_by_name(run):
    assert "hand" in run.tension and len(run.tension) == 2 and list(run.tension) == ["hand", "knee"]
    with pytest.raises(UnknownNameError, match="no string is called 'hnad'; did you mean 'hand'"):
        run.tension["hnad"]


def test_arrays_are_read_only(run):
    for array in (run.t, run.q_D, run.tension.values, run.state(0).q_D):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_summary(run):
    summary = run.summary()
    assert summary["duration"] == 2.0 and summary["samples"] == 22
    assert summary["events"] == {"catch": 1, "breakpoint": 1}
    assert summary["tension"]["hand"] == {
        "min": 1.0,
        "max": 3.0,
        "slack": pytest.approx(1.0),
        "catches": 1,
        "impulse": 0.25,
    }
    assert summary["ledger"]["potential"] == 2.0


@pytest.mark.parametrize(
    "change", [{"q_D": np.zeros((3, 1))}, {"tension": Columns(("a",), np.zeros((5, 1)))}]
)
def test_shapes_are_checked(table, change):
    with pytest.raises(ValueError, match=r"shape|samples|must"):
        run_of(table, np.array([0.0, 1.0]), **change)


def test_time_does_not_run_backwards(table):
    with pytest.raises(ValueError, match="not decreasing"):
        run_of(table, np.array([1.0, 0.0]))


def test_a_part_has_the_samples_and_events_there(table):
    run = run_of(table, np.linspace(0.0, 2.0, 41))
    part = run.between(0.62, 1.49)
    inner = run.t[(run.t > 0.62) & (run.t < 1.49)]
    assert np.array_equal(part.t, [0.62, *inner, 1.49])
    inside = np.isin(run.t, inner)
    for name in ("q_D", "v_D", "acc_D", "q_K"):
        assert np.array_equal(getattr(part, name)[1:-1], getattr(run, name)[inside]), name
    for t, k in ((0.62, 0), (1.49, -1)):
        q, v, _ = analytic_motion(np.array([t]))
        assert part.q_D[k] == pytest.approx(q[0], abs=1e-9)
        assert part.v_D[k] == pytest.approx(v[0], abs=1e-7)
    assert [event.t for event in part.events] == [1.0]
    assert np.array_equal(part.tension["hand"][1:-1], run.tension["hand"][inside])
    assert np.array_equal(run.between(0.0, 2.0).q_D, run.q_D)


def test_a_part_keeps_both_samples_of_an_impact_inside_and_one_at_its_ends(table):
    t = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    v_D = np.zeros((6, table.n_vD))
    v_D[:, 0] = [1.0, 1.0, 1.0, -2.0, -2.0, -2.0]
    run = run_of(table, t, v_D=v_D)
    assert np.array_equal(run.between(0.5, 1.5).v_D[:, 0], [1.0, 1.0, -2.0, -2.0])
    assert np.array_equal(run.between(1.0, 2.0).v_D[:, 0], [-2.0, -2.0, -2.0])
    assert np.array_equal(run.between(0.0, 1.0).v_D[:, 0], [1.0, 1.0, 1.0])


def test_a_part_is_inside_of_the_run(table):
    run = run_of(table, np.linspace(0.0, 2.0, 11))
    with pytest.raises(StateError, match="outside of the run, 0 s to 2 s"):
        run.between(0.5, 2.1)
    with pytest.raises(ValueError, match="the end must be after the start"):
        run.between(1.0, 1.0)
