"""Two mechanisms with published answers, written as puppets, and their own SciPy integration.

*Car axis* (Bari/CWI test set): two points of mass M eps^2/2 stand on springs of stiffness 1 and
rest length 1/2 on a massless road of length 1 that turns about its left end so that its right end
is at the height r sin(w t); the left point stays on the road's normal; a rod of length 1 joins the
points; the gravitational acceleration is 1. As a puppet: the road is a driven revolute joint, the
left point is on a prismatic joint of the road, the rod is a wire.

*A02* (IFToMM's library, N = 2): two windows of five uniform rods of 1 m and 1 kg. All cranks turn
alike, 3 theta'' = -3.5 g cos(theta). As a puppet: crank 0 carries both horizontal rods, cranks 1
and 2 stand on their own pivots, and a pin is two wires from the pinned point to points of the
other rod. Where the cranks lie flat the rods alone let each window fold, so each horizontal rod
has one more massless crank, a wire at right angles to it, as coupled locomotive wheels have.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853, solve_ivp

CAR_AXIS_END = np.array(
    [0.0493455784275402809, 0.496989460230171154, 1.04174252488542152, 0.373911027265361257]
)
"""xl, yl, xr, yr at t = 3, from the test set."""

A02_END = np.array([0.32845811154081538, 0.94451853817860096])
"""B0 at t = 10 s."""

MASS, REST, REACH, AMPLITUDE, FREQUENCY = 10.0 * 1e-2**2 / 2.0, 0.5, 1.0, 0.1, 10.0


def car_axis() -> dict:
    """The car axis as a puppet's description."""
    return {
        "puppet": "car_axis",
        "gravity": [0.0, 0.0, -1.0],
        "bodies": [
            {"name": "road", "joint": {"type": "revolute", "axis": [0, -1, 0], "driven": True}},
            {
                "name": "left",
                "parent": "road",
                "joint": {"type": "prismatic", "axis": [0, 0, 1]},
                "mass": MASS,
            },
            {"name": "right", "joint": {"type": "translation", "axes": ["x", "z"]}, "mass": MASS},
        ],
        "strings": [
            {
                "name": "chassis",
                "path": [
                    {"body": "left", "at": [0.0, 0.0, 0.0]},
                    {"body": "right", "at": [0.0, 0.0, 0.0]},
                ],
                "length": REACH,
                "wire": True,
            }
        ],
        "springs": [
            {
                "name": "tyre_left",
                "between": [{"world": [0.0, 0.0, 0.0]}, {"body": "left", "at": [0.0, 0.0, 0.0]}],
                "stiffness": 1.0,
                "rest": REST,
            },
            {
                "name": "tyre_right",
                "between": [
                    {"body": "road", "at": [REACH, 0.0, 0.0]},
                    {"body": "right", "at": [0.0, 0.0, 0.0]},
                ],
                "stiffness": 1.0,
                "rest": REST,
            },
        ],
        "pose": {"left": REST, "right.x": REACH, "right.z": REST},
    }


CAR_AXIS_START = {"left": 0.0, "right.x": -REST / REACH, "right.z": 0.0, "road": 1.0}
"""Velocities at t = 0."""


def road(t):
    """Angle of the road, its rate and its acceleration, from y_b = r sin(w t) = l sin(angle)."""
    t = np.asarray(t, dtype=float)
    s = AMPLITUDE * np.sin(FREQUENCY * t) / REACH
    ds = AMPLITUDE * FREQUENCY * np.cos(FREQUENCY * t) / REACH
    dds = -(FREQUENCY**2) * s
    c = np.sqrt(1.0 - s * s)
    return np.arcsin(s), ds / c, dds / c + s * ds**2 / c**3


def hermite(t, q, v, acc) -> np.ndarray:
    """Quintic pieces with values and derivatives at the times t.

    Args:
        t, q, v, acc: (n + 1,).

    Returns:
        (n, 6) ascending powers of the time since the piece began.
    """
    t, q, v, acc = (np.asarray(x, dtype=float) for x in (t, q, v, acc))
    d = np.diff(t)
    gap = q[1:] - q[:-1] - d * (v[:-1] + d * acc[:-1] / 2.0)
    slope = (v[1:] - v[:-1] - d * acc[:-1]) * d
    bend = (acc[1:] - acc[:-1]) * d * d
    return np.stack(
        [
            q[:-1],
            v[:-1],
            acc[:-1] / 2.0,
            (10.0 * gap - 4.0 * slope + 0.5 * bend) / d**3,
            (-15.0 * gap + 7.0 * slope - bend) / d**4,
            (6.0 * gap - 3.0 * slope + 0.5 * bend) / d**5,
        ],
        axis=1,
    )


def car_axis_points(angle, left, right_x, right_z) -> np.ndarray:
    """(xl, yl, xr, yr) of the puppet's coordinates."""
    return np.array([-left * np.sin(angle), left * np.cos(angle), right_x, right_z])


def car_axis_scipy(t_end: float = 3.0, tolerance: float = 1e-12) -> np.ndarray:
    """(xl, yl, xr, yr) at t_end, from the test set's equations with constraints derived twice.

    The two constraints are x_l x_b + y_l y_b = 0 and |l - r| = 1; positions and velocities are
    put back on them after every step.
    """

    def rows(t, q):
        angle, rate, acc = road(t)
        b = np.array([np.cos(angle), np.sin(angle)])
        n = np.array([-b[1], b[0]])
        d = q[:2] - q[2:]
        h = np.array([q[:2] @ b, (d @ d - 1.0) / 2.0])
        A = np.array([[b[0], b[1], 0.0, 0.0], [d[0], d[1], -d[0], -d[1]]])
        return h, A, b, n, rate, acc

    def rhs(t, y):
        q, v = y[:4], y[4:]
        _, A, b, n, rate, acc = rows(t, q)
        end = REACH * b
        to_left, to_right = q[:2], q[2:] - end
        l_left, l_right = np.linalg.norm(to_left), np.linalg.norm(to_right)
        force = np.concatenate(
            [(REST - l_left) * to_left / l_left, (REST - l_right) * to_right / l_right]
        )
        free = force / MASS - np.array([0.0, 1.0, 0.0, 1.0])
        w = v[:2] - v[2:]
        bdd = acc * n - rate**2 * b
        gamma = np.array([2.0 * v[:2] @ (rate * n) + q[:2] @ bdd, w @ w])
        lam = np.linalg.solve(A @ A.T, -(A @ free + gamma))
        return np.concatenate([v, free + A.T @ lam])

    s = DOP853(
        rhs,
        0.0,
        np.array([0.0, REST, REACH, REST, -REST / REACH, 0.0, -REST / REACH, 0.0]),
        t_end,
        rtol=tolerance,
        atol=tolerance,
    )
    while s.status == "running":
        s.step()
        q, v = s.y[:4], s.y[4:]
        for _ in range(2):
            h, A, *_ = rows(s.t, q)
            q = q - A.T @ np.linalg.solve(A @ A.T, h)
        _, A, _, n, rate, _ = rows(s.t, q)
        v = v - A.T @ np.linalg.solve(A @ A.T, A @ v + np.array([q[:2] @ n * rate, 0.0]))
        s.y = np.concatenate([q, v])
        s.f = s.fun(s.t, s.y)
    return s.y[:4]


def a02() -> dict:
    """IFToMM's A02 with two windows as a puppet's description, in the x-z plane."""
    axis = [0, -1, 0]
    rod = {"mass": 1.0, "com": [0.5, 0.0, 0.0], "inertia": [0.0, 1.0 / 12.0, 1.0 / 12.0]}

    def body(name, parent, at):
        return {
            "name": name,
            "parent": parent,
            "joint": {"type": "revolute", "axis": axis, "at": at},
            **rod,
        }

    def wire(name, one, other):
        return {"name": name, "path": [one, other], "length": 1.0, "wire": True}

    strings = []
    for i in (1, 2):
        pin = {"body": f"coupler{i}", "at": [1.0, 0.0, 0.0]}
        strings += [
            wire(f"pin{i}_along", pin, {"body": f"crank{i}", "at": [2.0, 0.0, 0.0]}),
            wire(f"pin{i}_across", pin, {"body": f"crank{i}", "at": [1.0, 0.0, 1.0]}),
            wire(
                f"side{i}",
                {"world": [i - 1.0, 0.0, 1.0]},
                {"body": f"coupler{i}", "at": [0.0, 0.0, 1.0]},
            ),
        ]
    right = np.pi / 2.0
    return {
        "puppet": "a02",
        "gravity": [0.0, 0.0, -9.81],
        "bodies": [
            body("crank0", "world", [0.0, 0.0, 0.0]),
            body("coupler1", "crank0", [1.0, 0.0, 0.0]),
            body("coupler2", "coupler1", [1.0, 0.0, 0.0]),
            body("crank1", "world", [1.0, 0.0, 0.0]),
            body("crank2", "world", [2.0, 0.0, 0.0]),
        ],
        "strings": strings,
        "pose": {
            "crank0": right,
            "coupler1": -right,
            "coupler2": 0.0,
            "crank1": right,
            "crank2": right,
        },
    }


A02_START = {"crank0": -1.0, "coupler1": 1.0, "coupler2": 0.0, "crank1": -1.0, "crank2": -1.0}
"""Velocities at t = 0: B0 moves with 1 m/s along +x."""


def a02_scipy(t_end: float = 10.0) -> np.ndarray:
    """B0 at t_end from the reduced equation 3 theta'' = -3.5 g cos(theta)."""
    run = solve_ivp(
        lambda _, y: [y[1], -3.5 * 9.81 * np.cos(y[0]) / 3.0],
        (0.0, t_end),
        (np.pi / 2.0, -1.0),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    angle = run.y[0, -1]
    return np.array([np.cos(angle), np.sin(angle)])
