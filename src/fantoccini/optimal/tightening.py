"""Sequential quadratic programming in a trust region, through the events of the runs found.

    phi = J + price (|x_N - end|_1 + passed rows),   |du| <= radius

Motions whose strings go slack and are caught are far from linear: the steps of the search are as
short as the program's prediction holds (Fletcher, Practical Methods of Optimization, 14.5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.arrays import Array
from fantoccini.optimal.dynamics import Ends, LinearEnds
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import Objective
from fantoccini.optimal.quadratic import UNBOUNDED, StageProgram, StageSolution, StageSolver
from fantoccini.optimal.shooting import EventRuns
from fantoccini.optimal.sqp import Iterate, Limits


class Tightening:
    def __init__(self, start: Iterate, runs: EventRuns, objective: Objective, radius: float, limits: Limits):
        self.best, self._runs, self._objective, self._limits = start, runs, objective, limits
        task = objective.task
        self._inner = Objective(replace(task, end=None))
        self._radius, self._solver = radius, StageSolver()
        self._price = 0.0

    def _theta(self, nodes, ends):
        gap = np.abs(self._objective.end_gap(nodes))
        rows = self._objective.rows.violation(nodes, ends)
        return float(np.sum(gap + gap**2/2) + np.sum(rows+rows**2/2))

    def run(self, progress=None):
        obj, inner = self._objective, self._inner
        at = self.best
        linear = None
        for it in range(self._limits.iterations):
            if linear is None:
                linear = self._runs.linearise(at.nodes, at.ends)
                if not inner.unit:
                    inner.take_unit(at.nodes, linear)
                    self._price = P0 * inner.unit
            inner.price = self._price
            program, gap = self._program(at, linear)
            sol = self._solver.solve(program, inner.unit)
            theta = self._theta(at.nodes, at.ends)
            phi = at.cost + self._price * theta
            step = np.concatenate([sol.u, sol.z[1:]], axis=1)
            curved = np.einsum("nij,nj->ni", program.H, step)
            curved[1:, :sol.u.shape[1]] += np.einsum("nij,ni->nj", program.cross[1:], step[:-1])
            curved[:-1] += np.einsum("nij,nj->ni", program.cross[1:], sol.u[1:])
            left = np.sum(sol.passed + sol.passed**2/2)
            pred = -(np.sum(program.g*step) + 0.5*np.sum(step*curved)) + self._price*(theta - left)
            z, u, longer = inner.widened(sol)
            made = self._runs.moved(at.nodes, z, u, longer)
            size = float(np.max(np.abs(sol.u)))
            at.iterations += 1
            ratio = -1.0
            if made is not None:
                nodes, ends = made
                cost = obj.cost(nodes, ends)
                th = self._theta(nodes, ends)
                ratio = (phi - cost - self._price*th)/max(pred, 1e-300)
                last, tried = sol, made
                for _ in range(SOCS):
                    if ratio >= 0.75 or obj.task.end is None: break
                    target = last.z[-1][:len(gap)] + obj.end_gap(tried[0])[inner._z]
                    again, _ = self._program(at, linear, target)
                    last = self._solver.solve(again, inner.unit)
                    z2, u2, longer2 = inner.widened(last)
                    tried = self._runs.moved(at.nodes, z2, u2, longer2) if last.solved else None
                    if tried is None: break
                    cost2 = obj.cost(*tried); th2 = self._theta(*tried)
                    r2 = (phi - cost2 - self._price*th2)/max(pred, 1e-300)
                    if r2 <= ratio: break
                    ratio, (nodes, ends), cost, th = r2, tried, cost2, th2
            g = np.max(np.abs(obj.end_gap(at.nodes)))
            print("%3d J %.6f gap %.2e pred %.2e ratio %.3f rad %.2e |u| %.2e left %.1e price %.1e solved %s %d"%(it, at.cost, g, pred/abs(phi), ratio, self._radius, size, left, self._price/inner.unit, sol.solved, sol.iterations)) if VERBOSE else None
            if sol.solved and pred/abs(phi) < self._limits.tolerance and g < 1e-6:
                break
            if ratio > 1e-4:
                at = replace(at, nodes=nodes, ends=ends, cost=cost, iterations=at.iterations)
                linear = None
            if ratio < 0.25: self._radius = 0.4*min(size, self._radius)
            elif ratio > 0.75 and size > 0.9*self._radius: self._radius *= 2
            if left > 1e-7 and size < 0.9*self._radius and self._price < 1e3*inner.unit: self._price *= 2
            if self._radius < 1e-9: break
            if sol.solved and linear is None and np.max(np.abs(obj.end_gap(at.nodes)), initial=0) < 1e-3:
                need = 3.0*float(np.max(np.abs(sol.costate[-1])))
                self._price = min(self._price, max(need, 1e-3*inner.unit))
        self.best = at
        return at

    def _program(self, at, linear, target=None):
        p = self._inner.program(at.nodes, linear, 1e-8*self._inner.unit, 0.0)
        N, n_z, k = p.B.shape
        free = self._objective.task.is_free
        nu = k - 1 if free else k
        low, high = p.low.copy(), p.high.copy()
        low[:, :nu] = np.maximum(low[:, :nu], -self._radius)
        high[:, :nu] = np.minimum(high[:, :nu], self._radius)
        gap = self._objective.end_gap(at.nodes)[self._inner._z]
        if target is not None: gap = target
        m = len(gap)
        C = np.zeros((N, m, p.C.shape[2]))
        C[-1, np.arange(m), n_z + k + k + np.arange(m)] = 1.0
        rl, rh = np.full((N, m), -UNBOUNDED), np.full((N, m), UNBOUNDED)
        rl[-1] = rh[-1] = gap
        cat = lambda a, b: np.concatenate([a, b], axis=1)
        return StageProgram(p.H, p.g, p.cross, p.A, p.B, p.e, low, high, cat(p.C, C), cat(p.row_low, rl), cat(p.row_high, rh), cat(p.elastic, np.full((N, m), self._price))), gap
VERBOSE=False
P0=10.0
SOCS=3
