"""Rigs with redundant strings, as puppet descriptions."""

from __future__ import annotations

import numpy as np

BODIES, STRINGS = 5, 12


def many_strings(seed: int = 0) -> dict:
    """Five free bodies on sixty wound strings: 30 degrees of freedom.

    Eight of a body's twelve strings run up to a carriage that is driven along x, y and z, two of
    them between the same two points; two run to the next body and two down to the floor.

    Args:
        seed: seed of the points.
    """
    rng = np.random.default_rng(seed)
    bodies = [{"name": "carriage", "joint": {"type": "translation", "axes": ["x", "y", "z"]}}]
    bodies[0]["joint"]["driven"] = True
    strings, pose = [], {}
    for i in range(BODIES):
        angle = 2 * np.pi * i / BODIES
        place = np.array([np.cos(angle), np.sin(angle), 1.0])
        box = {"type": "box", "size": [0.3, 0.2, 0.1], "mass": 0.5 + 0.2 * i}
        bodies.append({"name": f"body{i}", "joint": {"type": "free"}, "shapes": [box]})
        pose |= {f"body{i}.{axis}": float(x) for axis, x in zip("xyz", place, strict=True)}
        for j in range(STRINGS):
            here = {"body": f"body{i}", "at": rng.uniform(-0.15, 0.15, 3).tolist()}
            around = place[:2] + rng.uniform(-0.6, 0.6, 2)
            there = {"body": "carriage", "at": [*around.tolist(), float(rng.uniform(2, 3))]}
            if j == 7:
                here, there = strings[-1]["path"]
            if j in (8, 9):
                other = rng.uniform(-0.15, 0.15, 3).tolist()
                there = {"body": f"body{(i + 1) % BODIES}", "at": other}
            if j in (10, 11):
                there = {"world": [*around.tolist(), 0.0]}
            strings.append({"name": f"s{i}_{j}", "path": [here, there], "length": "driven"})
    return {"puppet": "many_strings", "bodies": bodies, "strings": strings, "pose": pose}
