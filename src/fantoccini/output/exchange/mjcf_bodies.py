"""Conversion of bodies and joints of a compiled MuJoCo model to those of a puppet.

A body in MuJoCo has any number of joints, each at its own point of the body; a body of a puppet has
one, at its origin. A body with joints at p_1 to p_n becomes n frames, parallel to it at zero, with
origins at p_1 to p_n; the last frame is the body, the others have no mass:

    T(pos) R(quat) T(p_1) J_1 T(p_2 - p_1) J_2 ... T(p_n - p_(n-1)) J_n T(-p_n)

For a hinge with the reference angle r the frame is rotated by -r about the axis, for a slide it is
moved by -r along the axis, so that coordinates equal MuJoCo's.

T and R are a translation and a rotation, pos and quat the pose of the body in its parent, and J_i
the motion of joint i. A driven coordinate is given as a function of time, and a wire is a string
that also pushes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fantoccini.base import Array, Quaternion, rotation
from fantoccini.dynamics.mujoco import library
from fantoccini.output.exchange.draft import (
    Draft,
    body_data,
    inertia_data,
    number_or_zero,
    orientation_keys,
    pose_keys,
    written_number,
    written_numbers,
)
from fantoccini.output.exchange.model_file import line_in_message

MAX_BOUND = 1e6
"""Larger bounds count as unbounded [rad or m]."""


@dataclass(frozen=True)
class CompiledModel:
    """MuJoCo model, and the elements from which it was compiled.

    Attributes:
        mujoco: the module.
        spec, model: MuJoCo's specification and model.
        qpos: (n_q,) start configuration.
        mocap_poses: (n_mocap, 7) start positions and quaternions of mocap bodies.
        warnings: warnings of MuJoCo's compiler.
    """

    mujoco: Any
    spec: Any
    model: Any
    qpos: Array
    mocap_poses: Array
    warnings: tuple[str, ...] = ()

    def elements(self, list_name: str) -> dict[int, Any]:
        """Index in the model -> element: ``bodies``, ``joints``, ``geoms``, ``tendons``, ..."""
        return {int(e.id): e for e in getattr(self.spec, list_name)}


class BodyConverter:
    """Converter of the bodies.

    Attributes:
        compiled, m: the compiled model, and MuJoCo's model in it.
        draft: draft of the puppet.
        bodies, joints: index -> element of the model's file.
        springs_enabled, dampers_enabled, limits_enabled, equalities_enabled: whether MuJoCo's
            flags enable them.
        damping, armature: (n_v,) values of the joints, including those of actuators.
        names: (n_body,) names of the puppet's bodies; ``world`` for the world.
        wires: tendons whose constraint became a wire.
        origins: (n_body, 3) origins of the puppet's bodies in the frames of MuJoCo's bodies.

    Args:
        compiled: the compiled model.
        draft: draft of the puppet.
    """

    def __init__(self, compiled: CompiledModel, draft: Draft):
        self.compiled, self.draft = compiled, draft
        self.m = m = compiled.model
        flags = library().mjtDisableBit
        disabled_flags = m.opt.disableflags
        self.springs_enabled, self.dampers_enabled = (
            not disabled_flags & int(bit) for bit in (flags.mjDSBL_SPRING, flags.mjDSBL_DAMPER)
        )
        self.limits_enabled, self.equalities_enabled = (
            not disabled_flags & int(bit | flags.mjDSBL_CONSTRAINT)
            for bit in (flags.mjDSBL_LIMIT, flags.mjDSBL_EQUALITY)
        )
        self.bodies, self.joints = compiled.elements("bodies"), compiled.elements("joints")
        self.damping, self.armature = m.dof_damping.copy(), m.dof_armature.copy()
        self._add_actuator_armature()
        self.names, self.wires = ["world"], set[int]()
        self.origins = np.zeros((m.nbody, 3))
        for b in range(1, m.nbody):
            line = line_of(self.bodies.get(b))
            self.names.append(draft.unique_name("body", m.body(b).name, line=line))
        for b in range(1, m.nbody):
            self._add_body(b)

    def site_point(self, site: int) -> dict[str, Any]:
        """Site as a point of a string or spring."""
        return self.point_on_body(int(self.m.site_bodyid[site]), self.m.site_pos[site])

    def point_on_body(self, body: int, body_point: Array) -> dict[str, Any]:
        """Point of a body of MuJoCo as a point of a string or spring."""
        position = written_numbers(body_point - self.origins[body])
        return {"world": position} if body == 0 else {"body": self.names[body], "at": position}

    def _add_actuator_armature(self) -> None:
        """Adds armature and damping of actuators on single coordinates; notes those of others."""
        m, transmission_types = self.m, library().mjtTrn
        elements = self.compiled.elements("actuators")
        single_coordinate_types = (
            int(library().mjtJoint.mjJNT_SLIDE),
            int(library().mjtJoint.mjJNT_HINGE),
        )
        # An actuator may have several controls and, for several coordinates, several gears.
        gear_addresses = m.actuator_outadr if hasattr(m, "actuator_outadr") else np.arange(m.nu)
        for a in range(len(m.actuator_trntype)):
            armature, damping = (
                field_value(m, f"actuator_{x}", a) for x in ("armature", "damping")
            )
            transmission = transmission_types(int(m.actuator_trntype[a]))
            drives_joint = transmission in (
                transmission_types.mjTRN_JOINT,
                transmission_types.mjTRN_JOINTINPARENT,
            )
            joint = int(m.actuator_trnid[a, 0])
            if drives_joint and m.jnt_type[joint] in single_coordinate_types:
                v, gear = m.jnt_dofadr[joint], float(m.actuator_gear[gear_addresses[a], 0])
                self.armature[v] += gear**2 * armature
                self.damping[v] += gear**2 * damping
            elif armature or damping:
                line, text = line_of(elements.get(a)), "has armature or damping, left out"
                self.draft.note("actuator", m.actuator(a).name, text, line)
            if np.any(field_value(m, "actuator_dampingpoly", a)):
                line, text = line_of(elements.get(a)), "has nonlinear damping, left out"
                self.draft.note("actuator", m.actuator(a).name, text, line)

    def _add_body(self, b: int) -> None:
        m, first_joint = self.m, int(self.m.body_jntadr[b])
        joints = range(first_joint, first_joint + int(m.body_jntnum[b]))
        name, line = self.names[b], line_of(self.bodies.get(b))
        parent = int(m.body_parentid[b])
        position, orientation = (
            m.body_pos[b] - self.origins[parent],
            rotation.normalised(m.body_quat[b]),
        )
        parent_frame, anchor = self.names[parent], np.zeros(3)
        for k, j in enumerate(joints):
            frame = (
                name
                if k == len(joints) - 1
                else self.draft.unique_name("body", "", f"{name}_{k + 1}")
            )
            joint, anchor = self._convert_joint(j, frame, position, orientation, anchor)
            data = body_data(frame, parent_frame, joint)
            self.draft.bodies.append(data)
            parent_frame, position, orientation = frame, np.zeros(3), np.eye(1, 4)[0]
        self.origins[b] = anchor
        if m.body_mocapid[b] >= 0:
            data = body_data(name, parent_frame, {"type": "free", "driven": True})
            self.draft.bodies.append(data)
            start_pose = self.compiled.mocap_poses[m.body_mocapid[b]]
            self._set_free_start(name, start_pose[:3], start_pose[3:])
        elif not joints:
            data = body_data(
                name, parent_frame, {"type": "fixed"} | pose_keys(position, orientation)
            )
            self.draft.bodies.append(data)
        self._add_inertia(b, data)
        if m.body_gravcomp[b]:
            self.draft.note("body", m.body(b).name, "has gravcomp, left out", line, name)

    def _convert_joint(
        self, j: int, body: str, position: Array, orientation: Quaternion, anchor: Array
    ) -> tuple[dict[str, Any], Array]:
        """Data of a joint, and its position in MuJoCo's body.

        Args:
            j: index of the joint.
            body: name of the puppet's body that it carries.
            position, orientation: pose of MuJoCo's body in the parent frame, with joints at zero.
            anchor: position of the previous joint in MuJoCo's body.
        """
        m, types = self.m, library().mjtJoint
        kind, axis = types(int(m.jnt_type[j])), m.jnt_axis[j]
        q = int(m.jnt_qposadr[j])
        ref = 0.0 if kind in (types.mjJNT_FREE, types.mjJNT_BALL) else float(m.qpos0[q])
        joint_position = m.jnt_pos[j] if kind in (types.mjJNT_HINGE, types.mjJNT_BALL) else anchor
        position = position + rotation.matrix(orientation) @ (joint_position - anchor)
        joint_type = {
            types.mjJNT_FREE: "free",
            types.mjJNT_BALL: "ball",
            types.mjJNT_HINGE: "revolute",
            types.mjJNT_SLIDE: "prismatic",
        }[kind]
        line, mujoco_name = line_of(self.joints.get(j)), m.joint(j).name
        joint: dict[str, Any] = {"type": joint_type} | self.draft.joint_name(
            body, mujoco_name, line
        )
        name = joint.get("name", body)
        if joint_type == "free":
            self._set_free_start(
                name, self.compiled.qpos[q : q + 3], self.compiled.qpos[q + 3 : q + 7]
            )
        else:
            if joint_type == "revolute":
                orientation = rotation.multiply(orientation, rotation.exp(-ref * axis))
            elif joint_type == "prismatic":
                position = position - rotation.matrix(orientation) @ (ref * axis)
            if joint_type != "ball":
                joint["axis"] = written_numbers(axis)
            joint |= pose_keys(position, orientation)
            self._set_start(name, joint_type, self.compiled.qpos[q:])
        joint |= dict(self._passive_keys(j, joint_type, q, line, name))
        return joint, joint_position

    def _passive_keys(
        self, j: int, joint_type: str, q: int, line: int | None, name: str
    ) -> Iterator[tuple[str, Any]]:
        """Damping, armature, spring and limits of a joint; the report notes the rest."""
        m, v = self.m, int(self.m.jnt_dofadr[j])

        def note(text: str) -> None:
            self.draft.note("joint", m.joint(j).name, text, line, name)

        if self.dampers_enabled and (damping := number_or_zero(self.damping[v], "damping")):
            yield "damping", damping
        if armature := number_or_zero(self.armature[v], "rotor"):
            yield "armature", armature
        if self.springs_enabled and (stiffness := number_or_zero(m.jnt_stiffness[j], "stiffness")):
            spring = {"stiffness": stiffness}
            if joint_type == "free":
                note("has a spring, left out: springs of free joints have no counterpart")
            elif joint_type == "ball":
                yield "spring", spring
                note("has a spring with the same stiffness for small angles only")
                if not np.allclose(m.qpos_spring[q : q + 4], [1, 0, 0, 0]):
                    note("has a springref, left out")
            else:
                rest_position = written_number(m.qpos_spring[q])
                yield "spring", spring | ({"rest": rest_position} if rest_position else {})
        if m.jnt_limited[j] and self.limits_enabled:
            if joint_type in ("free", "ball"):
                note(f"is limited to {m.jnt_range[j][1]:g} rad, left out: `cone` limits the swing")
            else:
                low, high = map(float, m.jnt_range[j])
                bounds = {"lower": low, "upper": high}
                limits = {
                    side: written_number(x) for side, x in bounds.items() if abs(x) < MAX_BOUND
                }
                if limits and low < high:
                    yield "limits", limits
                elif limits:
                    note(f"has the range {low:g} to {high:g}, left out")
        for quantity, values in (
            ("frictionloss", m.dof_frictionloss[v]),
            ("nonlinear stiffness", field_value(m, "jnt_stiffnesspoly", j)),
            ("nonlinear damping", field_value(m, "dof_dampingpoly", v)),
            ("springyield", field_value(m, "jnt_springyield", j)),
        ):
            if np.any(values):
                note(f"has {quantity}, left out")

    def _add_inertia(self, b: int, data: dict[str, Any]) -> None:
        m = self.m
        if not m.body_mass[b] and not np.any(m.body_inertia[b]):
            return
        R = rotation.matrix(rotation.normalised(m.body_iquat[b]))
        if mass := number_or_zero(m.body_mass[b], "mass"):
            data["mass"] = mass
        com = written_numbers(m.body_ipos[b] - self.origins[b])
        if any(com):
            data["com"] = com
        data["inertia"] = inertia_data(R @ np.diag(m.body_inertia[b]) @ R.T)

    def _set_start(self, name: str, joint_type: str, q: Array) -> None:
        if joint_type == "ball":
            if orientation_keys(q[:4]):
                self.draft.pose[f"{name}.rotation"] = written_numbers(q[:4])
        elif written_number(q[0]):
            self.draft.pose[name] = written_number(q[0])

    def _set_free_start(self, name: str, position: Array, orientation: Array) -> None:
        for axis, x in zip("xyz", written_numbers(position), strict=True):
            if x:
                self.draft.pose[f"{name}.{axis}"] = x
        if orientation_keys(orientation):
            self.draft.pose[f"{name}.rotation"] = written_numbers(orientation)


def field_value(m: Any, name: str, k: int) -> Any:
    """Entry of a field of MuJoCo's model; 0 if this version of MuJoCo has no such field."""
    return getattr(m, name)[k] if hasattr(m, name) else 0.0


def line_of(element: Any) -> int | None:
    """Line of an element in the model's text."""
    return None if element is None else line_in_message(element.info)
