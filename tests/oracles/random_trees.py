"""Seeded random puppets with every joint type, driven joints, and strings on request.

A puppet is a plain description with the keys of a puppet file, for both fantoccini and MuJoCo.
"""

from __future__ import annotations

import numpy as np

DOF = {"fixed": 0, "revolute": 1, "prismatic": 1, "translation": 2, "ball": 3, "free": 6}
ABOVE = np.array([0.0, 0.0, 2.0])
"""Middle of the upper ends of strings [m]."""

WEIGHT = {"fixed": 1, "revolute": 5, "prismatic": 2, "translation": 1, "ball": 2.5, "free": 1}


def description(
    seed: int,
    dof: int,
    *,
    driven: float = 0.2,
    kinds: tuple[str, ...] = tuple(DOF),
    dissipative: bool = True,
    springs: bool = True,
    strings: int = 0,
    limits: bool = False,
    drag: bool = False,
) -> dict:
    """A random puppet.

    Args:
        seed: the same seed gives the same puppet.
        dof: velocities in all, dynamic and driven together (reached or passed by at most 5).
        driven: share of the joints that are driven.
        kinds: joint types to draw from.
        dissipative: joint damping.
        springs: joint springs and springs between points.
        strings: number of strings, with paths of 2 to 4 points, some with driven ends or lengths.
        limits: scalar limits, cones and twists.
        drag: air drag on half of the bodies.
    """
    rng = np.random.default_rng([seed, dof])
    names, bodies, total = [], [], 0
    weights = np.array([WEIGHT[k] for k in kinds], float)
    while total < dof:
        kind = str(rng.choice(kinds, p=weights / weights.sum()))
        name = f"b{len(bodies)}"
        if not names or rng.random() < 0.07:
            parent = "world"
        elif rng.random() < 0.6:
            parent = names[-1]
        else:
            parent = str(rng.choice(names))
        moves = kind != "fixed"
        # the first body that moves is dynamic, so that every puppet has something to solve for
        drive = moves and total > 0 and rng.random() < driven
        bodies.append(
            {
                "name": name,
                "parent": parent,
                "joint": _joint(rng, kind, drive, dissipative, springs, limits),
                **_inertia(rng),
            }
        )
        names.append(name)
        total += 2 if kind == "translation" else DOF[kind]
    if all(b["joint"].get("driven") or b["joint"]["type"] == "fixed" for b in bodies):
        bodies[0]["joint"] = _joint(rng, "revolute", False, dissipative, springs, limits)
    if drag:
        for body in bodies:
            if rng.random() < 0.5:
                kinds_of_drag = ("linear", "quadratic", "angular")
                body["drag"] = {k: float(rng.uniform(0.0, 1.0)) for k in kinds_of_drag}
    puppet = {
        "puppet": f"random{seed}",
        "gravity": [0.0, 0.0, -9.81] if rng.random() < 0.5 else _floats(rng.normal(size=3) * 5.0),
        "bodies": bodies,
    }
    if springs:
        puppet["springs"] = [
            {
                "name": f"spring{i}",
                "between": _two_ends(rng, names),
                "stiffness": float(rng.uniform(1.0, 30.0)),
                "rest": float(rng.uniform(0.0, 0.5)),
                "damping": float(rng.uniform(0.0, 2.0)) if dissipative else 0.0,
            }
            for i in range(int(rng.integers(0, 3)))
        ]
    if strings:
        puppet["strings"] = [_string(rng, i, names) for i in range(strings)]
    return puppet


def _floats(values) -> list[float]:
    return [float(x) for x in np.asarray(values).ravel()]


def _point(rng) -> list[float]:
    return _floats(rng.uniform(-0.4, 0.4, 3))


def _attachment(rng, names) -> dict:
    if rng.random() < 0.2:
        return {"world": _floats(rng.uniform(-1.0, 1.0, 3))}
    return {"body": str(rng.choice(names)), "at": _point(rng)}


def _two_ends(rng, names) -> list[dict]:
    """Two attachments on different bodies."""
    ends = [_attachment(rng, names), _attachment(rng, names)]
    if ends[0].get("body") == ends[1].get("body"):
        ends[1] = {"world": _floats(rng.uniform(-1.0, 1.0, 3))}
        ends[0] = {"body": names[-1], "at": _point(rng)}
    return ends


def _string(rng, i, names) -> dict:
    path = [{"body": str(rng.choice(names)), "at": _point(rng)}]
    path += [_attachment(rng, names) for _ in range(int(rng.integers(0, 3)))]
    if rng.random() < 0.5:
        axes = [["x"], ["x", "y"], ["x", "y", "z"], ["z"]][int(rng.integers(0, 4))]
        path.append({"driven": axes, "at": _floats(rng.uniform(-1.0, 1.0, 3) + ABOVE)})
    else:
        path.append({"world": _floats(rng.uniform(-1.0, 1.0, 3) + ABOVE)})
    length = "driven" if rng.random() < 0.5 else float(rng.uniform(0.5, 2.0))
    return {"name": f"s{i}", "path": path, "length": length}


def _orientation(rng) -> dict:
    how = int(rng.integers(0, 3))
    if how == 0:
        return {"quaternion": _floats(rng.normal(size=4))}
    if how == 1:
        return {"axis": _floats(rng.normal(size=3)), "angle": float(rng.uniform(-3.0, 3.0))}
    return {"rpy": _floats(rng.uniform(-3.0, 3.0, 3))}


def _joint(rng, kind, driven, dissipative, springs, limits) -> dict:
    joint: dict = {"type": kind}
    if kind in ("revolute", "prismatic"):
        joint["axis"] = _floats(rng.normal(size=3))
    if kind == "translation":
        joint["axes"] = [["x", "z"], ["x", "y"], ["y", "z"], ["z"], ["x", "y", "z"]][
            int(rng.integers(0, 5))
        ]
    if rng.random() < 0.8:
        joint["at"] = _point(rng)
    if rng.random() < 0.6:
        joint["orientation"] = _orientation(rng)
    if driven:
        joint["driven"] = True
        return joint
    if dissipative and kind != "fixed" and rng.random() < 0.5:
        joint["damping"] = float(rng.uniform(0.0, 1.0))
    if springs and kind in ("revolute", "prismatic") and rng.random() < 0.3:
        joint["spring"] = {"stiffness": float(rng.uniform(0.0, 20.0)), "rest": float(rng.normal())}
    if limits and kind in ("revolute", "prismatic") and rng.random() < 0.7:
        low, high = rng.uniform(0.5, 2.0, 2)
        joint["limits"] = {"lower": -float(low), "upper": float(high)}
    if limits and kind == "ball":
        axis = _floats(rng.normal(size=3))
        of = _floats(rng.normal(size=3))
        joint["cone"] = {"max": float(rng.uniform(0.3, 1.5)), "axis": axis, "of": of}
        joint["twist"] = {"lower": -1.0, "upper": 0.7}
    return joint


def _inertia(rng) -> dict:
    if rng.random() < 0.4:
        return {"shapes": [_shape(rng) for _ in range(int(rng.integers(1, 3)))]}
    mass = float(rng.uniform(0.1, 2.0))
    spread = rng.normal(size=(6, 3)) * rng.uniform(0.03, 0.15, 3)
    spread -= spread.mean(axis=0)
    second = spread.T @ spread * mass / 6.0
    J = np.trace(second) * np.eye(3) - second
    six = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    if rng.random() < 0.3:
        six = list(np.linalg.eigvalsh(J))
    return {"mass": mass, "com": _floats(rng.uniform(-0.2, 0.2, 3)), "inertia": _floats(six)}


def _shape(rng) -> dict:
    kind = str(rng.choice(["capsule", "box", "sphere", "ellipsoid"]))
    shape: dict = {"type": kind}
    if kind == "capsule":
        shape |= {"from": _point(rng), "to": _point(rng), "radius": float(rng.uniform(0.02, 0.1))}
    elif kind == "box":
        shape |= {"size": _floats(rng.uniform(0.05, 0.4, 3))}
    elif kind == "sphere":
        shape |= {"radius": float(rng.uniform(0.05, 0.2))}
    else:
        shape |= {"radii": _floats(rng.uniform(0.05, 0.2, 3))}
    if kind != "capsule":
        shape["at"] = _point(rng)
    if kind in ("box", "ellipsoid"):
        shape["orientation"] = _orientation(rng)
    if rng.random() < 0.5:
        shape["mass"] = float(rng.uniform(0.1, 2.0))
    else:
        shape["density"] = float(rng.uniform(200.0, 1000.0))
    return shape


def configuration(rng, names: tuple[str, ...], spread: float = 1.0) -> np.ndarray:
    """A random configuration for the coordinates of the given names.

    Quaternions are unit and uniform, string lengths lie between 0.5 and 2.
    """
    q = rng.normal(size=len(names)) * spread
    for i, name in enumerate(names):
        if name.endswith(".qw"):
            q[i : i + 4] = rng.normal(size=4)
            q[i : i + 4] /= np.linalg.norm(q[i : i + 4])
        elif name.endswith(".length"):
            q[i] = rng.uniform(0.5, 2.0)
    return q
