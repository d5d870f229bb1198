"""Drake as a peer: unconstrained derivatives, and steps of a discrete plant with seven distances.

Distance constraints exist only in discrete plants with the SAP solver, pull and push, and need two
bodies: the strings' upper ends are points of a body welded to the world.
"""

from __future__ import annotations

import logging
import time
from importlib import metadata

import numpy as np
from scipy.spatial.transform import Rotation

from fantoccini.base.arrays import Array

from .by_joint import AnchoredString, dynamic_joints, pack_rates
from .mujoco_peer import PeerError
from .subject import DT, still_tree

CALLS = 500
STEPS = 250


class Drake:
    """A continuous plant without strings and a discrete one with them.

    Attributes:
        version: version of the wheel.
    """

    def __init__(self, text: str, hung: list[AnchoredString]):
        """Creates both from MJCF text without tendons, and the strings.

        Raises:
            PeerError: it is not installed.
        """
        try:
            from pydrake.systems.analysis import Simulator
        except ImportError:
            raise PeerError("not installed") from None
        self.version, self.strings = metadata.version("drake"), hung
        self.free, self.hung = _plant(text, 0.0, []), _plant(text, DT, hung)
        self.context = self.free.CreateDefaultContext()
        self.simulator = Simulator(self.hung)
        self.simulator.Initialize()

    def acceleration(self, q_D: Array, v_D: Array) -> Array:
        """(n_vD,) without strings, in our order and axes."""
        self._place(self.free, self.context, q_D, v_D)
        rates = self.free.EvalTimeDerivatives(self.context).CopyToVector()
        acc = rates[self.free.num_positions() :]
        by_name = {}
        for name, joint in dynamic_joints(still_tree(), q_D, v_D).items():
            start, count = _velocities(self.free, name)
            part = acc[start : start + count]
            if joint.kind == "free":
                by_name[name] = np.concatenate([part[3:], _rotation(joint.q).T @ part[:3]])
            else:
                by_name[name] = _rotation(joint.q).T @ part if joint.kind == "ball" else part
        return pack_rates(still_tree(), by_name)

    def derivative(self, q_D: Array, v_D: Array) -> float:
        """Time of an unconstrained derivative [s]."""
        plant, context = self.free, self.context
        self._place(plant, context, q_D, v_D)
        v = plant.GetVelocities(context)
        start = time.thread_time()
        for _ in range(CALLS):
            plant.SetVelocities(context, v)  # otherwise it answers from its cache
            plant.EvalTimeDerivatives(context)
        return (time.thread_time() - start) / CALLS

    def stretch(self, q_D: Array, v_D: Array) -> float:
        """Largest length error of a string after several steps from a state [m]."""
        self._begin(q_D, v_D)
        self.simulator.AdvanceTo(STEPS * DT)
        context, world = self.simulator.get_context(), self.hung.world_frame()
        apart = 0.0
        for s in self.strings:
            frame = self.hung.GetBodyByName(s.body).body_frame()
            end = self.hung.CalcPointsPositions(context, frame, np.array(s.at), world).ravel()
            apart = max(apart, abs(float(np.linalg.norm(end - s.world)) - s.length))
        return apart

    def step(self, q_D: Array, v_D: Array) -> float:
        """Time of a step with strings [s]."""
        self._begin(q_D, v_D)
        start = time.thread_time()
        self.simulator.AdvanceTo(STEPS * DT)
        return (time.thread_time() - start) / STEPS

    def _begin(self, q_D: Array, v_D: Array) -> None:
        """Sets time 0 and a state."""
        context = self.simulator.get_mutable_context()
        context.SetTime(0.0)
        self._place(self.hung, context, q_D, v_D)
        self.simulator.Initialize()

    @staticmethod
    def _place(plant, context, q_D: Array, v_D: Array) -> None:
        from pydrake.math import RollPitchYaw, RotationMatrix

        q, v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        for name, joint in dynamic_joints(still_tree(), q_D, v_D).items():
            rate = np.array(joint.v)
            if joint.kind == "free":
                body = _body_of(name)
                q_at = plant.GetBodyByName(body).floating_positions_start()
                q[q_at : q_at + 7] = [*joint.q[3:], *joint.q[:3]]
                rate = np.concatenate([_rotation(joint.q) @ rate[3:], rate[:3]])
            else:
                own = plant.GetJointByName(name)
                values = joint.q
                if joint.kind == "ball":
                    R = _rotation(joint.q)
                    values, rate = RollPitchYaw(RotationMatrix(R)).vector(), R @ rate
                q[own.position_start() : own.position_start() + len(values)] = values
            start, count = _velocities(plant, name)
            v[start : start + count] = rate
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)


def _plant(text: str, dt: float, hung: list[AnchoredString]):
    """A finalised plant with the strings as distances."""
    from pydrake.math import RigidTransform
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
    from pydrake.multibody.tree import SpatialInertia, UnitInertia

    logging.getLogger("drake").setLevel(logging.ERROR)  # it warns of omitted elements
    plant = MultibodyPlant(dt)
    Parser(plant).AddModelsFromString(text, "xml")
    if dt > 0.0:
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        unit = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
        anchor = plant.AddRigidBody("anchor", plant.GetModelInstanceByName("puppet"), unit)
        plant.WeldFrames(plant.world_frame(), anchor.body_frame(), RigidTransform())
        for s in hung:
            body = plant.GetBodyByName(s.body)
            plant.AddDistanceConstraint(anchor, np.array(s.world), body, np.array(s.at), s.length)
    plant.Finalize()
    return plant


def _velocities(plant, name: str) -> tuple[int, int]:
    """Index of a joint's first velocity among v, and their number."""
    body = _body_of(name)
    if _is_free(name):
        start = plant.GetBodyByName(body).floating_velocities_start_in_v()
        return start, 6
    own = plant.GetJointByName(name)
    return own.velocity_start(), own.num_velocities()


def _body_of(joint: str) -> str:
    return next(link.name for link in still_tree().links if link.joint == joint)


def _is_free(joint: str) -> bool:
    return next(link.kind for link in still_tree().links if link.joint == joint) == "free"


def _rotation(q: tuple[float, ...]) -> Array:
    """Rotation matrix of the quaternion (w, x, y, z) at the end of a joint's configuration."""
    w, *xyz = q[-4:]
    return Rotation.from_quat([*xyz, w]).as_matrix()
