"""Steps of MuJoCo and their derivatives, for the same links (https://mujoco.org)."""

from __future__ import annotations

import time
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from fantoccini.base.arrays import Array

from .peer_problems import Problem

HEAVY = 1e9
"""Mass of the hand, by which its force is scaled [kg]."""


class MuJoCoSteps:
    """Links that hang from a heavy hand on three slides.

    Args:
        problem: the links.
    """

    def __init__(self, problem: Problem):
        self._model = mujoco.MjModel.from_xml_string(_xml(problem))
        self._data = mujoco.MjData(self._model)
        self._k = len(problem.axes)

    def accelerations(self, q: Array, v: Array, acc: Array) -> Array:
        """(n_vD,) accelerations of the hinges for one of the hand."""
        self._data.qpos[:], self._data.qvel[:] = q, v
        self._data.ctrl[:] = HEAVY * acc
        mujoco.mj_forward(self._model, self._data)
        return np.array(self._data.qacc[self._k :])

    def derivatives(self, q: Array, v: Array, centred: bool) -> float:
        """Time of a step's derivatives by differences, over states (n, ...) [s]."""
        model, data, n = self._model, self._data, self._model.nv
        A, B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, self._k))
        began = time.perf_counter()
        for state in range(len(q)):
            data.qpos[:], data.qvel[:] = q[state], v[state]
            mujoco.mjd_transitionFD(model, data, 1e-6, centred, A, B, None, None)
        return (time.perf_counter() - began) / len(q)


def _xml(problem: Problem) -> str:
    """MJCF of the links, without contact; gravity does not pull at the hand."""
    below: dict[int, list[int]] = {}
    for i, link in enumerate(problem.links):
        below.setdefault(link.parent, []).append(i)

    def words(values: tuple[float, ...]) -> str:
        return quoteattr(" ".join(map(repr, values)))

    def body(i: int) -> str:
        link = problem.links[i]
        return (
            f"<body pos={words(link.at)}><joint type='hinge' axis={words(link.axis)}/>"
            f"<inertial pos={words(link.com)} mass='{link.mass!r}' "
            f"diaginertia={words(link.inertia)}/>{''.join(map(body, below.get(i, [])))}</body>"
        )

    slides = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    joints = "".join(f"<joint name='{a}' type='slide' axis='{slides[a]}'/>" for a in problem.axes)
    motors = "".join(f"<motor joint='{a}'/>" for a in problem.axes)
    return (
        "<mujoco><option integrator='Euler' timestep='0.005'><flag contact='disable'/></option>"
        f"<worldbody><body gravcomp='1'>{joints}<inertial pos='0 0 0' mass='{HEAVY!r}' "
        f"diaginertia='1 1 1'/>{''.join(map(body, below[-1]))}</body></worldbody>"
        f"<actuator>{motors}</actuator></mujoco>"
    )
