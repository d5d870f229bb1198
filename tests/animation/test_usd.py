"""Files of OpenUSD, read by usd-core."""

from __future__ import annotations

from importlib import util
from pathlib import Path

import numpy as np
import pytest
from tests.animation.test_glb import still_of

import fantoccini as fan
from fantoccini.output.animation import formats

pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Usd, UsdGeom, UsdShade  # noqa: E402

pytestmark = pytest.mark.medium


def open_usd(path: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(path))


def pose(stage: Usd.Stage, name: str, code: float) -> np.ndarray:
    """(3, 4) pose of a prim in the world."""
    prim = next(prim for prim in stage.Traverse() if prim.GetName() == name)
    moved = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(code)
    return np.array(moved).T[:3]


@pytest.mark.parametrize("ending", [".usda", ".usdc"])
def test_frames_are_exact(greeting: fan.Trajectory, tmp_path: Path, ending: str) -> None:
    stage = open_usd(fan.export(greeting, tmp_path / f"greeting{ending}", fps=24))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == 24.0
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, 240.0)
    still, t = still_of(greeting), np.arange(0, 241, 7) / 24
    run = greeting.resample(t)
    poses = still.poses(run.q_D, run.q_K)
    for k, link in enumerate(still.tree.links):
        name = link.name.replace(".", "_")
        poses_in_file = np.array([pose(stage, name, 24 * time) for time in t])
        # USD takes the arc cosine of a quaternion's w: half of a double's digits.
        assert np.abs(poses_in_file - poses[:, k]).max() < 1e-7, link.name


def test_between_frames_the_error_falls_with_the_square_of_the_rate(
    greeting: fan.Trajectory, tmp_path: Path
) -> None:
    still, t = still_of(greeting), np.arange(3.0, 5.0, 1 / 240)
    run = greeting.resample(t)
    k = [link.name for link in still.tree.links].index("shin_left")
    wanted = still.poses(run.q_D, run.q_K)[:, k, :, 3]
    off = []
    for fps in (30, 120):
        stage = open_usd(fan.export(greeting, tmp_path / f"{fps}.usdc", fps=fps))
        places = np.array([pose(stage, "shin_left", fps * time)[:, 3] for time in t])
        off.append(np.percentile(np.linalg.norm(places - wanted, axis=1), 90))
    assert off[0] < 1e-3
    assert 8.0 < off[0] / off[1] < 24.0


def test_strings_end_on_their_bodies_and_sag(greeting: fan.Trajectory, tmp_path: Path) -> None:
    stage = open_usd(fan.export(greeting, tmp_path / "greeting.usdc", fps=20))
    still, t = still_of(greeting), np.arange(201) / 20
    run = greeting.resample(t)
    lengths = still.string_lengths(run.q_D, run.q_K)
    for k, string in enumerate(still.tree.strings):
        curve = UsdGeom.BasisCurves(stage.GetPrimAtPath(f"/marionette/{string.name}"))
        points = np.array([curve.GetPointsAttr().Get(code) for code in range(201)])
        ends = list(still.string_points(run.q_D, run.q_K).values())[k]
        assert np.abs(points[:, [0, -1]] - ends[:, [0, -1]]).max() < 1e-6
        drawn = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
        # A polyline of 16 pieces is slightly shorter than its curve, most at a fold.
        assert drawn == pytest.approx(lengths[:, k], rel=0.02)


def test_bodies_have_shapes_and_materials(thrown: fan.Trajectory, tmp_path: Path) -> None:
    stage = open_usd(fan.export(thrown, tmp_path / "thrown.usda"))
    assert stage.GetDefaultPrim().GetName() == "string_pendulum"
    assert stage.GetFramesPerSecond() == 60.0
    ball = stage.GetPrimAtPath("/string_pendulum/bob/bob_shape1")
    box = UsdGeom.Mesh(ball).ComputeLocalBound(0.0, "default").ComputeAlignedRange()
    assert np.allclose(box.GetMax(), 0.04, atol=1e-3)
    material = UsdShade.MaterialBindingAPI(ball).ComputeBoundMaterial()[0]
    shader = UsdShade.Shader(material.GetPrim().GetChildren()[0])
    # Linear of #b03a2e.
    colour = np.array(shader.GetInput("diffuseColor").Get())
    assert colour == pytest.approx([0.4342, 0.0423, 0.0273], abs=1e-4)


def test_names_that_usd_refuses_are_display_names(greeting: fan.Trajectory, tmp_path: Path) -> None:
    stage = open_usd(fan.export(greeting, tmp_path / "greeting.usdc", fps=1, bodies=["skull"]))
    prim = stage.GetPrimAtPath("/marionette/head_end")
    assert prim.GetDisplayName() == "head.end"
    assert not stage.GetPrimAtPath("/marionette/torso")


def test_a_missing_library_has_an_install_command(
    thrown: fan.Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(formats, "find_spec", lambda name: None)
    with pytest.raises(fan.errors.MissingLibraryError, match=r"pip install 'fantoccini\[usd\]'"):
        fan.export(thrown, tmp_path / "thrown.usda")
    assert list(tmp_path.iterdir()) == []
    assert util.find_spec("pxr") is not None


def test_materials_are_called_after_their_colours(thrown: fan.Trajectory, tmp_path: Path) -> None:
    stage = open_usd(fan.export(thrown, tmp_path / "thrown.usda"))
    ball = stage.GetPrimAtPath("/string_pendulum/bob/bob_shape1")
    string = stage.GetPrimAtPath("/string_pendulum/line")
    materials = [
        UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0] for prim in (ball, string)
    ]
    assert [m.GetPath().name for m in materials] == ["colour_b03a2e", "colour_6e6a62"]


def test_a_body_may_be_called_materials(tmp_path: Path) -> None:
    puppet = fan.loads(
        "puppet: p\nbodies: [{name: materials, joint: {type: free}, shapes: [{type: sphere, "
        "radius: 0.1, mass: 1}]}]\n"
    )
    run = fan.simulate(puppet, puppet.state(), t_end=0.1, method="timestepping")
    stage = open_usd(fan.export(run, tmp_path / "a.usda"))
    assert stage.GetPrimAtPath("/p/materials").GetTypeName() == "Xform"
    shape = stage.GetPrimAtPath("/p/materials/materials_shape1")
    assert UsdShade.MaterialBindingAPI(shape).ComputeBoundMaterial()[0]
