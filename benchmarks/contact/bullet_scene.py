"""Free boxes over a floor in Bullet, by its sequential impulses."""

from __future__ import annotations

import importlib.util

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.base.arrays import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

from .boxes import free_boxes


def is_installed() -> bool:
    """Whether Bullet is installed."""
    return importlib.util.find_spec("pybullet") is not None


class BulletScene:
    """A world of our free bodies, each one box; without damping and sleep.

    Args:
        marionette: puppet of free bodies with one box each and one coefficient of friction.
        dt: step [s].

    Raises:
        Unlike: there are other bodies.
    """

    def __init__(self, marionette: Marionette, dt: float):
        import pybullet
        from pybullet_utils.bullet_client import BulletClient

        scene = free_boxes(marionette)
        self.client = BulletClient(connection_mode=pybullet.DIRECT)
        self.client.setGravity(*scene.gravity)
        self.client.setPhysicsEngineParameter(fixedTimeStep=dt, numSubSteps=0)
        self.dt, self.steps = dt, 0
        plane = self.client.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0])
        floor = self.client.createMultiBody(0.0, plane, basePosition=[0.0, 0.0, scene.floor])
        self.client.changeDynamics(floor, -1, lateralFriction=1.0)  # frictions are multiplied
        self.bodies = []
        for box in scene.boxes:
            shape = self.client.createCollisionShape(
                pybullet.GEOM_BOX, halfExtents=list(0.5 * box.size)
            )
            body = self.client.createMultiBody(box.mass, shape)
            self.client.changeDynamics(
                body,
                -1,
                lateralFriction=scene.friction,
                linearDamping=0.0,
                angularDamping=0.0,
                activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            )
            self.bodies.append(body)
        self._force = 0.0

    def put(self, x: State) -> None:
        """Sets the state; the coordinates of each body are x, y, z and a quaternion."""
        for k, body in enumerate(self.bodies):
            at, (w, *xyz) = x.q_D[7 * k : 7 * k + 3], x.q_D[7 * k + 3 : 7 * k + 7]
            linear, angular = x.v_D[6 * k : 6 * k + 3], x.v_D[6 * k + 3 : 6 * k + 6]
            turn = Rotation.from_quat([*xyz, w])
            self.client.resetBasePositionAndOrientation(body, list(at), [*xyz, w])
            rate = turn.apply(np.array(angular))
            self.client.resetBaseVelocity(body, list(linear), list(rate))

    def push(self, force: float) -> None:
        """Applies a force along x to the first body from now on [N]."""
        self._force = force

    def state(self) -> tuple[Array, Array]:
        """(n_qD,), (n_vD,) in our order."""
        q, v = [], []
        for body in self.bodies:
            at, (*xyz, w) = self.client.getBasePositionAndOrientation(body)
            linear, angular = self.client.getBaseVelocity(body)
            q += [*at, w, *xyz]
            v += [*linear, *Rotation.from_quat([*xyz, w]).inv().apply(angular)]
        return np.array(q), np.array(v)

    def advance(self, t: float) -> None:
        """Steps to a time [s]."""
        import pybullet

        while self.steps < round(t / self.dt):
            if self._force:
                at, _ = self.client.getBasePositionAndOrientation(self.bodies[0])
                self.client.applyExternalForce(
                    self.bodies[0], -1, [self._force, 0.0, 0.0], at, pybullet.WORLD_FRAME
                )
            self.client.stepSimulation()
            self.steps += 1
