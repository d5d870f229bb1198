"""Random scenes in which all bodies collide, and the required properties of their runs.

A stage has fixed bodies, so that it is compiled once; friction, restitution, obstacles, starts,
throws, inputs and steps are drawn from a seed. `python -m properties.stages STAGE SEED` runs one
case and prints broken properties.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import sys
import zlib
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini import Status
from fantoccini.kernel.runtime.contacts import Contacts
from fantoccini.kernel.runtime.solids import solid
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.model.tree import WORLD
from properties.check import INACCURATE_STATUSES, Result
from properties.performances import with_velocity

METHOD = "timestepping"

EXPECTED_STATUSES = {
    Status.DONE,
    Status.OVERSTEPPED,
    Status.GAINED_ENERGY,
    Status.NOT_SETTLED,
    Status.COLLAPSED,
    Status.LENGTH_NOT_POSITIVE,
    Status.REDUNDANT_STRINGS,
    Status.TOO_MANY_CONTACTS,
    Status.UNBALANCED,
}
"""Expected statuses."""

MAX_OVERLAP = 0.02
"""Depth beyond which a run may not be DONE [m]."""
MAX_CONTACT_RESIDUAL = 1e-5
"""Residual of the laws of contact beyond which a step is not accepted, relative."""
MAX_CONE_EXCESS = 1e-4
"""Largest part of friction outside the cone, relative to the largest normal force."""
MAX_LOSS_DECREASE = 0.02
"""Largest decrease of a loss, relative to the energy of the stage."""
MAX_TURN = 0.3
"""Turn of a body in one step up to which its energy is kept, for any inertia [rad]: velocity
products are extrapolated, which is invalid after larger turns.
"""
MAX_LEDGER_RESIDUAL = 0.2
"""Bound on the ledger's residual of a run that is DONE, relative to the energy of the stage."""
MAX_PIECES = 60
"""Bound on the pieces of 200 steps of a run."""
MAX_DRAWS = 200
"""Number of starts drawn until nothing overlaps."""
N_OBSTACLES = 3
"""Fixed solids of a stage, some of them far away."""
N_CHECKED_SAMPLES = 40
"""Number of samples at which all gaps are measured."""


@dataclass(frozen=True, eq=False)
class StageRun:
    """Arguments of one run."""

    marionette: fan.Marionette
    x0: fan.State
    inputs: fan.Input | None
    t_end: float
    dt: float


class StageResult(Result):
    """Result of one case.

    `violation` is the deepest overlap [m], `gap` the residual of the laws of contact.
    """

    @property
    def command(self) -> str:
        """Command that repeats the case."""
        module = "PYTHONPATH=tests .venv/bin/python -m properties.stages"
        return f"{module} {self.puppet} {self.seed}"


def _shape(kind: str, *size: float, **options: object) -> dict:
    keys_of_size = {
        "sphere": lambda r: {"radius": r},
        "capsule": lambda x, r: {"from": [0, 0, -x / 2], "to": [0, 0, x / 2], "radius": r},
        "box": lambda *s: {"size": list(s)},
        "ellipsoid": lambda *s: {"radii": list(s)},
    }
    return {"type": kind, **keys_of_size[kind](*size), **options}


def _prop(name: str, *shapes: dict) -> dict:
    return {"name": name, "shapes": list(shapes)}


BALL = _prop("ball", _shape("sphere", 0.06, mass=0.2))
STICK = _prop("stick", _shape("capsule", 0.3, 0.015, mass=0.1))
BOX = _prop("box", _shape("box", 0.12, 0.16, 0.2, mass=1.0))
PLATE = _prop("tile", _shape("box", 0.3, 0.3, 0.01, mass=0.3))
EGG = _prop("egg", _shape("ellipsoid", 0.04, 0.05, 0.09, mass=0.15))
DUMBBELL = _prop(
    "dumbbell",
    _shape("box", 0.1, 0.1, 0.1, at=[-0.12, 0, 0], mass=2.0),
    _shape("sphere", 0.06, at=[0.12, 0, 0], mass=0.5),
)
PEBBLE = _prop("pebble", _shape("sphere", 0.012, mass=0.003))


def _figure() -> dict:
    """A trunk with two legs, feet and an arm, on three strings."""
    hinge = {"type": "revolute", "axis": [0, -1, 0], "limits": {"lower": -0.8, "upper": 1.2}}
    limb = {"type": "capsule", "from": [0, 0, 0], "to": [0, 0, -0.2], "radius": 0.02, "mass": 0.1}
    bodies = [
        {
            "name": "trunk",
            "joint": {"type": "free", "at": [0, 0, 0.4]},
            "shapes": [_shape("box", 0.1, 0.14, 0.2, mass=0.5)],
        },
        {
            "name": "arm",
            "parent": "trunk",
            "shapes": [limb],
            "joint": {
                "type": "ball",
                "at": [0, 0.1, 0.08],
                "cone": {"max": 2.2, "axis": [0, 0, -1]},
            },
        },
    ]
    for side, y in (("left", 0.04), ("right", -0.04)):
        bodies += [
            {
                "name": f"leg_{side}",
                "parent": "trunk",
                "shapes": [limb],
                "joint": hinge | {"at": [0, y, -0.1]},
            },
            {
                "name": f"foot_{side}",
                "parent": f"leg_{side}",
                "joint": {"type": "fixed", "at": [0.02, 0, -0.23]},
                "shapes": [_shape("box", 0.1, 0.05, 0.02, mass=0.05)],
            },
        ]
    ends = {
        "head": ("trunk", [0, 0, 0.1]),
        "hand": ("arm", [0, 0, -0.2]),
        "heel": ("leg_left", [0, 0, -0.2]),
    }
    strings = [
        {
            "name": name,
            "length": "driven",
            "path": [
                {"body": body, "at": at},
                {"driven": ["x", "y", "z"], "at": [0, 0.05 * k, 1.1]},
            ],
        }
        for k, (name, (body, at)) in enumerate(ends.items())
    ]
    return {"puppet": "figure", "bodies": bodies, "strings": strings}


def _paddle() -> dict:
    """A driven plate, a driven stamp and a load on a winch that slips."""
    return {
        "puppet": "paddle",
        "bodies": [
            {
                "name": "plate",
                "joint": {"type": "free", "at": [0, 0, 0.5], "driven": True},
                "shapes": [_shape("box", 0.5, 0.4, 0.02, mass=2.0)],
            },
            {
                "name": "stamp",
                "shapes": [_shape("capsule", 0.2, 0.05, mass=3.0)],
                "joint": {
                    "type": "prismatic",
                    "axis": [1, 0, 0],
                    "at": [-0.8, 0, 0.3],
                    "driven": True,
                },
            },
            {
                "name": "load",
                "joint": {"type": "free", "at": [0.5, 0, 0.5]},
                "shapes": [_shape("box", 0.1, 0.1, 0.1, mass=1.0)],
            },
        ],
        "strings": [
            {
                "name": "rope",
                "length": "driven",
                "max_tension": 60,
                "rewind_speed": 0.5,
                "path": [
                    {"body": "load", "at": [0, 0, 0.05]},
                    {"driven": ["x", "z"], "at": [0.5, 0, 1.2]},
                ],
            }
        ],
    }


ALL: dict[str, tuple[list[dict], list[dict]]] = {
    "heap": ([], [BALL, STICK, BOX, PLATE, EGG, DUMBBELL]),
    "crates": ([], [BOX | {"name": f"box_{k}"} for k in range(4)] + [PEBBLE]),
    "balls": ([], [BALL | {"name": f"ball_{k}"} for k in range(4)] + [EGG, PEBBLE]),
    "paddle": ([_paddle()], [BALL, PEBBLE, PLATE]),
    "figure": ([_figure()], [BALL, BOX]),
    "duet": ([_figure(), _figure()], [BALL]),
}
"""Name -> puppets and props; a stage without puppets has a peg without contact."""

_PEG = {
    "puppet": "peg",
    "bodies": [{"name": "peg", "joint": {"type": "fixed"}, "mass": 1.0, "inertia": [1, 1, 1]}],
}


@functools.cache
def load(name: str) -> fan.Marionette:
    """The stage of a name, compiled or from the cache."""
    obstacles = [_shape("sphere", 0.1, name=f"o{k}") for k in range(N_OBSTACLES)]
    return _build_stage(name, True, obstacles)


def _build_stage(name: str, contact: object, obstacles: list[dict]) -> fan.Marionette:
    """The stage of a name with rules of contact and obstacles."""
    puppets, props = ALL[name]
    members = [
        {"name": f"p{k}", "at": [0.0, 0.7 * k, 0.0], "puppet": fan.model.loads(json.dumps(puppet))}
        for k, puppet in enumerate(puppets or [_PEG])
    ]
    scene = {
        "scene": name,
        "floor": 0.0,
        "contact": contact,
        "obstacles": obstacles,
        "puppets": members,
        "props": [prop | {"at": [0.4 * k, -1.5, 0.5]} for k, prop in enumerate(props)],
    }
    return fan.Marionette(fan.Scene.model_validate(scene))


def draw_stage(name: str, rng: np.random.Generator) -> fan.Marionette:
    """A stage with random rules, and random solids as its obstacles."""
    marionette = load(name)
    contacts = marionette.contacts
    assert contacts is not None
    solids = contacts.solids.copy()
    solid_index = {
        n[1]: int(pair[1]) for n, pair in zip(contacts.names, contacts.pairs, strict=True)
    }
    n_used = int(rng.integers(0, N_OBSTACLES + 1))
    for k in range(N_OBSTACLES):
        solids[solid_index[f"o{k}"]] = solid(_draw_obstacle(rng, is_distant=k >= n_used), WORLD)
    friction, restitution = _draw_rules(rng)
    rules = np.full(len(contacts.pairs), friction), np.full(len(contacts.pairs), restitution)
    with_rules = dataclasses.replace(marionette)
    # Rules and standing solids are arguments of compiled code.
    with_rules.__dict__["contacts"] = Contacts(solids, contacts.pairs, *rules, contacts.names)
    return fan.Marionette(with_rules)


def draw_scene(name: str, rng: np.random.Generator) -> fan.Marionette:
    """The same stage as a scene of its own, which keeps its rules when its winches change."""
    n_used = int(rng.integers(0, N_OBSTACLES + 1))
    shapes = [_draw_obstacle(rng, is_distant=k >= n_used) for k in range(N_OBSTACLES)]
    obstacles = [
        shape.model_dump(mode="json", by_alias=True, exclude_none=True) | {"name": f"o{k}"}
        for k, shape in enumerate(shapes)
    ]
    friction, restitution = _draw_rules(rng)
    return _build_stage(name, {"friction": friction, "restitution": restitution}, obstacles)


def _draw_rules(rng: np.random.Generator) -> tuple[float, float]:
    """Friction and restitution."""
    friction = float(rng.choice([0.0, rng.uniform(0.0, 1.5), 1.5], p=[0.1, 0.8, 0.1]))
    return friction, float(rng.choice([0.0, rng.uniform(0.0, 0.9)]))


def _draw_obstacle(rng: np.random.Generator, is_distant: bool) -> Shape:
    """A box, thin wall, ball, pole or ellipsoid at a random place, or far away."""
    size = [float(x) for x in rng.uniform(0.05, 0.4, 3)]
    at = [float(x) for x in rng.uniform([-0.7, -0.5, 0.0], [0.7, 1.0, 0.5])]
    if is_distant:
        at[2] = -100.0
    ends = {"from_": (at[0], at[1] - 0.5, at[2]), "to": (at[0], at[1] + 0.5, at[2])}
    shapes = [
        Box(type="box", at=at, size=size),
        Box(type="box", at=at, size=[0.005, 4 * size[1], 3 * size[2]]),
        Sphere(type="sphere", at=at, radius=0.5 * size[0]),
        Capsule(type="capsule", radius=0.02, **ends),
        Ellipsoid(type="ellipsoid", at=at, radii=[0.5 * x for x in size]),
    ]
    return shapes[int(rng.integers(len(shapes)))]


def draw_run(name: str, seed: int) -> StageRun | None:
    """The run of a stage and seed; None if nothing fits among its obstacles."""
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    marionette = draw_stage(name, rng)
    x0 = draw_start(rng, marionette)
    if x0 is None:
        return None
    t_end = float(rng.uniform(0.3, 1.0))
    v = rng.normal(size=len(x0.v_D)) * rng.choice([0.0, 0.5, 3.0, 10.0])
    x0 = with_velocity(marionette, x0.replace(v_D=v * (rng.random(len(v)) < 0.7)), x0.v_K)
    dt = float(np.exp(rng.uniform(np.log(5e-4), np.log(4e-3))))
    return StageRun(marionette, x0, _draw_inputs(rng, marionette, x0, t_end), t_end, dt)


def draw_start(rng: np.random.Generator, marionette: fan.Marionette) -> fan.State | None:
    """Bodies at random places, sometimes near one another; strings of the needed length, or
    longer.
    """
    table, spread = marionette.coordinates, float(rng.choice([0.15, 0.4]))
    for k in range(MAX_DRAWS):
        x = marionette.state()
        q = np.array(x.q_D)
        for q_index, _ in table.quaternions_D:
            quaternion = rng.normal(size=4) * (0.2 if rng.random() < 0.3 else 1.0) + [1, 0, 0, 0]
            q[q_index : q_index + 4] = quaternion / np.linalg.norm(quaternion)
            name = table.q_D[q_index].rpartition(".")[0]
            if f"{name}.x" in table.q_D:
                x_index = table.q_D.index(f"{name}.x")
                # Props are placed by the scene, puppets by their file.
                low, high = (-0.2, 0.5) if "trunk" in name else (0.05, 2.0)
                q[x_index : x_index + 3] = rng.uniform([-1, -1, low], [1, 1, high])
                q[x_index : x_index + 3] *= spread * (1.0 + 0.02 * k)
        x = x.replace(q_D=q)
        q_K = np.array(x.q_K)
        h = marionette.constraint(x)
        for row, string in enumerate(marionette.tree.strings):
            if string.length_index is not None:
                q_K[string.length_index[0]] += h[row] + rng.choice([0.0, 0.05]) * rng.random()
        x = x.replace(q_K=q_K)
        limits = marionette.constraint(x)[len(marionette.tree.strings) :]
        if np.all(limits <= 0.0) and not marionette.overlaps(x.q_D, x.q_K):
            return x
    return None


def _draw_inputs(
    rng: np.random.Generator, marionette: fan.Marionette, x0: fan.State, t_end: float
) -> fan.Input | None:
    """Random waypoints of the driven coordinates, gentle or wild; None in some cases."""
    reach = float(rng.choice([0.0, 0.1, 0.6], p=[0.3, 0.4, 0.3]))
    table = marionette.coordinates
    waypoints = {}
    for q, _ in table.scalars_K:
        if rng.random() < 0.5:
            continue
        times = np.sort(rng.uniform(0.05, t_end, int(rng.integers(1, 4))))
        value, min_value = float(x0.q_K[q]), 0.05 if table.q_K[q].endswith(".length") else -np.inf
        points = [(0.0, value)]
        for t, previous in zip(times, [0.0, *times], strict=False):
            if t - previous > 0.03:
                points.append((float(t), max(value + reach * float(rng.normal()), min_value)))
        waypoints[table.q_K[q]] = points
    return fan.Input.waypoints(marionette, waypoints) if waypoints and reach else None


def check_stage(name: str, seed: int) -> StageResult:
    """Run one case and return broken properties."""
    stage_run = draw_run(name, seed)
    if stage_run is None:
        return StageResult(name, seed, METHOD, "nothing", "DONE", 0, 0, 0.0, 0.0, 0.0, ())
    pieces = iter(range(MAX_PIECES))

    def count(_: object) -> None:
        if next(pieces, None) is None:
            raise KeyboardInterrupt

    run = fan.simulate(
        stage_run.marionette,
        stage_run.x0,
        stage_run.inputs,
        stage_run.t_end,
        method=fan.TimeStepping(dt=stage_run.dt),
        progress=count,
        throw=False,
    )
    broken = _non_finite_arrays(run)
    measures = (0.0, 0.0, 0.0)
    if not broken:
        measures, broken = _check_run(stage_run, run)
    input_kind = "nothing" if stage_run.inputs is None else "wild"
    touches = sum(e.kind == "touch" for e in run.events)
    return StageResult(
        name,
        seed,
        METHOD,
        input_kind,
        run.status.name,
        touches,
        len(run.events),
        *measures,
        tuple(broken),
    )


def _non_finite_arrays(run: fan.Trajectory) -> list[str]:
    assert run.contact is not None and run.effort is not None and run.violation is not None
    arrays = {n: getattr(run, n) for n in ("t", "q_D", "v_D", "acc_D", "contact_residual")}
    arrays |= {n: getattr(run, n).values for n in ("tension", "limit_force", "ledger", "violation")}
    arrays |= {n: getattr(run.contact, n) for n in ("gap", "point", "normal", "force", "velocity")}
    arrays |= {"effort": run.effort.values}
    return [f"{n} is not finite" for n, a in arrays.items() if not np.all(np.isfinite(a))]


def _check_run(
    stage_run: StageRun, run: fan.Trajectory
) -> tuple[tuple[float, float, float], list[str]]:
    """Overlap, residuals of the law and of the ledger; and broken properties."""
    broken: list[str] = []
    marionette, contact = stage_run.marionette, run.contact
    assert contact is not None and marionette.contacts is not None
    done = run.status is Status.DONE
    if run.status is Status.STOPPED:
        broken.append("takes too many steps")
    elif run.status not in EXPECTED_STATUSES:
        broken.append(f"ends with {run.status.name}")
    if done and run.t[-1] != stage_run.t_end:
        broken.append("ends with DONE before the end")
    samples = np.unique(np.linspace(0, len(run) - 1, N_CHECKED_SAMPLES).astype(int))
    overlaps = [marionette.overlaps(run.q_D[i], run.q_K[i]) for i in samples]
    depth = max((max(depths.values(), default=0.0) for depths in overlaps), default=0.0)
    depth = max(depth, -float(np.min(contact.gap, initial=0.0)))
    if done and depth > MAX_OVERLAP:
        broken.append("overlaps silently")
    contact_residual = float(np.max(run.contact_residual, initial=0.0))
    if contact_residual > MAX_CONTACT_RESIDUAL:
        broken.append("breaks the law of contact silently")
    broken += _check_forces(marionette, contact) + _check_events(run)
    columns = {n: run.ledger[n] for n in ("kinetic", "potential", "work")}
    energy_scale = max(float(np.max(np.abs(columns["kinetic"]))), stage_run.marionette.weight)
    energy_scale += float(np.max(np.abs(columns["work"]))) + float(np.ptp(columns["potential"]))
    residual = float(np.max(np.abs(run.ledger["residual"]))) / energy_scale
    if done and residual > MAX_LEDGER_RESIDUAL:
        broken.append("the ledger does not close silently")
    if stage_run.inputs is None and _largest_turn(stage_run, run) < MAX_TURN:
        if run.status in INACCURATE_STATUSES:
            broken.append("the ledger does not close")
        for name in ("friction", "impact"):
            if np.any(np.diff(run.ledger[name]) < -MAX_LOSS_DECREASE * energy_scale):
                broken.append(f"{name} gives energy")
    else:
        residual = 0.0
    return (depth if done else 0.0, contact_residual, residual), broken


def _largest_turn(stage_run: StageRun, run: fan.Trajectory) -> float:
    """Largest turn of a body in a step [rad]."""
    table = stage_run.marionette.coordinates
    spins = [run.v_D[:, v : v + 3] for _, v in table.quaternions_D]
    hinges = [run.v_D[:, v] for q, v in table.scalars_D if "leg" in table.q_D[q]]
    return stage_run.dt * max(
        float(np.max(np.abs(speeds), initial=0.0)) for speeds in (spins, hinges)
    )


def _check_forces(model: fan.Marionette, contact: fan.motion.ContactPoints) -> list[str]:
    """Messages about forces that pull or leave their cones."""
    if not len(contact):
        return []
    friction, normal = model.contacts.friction[contact.pair], contact.normal_force
    friction_force = np.linalg.norm(contact.force - normal[:, None] * contact.normal, axis=1)
    broken = []
    if np.min(normal) < 0.0:
        broken.append("a contact pulls")
    if np.any(friction_force > friction * normal + MAX_CONE_EXCESS * np.max(normal)):
        broken.append("friction passes its cone")
    return broken


def _check_events(run: fan.Trajectory) -> list[str]:
    """Messages about touches and lifts, slides and sticks, that do not alternate; any start."""
    broken = []
    for name in {event.name for event in run.events if "|" in event.name}:
        is_touching: bool | None = None
        is_sliding: bool | None = None
        for event in run.events:
            if event.name != name:
                continue
            begins = event.kind in ("touch", "slide")
            if event.kind in ("touch", "lift"):
                is_in_order = is_touching is not begins
                is_touching, is_sliding = begins, False if begins else None
            else:
                is_in_order = is_touching is not False and is_sliding is not begins
                is_sliding = begins
            if not is_in_order:
                broken.append(f"{event.kind} comes out of turn")
    return broken


def main() -> None:
    """Run the case of the command line."""
    name, seed = sys.argv[1:3]
    result = check_stage(name, int(seed))
    print(result)
    print("broken:", *(result.broken or ["nothing"]), sep="\n  ")
    sys.exit(bool(result.broken))


if __name__ == "__main__":
    main()
