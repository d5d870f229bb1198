"""Crocoddyl in a separate interpreter: problems and requests are lines of JSON.

    python crocoddyl_peer.py < requests

The first line is a problem (``peer_problems.Problem.as_json``); further lines request ``solve``,
``score`` of inputs or the time of ``derivatives``, and get a line as the answer.

The hand is a body of 1 kg, driven by forces; the links below it weigh 1e-12 kg in total. So the
forces are the hand's accelerations, except for gravity, and the links move as at any scale
of their masses.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import crocoddyl
import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

SCALE = 1e-12
"""Mass of all links together [kg]."""


class Hand(crocoddyl.ActuationModelAbstract):
    """Forces on the first joints."""

    def __init__(self, state: Any, n: int):
        super().__init__(state, n)
        self._B = np.eye(state.nv, n)

    def calc(self, data: Any, x: Any, u: Any) -> None:
        data.tau = self._B @ u

    def calcDiff(self, data: Any, x: Any, u: Any) -> None:
        """Keeps the values of createData."""

    def createData(self) -> Any:
        data = crocoddyl.ActuationDataAbstract(self)
        data.dtau_du = self._B
        return data


def crocoddyl_model(problem: dict[str, Any]) -> Any:
    """The links below a hand."""
    model, joint = pin.Model(), 0
    for axis in problem["axes"]:
        of_axis = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelPZ}[axis]
        joint = model.addJoint(joint, of_axis(), pin.SE3.Identity(), f"hand {axis}")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    joints, unit = [joint], SCALE / sum(link["mass"] for link in problem["links"])
    for link in problem["links"]:
        place = pin.SE3(np.eye(3), np.array(link["at"]))
        turns = pin.JointModelRevoluteUnaligned(*link["axis"])
        joints.append(model.addJoint(joints[link["parent"] + 1], turns, place, link["name"]))
        inertia = pin.Inertia(
            unit * link["mass"], np.array(link["com"]), unit * np.diag(link["inertia"])
        )
        model.appendBodyToJoint(joints[-1], inertia, pin.SE3.Identity())
    return model


class Peer:
    """A problem for Crocoddyl."""

    def __init__(self, problem: dict[str, Any]):
        self._problem, self._model = problem, crocoddyl_model(problem)
        self._n, self._state = len(problem["axes"]), crocoddyl.StateMultibody(self._model)
        self._hold = np.array([9.81 * (1.0 + SCALE) if a == "z" else 0.0 for a in problem["axes"]])
        self._goal = np.zeros(self._state.nx)
        self._goal[: self._n] = problem["goal"]
        self._x0 = np.zeros(self._state.nx)
        self._solvers: dict[str, Any] = {}

    def _differential(self, at_end: bool) -> Any:
        state, costs = self._state, crocoddyl.CostModelSum(self._state, self._n)
        if at_end:
            residual = crocoddyl.ResidualModelState(state, self._goal, self._n)
            weight = self._problem["end"]
        else:
            residual = crocoddyl.ResidualModelControl(state, self._hold)
            weight = self._problem["smooth"]
        costs.addCost("cost", crocoddyl.CostModelResidual(state, residual), weight)
        hand = Hand(state, self._n)
        return crocoddyl.DifferentialActionModelFreeFwdDynamics(state, hand, costs)

    def _action(self, integrator: str, at_end: bool = False) -> Any:
        h = 0.0 if at_end else self._problem["interval"]
        differential = self._differential(at_end)
        if integrator == "euler":
            action = crocoddyl.IntegratedActionModelEuler(differential, h)
        else:
            action = crocoddyl.IntegratedActionModelRK(differential, crocoddyl.RKType.four, h)
        bound = self._problem["acceleration"]
        if bound is not None and not at_end:
            action.u_lb, action.u_ub = self._hold - bound, self._hold + bound
        return action

    def solve(self, integrator: str, stop: float, iterations: int) -> dict[str, Any]:
        """Solves from constant inputs; the time is that of ``solve`` alone [s]."""
        N = self._problem["intervals"]
        if integrator not in self._solvers:
            running = [self._action(integrator)] * N
            problem = crocoddyl.ShootingProblem(
                self._x0, running, self._action(integrator, at_end=True)
            )
            bounded = self._problem["acceleration"] is not None
            self._solvers[integrator] = (
                crocoddyl.SolverBoxFDDP(problem) if bounded else crocoddyl.SolverFDDP(problem)
            )
        solver = self._solvers[integrator]
        solver.th_stop = stop
        solver.preg = solver.dreg = 1e-9
        began = time.perf_counter()
        done = solver.solve([self._x0] * (N + 1), [self._hold] * N, iterations, False, 1e-9)
        seconds = time.perf_counter() - began
        return {
            "seconds": seconds,
            "iterations": int(solver.iter),
            "cost": float(solver.cost),
            "done": bool(done),
            "stop": float(solver.stop),
            "u": (np.array(solver.us) - self._hold).tolist(),
        }

    def score(self, u: Any) -> dict[str, Any]:
        """The cost of accelerations of the hand, by SciPy's DOP853."""
        u, model, data = np.array(u), self._model, self._model.createData()
        nv, tau = model.nv, np.zeros(model.nv)
        x, h = self._x0, self._problem["interval"]

        def rates(_t: float, x: Any) -> Any:
            return np.concatenate([x[nv:], pin.aba(model, data, x[:nv], x[nv:], tau)])

        for now in u:
            tau[: self._n] = now + self._hold
            x = solve_ivp(rates, (0.0, h), x, "DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        of_u = 0.5 * self._problem["smooth"] * h * float(np.sum(u**2))
        left = x - self._goal
        return {"cost": of_u + 0.5 * self._problem["end"] * float(left @ left)}

    def derivatives(self, integrator: str, turns: int) -> dict[str, Any]:
        """The time of a step and its derivatives, ``calc`` and ``calcDiff`` together [s]."""
        action = self._action(integrator)
        data, rng = action.createData(), np.random.default_rng(0)
        x, u = 0.2 * rng.standard_normal(self._state.nx), self._hold.copy()
        began = time.perf_counter()
        for _ in range(turns):
            action.calc(data, x, u)
            action.calcDiff(data, x, u)
        return {"seconds": (time.perf_counter() - began) / turns}


def main() -> None:
    """Answers requests."""
    peer = None
    for line in sys.stdin:
        asked = json.loads(line)
        if peer is None:
            peer = Peer(asked)
            answer = {"versions": f"Crocoddyl {crocoddyl.__version__}, Pinocchio {pin.__version__}"}
        else:
            answer = getattr(peer, asked.pop("ask"))(**asked)
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
