"""The equations of a described puppet, evaluated by CasADi's interpreter at plain arrays."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini import motion
from fantoccini.dynamics.compiled.methods import METHODS
from fantoccini.kernel.equations import derive
from fantoccini.model.puppet import Puppet, loads
from fantoccini.model.tree import grow
from fantoccini.motion import Input
from oracles.random_trees import configuration


@dataclass(frozen=True)
class State:
    """Arguments of the functions, by the paper's names."""

    q_D: np.ndarray
    v_D: np.ndarray
    q_K: np.ndarray
    v_K: np.ndarray
    acc_K: np.ndarray


class Model:
    """A tree and its equations.

    Args:
        description: a puppet with the keys of a puppet file.
    """

    def __init__(self, description: dict, puppet: Puppet | None = None):
        self.description = description
        self.puppet = loads(json.dumps(description)) if puppet is None else puppet
        self.tree = grow(self.puppet)
        self.equations = derive(self.tree)
        self.table = self.tree.coordinates
        self.p = np.array(list(self.tree.parameters.values()))

    @classmethod
    def of(cls, puppet: Puppet) -> Model:
        """Model of a loaded puppet."""
        return cls({}, puppet)

    def call(self, name: str, state: State, **more) -> dict[str, np.ndarray]:
        """All outputs of a function, without axes of length 1."""
        function = self.equations[name]
        zero = {"u_D": np.zeros(self.table.n_vD), "dt": 0.0}
        more = zero | {"v_ahead": state.v_D, "p": self.p} | more
        inputs = {n: more[n] if n in more else getattr(state, n) for n in function.name_in()}
        outputs = {}
        for key, value in function(**inputs).items():
            value = np.array(value)
            outputs[key] = value[:, 0] if value.shape[1] == 1 else value
        return outputs

    def first_output(self, name: str, state: State, **more) -> np.ndarray:
        """The first output of a function; matrices keep their shape."""
        function = self.equations[name]
        more = {"p": self.p} | more
        inputs = {n: more[n] if n in more else getattr(state, n) for n in function.name_in()}
        return np.array(function(**inputs)[function.name_out()[0]])

    def random(self, seed: int, *, moving_inputs: bool = True) -> State:
        """A random state with unit quaternions."""
        rng, t = np.random.default_rng(seed), self.table
        on = 1.0 if moving_inputs else 0.0
        return State(
            q_D=configuration(rng, t.q_D),
            v_D=rng.normal(size=t.n_vD),
            q_K=configuration(rng, t.q_K),
            v_K=rng.normal(size=t.n_vK) * on,
            acc_K=rng.normal(size=t.n_vK) * on,
        )

    def acceleration(self, state: State) -> np.ndarray:
        """acc_D of the puppet without strings, from results of the compiled model (Eq. 8)."""
        dynamics = self.call("dynamics", state)
        return np.array(self.equations["solve_factor"](dynamics["L"], dynamics["w0"])).ravel()

    def moved(self, state: State, s: float, acc_D: np.ndarray | None = None) -> State:
        """A state s seconds on along a smooth curve with the motion's tangent.

        Only first derivatives by s are asked of the curve: scalars go on a parabola, a quaternion
        turns by the rotation vector w s + wdot s^2/2.
        """
        t = self.table
        acc_D = np.zeros(t.n_vD) if acc_D is None else acc_D
        move_D = state.v_D * s + acc_D * s * s / 2
        move_K = state.v_K * s + state.acc_K * s * s / 2
        return State(
            q_D=_advance(state.q_D, move_D, t.quaternions_D, t.scalars_D),
            v_D=state.v_D + acc_D * s,
            q_K=_advance(state.q_K, move_K, t.quaternions_K, t.scalars_K),
            v_K=state.v_K + state.acc_K * s,
            acc_K=state.acc_K,
        )

    def rate(self, function, state: State, acc_D: np.ndarray | None = None, step: float = 5e-4):
        """d/dt of function(state) along the motion, by an eighth-order central difference."""
        weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
        return (
            sum(
                w
                * (
                    function(self.moved(state, k * step, acc_D))
                    - function(self.moved(state, -k * step, acc_D))
                )
                for k, w in weights
            )
            / step
        )


def _advance(q, change, quaternions, scalars) -> np.ndarray:
    q = q.copy()
    for at, v in scalars:
        q[at] += change[v]
    for at, v in quaternions:
        q[at : at + 4] = turned(q[at : at + 4], change[v : v + 3])
    return q


def turned(q: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """q exp(rotation/2): the orientation q turned by a rotation vector in the body's frame."""
    angle = np.linalg.norm(rotation)
    w, v = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * rotation
    return np.concatenate([[q[0] * w - q[1:] @ v], q[0] * v + w * q[1:] + np.cross(q[1:], v)])


def polynomial_input(model, breaks, coef: dict[str, np.ndarray], q_K: np.ndarray) -> Input:
    """An input from polynomials.

    Args:
        model: a marionette, or anything with ``.coordinates``.
        breaks: (n + 1,) [s].
        coef: name of a driven scalar -> (n, 6) ascending powers of the time since the piece began.
        q_K: (n_qK,) values of the other coordinates.
    """
    table, n = model.coordinates, len(breaks) - 1
    rows, base = np.zeros((n, table.n_vK, 6)), np.tile(np.asarray(q_K, float), (n, 1))
    named = np.zeros(table.n_vK, dtype=bool)
    for q, v in table.scalars_K:
        name = table.v_K[v]
        rows[:, v, 0] = q_K[q]
        if name in coef:
            rows[:, v], named[v] = coef[name], True
            base[:, q] = rows[:, v, 0]
    return Input(table, np.asarray(breaks, float), rows, base, named)


def start(model, pose: dict[str, float], rates: dict[str, float]) -> motion.State:
    """State from values by name; other coordinates have the file's pose, at rest."""
    table = model.coordinates
    q_D, q_K = np.array(table.start_D), np.array(table.start_K)
    v_D, v_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
    for values, places in ((pose, (table.q_D, table.q_K)), (rates, (table.v_D, table.v_K))):
        dynamic, driven = (q_D, q_K) if values is pose else (v_D, v_K)
        for name, value in values.items():
            if name in places[0]:
                dynamic[places[0].index(name)] = value
            else:
                driven[places[1].index(name)] = value
    taut = np.zeros(model.tree.n_rows, dtype=bool)
    return motion.State(t=0.0, q_D=q_D, v_D=v_D, q_K=q_K, v_K=v_K, taut=taut)


def bulge() -> tuple[fan.Marionette, Input]:
    """A bob whose string is released at 1 s, opens and closes within one long step."""
    bob = fan.loads("""
puppet: bob
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 1}
strings:
  - {name: line, path: [{body: bob}, {world: [0, 0, 1]}], length: driven}
pose: {line.length: 1.0}
""")
    height = -2e4 * np.array([0, 0, 0.0018, -0.09, 1, 0])
    coef = np.zeros((2, 1, 6))
    coef[:, 0, 0] = 1.0
    coef[1, 0, 1:] = -height[1:]
    coef[1, 0, 2] += 4.905
    breaks, base, named = np.array([0, 1, 1.1]), np.ones((2, 1)), np.array([True])
    return bob, Input(bob.coordinates, breaks, coef, base, named)


def method_of(name: str, **options) -> fan.dynamics.Method:
    """A method by its name, with the options that apply to it."""
    known = METHODS[name].__dataclass_fields__
    return METHODS[name](**{key: value for key, value in options.items() if key in known})
