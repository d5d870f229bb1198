"""A scene in MuJoCo: the puppet's MJCF with contact, elliptic cones, Newton's method."""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, field
from xml.etree import ElementTree

import mujoco
import numpy as np
from mujoco import rollout

from fantoccini.base.arrays import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.mujoco import all_joints, mjcf
from fantoccini.model import tree
from fantoccini.model.puppet import Box, Capsule, Ellipsoid, Shape, Sphere
from fantoccini.model.tree import WORLD
from fantoccini.motion import State

SETTINGS = tuple(
    {"jacobian": jacobian, "islands": islands}
    for jacobian, islands in itertools.product(("dense", "sparse"), (False, True))
)
"""MuJoCo's options other than the solver and the friction cone."""

HARD = {"solref": (2.0, 1.0), "solimp": (0.9999, 0.9999, 0.001, 0.5, 2.0)}
"""Contacts and limits as hard as MuJoCo permits: time constant in steps, damping; impedance."""

FLOOR_SIZE = 5.0
"""Half edge of the drawn floor; the plane itself is infinite [m]."""


@dataclass
class MuJoCoScene:
    """A model, its data, and the puppet's coordinates in them.

    Attributes:
        model, data: MuJoCo's.
        q_D, v_D: index in ``qpos`` and ``qvel`` of each of our coordinates.
        settings: the active one of ``SETTINGS``.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    q_D: Array
    v_D: Array
    settings: dict = field(default_factory=dict)

    @classmethod
    def of(cls, marionette: Marionette, still: Array, dt: float, hard: bool = False) -> MuJoCoScene:
        """A scene with constant driven coordinates.

        Args:
            marionette: puppet with contact.
            still: (n_qK,) driven coordinates.
            dt: step [s].
            hard: whether contacts, strings and limits are as hard as MuJoCo permits.
        """
        model = mujoco.MjModel.from_xml_string(scene_mjcf(marionette, still))
        option = model.opt
        option.timestep, option.integrator = dt, mujoco.mjtIntegrator.mjINT_EULER
        option.cone, option.solver = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtSolver.mjSOL_NEWTON
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        if hard:
            solref = HARD["solref"][0] * dt, HARD["solref"][1]
            for reference in (model.geom_solref, model.jnt_solref, model.tendon_solref_lim):
                reference[:] = solref
            for impedance in (model.geom_solimp, model.jnt_solimp, model.tendon_solimp_lim):
                impedance[:] = HARD["solimp"]
        joints = [j for j in all_joints(marionette.tree) if j.role is tree.Role.DYNAMIC]
        q = np.zeros(marionette.coordinates.n_qD, dtype=int)
        v = np.zeros(marionette.coordinates.n_vD, dtype=int)
        for joint in joints:
            place = model.joint(joint.name)
            q[joint.q] = place.qposadr[0] + np.arange(len(q[joint.q]))
            v[joint.v] = place.dofadr[0] + np.arange(len(v[joint.v]))
        return cls(model, mujoco.MjData(model), q, v)

    def choose(self, settings: dict) -> None:
        """Applies one of ``SETTINGS``."""
        option = self.model.opt
        option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{settings['jacobian'].upper()}")
        island = int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
        option.disableflags &= ~island
        if not settings["islands"]:
            option.disableflags |= island
        self.settings = settings

    def put(self, x: State) -> None:
        """Sets the state."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self.q_D], self.data.qvel[self.v_D] = x.q_D, x.v_D

    def step(self, n: int) -> None:
        """Makes n steps."""
        mujoco.mj_step(self.model, self.data, n)

    def burst(self, x: State, n: int, warm_up: int) -> float:
        """Processor time of a step [s], after a warm-up from the same state."""
        self.put(x)
        self.step(warm_up)
        self.put(x)
        start = time.thread_time()
        self.step(n)
        took = time.thread_time() - start
        if not np.all(np.isfinite(self.data.qpos)):
            raise RuntimeError("MuJoCo's burst is not finite")
        return took / n

    def find_fastest(self, x: State, n: int, tries: int) -> dict[str, float]:
        """Times all settings, and keeps the fastest: setting -> shortest time of a step [s]."""
        shortest = dict.fromkeys(range(len(SETTINGS)), math.inf)
        for _, (i, settings) in itertools.product(range(tries), enumerate(SETTINGS)):
            self.choose(settings)
            shortest[i] = min(shortest[i], self.burst(x, n, n // 4))
        self.choose(SETTINGS[min(shortest, key=lambda i: shortest[i])])
        return {settings_name(SETTINGS[i]): seconds for i, seconds in shortest.items()}

    def trajectories(self, states: list[State], steps: int, threads: int) -> float:
        """Time of a rollout from several states on several threads [s]."""
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.empty((len(states), mujoco.mj_stateSize(self.model, full)))
        for row, x in zip(start, states, strict=True):
            self.put(x)
            mujoco.mj_getState(self.model, self.data, row, full)
        data = [mujoco.MjData(self.model) for _ in range(threads)]
        out = np.zeros((len(states), steps, start.shape[1]))
        with rollout.Rollout(nthread=threads) as pool:
            began = time.perf_counter()
            pool.rollout(self.model, data, start, nstep=steps, state=out)
            took = time.perf_counter() - began
        if not np.isfinite(out).all():
            raise RuntimeError("a rollout of MuJoCo is not finite")
        return took

    @property
    def points(self) -> int:
        """Number of contacts with a force."""
        self.forward()
        return sum(self.force(i)[0] > 0.0 for i in range(self.data.ncon))

    @property
    def depth(self) -> float:
        """The deepest overlap [m]."""
        self.forward()
        return max([0.0, *(-float(d) for d in self.data.contact.dist)])

    def forward(self) -> None:
        """Computes the forces at the present state."""
        mujoco.mj_forward(self.model, self.data)

    def force(self, contact: int) -> Array:
        """(6,) force and torque of a contact in its frame: the normal first [N], [N m]."""
        out = np.zeros(6)
        mujoco.mj_contactForce(self.model, self.data, contact, out)
        return out


def settings_name(settings: dict) -> str:
    """``dense, islands``."""
    return settings["jacobian"] + (", islands" if settings["islands"] else "")


def scene_mjcf(marionette: Marionette, still: Array | None) -> str:
    """MJCF of the puppet with the solids that may touch; other bodies are excluded."""
    root = ElementTree.fromstring(mjcf(marionette, still))
    option = root.find("option")
    option.remove(option.find("flag"))
    bodies = {body.get("name"): body for body in root.iter("body")}
    world = root.find("worldbody")
    contacts = marionette.contacts
    touching = np.zeros(len(contacts.solids), dtype=bool)
    touching[contacts.pairs.ravel()] = True
    friction = f"{float(contacts.friction.max())!r} 0 0"
    shapes = [(link.name, s) for link in marionette.tree.links for s in link.shapes]
    for (name, shape), used in zip(shapes, touching, strict=False):
        if used:
            _geom(bodies[name], shape, friction)
    for obstacle in marionette.puppet.obstacles:
        _geom(world, obstacle, friction)
    floor = marionette.puppet.floor
    if floor is not None:
        size = f"{FLOOR_SIZE} {FLOOR_SIZE} 1"
        _add(
            world,
            "geom",
            type="plane",
            pos=f"0 0 {floor}",
            size=size,
            friction=friction,
            condim="3",
        )
    met = {frozenset(pair) for pair in contacts.names}
    moving = [link.name for link in marionette.tree.links if link.shapes and link.name in bodies]
    parents = {
        frozenset((link.name, marionette.tree.links[link.parent].name))
        for link in marionette.tree.links
        if link.parent != WORLD
    }
    left_out = _add(root, "contact")
    for pair in itertools.combinations(moving, 2):
        if frozenset(pair) not in met | parents:
            _add(left_out, "exclude", body1=pair[0], body2=pair[1])
    return ElementTree.tostring(root, encoding="unicode")


def _add(parent: ElementTree.Element, tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, attributes)


def _geom(body: ElementTree.Element, shape: Shape, friction: str) -> None:
    def words(*numbers: object) -> str:
        flat = np.concatenate([np.ravel(n) for n in numbers])
        return " ".join(repr(float(x)) for x in flat)

    attributes = {"friction": friction, "condim": "3"}
    match shape:
        case Capsule():
            attributes |= {"type": "capsule", "fromto": words(shape.from_, shape.to)}
            attributes["size"] = words(shape.radius)
        case Sphere():
            attributes |= {"type": "sphere", "pos": words(shape.at), "size": words(shape.radius)}
        case Ellipsoid():
            attributes |= {"type": "ellipsoid", "pos": words(shape.at), "size": words(shape.radii)}
        case Box():
            attributes |= {"type": "box", "pos": words(shape.at)}
            attributes["size"] = words(np.asarray(shape.size) / 2)
        case _:
            raise TypeError(f"{type(shape).__name__} has no counterpart here")
    if isinstance(shape, Ellipsoid | Box) and shape.orientation is not None:
        R = np.asarray(shape.orientation.matrix)
        attributes["xyaxes"] = words(R[:, 0], R[:, 1])
    _add(body, "geom", **attributes)
