"""CSV at a rate, with places, read by pandas and NumPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation
from tests.animation.test_bvh import BODIES
from tests.animation.test_glb import still_of
from tests.cli.command import fantoccini

import fantoccini as fan


def read(path: Path) -> pd.DataFrame:
    """Table with exact numbers; older versions of pandas round the last bit by default."""
    return pd.read_csv(path, dtype=str).astype(float)


def test_by_default_the_table_equals_to_csv(thrown: fan.Trajectory, tmp_path: Path) -> None:
    thrown.to_csv(tmp_path / "own.csv")
    path = fan.export(thrown, tmp_path / "run.csv")
    assert path.read_bytes() == (tmp_path / "own.csv").read_bytes()


def test_rows_are_at_the_rate_to_the_same_bits(greeting: fan.Trajectory, tmp_path: Path) -> None:
    table = read(fan.export(greeting, tmp_path / "run.csv", fps=50))
    t = np.arange(501) / 50
    assert np.array_equal(table["t"], t)
    wanted = greeting.resample(t).columns()
    assert list(table) == list(wanted)
    for name, values in wanted.items():
        assert np.array_equal(table[name], values.astype(float)), name
    again = np.genfromtxt(tmp_path / "run.csv", delimiter=",", skip_header=1)
    assert np.array_equal(again, table.to_numpy(float))


def test_poses_and_ends_of_strings_follow(greeting: fan.Trajectory, tmp_path: Path) -> None:
    table = read(fan.export(greeting, tmp_path / "run.csv", fps=30, bodies="all"))
    still, run = still_of(greeting), greeting.resample(np.arange(301) / 30)
    poses = still.poses(run.q_D, run.q_K)
    names = [link.name for link in still.tree.links]
    for name in BODIES:
        columns = [f"pose:{name}.{x}" for x in ("x", "y", "z", "qw", "qx", "qy", "qz")]
        pose, link = table[columns].to_numpy(), poses[:, names.index(name)]
        assert np.abs(pose[:, :3] - link[..., 3]).max() < 1e-12
        q = np.roll(pose[:, 3:], -1, axis=1)
        assert np.abs(Rotation.from_quat(q).as_matrix() - link[..., :3]).max() < 1e-12
        assert np.abs(np.diff(q, axis=0)).max() < 0.5, "the sign does not flip"
    points = still.string_points(run.q_D, run.q_K).values()
    for string, path in zip(still.tree.strings, points, strict=True):
        for which, end in (("start", path[:, 0]), ("end", path[:, -1])):
            columns = [f"{which}:{string.name}.{x}" for x in "xyz"]
            assert np.abs(table[columns].to_numpy() - end).max() < 1e-12
    assert {name[5:].split(".")[0] for name in table if name.startswith("pose:")} == BODIES


def test_named_bodies_include_their_strings(greeting: fan.Trajectory, tmp_path: Path) -> None:
    table = read(fan.export(greeting, tmp_path / "run.csv", fps=5, bodies=["skull"]))
    posed = {name.split(".")[0] for name in table if name.startswith("pose:")}
    strung = {name.split(".")[0] for name in table if name.startswith(("start:", "end:"))}
    assert posed == {"pose:skull"}
    assert strung == {"start:head", "end:head"}


def test_a_run_that_starts_late_keeps_its_times(thrown: fan.Trajectory, tmp_path: Path) -> None:
    late = thrown.resample(np.linspace(0.5, 1.23, 60))
    table = read(fan.export(late, tmp_path / "run.csv", fps=10))
    assert np.abs(table["t"] - 0.5 - np.arange(8) / 10).max() < 1e-12


def test_the_command_line_writes_the_same(tmp_path: Path) -> None:
    arm = fan.puppets.arm2d()
    run = fan.simulate(arm, arm.rest(), t_end=0.2)
    run.save(tmp_path / "run.npz")
    more = ("--fps", "100", "--bodies", "lower")
    assert fantoccini("export", tmp_path / "run.npz", tmp_path / "c.csv", *more).exit_code == 0
    path = fan.export(run, tmp_path / "python.csv", fps=100, bodies=["lower"])
    assert (tmp_path / "c.csv").read_bytes() == path.read_bytes()
    assert fantoccini("export", tmp_path / "run.npz", tmp_path / "run.bvh").exit_code == 0
    done = fantoccini("export", tmp_path / "run.npz", tmp_path / "a.csv", "--bodies", "all")
    assert done.exit_code == 0
    assert {"pose:upper.x", "pose:lower.qz"} <= set(read(tmp_path / "a.csv"))


def test_all_is_every_body_of_an_animation(thrown: fan.Trajectory, tmp_path: Path) -> None:
    paths = [
        fan.export(thrown, tmp_path / f"{k}.glb", bodies=bodies)
        for k, bodies in enumerate((None, "all"))
    ]
    assert paths[0].read_bytes() == paths[1].read_bytes()
