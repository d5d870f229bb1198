"""The paper's planar arm (Fig. 2): Eqs. 1-9 and 11, transcribed to SymPy.

The arm lies in the x-z plane; theta_1 is measured from +x towards +z and theta_2 is relative.
The string runs from the tip to the point S = (x, height) and has the length L, so that
q_K = (x, L). These errors of the paper are corrected:

* Eq. 6 lacks the gravitational acceleration, and its gravity acts along y, here along z;
* in the Euler-Lagrange equation the first derivative is with respect to v, the second to q;
* A_D also depends on q_K, so its rate in Eq. 11 has a term with v_K.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import sympy as sp


@dataclass(frozen=True)
class Arm:
    """Numbers of the arm.

    Attributes:
        m1, m2: masses [kg].
        I1, I2: moments of inertia about the centres of mass, which are the links' middles [kg m^2].
        L1, L2: lengths [m].
        height: height of the string's upper end [m].
        gravity: [m/s^2].
        xs, zs: place of the shoulder [m].
    """

    m1: float = 0.3
    m2: float = 0.2
    I1: float = 0.3 * 0.3**2 / 12
    I2: float = 0.2 * 0.25**2 / 12
    L1: float = 0.3
    L2: float = 0.25
    height: float = 0.6
    gravity: float = 9.81
    xs: float = 0.0
    zs: float = 0.0

    def numbers(self) -> tuple[float, ...]:
        """Numbers in the order of the arguments of the compiled functions."""
        return tuple(float(getattr(self, name)) for name in NAMES)


NAMES = ("m1", "m2", "I1", "I2", "L1", "L2", "height", "gravity", "xs", "zs")


def _rotation(angle):
    """R(theta) in SE(2)."""
    c, s = sp.cos(angle), sp.sin(angle)
    return sp.Matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _translation(x, z=0):
    """T(x, z) in SE(2)."""
    return sp.Matrix([[1, 0, x], [0, 1, z], [0, 0, 1]])


def _inverse(pose):
    """The inverse of a pose in SE(2)."""
    turn = pose[:2, :2].T
    return sp.Matrix.vstack(turn.row_join(-turn * pose[:2, 2]), sp.Matrix([[0, 0, 1]]))


def _unhat(twist):
    """(x, z, omega) of a matrix in se(2)."""
    return sp.Matrix([twist[0, 2], twist[1, 2], twist[1, 0]])


@functools.cache
def model() -> dict[str, object]:
    """The paper's name -> function of (q_D, v_D, q_K, v_K, numbers); q and v have shape (2,).

    Keys: M (2, 2), C (2, 2), g (2,), h (), A_D (2,), A_K (2,), Adot_D (2,), Adot_K (2,),
    Adot_v () = Adot_D v_D + Adot_K v_K, T (), V (), g_1 and g_2 (3, 3), V_1 and V_2 (3,),
    stacked (12,) = M, C v_D + g, h, A_D, A_K, Adot_v.
    """
    q1, q2, x, length = sp.symbols("theta1 theta2 x L", real=True)
    dq1, dq2, dx, dlength = sp.symbols("dtheta1 dtheta2 dx dL", real=True)
    parameters = dict(zip(NAMES, sp.symbols(" ".join(NAMES), positive=True), strict=True))
    q_D, v_D = sp.Matrix([q1, q2]), sp.Matrix([dq1, dq2])
    q_K, v_K = sp.Matrix([x, length]), sp.Matrix([dx, dlength])

    inertia = [
        sp.diag(parameters[f"m{i}"], parameters[f"m{i}"], parameters[f"I{i}"]) for i in (1, 2)
    ]  # Eq. 1
    base = _translation(parameters["xs"], parameters["zs"])
    g_1 = base * _rotation(q1) * _translation(parameters["L1"] / 2)  # Eq. 2
    g_2 = (
        base
        * _rotation(q1)
        * _translation(parameters["L1"])
        * _rotation(q2)
        * _translation(parameters["L2"] / 2)
    )
    frames = [g_1, g_2]
    twists = []
    for g_i in frames:  # Eq. 4
        rate = sum((sp.diff(g_i, q) * v for q, v in zip(q_D, v_D, strict=True)), sp.zeros(3, 3))
        twists.append(_unhat(_inverse(g_i) * rate).applyfunc(sp.trigsimp))
    kinetic = sum(((V.T * J * V)[0] / 2 for V, J in zip(twists, inertia, strict=True)), sp.S(0))
    potential = sum(
        (parameters[f"m{i}"] * parameters["gravity"] * frames[i - 1][1, 2] for i in (1, 2)), sp.S(0)
    )  # Eq. 6
    lagrangian = kinetic - potential  # Eq. 7

    momentum = sp.Matrix([sp.diff(lagrangian, v) for v in v_D])
    M = momentum.jacobian(v_D)
    C = sp.zeros(2, 2)
    for i in range(2):
        for j in range(2):
            for k in range(2):
                gamma = (
                    sp.diff(M[i, j], q_D[k]) + sp.diff(M[i, k], q_D[j]) - sp.diff(M[k, j], q_D[i])
                ) / 2
                C[i, j] += gamma * v_D[k]
    g = sp.Matrix([sp.diff(potential, q) for q in q_D])
    # without the accelerations, d/dt dL/dv - dL/dq must equal the C v + g of Eq. 8
    velocity_terms = momentum.jacobian(q_D) * v_D - sp.Matrix([sp.diff(lagrangian, q) for q in q_D])
    assert (velocity_terms - C * v_D - g).applyfunc(
        lambda e: sp.trigsimp(sp.expand(e))
    ) == sp.zeros(2, 1)

    tip = (g_2 * _translation(parameters["L2"] / 2))[:2, 2]
    to_tip = tip - sp.Matrix([x, parameters["height"]])
    h = sp.sqrt(to_tip.dot(to_tip)) - length
    A_D = sp.Matrix([[sp.diff(h, q) for q in q_D]])  # Eq. 9
    A_K = sp.Matrix([[sp.diff(h, q) for q in q_K]])

    def rate_of(row):
        return sp.Matrix(
            [
                [
                    sum(sp.diff(a, q) * v for q, v in zip([*q_D, *q_K], [*v_D, *v_K], strict=True))
                    for a in row
                ]
            ]
        )

    Adot_D, Adot_K = rate_of(A_D), rate_of(A_K)
    expressions = {
        "M": M,
        "C": C,
        "g": g,
        "h": h,
        "A_D": A_D,
        "A_K": A_K,
        "Adot_D": Adot_D,
        "Adot_K": Adot_K,
        "Adot_v": (Adot_D * v_D + Adot_K * v_K)[0],
        "T": kinetic,
        "V": potential,
        "g_1": g_1,
        "g_2": g_2,
        "V_1": twists[0],
        "V_2": twists[1],
    }
    symbols = [*q_D, *v_D, *q_K, *v_K, *parameters.values()]
    vectors = {"g", "A_D", "A_K", "Adot_D", "Adot_K", "V_1", "V_2"}
    functions = {name: _numeric(symbols, e, name in vectors) for name, e in expressions.items()}
    stacked = sp.Matrix([*M, *(C * v_D + g), h, *A_D, *A_K, expressions["Adot_v"]])
    functions["stacked"] = _numeric(symbols, stacked, True)
    return functions


def _numeric(symbols, expression, flat: bool):
    function = sp.lambdify(symbols, expression, modules="numpy", cse=True)

    def evaluate(q_D, v_D, q_K, v_K, numbers):
        value = np.asarray(function(*q_D, *v_D, *q_K, *v_K, *numbers), dtype=float)
        return value.ravel() if flat else value

    return evaluate
