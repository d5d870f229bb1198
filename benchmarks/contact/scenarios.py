"""Section 5: residuals of the contact law on scenes of a published comparison.

Le Lidec, Jallet, Montaut, Laptev, Schmid and Carpentier, *Contact Models in Robotics: a Comparative
Analysis* (arXiv 2304.06372), where one line describes the scene; and the standing
marionette.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.runtime import contact_points
from fantoccini.motion import ContactPoints, State

from ..speed.figures import Chapter
from ..strings.report import Section, Table, number
from . import bullet_scene, drake_scene
from .boxes import UnsupportedSceneError
from .bullet_scene import BulletScene
from .drake_scene import DrakeScene
from .mujoco_scene import MuJoCoScene
from .subject import ONE

DT = 0.001
"""Step of both engines [s]."""

G = 9.81
SIDE, MASS = 0.1, 1.0
FEET = ("shin_left", "shin_right")

CUBE = """
puppet: cube
floor: 0
gravity: [{x!r}, 0, {z!r}]
contact: {{friction: {mu}}}
bodies:
- name: cube
  joint: {{type: free}}
  shapes: [{{type: box, size: [{side}, {side}, {side}], mass: {mass}}}]
pose: {{cube.z: {height!r}}}
"""


@dataclass(frozen=True)
class EngineRun:
    """A run of either engine.

    Attributes:
        t: (n,) times [s].
        q, v: (n, n_qD), (n, n_vD) in our order.
        normal: list of (m,) normal forces of the points [N]; empty for an engine without points.
        tangent: list of (m,) magnitudes of the tangential forces [N]; likewise.
        depth: (n,) deepest overlap [m].
        energy: (n,) kinetic and potential [J].
    """

    t: Array
    q: Array
    v: Array
    normal: list[Array]
    tangent: list[Array]
    depth: Array
    energy: Array


Push = Callable[[float], float]
"""Force along x on the first body at a time [N]."""


def run_fantoccini(
    puppet: fan.Marionette, x: State, t_end: float, push: Push | None = None
) -> EngineRun:
    """A time-stepping run."""
    stepper = puppet.stepper(x, method=fan.TimeStepping(dt=DT))
    layout, n = puppet.sample_layout, puppet.coordinates.n_vD
    rows, normal, tangent, depth = [], [], [], []
    for k in range(round(t_end / DT)):
        force = np.zeros(n)
        if push:
            force[0] = push(k * DT)
        stepper.advance(DT, u_D=force)
        rows.append(stepper.samples[-1])
        points = _points(puppet, stepper)
        along = np.einsum("ij,ij->i", points.force, points.normal)
        normal.append(along)
        tangent.append(np.linalg.norm(points.force - along[:, None] * points.normal, axis=1))
        depth.append(max([0.0, *(-points.gap)]))
    split = layout.split(np.array(rows))
    energy = split["kinetic"] + split["potential"]
    return EngineRun(
        split["t"], split["q_D"], split["v_D"], normal, tangent, np.array(depth), energy
    )


def _points(puppet: fan.Marionette, stepper: Stepper) -> ContactPoints:
    """The contact points of the last sample."""
    rows = stepper.contacts[stepper.contacts[:, 0] == len(stepper.samples) - 1]
    return contact_points(rows, puppet.contacts.names)


def run_mujoco(
    puppet: fan.Marionette, x: State, t_end: float, hard: bool, push: Push | None = None
) -> EngineRun:
    """A run of MuJoCo's Euler method with elliptic cones and Newton's method."""
    scene = MuJoCoScene.of(puppet, x.q_K, DT, hard)
    scene.put(x)
    data, rows, normal, tangent, depth = scene.data, [], [], [], []
    for k in range(round(t_end / DT)):
        if push:
            data.qfrc_applied[scene.v_D[0]] = push(k * DT)
        scene.step(1)
        rows.append([data.time, *data.qpos[scene.q_D], *data.qvel[scene.v_D]])
        scene.forward()
        forces = np.array([scene.force(i)[:3] for i in range(data.ncon)]).reshape(-1, 3)
        normal.append(forces[:, 0])
        tangent.append(np.linalg.norm(forces[:, 1:], axis=1))
        depth.append(max([0.0, *(-data.contact.dist)]))
    t, q, v = np.split(np.array(rows), [1, 1 + puppet.coordinates.n_qD], axis=1)
    energy = _energy(puppet, x, q, v)
    return EngineRun(t[:, 0], q, v, normal, tangent, np.array(depth), energy)


def run_boxes(
    scene_of: Callable[[fan.Marionette, float], DrakeScene | BulletScene],
    puppet: fan.Marionette,
    x: State,
    t_end: float,
    push: Push | None = None,
) -> EngineRun:
    """A run of an engine without strings.

    Raises:
        Unlike: the scene is not one of boxes over a floor.
    """
    scene = scene_of(puppet, DT)
    scene.put(x)
    rows = []
    for k in range(round(t_end / DT)):
        if push:
            scene.push(push(k * DT))
        scene.advance((k + 1) * DT)
        rows.append(np.concatenate(scene.state()))
    q, v = np.split(np.array(rows), [puppet.coordinates.n_qD], axis=1)
    t = DT * np.arange(1, len(rows) + 1)
    heights = np.concatenate([np.full((len(q), 1), -0.5 * SIDE), q[:, 2::7]], axis=1)
    depth = np.maximum(SIDE - np.diff(heights, axis=1), 0.0).max(axis=1)
    return EngineRun(t, q, v, [], [], depth, _energy(puppet, x, q, v))


def installed_engines() -> dict[str, Callable[..., EngineRun]]:
    """The run function of every installed engine."""
    runs: dict[str, Callable[..., EngineRun]] = {
        "fantoccini": run_fantoccini,
        "MuJoCo": functools.partial(run_mujoco, hard=False),
        "MuJoCo, hard": functools.partial(run_mujoco, hard=True),
    }
    if drake_scene.is_installed():
        for name, approximation in drake_scene.APPROXIMATIONS.items():
            scene_of = functools.partial(DrakeScene, approximation=approximation)
            runs[f"Drake, {name}"] = functools.partial(run_boxes, scene_of)
    if bullet_scene.is_installed():
        runs["Bullet"] = functools.partial(run_boxes, BulletScene)
    return runs


def chapter() -> Chapter:
    """All scenes with all engines."""
    runs = installed_engines()
    rows = []
    for what, measure in SCENES.items():
        rows.append([what, *(_cell(measure, run) for run in runs.values())])
    text = (
        f"All with steps of {number(DT * 1e3)} ms. *Hard* is MuJoCo with contacts, strings and "
        "limits as hard as it permits: a time constant of two steps and an impedance of 0.9999. "
        "Scenes are those of Le Lidec et al., [arXiv "
        "2304.06372](https://arxiv.org/abs/2304.06372), as summarised in each row, and the "
        "standing marionette. Every row is 0 for the exact law, with two exceptions: the "
        "distance to a stop has the error of the step, v dt/2; and of a resting cube's four "
        "normal forces only their sum and two moments are determined. The last two rows are "
        "their largest difference from a quarter of the weight, and the friction without any "
        "pull on the cube."
    )
    modulus = number(drake_scene.MODULUS * 1e-9)
    others = (
        f"Drake's boxes are compliant (`hydroelastic`), of {modulus} GPa, because its point "
        "contact has only one point for a box on a plane; such a patch has no points, and the "
        "model has no marionette on strings (`-`). Its SAP solves a convex relaxation, which "
        "lifts sliding bodies; *lagged* lifts them less. Bullet has no damping and no sleep, "
        "otherwise default settings. Other engines were not run."
    )
    return Chapter(Section("5. The law", [text, Table(["", *runs], rows), others]))


def _cell(
    measure: Callable[[Callable[..., EngineRun]], float], run: Callable[..., EngineRun]
) -> str:
    """A figure, or a dash if an engine does not provide it."""
    try:
        value = measure(run)
    except UnsupportedSceneError:
        return "-"
    return number(value)


def cube_on_floor(mu: float, slope: float = 0.0, height: float = 0.5 * SIDE) -> fan.Marionette:
    """A cube over a floor; the slope tilts gravity."""
    x, z = G * float(np.sin(slope)), -G * float(np.cos(slope))
    return fan.loads(CUBE.format(x=x, z=z, mu=mu, side=SIDE, mass=MASS, height=height))


def _sliding_state(puppet: fan.Marionette, speed: float) -> State:
    """A state on the floor, with a speed along x."""
    x = puppet.state()
    v = x.v_D.copy()
    v[puppet.coordinates.v_D.index("cube.x")] = speed
    return x.replace(v_D=v)


def _creep(run: Callable[..., EngineRun]) -> float:
    puppet = cube_on_floor(0.6, slope=0.5)
    course = run(puppet, puppet.state(), 5.0)
    return float(np.abs(course.q[-1, 0] - course.q[999, 0]))


def stopping_error(run: Callable[..., EngineRun]) -> float:
    mu, speed = 0.3, 1.0
    puppet = cube_on_floor(mu)
    course = run(puppet, _sliding_state(puppet, speed), 1.0)
    return abs(float(course.q[-1, 0]) - speed**2 / (2.0 * mu * G))


def _lift(run: Callable[..., EngineRun]) -> float:
    puppet = cube_on_floor(0.3)
    course = run(puppet, _sliding_state(puppet, 1.0), 0.3)
    return float(np.abs(course.q[:, 2] - 0.5 * SIDE).max())


def _gain(run: Callable[..., EngineRun]) -> float:
    puppet = cube_on_floor(0.3)
    course = run(puppet, _sliding_state(puppet, 1.0), 1.0)
    return float(np.maximum(np.diff(course.energy), 0.0).sum())


def dragged_distance(run: Callable[..., EngineRun]) -> float:
    """Distance of a pulled cube when the force reaches 95 % of the friction limit."""
    mu, t_end = 0.5, 1.0
    puppet = cube_on_floor(mu)
    limit_force = mu * MASS * G
    course = run(puppet, puppet.state(), t_end, push=lambda t: 0.95 * limit_force * t / t_end)
    return float(np.abs(course.q[-1, 0]))


def _stack(run: Callable[..., EngineRun]) -> float:
    """Cubes of 1, 1 and 1000 kg, the heaviest on top: the deepest overlap in the second second."""
    bodies = "\n".join(
        f"- {{name: c{k}, joint: {{type: free}}, "
        f"shapes: [{{type: box, size: [{SIDE}, {SIDE}, {SIDE}], mass: {mass}}}]}}"
        for k, mass in enumerate((1.0, 1.0, 1000.0))
    )
    pose = ", ".join(f"c{k}.z: {(k + 0.5) * SIDE!r}" for k in range(3))
    puppet = fan.loads(
        "puppet: stack\nfloor: 0\ncontact: {friction: 0.5}\n"
        f"bodies:\n{bodies}\npose: {{{pose}}}\n"
    )
    course = run(puppet, puppet.state(), 2.0)
    return float(course.depth[1000:].max())


def _uneven(run: Callable[..., EngineRun]) -> float:
    puppet = cube_on_floor(0.5)
    course = run(puppet, puppet.state(), 1.0)
    if not course.normal:
        raise UnsupportedSceneError("it has no points")
    return float(np.abs(course.normal[-1] - 0.25 * MASS * G).max() / (MASS * G))


def _internal(run: Callable[..., EngineRun]) -> float:
    puppet = cube_on_floor(0.5)
    course = run(puppet, puppet.state(), 1.0)
    if not course.normal:
        raise UnsupportedSceneError("it has no points")
    return float(course.tangent[-1].sum() / (MASS * G))


def _feet(run: Callable[..., EngineRun]) -> EngineRun:
    return run(_standing_peer(), _standing_state(ONE.standing.q_D, ONE.standing.v_D), 5.0)


@functools.cache
def _standing_peer() -> fan.Marionette:
    return fan.Marionette(ONE.peers_puppet)


def _standing_state(q_D: Array, v_D: Array) -> State:
    """A state of the peers' puppet."""
    return _standing_peer().state().replace(q_D=q_D, v_D=v_D, q_K=ONE.standing.q_K)


def sunk_depth(run: Callable[..., EngineRun]) -> float:
    return float(_feet(run).depth[1000:].max())


def _crept(run: Callable[..., EngineRun]) -> float:
    """Distance that a foot moves in the last four of five seconds."""
    course = _feet(run)
    places = []
    for k in (999, -1):
        x = _standing_state(course.q[k], course.v[k])
        places.append([_standing_peer().pose(x, name)[:2, 3] for name in FEET])
    return float(np.linalg.norm(np.subtract(*places), axis=1).max())


def _energy(puppet: fan.Marionette, x: State, q: Array, v: Array) -> Array:
    """(n,) kinetic and potential energy by our equations."""
    still = {"q_K": np.tile(x.q_K, (len(q), 1)), "v_K": np.zeros((len(q), len(x.v_K)))}
    energies = puppet.library.evaluate("energy", q_D=q, v_D=v, **still, p=puppet.p)
    return np.asarray(energies.T + energies.V)


SCENES: dict[str, Callable[[Callable[..., EngineRun]], float]] = {
    "cube on a slope below the threshold: creep from 1 s to 5 s [m]": _creep,
    "sliding cube: error of the distance to its stop [m]": stopping_error,
    "sliding cube: vertical displacement [m]": _lift,
    "sliding cube: energy gained in all steps [J]": _gain,
    "dragged cube: displacement at 95 % of the friction limit [m]": dragged_distance,
    "stack of 1, 1 and 1000 kg: deepest overlap from 1 s to 2 s [m]": _stack,
    "standing marionette: deepest overlap from 1 s to 5 s [m]": sunk_depth,
    "standing marionette: displacement of a foot from 1 s to 5 s [m]": _crept,
    "resting cube: uneven normal forces, of its weight": _uneven,
    "resting cube: friction at rest, of its weight": _internal,
}
