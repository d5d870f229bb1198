"""``python -m benchmarks.long_runs.fourth_order``: cost and accuracy of a fourth-order method.

The midpoint rule of the integrator, compared with Lobatto IIIA-IIIB with three stages in its
variational form: a parabola through q_k, q_mid, q_k+1, the action by Simpson's rule,

    L_d = dt (L_k + 4 L_mid + L_k+1) / 6

order four, with positive time steps, strings held at q_mid and q_k+1 by impulses at q_k and q_mid
(Marsden and West, Discrete mechanics and variational integrators, 2001, section 2.6). Both are
solved by a Newton iteration whose matrix is made once a step. A correction takes one evaluation of
L's gradient by the midpoint rule and three by the other; these evaluations are the cost.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from benchmarks.strings.report import Table

import fantoccini as fan
from fantoccini.dynamics.compiled import Evaluation

CHAIN = """
puppet: chain
bodies:
  - {name: a, joint: {type: revolute, axis: [0, -1, 0]}, mass: 0.2, com: [0, 0, -0.1],
     inertia: [1e-3, 1e-3, 1e-4]}
  - {name: b, parent: a, joint: {type: revolute, axis: [0, -1, 0], at: [0, 0, -0.2]}, mass: 0.15,
     com: [0, 0, -0.1], inertia: [8e-4, 8e-4, 1e-4]}
  - {name: c, parent: b, joint: {type: revolute, axis: [0, -1, 0], at: [0, 0, -0.2]}, mass: 0.1,
     com: [0, 0, -0.08], inertia: [4e-4, 4e-4, 1e-4]}
strings:
  - {name: line, path: [{body: c, at: [0, 0, -0.16]}, {world: [0.35, 0, 0.5]}], length: driven}
pose: {a: 0.6, b: 0.2, c: 0.3, line.length: 0.75}
"""
"""Three links on hinges, the last one on a string that stays taut; no damping."""

SECONDS = 0.4
ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
EXACT = 1e-12
RULES = {"midpoint rule": 1, "Lobatto, three stages": 3}
"""Numbers of evaluations of L's gradient in a correction."""


class Rule:
    """A step of a rule: p_k, q_k -> p_k+1, q_k+1, the strings held.

    Args:
        puppet: undamped puppet with scalar coordinates and constant inputs.
        x: state with the inputs and the taut strings.
        stages: 1 for the midpoint rule, 3 for Lobatto.
    """

    def __init__(self, puppet: fan.Marionette, x: fan.State, stages: int):
        equations, n = puppet.equations, len(x.q_D)
        self.n, self.stages = n, stages
        taut = np.flatnonzero(
            np.abs(Evaluation.at_state(puppet, x).h[: len(puppet.tree.strings)]) < 1e-9
        )
        self.m = len(taut)
        q, q_mid, q_next, p = (ca.SX.sym(name, n) for name in ("q", "q_mid", "q_next", "p"))
        first, second, dt = ca.SX.sym("first", self.m), ca.SX.sym("second", self.m), ca.SX.sym("dt")

        def lagrangian(at, v):
            return equations["lagrangian"](at, v, x.q_K, np.zeros(len(x.v_K)), puppet.p)

        def held(at):
            return equations["rows"](at, x.q_K, puppet.p)[taut]

        if stages == 1:
            L_d = dt * lagrangian((q + q_next) / 2, (q_next - q) / dt)
            unknowns = ca.vertcat(q_next, first)
            pull = ca.jacobian(held(q), q).T @ first
            residual = ca.vertcat(p + ca.gradient(L_d, q) - pull, held(q_next))
        else:
            ends = (
                lagrangian(q, (-3 * q + 4 * q_mid - q_next) / dt)
                + 4 * lagrangian(q_mid, (q_next - q) / dt)
                + lagrangian(q_next, (q - 4 * q_mid + 3 * q_next) / dt)
            )
            L_d = dt / 6 * ends
            unknowns = ca.vertcat(q_next, q_mid, first, second)
            pull = ca.jacobian(held(q), q).T @ first
            between = ca.jacobian(held(q_mid), q_mid).T @ second
            residual = ca.vertcat(
                p + ca.gradient(L_d, q) - pull,
                ca.gradient(L_d, q_mid) - between,
                held(q_next),
                held(q_mid),
            )
        arguments = [unknowns, q, p, dt]
        self.residual = ca.Function("residual", arguments, [residual])
        self.jacobian = ca.Function("jacobian", arguments, [ca.jacobian(residual, unknowns)])
        self.after = ca.Function("after", arguments, [ca.gradient(L_d, q_next)])

    def run(self, q: np.ndarray, p: np.ndarray, v: np.ndarray, dt: float) -> tuple:
        """The final q, and the number of corrections of the steps."""
        corrections, n_steps = 0, round(SECONDS / dt)
        for _ in range(n_steps):
            q_next, q_mid = q + dt * v, q + 0.5 * dt * v
            guess = [q_next] if self.stages == 1 else [q_next, q_mid]
            size = self.m if self.stages == 1 else 2 * self.m
            z = np.concatenate([*guess, np.zeros(size)])
            inverse = np.linalg.inv(np.array(self.jacobian(z, q, p, dt)))
            for _ in range(60):
                residual = np.array(self.residual(z, q, p, dt)).ravel()
                corrections += 1
                if np.max(np.abs(residual)) < EXACT:
                    break
                z = z - inverse @ residual
            p = np.array(self.after(z, q, p, dt)).ravel()
            v, q = (z[: self.n] - q) / dt, z[: self.n]
        return q, corrections


def measure_rules() -> tuple[Table, Table]:
    """Error and cost over the step, and the cost of reaching an error by both rules."""
    puppet = fan.loads(CHAIN)
    x = puppet.rest()
    push = x.replace(v_D=np.array([0.5, 2.0, -1.5]))
    evaluation = Evaluation.at_state(puppet, push)
    W = evaluation.W[:, :1]
    v_D = push.v_D - evaluation.solve_factor(W @ np.linalg.solve(W.T @ W, evaluation.hdot[:1]))
    x = push.replace(v_D=v_D)
    exact = fan.simulate(puppet, x, t_end=SECONDS, method=fan.Event(rtol=1e-13, atol=1e-13))
    if exact.events:
        raise RuntimeError("the string goes slack; choose a gentler push")
    momentum = puppet.mass_matrix(x) @ x.v_D
    steps, curves, rows = SECONDS / np.array([6, 12, 24, 48, 96, 192, 384]), {}, []
    for name, evaluations in RULES.items():
        rule = Rule(puppet, x, evaluations)
        results = []
        for dt in steps:
            q, corrections = rule.run(x.q_D, momentum, x.v_D, dt)
            results.append((np.max(np.abs(q - exact.q_D[-1])), corrections * evaluations))
            each = corrections / round(SECONDS / dt)
            rows.append(
                [
                    name,
                    f"{1e3 * dt:.3g}",
                    f"{results[-1][0]:.1e}",
                    f"{each:.1f}",
                    str(results[-1][1]),
                ]
            )
        curves[name] = np.log(np.array(results, dtype=float))
    cost = [[f"{e:.0e}"] for e in ERRORS]
    for curve in curves.values():
        for row, e in zip(cost, ERRORS, strict=True):
            off, work = curve[::-1].T
            inside = off[0] <= np.log(e) <= off[-1]
            row.append(f"{np.exp(np.interp(np.log(e), off, work)):.0f}" if inside else "")
    return (
        Table(["rule", "step [ms]", "error", "corrections a step", "evaluations"], rows),
        Table(["error", *RULES], cost),
    )


if __name__ == "__main__":
    for table in measure_rules():
        print(table.markdown(), end="\n\n")
