"""Puppets of any size: a chain of hinges, and a tree of hinges in which every body carries two."""

from __future__ import annotations

import json

import fantoccini as fan

SHAPES = {"chain": lambda i: i - 1, "bushy": lambda i: (i - 1) // 2}
"""Kind -> the parent of the i-th body."""

_LENGTH = 0.1
_AXES = ([0, 1, 0], [1, 0, 0], [0, 0.6, 0.8])


def puppet_description(kind: str, dof: int, strings: int) -> dict:
    """A puppet's description, with the keys of a puppet file.

    Args:
        kind: one of ``SHAPES``.
        dof: bodies, each on a damped hinge; the axes take turns, one of them oblique.
        strings: number of strings with driven lengths, spread over the bodies from the last.
    """
    parent = SHAPES[kind]
    bodies = [
        {
            "name": f"b{i}",
            "parent": f"b{parent(i)}" if i else "world",
            "joint": {
                "type": "revolute",
                "axis": _AXES[i % 3],
                "at": [0, 0.02 * (-1) ** i, -_LENGTH] if i else [0, 0, 0],
                "damping": 1e-3,
            },
            "shapes": [
                {
                    "type": "capsule",
                    "from": [0, 0, 0],
                    "to": [0, 0, -_LENGTH],
                    "radius": 0.01,
                    "mass": 0.05,
                }
            ],
        }
        for i in range(dof)
    ]
    carriers = [dof - 1 - k * dof // strings for k in range(strings)]
    rows = [
        {
            "name": f"s{k}",
            "path": [
                {"body": f"b{i}", "at": [0.001 * k, 0, -_LENGTH]},
                {"world": [0.02 * k, 0.3, 1.0]},
            ],
            "length": "driven",
        }
        for k, i in enumerate(carriers)
    ]
    return {"puppet": f"{kind}{dof}", "bodies": bodies, "strings": rows}


def marionette(kind: str, dof: int, strings: int = 3) -> fan.Marionette:
    """A puppet of a size."""
    return fan.loads(json.dumps(puppet_description(kind, dof, strings)))
