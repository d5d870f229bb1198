"""Plans on disk equal the saved ones, searches continue, and damaged files are refused."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.control.planning import Explore

pytestmark = pytest.mark.own_puppets

NO_PLAN = r"is not a plan that this version can read|is not an npz file"


def test_a_saved_plan_is_complete_and_continues(boxes, tmp_path):
    plan = fan.control.solve(boxes, seed=4)
    plan.save(tmp_path / "plan.npz")
    loaded = fan.control.PlanResult.load(tmp_path / "plan.npz", boxes)
    assert loaded and loaded.path == plan.path and loaded.replay()
    assert (loaded.tried, loaded.curve, loaded.status) == (plan.tried, plan.curve, plan.status)
    with np.load(tmp_path / "plan.npz") as file:
        assert np.array_equal(file["looks"], plan.tree.n_checks), "the key of earlier versions"
    for name, a in plan.tree.arrays.items():
        assert np.array_equal(a, loaded.tree.arrays[name])
    assert np.array_equal(plan.inputs.coef, loaded.inputs.coef)
    grown, loaded_and_grown = (p.grow(seconds=60.0, iterations=800) for p in (plan, loaded))
    assert grown.path == loaded_and_grown.path and np.array_equal(
        grown.tree.q_D, loaded_and_grown.tree.q_D
    )
    assert not list(tmp_path.glob(".*")), "a half-written file is left"


def test_a_planner_passed_as_an_object_can_be_given_again(boxes, tmp_path):
    planner = Explore(batch=32)
    fan.control.solve(boxes, planner=planner, seed=1).save(tmp_path / "plan.npz")
    loaded = fan.control.PlanResult.load(tmp_path / "plan.npz", boxes, planner)
    assert loaded.search.options.planner is planner


def test_files_without_a_plan_are_refused(boxes, tmp_path):
    path = tmp_path / "plan.npz"
    with pytest.raises(FileError, match="no such file"):
        fan.control.PlanResult.load(path, boxes)
    path.write_bytes(b"not a plan")
    with pytest.raises(FileError, match=NO_PLAN):
        fan.control.PlanResult.load(path, boxes)
    fan.simulate(boxes.marionette, boxes.start, t_end=0.1).save(path)
    with pytest.raises(FileError, match="has the format"):
        fan.control.PlanResult.load(path, boxes)
    fan.control.solve(boxes, seed=0).save(path)
    arm = boxes.marionette
    other = fan.control.Problem(arm, arm.rest({"hand.x": 0.2}), {"elbow": 1.0})
    with pytest.raises(FileError, match="another problem"):
        fan.control.PlanResult.load(path, other)
    with pytest.raises(FileError, match="another problem"):
        fan.control.PlanResult.load(path, fan.control.load_problem("arm3d_boxes", tolerance=0.2))
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(FileError, match=NO_PLAN):
        fan.control.PlanResult.load(path, boxes)


def test_pictures_and_films_of_plans(boxes, tmp_path):
    from matplotlib.image import imread

    plan = fan.control.solve(boxes, seed=0, improve=0.2)
    pixels = imread(plan.plot(tmp_path / "plan.png", size=(400, 400)))
    assert pixels.shape[:2] == (800, 800) and pixels[..., :3].std() > 0.02
    blue = (pixels[..., 2] > pixels[..., 0] + 0.3).sum()
    assert blue > 100, "the path is not drawn"
    plan.animate(tmp_path / "plan.gif", size=(160, 200))
    assert (tmp_path / "plan.gif").stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("parent", lambda a: np.arange(len(a))),
        ("parent", lambda a: a + 10_000),
        ("distance", lambda a: a.astype(str)),
        ("acceleration", lambda a: a[:, :1]),
        ("time", lambda a: a * np.nan),
        ("path", lambda a: a[:-1] * 0 + 10_000),
    ],
)
def test_damaged_arrays_are_refused(boxes, tmp_path, name, change):
    path = tmp_path / "plan.npz"
    fan.control.solve(boxes, seed=0).save(path)
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files}
    arrays[name] = change(arrays[name])
    np.savez(path, **arrays)
    with pytest.raises(FileError, match=NO_PLAN):
        fan.control.PlanResult.load(path, boxes)
