"""Runs MuJoCo in a separate process, so that two versions can be timed alternately.

It needs only the mujoco wheel. Every line of stdin is a request in JSON, ``{"task": name,
...}``; every line of stdout is its answer. States are given and returned joint by joint:
``{joint: [numbers]}`` in MuJoCo's own order and axes.
"""

from __future__ import annotations

import json
import sys
import time

import mujoco
import numpy as np
from mujoco import rollout

WARM_UP = 200
"""Number of steps before the timed ones."""

SOLREF, SOLIMP = (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0)
"""MuJoCo's default softness of a limit."""


class Bench:
    """The loaded models, and the tasks."""

    def __init__(self):
        self.models: dict[str, mujoco.MjModel] = {}
        self.pools: dict[int, rollout.Rollout] = {}

    def load(self, name: str, text: str) -> dict:
        """Loads a model from MJCF text."""
        self.models[name] = model = mujoco.MjModel.from_xml_string(text)
        return {"version": mujoco.__version__, "nv": model.nv, "nq": model.nq}

    def accelerate(self, model: str, q: dict, v: dict) -> dict:
        """Computes the accelerations without constraints."""
        m, d = self._prepared(model, {}, q, v)
        m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        mujoco.mj_forward(m, d)
        return {"acc": {name: d.joint(name).qacc.tolist() for name in q}}

    def step(self, model: str, settings: dict, q: dict, v: dict, steps: int) -> dict:
        """Measures the time of a step [s]; also returns the final state and tendon tensions."""
        m, d = self._prepared(model, settings, q, v)
        mujoco.mj_step(m, d, WARM_UP)
        self._set_state(m, d, q, v)
        start = time.thread_time()
        mujoco.mj_step(m, d, steps)
        took = time.thread_time() - start
        end, speed = self._joints(m, d, q)
        mujoco.mj_forward(m, d)
        is_tendon_limit = d.efc_type[: d.nefc] == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON
        tendon_ids, force = (
            d.efc_id[: d.nefc][is_tendon_limit].tolist(),
            d.efc_force[: d.nefc][is_tendon_limit].tolist(),
        )
        force_by_tendon = dict(zip(tendon_ids, force, strict=True))
        tension = {m.tendon(i).name: force_by_tendon.get(i, 0.0) for i in range(m.ntendon)}
        return {"seconds": took / steps, "q": end, "v": speed, "tension": tension}

    def rollout(self, model: str, settings: dict, states: list, steps: int, threads: int) -> dict:
        """Measures the time [s] of trajectories from several states on a pool of threads."""
        m, d = self._prepared(model, settings, *states[0])
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.empty((len(states), mujoco.mj_stateSize(m, full)))
        for row, (q, v) in zip(start, states, strict=True):
            self._set_state(m, d, q, v)
            mujoco.mj_getState(m, d, row, full)
        data = [mujoco.MjData(m) for _ in range(threads)]
        pool = self.pools.setdefault(threads, rollout.Rollout(nthread=threads))
        out = np.empty((len(states), steps, start.shape[1]))
        out.fill(0.0)  # allocates its memory before the clock starts
        began = time.perf_counter()
        pool.rollout(m, data, start, nstep=steps, state=out)
        took = time.perf_counter() - began
        return {"seconds": took, "finite": bool(np.isfinite(out).all())}

    def _prepared(self, name: str, settings: dict, q: dict, v: dict):
        model = self.models[name]
        flags = mujoco.mjtDisableBit
        off = flags.mjDSBL_CONTACT | flags.mjDSBL_AUTORESET
        if not settings.get("islands", True):
            off |= flags.mjDSBL_ISLAND
        model.opt.disableflags = off
        model.opt.enableflags = 0
        for key, kind in (("integrator", "INT"), ("solver", "SOL"), ("jacobian", "JAC")):
            if key in settings:
                chosen = getattr(mujoco, f"mjt{key.capitalize()}")
                setattr(model.opt, key, getattr(chosen, f"mj{kind}_{settings[key].upper()}"))
        for key in ("timestep", "iterations", "tolerance"):
            if key in settings:
                setattr(model.opt, key, settings[key])
        model.tendon_solref_lim[:] = settings.get("solref", SOLREF)
        model.tendon_solimp_lim[:] = settings.get("solimp", SOLIMP)
        data = mujoco.MjData(model)
        self._set_state(model, data, q, v)
        return model, data

    @staticmethod
    def _set_state(m, d, q: dict, v: dict) -> None:
        mujoco.mj_resetData(m, d)
        for name, values in q.items():
            d.joint(name).qpos[:] = values
            d.joint(name).qvel[:] = v[name]

    @staticmethod
    def _joints(m, d, q: dict) -> tuple[dict, dict]:
        return (
            {name: d.joint(name).qpos.tolist() for name in q},
            {name: d.joint(name).qvel.tolist() for name in q},
        )


def main() -> None:
    bench = Bench()
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = getattr(bench, request.pop("task"))(**request)
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
