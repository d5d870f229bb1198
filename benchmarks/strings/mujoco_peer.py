"""The mechanisms of scenarios.py in MuJoCo: strings are spatial tendons of limited length.

MuJoCo's limits are soft. ``default`` keeps its `solreflimit` and `solimplimit`; ``stiffest``
has the shortest time constant that `refsafe` allows, two steps, and the highest impedance;
``overdamped`` is ``stiffest`` with twice the damping. Resetting after a NaN is switched off.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from fantoccini.base.arrays import Array

from .scenarios import ARM, FALL, GRAVITY, LENGTH, MASS

COST = {"Euler": 1, "RK4": 4}
"""Evaluations of the model per step."""

DAMPING = {"default": None, "stiffest": 1, "overdamped": 2}
"""Settings, and their damping ratios."""


@dataclass
class Peer:
    """A MuJoCo model with one limited tendon, and its data.

    Attributes:
        model, data: MuJoCo's.
    """

    model: mujoco.MjModel
    data: mujoco.MjData

    @classmethod
    def of(cls, body: str, tendon: str, dt: float, setting: str, integrator: str) -> Peer:
        """A model from the content of its world and the sites of its tendon.

        Args:
            body: MJCF of bodies and sites.
            tendon: the tendon's greatest length [m], then the names of its sites.
            dt: step [s].
            setting: one of DAMPING.
            integrator: ``Euler`` or ``RK4``.
        """
        length, *sites = tendon.split()
        limit_attributes, damping = "", DAMPING[setting]
        if damping:
            limit_attributes = (
                f'solreflimit="{2 * dt!r} {damping}" solimplimit="0.9999 0.9999 0.001 0.5 2"'
            )
        text = (
            f'<mujoco><compiler angle="radian"/><option timestep="{dt!r}" '
            f'integrator="{integrator}" gravity="0 0 {-GRAVITY}" tolerance="1e-14" '
            'iterations="200" jacobian="dense"><flag contact="disable" autoreset="disable"/>'
            f'</option><worldbody>{body}</worldbody><tendon><spatial name="line" limited="true" '
            f'range="0 {length}" {limit_attributes}>'
            + "".join(f'<site site="{site}"/>' for site in sites)
            + "</spatial></tendon></mujoco>"
        )
        model = mujoco.MjModel.from_xml_string(text)
        return cls(model, mujoco.MjData(model))

    def put(self, q: Array, v: Array) -> Peer:
        """Sets the state."""
        self.data.qpos[:], self.data.qvel[:] = q, v
        return self

    def advance(self, steps: int) -> tuple[Array, Array]:
        """Positions and velocities after these steps."""
        mujoco.mj_step(self.model, self.data, steps)
        return self.data.qpos.copy(), self.data.qvel.copy()

    def course(self, steps: int) -> tuple[Array, Array, Array]:
        """Before each step: (n, nq) positions, (n, nv) velocities and (n,) tension [N]."""
        q, v, tension = [], [], []
        for _ in range(steps):
            # After an RK4 step the forces are those of its last stage: evaluate them again.
            mujoco.mj_forward(self.model, self.data)
            q.append(self.data.qpos.copy())
            v.append(self.data.qvel.copy())
            tension.append(float(np.sum(self.data.efc_force)))
            mujoco.mj_step(self.model, self.data)
        return np.array(q), np.array(v), np.array(tension)


def pendulum(dt: float, setting: str, integrator: str = "RK4") -> Peer:
    """The point mass on its string."""
    body = (
        '<site name="pivot"/><body><joint type="slide" axis="1 0 0"/>'
        '<joint type="slide" axis="0 0 1"/>'
        f'<inertial mass="{MASS}" pos="0 0 0" diaginertia="1 1 1"/><site name="bob"/></body>'
    )
    return Peer.of(body, f"{LENGTH} pivot bob", dt, setting, integrator)


def arm(dt: float, setting: str, integrator: str = "RK4") -> Peer:
    """The arm whose string ends at a fixed point and has a fixed length."""
    lower = _link(ARM.m2, ARM.L2, ARM.I2, f'<site name="tip" pos="{ARM.L2} 0 0"/>', ARM.L1)
    body = f'<site name="hook" pos="{FALL["hand.x"]} 0 {ARM.height}"/>'
    body += _link(ARM.m1, ARM.L1, ARM.I1, lower, 0.0)
    return Peer.of(body, f"{FALL['hand.length']} hook tip", dt, setting, integrator)


def _link(mass: float, length: float, inertia: float, children: str, at: float) -> str:
    return (
        f'<body pos="{at} 0 0"><joint type="hinge" axis="0 -1 0"/><inertial mass="{mass}" '
        f'pos="{length / 2} 0 0" diaginertia="{inertia / 10} {inertia} {inertia}"/>'
        f"{children}</body>"
    )
