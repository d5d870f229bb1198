"""A puppet's description as a MuJoCo model, and the residual of MuJoCo's equations of motion.

Bodies, joints, inertia, damping, joint springs and point-to-point springs are translated, but no
contacts, limits or strings. Driven joints are joints too. A free joint becomes three slides and a
ball, its definition; at a root without offset it is MuJoCo's own free joint. A body with shapes and
no explicit inertia leaves the sum to MuJoCo's geoms.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

SUFFIX_Q = {"ball": (".qw", ".qx", ".qy", ".qz"), "hinge": ("",), "slide": ("",)}
SUFFIX_V = {"ball": (".wx", ".wy", ".wz"), "hinge": ("",), "slide": ("",)}


@dataclass(frozen=True)
class Mirror:
    """A MuJoCo model of a puppet.

    Attributes:
        model, data: objects of MuJoCo.
        q, v: fantoccini's name of a coordinate -> place in qpos, qvel.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    q: dict[str, int]
    v: dict[str, int]

    def set(self, q: dict[str, float], v: dict[str, float], acc: dict[str, float]) -> None:
        """Configuration, velocity and acceleration by fantoccini's names."""
        for names, values, target in (
            (self.q, q, self.data.qpos),
            (self.v, v, self.data.qvel),
            (self.v, acc, self.data.qacc),
        ):
            for name, place in names.items():
                target[place] = values[name]

    def residual(self, names: tuple[str, ...]) -> tuple[np.ndarray, float]:
        """M qacc + bias - passive on the rows of the given names, and the size of its terms."""
        m, d = self.model, self.data
        qacc = d.qacc.copy()  # mj_forward overwrites it
        mujoco.mj_forward(m, d)
        inertial = np.zeros(m.nv)
        mujoco.mj_mulM(m, d, inertial, qacc)
        rows = [self.v[n] for n in names]
        terms = np.stack([inertial, d.qfrc_bias, -d.qfrc_passive])[:, rows]
        return terms.sum(axis=0), float(np.abs(terms).max())

    def energy(self) -> tuple[float, float]:
        """Potential and kinetic energy of the configuration and velocity that were set."""
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[0]), float(self.data.energy[1])

    def body_pose(self, name: str) -> np.ndarray:
        """(3, 4) world pose of a body, after :meth:`residual` or :meth:`energy`."""
        body = self.data.body(name)
        return np.column_stack([body.xmat.reshape(3, 3), body.xpos])


def mirror(puppet: dict) -> Mirror:
    """The MuJoCo model of a description with the keys of a puppet file."""
    text, order = xml(puppet)
    model = mujoco.MjModel.from_xml_string(text)
    q, v = {}, {}
    for joint, name, kind in order:
        mj_joint = model.joint(joint)
        if kind == "free":
            names_q = [name + s for s in (".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz")]
            names_v = [name + s for s in (".x", ".y", ".z", ".wx", ".wy", ".wz")]
        else:
            names_q = [name + s for s in SUFFIX_Q[kind]]
            names_v = [name + s for s in SUFFIX_V[kind]]
        q |= {n: int(mj_joint.qposadr[0]) + i for i, n in enumerate(names_q)}
        v |= {n: int(mj_joint.dofadr[0]) + i for i, n in enumerate(names_v)}
    return Mirror(model, mujoco.MjData(model), q, v)


def xml(puppet: dict) -> tuple[str, list[tuple[str, str, str]]]:
    """MJCF text, and (MuJoCo joint, fantoccini name, MuJoCo type) of every joint."""
    children: dict[str, list[dict]] = {}
    for body in puppet["bodies"]:
        children.setdefault(body.get("parent") or "world", []).append(body)
    sites: dict[str, list[str]] = {}
    tendons = []
    for spring in puppet.get("springs") or []:
        ends = []
        for k, end in enumerate(spring["between"]):
            site = f"site_{spring['name']}_{k}"
            at = end.get("world") or end.get("at") or [0, 0, 0]
            sites.setdefault(end.get("body") or "world", []).append(
                f"<site name={quoteattr(site)} pos={_text(at)}/>"
            )
            ends.append(f"<site site={quoteattr(site)}/>")
        tendons.append(
            f"<spatial springlength={_text([spring['rest']])} "
            f"stiffness={_text([spring['stiffness']])} damping={_text([spring.get('damping', 0)])}>"
            + "".join(ends)
            + "</spatial>"
        )
    order: list[tuple[str, str, str]] = []
    inside = "".join(sites.get("world", []))
    inside += "".join(_body(b, children, sites, order) for b in children.get("world", []))
    gravity = puppet.get("gravity") or (0.0, 0.0, -9.81)
    text = (
        "<mujoco><compiler angle='radian' inertiafromgeom='auto' fusestatic='false'/>"
        f"<option gravity={_text(gravity)}><flag contact='disable' energy='enable'/></option>"
        f"<worldbody>{inside}</worldbody>"
    )
    if tendons:
        text += f"<tendon>{''.join(tendons)}</tendon>"
    return text + "</mujoco>", order


def _number(value) -> float:
    if isinstance(value, dict):
        return float(value["value"])
    if isinstance(value, str):
        number, unit = value.split()
        return float(number) * (np.pi / 180.0 if unit == "deg" else 1.0)
    return float(value)


def _text(values) -> str:
    return '"' + " ".join(repr(_number(v)) for v in values) + '"'


def quaternion(orientation: dict | None) -> np.ndarray:
    """(w, x, y, z) of a file's orientation."""
    if not orientation:
        return np.array([1.0, 0.0, 0.0, 0.0])
    if orientation.get("quaternion") is not None:
        q = np.array([_number(x) for x in orientation["quaternion"]])
        return q / np.linalg.norm(q)
    if orientation.get("axis") is not None:
        return _turn(np.array(orientation["axis"], float), _number(orientation["angle"]))
    roll, pitch, yaw = (_number(a) for a in orientation["rpy"])
    result = np.zeros(4)
    xy = np.zeros(4)
    mujoco.mju_mulQuat(xy, _turn(np.eye(3)[1], pitch), _turn(np.eye(3)[0], roll))
    mujoco.mju_mulQuat(result, _turn(np.eye(3)[2], yaw), xy)
    return result


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    return np.concatenate(
        [[np.cos(angle / 2.0)], np.sin(angle / 2.0) * axis / np.linalg.norm(axis)]
    )


def _body(body: dict, children, sites, order) -> str:
    name, joint = body["name"], body.get("joint") or {"type": "fixed"}
    at, turn = joint.get("at") or (0.0, 0.0, 0.0), quaternion(joint.get("orientation"))
    parts = [
        f"<body name={quoteattr(name)} pos={_text(at)} quat={_text(turn)}>",
        *_joints(body, joint, order),
        _inertial(body),
        *sites.get(name, []),
        *(_body(child, children, sites, order) for child in children.get(name, [])),
        "</body>",
    ]
    return "".join(parts)


def _joints(body: dict, joint: dict, order) -> list[str]:
    kind, name = joint["type"], joint.get("name") or body["name"]
    damping = f"damping={_text([joint.get('damping') or 0.0])}"
    damping += f" armature={_text([joint.get('armature') or 0.0])}"
    if kind == "fixed":
        return []
    plain = not joint.get("orientation") and not any(_number(a) for a in joint.get("at") or ())
    if (
        kind == "free"
        and plain
        and (body.get("parent") or "world") == "world"
        and not joint.get("damping")
        and not joint.get("armature")
    ):
        order.append((name, name, "free"))
        return [f"<freejoint name={quoteattr(name)}/>"]
    if kind in ("revolute", "prismatic"):
        spring, mj_type = joint.get("spring"), {"revolute": "hinge", "prismatic": "slide"}[kind]
        extra = ""
        if spring:
            stiffness, rest = _text([spring["stiffness"]]), _text([spring.get("rest", 0)])
            extra = f" stiffness={stiffness} springref={rest}"
        order.append((name, name, mj_type))
        axis = f"axis={_text(joint['axis'])}"
        return [f"<joint name={quoteattr(name)} type='{mj_type}' {axis} {damping}{extra}/>"]
    parts = []
    axes = {"translation": joint.get("axes"), "free": ["x", "y", "z"], "ball": []}[kind]
    for axis in axes:
        unit = [float(axis == a) for a in "xyz"]
        order.append((f"{name}.{axis}", f"{name}.{axis}", "slide"))
        parts.append(
            f"<joint name={quoteattr(f'{name}.{axis}')} type='slide' axis={_text(unit)} {damping}/>"
        )
    if kind in ("ball", "free"):
        order.append((f"{name}.ball", name, "ball"))
        parts.append(f"<joint name={quoteattr(f'{name}.ball')} type='ball' {damping}/>")
    return parts


def _inertial(body: dict) -> str:
    if body.get("mass") is None:
        return "".join(_geom(shape) for shape in body.get("shapes") or [])
    six = [_number(x) for x in body["inertia"]]
    xx, yy, zz, xy, xz, yz = six if len(six) == 6 else (*six, 0.0, 0.0, 0.0)
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1.0
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, axes.ravel())
    return (
        f"<inertial mass={_text([body['mass']])} pos={_text(body.get('com') or (0, 0, 0))} "
        f"diaginertia={_text(moments)} quat={_text(turn)}/>"
    )


def _geom(shape: dict) -> str:
    kind = shape["type"]
    if shape.get("mass") is not None:
        amount = f"mass={_text([shape['mass']])}"
    elif shape.get("density") is not None:
        amount = f"density={_text([shape['density']])}"
    else:
        return ""
    if kind == "capsule":
        ends = shape.get("from", shape.get("from_"))
        size = f"size={_text([shape['radius']])} fromto={_text([*ends, *shape['to']])}"
        return f"<geom type='capsule' {size} {amount}/>"
    size = {
        "box": lambda: [s / 2.0 for s in shape["size"]],
        "sphere": lambda: [shape["radius"]],
        "ellipsoid": lambda: shape["radii"],
    }[kind]()
    return (
        f"<geom type='{kind}' size={_text(size)} pos={_text(shape.get('at') or (0, 0, 0))} "
        f"quat={_text(quaternion(shape.get('orientation')))} {amount}/>"
    )
