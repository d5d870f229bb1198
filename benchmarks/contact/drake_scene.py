"""Free boxes over a floor in Drake, with compliant hydroelastic contact."""

from __future__ import annotations

import importlib.util
import logging
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.base.arrays import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import State

from .boxes import free_boxes

MODULUS = 1e9
"""Hydroelastic modulus of every box [Pa]: ten times that of hard rubber."""

APPROXIMATIONS = {"SAP": "kSap", "lagged": "kLagged"}
"""Drake's contact models: SAP lifts sliding bodies, lagged lifts them less."""


def is_installed() -> bool:
    """Whether Drake is installed."""
    return importlib.util.find_spec("pydrake") is not None


class DrakeScene:
    """A plant of our free bodies, each one box, and the simulator that steps it.

    Args:
        marionette: puppet of free bodies with one box each and one coefficient of friction.
        dt: step [s].
        approximation: a value of ``APPROXIMATIONS``.

    Raises:
        Unlike: there are other bodies.
    """

    def __init__(self, marionette: Marionette, dt: float, approximation: str):
        from pydrake.math import RigidTransform
        from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
        from pydrake.multibody.tree import SpatialInertia
        from pydrake.systems.analysis import Simulator
        from pydrake.systems.framework import DiagramBuilder

        logging.getLogger("drake").setLevel(logging.ERROR)
        scene = free_boxes(marionette)
        builder = DiagramBuilder()
        self.plant, _ = AddMultibodyPlantSceneGraph(builder, dt)
        self._model(approximation)
        self.bodies = []
        for box in scene.boxes:
            inertia = SpatialInertia.SolidBoxWithMass(box.mass, *box.size)
            own = self.plant.AddRigidBody(box.name, inertia)
            self._touches(own, RigidTransform(), box.size, scene.friction)
            self.bodies.append(own)
        self._floor(scene.friction, scene.floor)
        self.plant.mutable_gravity_field().set_gravity_vector(scene.gravity)
        self.plant.Finalize()
        self.simulator = Simulator(builder.Build())
        self.root = self.simulator.get_mutable_context()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def _model(self, approximation: str) -> None:
        from pydrake.multibody.plant import ContactModel, DiscreteContactApproximation

        approximate = getattr(DiscreteContactApproximation, approximation)
        self.plant.set_discrete_contact_approximation(approximate)
        self.plant.set_contact_model(ContactModel.kHydroelastic)

    def _touches(self, body: Any, at: Any, size: Array, mu: float) -> None:
        from pydrake.geometry import AddCompliantHydroelasticProperties, Box as DrakeBox

        properties = _properties(mu)
        AddCompliantHydroelasticProperties(float(np.min(size)), MODULUS, properties)
        self.plant.RegisterCollisionGeometry(body, at, DrakeBox(*size), body.name(), properties)

    def _floor(self, mu: float, height: float) -> None:
        from pydrake.geometry import AddRigidHydroelasticProperties, HalfSpace
        from pydrake.math import RigidTransform

        properties = _properties(mu)
        AddRigidHydroelasticProperties(properties)
        self.plant.RegisterCollisionGeometry(
            self.plant.world_body(),
            RigidTransform([0.0, 0.0, height]),
            HalfSpace(),
            "floor",
            properties,
        )

    def put(self, x: State) -> None:
        """Sets the state; the coordinates of each body are x, y, z and a quaternion."""
        q, v = np.zeros(self.plant.num_positions()), np.zeros(self.plant.num_velocities())
        for k, body in enumerate(self.bodies):
            at, quaternion = x.q_D[7 * k : 7 * k + 3], x.q_D[7 * k + 3 : 7 * k + 7]
            linear, angular = x.v_D[6 * k : 6 * k + 3], x.v_D[6 * k + 3 : 6 * k + 6]
            i, j = body.floating_positions_start(), body.floating_velocities_start_in_v()
            q[i : i + 7] = [*quaternion, *at]
            v[j : j + 6] = [*_rotation_matrix(quaternion).apply(np.array(angular)), *linear]
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, v)
        self.simulator.Initialize()

    def push(self, force: float) -> None:
        """Applies a force along x to the first body [N]."""
        port = self.plant.get_applied_generalized_force_input_port()
        u = np.zeros(self.plant.num_velocities())
        u[self.bodies[0].floating_velocities_start_in_v() + 3] = force
        port.FixValue(self.context, u)

    def state(self) -> tuple[Array, Array]:
        """(n_qD,), (n_vD,) in our order."""
        all_q = self.plant.GetPositions(self.context)
        all_v = self.plant.GetVelocities(self.context)
        q, v = [], []
        for body in self.bodies:
            i, j = body.floating_positions_start(), body.floating_velocities_start_in_v()
            quaternion = all_q[i : i + 4]
            q += [*all_q[i + 4 : i + 7], *quaternion]
            v += [
                *all_v[j + 3 : j + 6],
                *_rotation_matrix(quaternion).inv().apply(np.array(all_v[j : j + 3])),
            ]
        return np.array(q), np.array(v)

    def advance(self, t: float) -> None:
        """Steps to a time [s]."""
        self.simulator.AdvanceTo(t)


def _properties(mu: float) -> Any:
    from pydrake.geometry import AddContactMaterial, ProximityProperties
    from pydrake.multibody.plant import CoulombFriction

    properties = ProximityProperties()
    AddContactMaterial(0.0, None, CoulombFriction(mu, mu), properties)
    return properties


def _rotation_matrix(quaternion: Array) -> Rotation:
    w, *xyz = quaternion
    return Rotation.from_quat([*xyz, w])
