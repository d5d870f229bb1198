"""Seeded random models in MJCF and URDF, as text for programs that read them."""

from __future__ import annotations

import re

import numpy as np

HINGES = ("hinge", "slide")


def mjcf(seed: int, bodies: int = 5) -> str:
    """Bodies with 0 to 3 joints each at different points, with references and springs.

    Two limited tendons run through three sites each, one spring joins two. Two motors have rotors.
    """
    rng = np.random.default_rng(seed)

    def row(*size: int, low: float = -0.4, high: float = 0.4) -> str:
        return " ".join(repr(float(x)) for x in rng.uniform(low, high, size).ravel())

    def joint(name: str, kind: str) -> str:
        more = ""
        if kind in HINGES:
            more = f' axis="{row(3)}" ref="{row(1)}" springref="{row(1)}"'
            more += f' stiffness="{row(1, low=0.0, high=9.0)}"'
        place = "" if kind in ("slide", "free") else f' pos="{row(3)}"'
        passive = f'damping="{row(1, low=0.0)}" armature="{row(1, low=0.0)}"'
        return f'<joint name="{name}" type="{kind}"{place} {passive}{more}/>'

    def body(i: int) -> str:
        kinds = [str(rng.choice(HINGES)) for _ in range(rng.integers(0, 4))]
        if i == 0:
            kinds = ["free"] if rng.random() < 0.4 else ["slide", "hinge"]
        elif rng.random() < 0.3:
            kinds = [*kinds[:1], "ball"]
        joints = [joint(f"j{i}_{k}", kind) for k, kind in enumerate(kinds)]
        half = [joints[:1], joints[1:]]
        a, b, c = rng.uniform(0.5, 1.0, 3)
        inside = "".join(half[0])
        inside += f'<inertial pos="{row(3)}" quat="{row(4)}" mass="{row(1, low=0.5, high=2.0)}"'
        inside += f' diaginertia="{b + c} {a + c} {a + b}"/>'
        inside += "".join(half[1]) + f'<site name="s{i}" pos="{row(3)}"/>'
        children = [k for k in range(i + 1, bodies) if above[k] == i]
        inside += "".join(body(k) for k in children)
        return f'<body name="b{i}" pos="{row(3)}" quat="{row(4)}">{inside}</body>'

    above = [-1, *(int(rng.integers(0, k)) for k in range(1, bodies))]
    root = body(0)
    single = re.findall(r'name="(\w+)" type="(?:hinge|slide)"', root)
    rotor = 'gear="2" armature="0.1" damping="0.2"'
    motors = "".join(f'<motor joint="{name}" {rotor}/>' for name in single[:2])
    tendons = ""
    for k in range(2):
        sites = [*rng.permutation(bodies)[:2], "w"]
        path = "".join(f'<site site="s{s}"/>' for s in sites)
        tendons += f'<spatial name="t{k}" limited="true" range="0 {3 + k}">{path}</spatial>'
    tendons += (
        f'<spatial name="t2" springlength="0.3" stiffness="5" damping="0.4">'
        f'<site site="sw"/><site site="s{bodies - 1}"/></spatial>'
    )
    return (
        '<mujoco><compiler angle="radian"/><option gravity="0.3 -2 -9"/><worldbody>'
        f'<site name="sw" pos="{row(3)}"/>{root}</worldbody><tendon>{tendons}</tendon>'
        f"<actuator>{motors}</actuator></mujoco>"
    )


def urdf(seed: int, links: int = 6) -> str:
    """A tree of links on revolute, continuous, prismatic and fixed joints."""
    rng = np.random.default_rng(seed)

    def row(*size: int, low: float = -0.4, high: float = 0.4) -> str:
        return " ".join(repr(float(x)) for x in rng.uniform(low, high, size).ravel())

    text = '<robot name="random">\n<link name="l0"/>\n'
    for i in range(1, links):
        kind = str(rng.choice(["revolute", "continuous", "prismatic", "fixed"]))
        if i == 1:
            kind = "revolute"
        a, b, c = rng.uniform(0.5, 1.0, 3)
        text += (
            f'<link name="l{i}"><inertial><origin xyz="{row(3)}" rpy="{row(3, low=-3, high=3)}"/>'
            f'<mass value="{row(1, low=0.5, high=2.0)}"/><inertia ixx="{b + c}" iyy="{a + c}" '
            f'izz="{a + b}" ixy="{row(1, low=0.0, high=0.1)}" ixz="0.03" iyz="-0.02"/></inertial>'
            f'</link>\n<joint name="j{i}" type="{kind}"><parent link="l{rng.integers(0, i)}"/>'
            f'<child link="l{i}"/><origin xyz="{row(3)}" rpy="{row(3, low=-3, high=3)}"/>'
            f'<axis xyz="{row(3)}"/><dynamics damping="{row(1, low=0.0)}"/>'
            f'<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>\n'
        )
    return f"{text}</robot>\n"
