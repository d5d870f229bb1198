"""The clips of benchmarks/capture: possible motions of people, equal in all conventions."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.capture.clips import CONVENTIONS, write
from benchmarks.capture.motions import MOTIONS

import fantoccini as fan

ROLES = {"cmu": ("", "ToeBase"), "mixamo": ("mixamorig:", "ToeBase"), "lafan1": ("", "Toe")}
JOINTS = ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """(T, 3) places of joints at 30 frames a second [m], by convention, clip and joint."""
    places: dict[tuple[str, str], dict[str, np.ndarray]] = {}
    for name, kind in CONVENTIONS.items():
        prefix, toe = ROLES[name]
        for path in write(tmp_path_factory.mktemp(name), name):
            clip = fan.theatre.load_bvh(path)
            positions = clip.positions[int(kind.t_pose) :: round(kind.rate / 30.0)] * kind.unit
            joints = {"Hips": "Hips", "Head": "Head"}
            for side in ("Left", "Right"):
                joints |= {side + joint: side + joint for joint in JOINTS}
                joints[f"{side}Toe"] = side + toe
            places[name, path.stem] = {
                role: positions[:, clip.skeleton.index(prefix + joint)]
                for role, joint in joints.items()
            }
    return places


def folded(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Angles between the segments of a limb at its middle joint [deg]."""
    upper, lower = b - a, c - b
    cosine = np.sum(upper * lower, axis=1)
    cosine /= np.linalg.norm(upper, axis=1) * np.linalg.norm(lower, axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


@pytest.mark.parametrize("name", MOTIONS)
def test_conventions_hold_the_same_motion(places, name):
    for convention in ("cmu", "lafan1"):
        for role, path in places["mixamo", name].items():
            # CMU's spine has one joint fewer.
            np.testing.assert_allclose(places[convention, name][role], path, atol=0.015)


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_are_possible_for_a_person(places, name):
    joints = places["mixamo", name]
    for role, path in joints.items():
        assert np.min(path[:, 1]) > 0.0149, role
        np.testing.assert_allclose(path[1], path[0], atol=1e-4)
        np.testing.assert_allclose(path[-2], path[-1], atol=1e-4)
    for side in ("Left", "Right"):
        arm = folded(joints[f"{side}Arm"], joints[f"{side}ForeArm"], joints[f"{side}Hand"])
        leg = folded(joints[f"{side}UpLeg"], joints[f"{side}Leg"], joints[f"{side}Foot"])
        assert np.min(arm) > 5.0 and np.max(arm) < 140.0
        assert np.min(leg) > 5.0 and np.max(leg) < 140.0
        # Knees fold backwards: they are in front of the line from hip to ankle.
        hip, ankle = joints[f"{side}UpLeg"], joints[f"{side}Foot"]
        assert np.all((joints[f"{side}Leg"] - (hip + ankle) / 2.0)[:, 2] > 0.0)
    if name != "jumping_jack":
        lower = np.minimum(joints["LeftToe"][:, 1], joints["RightToe"][:, 1])
        np.testing.assert_allclose(lower, 0.015, atol=1e-3)


def test_figures_are_as_stated(places):
    walk, jack = places["mixamo", "walk"], places["mixamo", "jumping_jack"]
    assert np.max(np.gradient(walk["Hips"][:, 2], 1 / 30)) == pytest.approx(1.2, abs=0.02)
    assert np.max(jack["LeftToe"][:, 1]) == pytest.approx(0.105, abs=0.01)
    bow = places["mixamo", "bow"]
    shoulders = (bow["LeftArm"] + bow["RightArm"]) / 2.0 - bow["Hips"]
    bent = np.degrees(np.arctan2(shoulders[:, 2], shoulders[:, 1]))
    assert np.max(bent) == pytest.approx(45.0, abs=5.0)  # of a chord; the chest bends by 60
