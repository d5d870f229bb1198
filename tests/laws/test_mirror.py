"""A mirrored puppet moves as its mirror image.

A random half hangs on a torso and is reflected by the file's `mirror`. Reflecting a state and
simulating it must equal simulating it and reflecting the motion.
"""

from __future__ import annotations

import numpy as np
import pytest

from harness import Model, State
from oracles import random_trees

pytestmark = pytest.mark.medium

NORMAL = {"yz": 0, "xz": 1, "xy": 2}


def halved(seed: int, plane: str) -> dict:
    """A torso in the mirror plane and a random half called l_..., with its mirror."""
    half = random_trees.description(
        seed, 4 + seed % 8, strings=2, limits=True, drag=True, driven=0.25
    )
    names = {b["name"] for b in half["bodies"]} | {"world"}

    def renamed(part):
        """The half's own names, and attachments to its bodies, get the token."""
        if isinstance(part, dict):
            return {k: "l_" + v if k in ("name", "body") else renamed(v) for k, v in part.items()}
        return [renamed(p) for p in part] if isinstance(part, list) else part

    bodies = []
    for body in half["bodies"]:
        parent = body["parent"]
        mine = renamed(body)
        assert parent in names
        mine["parent"] = "torso" if parent == "world" else "l_" + parent
        bodies.append(mine)
    n = NORMAL[plane]
    com = [0.1, -0.05, 0.2]
    com[n] = 0.0
    products = {0: (3, 4), 1: (3, 5), 2: (4, 5)}[n]  # ixy, ixz, iyz that contain the normal axis
    inertia = [0.05, 0.06, 0.07, 0.003, -0.004, 0.002]
    for k in products:
        inertia[k] = 0.0
    gravity = [1.0, 2.0, -9.0]
    gravity[n] = 0.0
    torso = {
        "name": "torso",
        "joint": {"type": "free", "damping": 0.3},
        "mass": 2.0,
        "com": com,
        "inertia": inertia,
    }
    return {
        "puppet": "mirrored",
        "gravity": gravity,
        "bodies": [torso, *bodies],
        "strings": renamed(half["strings"]),
        "springs": renamed(half["springs"]),
        "mirror": {"plane": plane, "from": "l_", "to": "r_"},
    }


def twin(name: str) -> str:
    """The name on the other side."""
    if name.startswith("l_"):
        return "r_" + name[2:]
    return "l_" + name[2:] if name.startswith("r_") else name


def reflected(names: tuple[str, ...], values: np.ndarray, plane: str) -> np.ndarray:
    """Coordinates of the mirror image: sides swapped, vectors and axial vectors reflected."""
    normal = "xyz"[NORMAL[plane]]
    out = np.empty_like(values)
    for i, name in enumerate(names):
        suffix = name.rpartition(".")[2] if "." in name else ""
        flips = suffix == normal or (
            len(suffix) == 2 and suffix[0] in "qw" and suffix[1] in "xyz" and suffix[1] != normal
        )
        out[names.index(twin(name))] = -values[i] if flips else values[i]
    return out


@pytest.mark.parametrize("plane", NORMAL)
@pytest.mark.parametrize("seed", range(500, 506))
def test_reflected_motion_is_the_motion_of_the_reflection(seed, plane):
    model = Model(halved(seed, plane))
    t = model.table
    assert sorted(map(twin, t.v_D)) == sorted(t.v_D)
    x = model.random(seed)
    y = State(
        q_D=reflected(t.q_D, x.q_D, plane),
        v_D=reflected(t.v_D, x.v_D, plane),
        q_K=reflected(t.q_K, x.q_K, plane),
        v_K=reflected(t.v_K, x.v_K, plane),
        acc_K=reflected(t.v_K, x.acc_K, plane),
    )
    acc = model.acceleration(x)
    size = np.abs(acc).max()
    np.testing.assert_allclose(
        model.acceleration(y), reflected(t.v_D, acc, plane), atol=1e-11 * size
    )
    assert model.first_output("lagrangian", y)[0, 0] == pytest.approx(
        model.first_output("lagrangian", x)[0, 0]
    )

    rows = model.tree.row_names
    h = dict(zip(rows, model.first_output("constraint", x)[:, 0], strict=True))
    image = dict(zip(rows, model.first_output("constraint", y)[:, 0], strict=True))
    for name, value in h.items():
        # A twist has the opposite sense in the mirror: its lower bound is its twin's upper bound.
        other = twin(name)
        if ".twist." in name:
            side = {"lower": "upper", "upper": "lower"}[name.rpartition(".")[2]]
            other = f"{other.rpartition('.')[0]}.{side}"
        assert image[other] == pytest.approx(value, abs=1e-12), name

    places = {link.name: i for i, link in enumerate(model.tree.links)}
    S = np.eye(3)
    S[NORMAL[plane], NORMAL[plane]] = -1.0
    here, there = (model.first_output("poses", s).reshape(-1, 12) for s in (x, y))
    for name, i in places.items():
        j = places[twin(name)]
        R, Q = (p[:9].reshape(3, 3).T for p in (here[i], there[j]))
        np.testing.assert_allclose(Q, S @ R @ S, atol=1e-12)
        np.testing.assert_allclose(there[j, 9:], S @ here[i, 9:], atol=1e-12)
