"""Balls on one string each, with ends at chosen places."""

from __future__ import annotations

from functools import cache

import numpy as np

import fantoccini as fan


@cache
def balls(n: int) -> fan.Marionette:
    """n balls on the strings s0, s1, ..."""
    return fan.Marionette(
        fan.model.Puppet.model_validate(
            {
                "puppet": "balls",
                "bodies": [
                    {
                        "name": f"ball{i}",
                        "joint": {"type": "translation", "axes": ["x", "y", "z"]},
                        "shapes": [{"type": "sphere", "radius": 0.01, "mass": 0.1}],
                    }
                    for i in range(n)
                ],
                "strings": [
                    {
                        "name": f"s{i}",
                        "path": [
                            {"body": f"ball{i}"},
                            {"driven": ["x", "y", "z"], "at": [0.3 * i, 0, 1]},
                        ],
                        "length": "driven",
                    }
                    for i in range(n)
                ],
                "pose": {f"ball{i}.x": 0.3 * i for i in range(n)},
            }
        )
    )


def carried(
    marionette: fan.Marionette, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """q_D and q_K (T, ...) with balls at low (T, n, 3), hands at high, and straight strings."""
    table = marionette.coordinates
    q_D, q_K = np.zeros((len(low), table.n_qD)), np.zeros((len(low), table.n_qK))
    for i in range(low.shape[1]):
        for c, axis in enumerate("xyz"):
            q_D[:, table.q_D.index(f"ball{i}.{axis}")] = low[:, i, c]
            q_K[:, table.q_K.index(f"s{i}.{axis}")] = high[:, i, c]
        q_K[:, table.q_K.index(f"s{i}.length")] = 0.01
    return q_D, q_K


def smooth(rng: np.random.Generator, t: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Motions (T, *shape) of an amplitude of about 1."""
    phase, pace = rng.uniform(0, 2 * np.pi, (3, *shape)), rng.uniform(0.3, 2.0, (3, *shape))
    waves = [np.sin(np.multiply.outer(t, w) + p) for p, w in zip(phase, pace, strict=True)]
    return np.mean(waves, axis=0)
