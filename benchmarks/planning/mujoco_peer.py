"""A puppet in MuJoCo whose strings follow what drives them.

The text is that of :mod:`benchmarks.speed.exported`; strings and limits are as stiff as the
stiffest of :mod:`benchmarks.strings.mujoco_peer`. A string's driven end and its winch are slides so
heavy that nothing moves them: the winch stands away from the end by what is wound in, so that
MuJoCo knows how fast both go. They are put right at every look.
"""

from __future__ import annotations

import mujoco
import numpy as np
from benchmarks.speed.exported import Anchored, joints, mjcf, packed, strings

from fantoccini.arrays import Array
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.tree import LimitRow, Role, Tree

_HEAVY = 1e5
"""Inertia of a slide [kg]; a puppet pulls with some newtons."""

_REEL = 10.0
"""Length of a string with what is wound in [m]."""

_FAR = 100.0
"""Bound of a side that has none [rad]."""

_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "reel": (0, 0, 1)}


class Peer:
    """A puppet, its strings and its limits in MuJoCo.

    Attributes:
        x: where it is.

    Args:
        marionette: the puppet; each of its strings leads from a body to a driven end.
        x0: where it starts.
        dt: step [s].
    """

    def __init__(self, marionette: Marionette, x0: State, dt: float = 0.001):
        tree, hung = marionette.tree, strings(marionette, x0)
        spec = mujoco.MjSpec.from_string(mjcf(tree, hung))
        option = spec.option
        option.timestep, option.integrator = dt, mujoco.mjtIntegrator.mjINT_RK4
        # The heavy slides make tolerances, which are relative, coarse for the puppet.
        option.tolerance, option.iterations = 1e-20, 200
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        stiff = {
            "solref_limit": np.array([2.0 * dt, 1.0]),
            "solimp_limit": np.array([0.9999, 0.9999, 0.001, 0.5, 2.0]),
        }
        for string in hung:
            _lead(spec, string, stiff)
        for limit in tree.limits:
            _limit(spec.joint(tree.links[limit.link].joint), limit, stiff)
        self.x, self._tree, self._stands = x0, tree, {s.name: s.world for s in hung}
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        slides = [self._model.joint(f"{s.name}.{axis}") for s in hung for axis in _AXES]
        self._q = np.array([slide.qposadr[0] for slide in slides])
        self._v = np.array([slide.dofadr[0] for slide in slides])
        # Ends are sums of driven coordinates, and a length is one of them.
        changes = np.concatenate([np.zeros((1, len(x0.q_K))), np.eye(len(x0.q_K))])
        places = np.array([self._slid(marionette, q_K) for q_K in x0.q_K + changes])
        self._slopes = (places[1:] - places[0]).T
        self._base = places[0] - self._slopes @ x0.q_K
        for name, joint in joints(tree, x0.q_D, x0.v_D).items():
            there = self._data.joint(name)
            there.qpos[:], there.qvel[:] = joint.q, joint.v

    def advance(self, duration: float, acc_K: Array) -> State:
        """Goes on with constant accelerations of the driven coordinates.

        Args:
            duration: a multiple of the step [s].
            acc_K: (n_vK,).
        """
        data, x = self._data, self.x
        data.qpos[self._q] = self._base + self._slopes @ x.q_K
        data.qvel[self._v] = self._slopes @ x.v_K
        data.qfrc_applied[self._v] = _HEAVY * (self._slopes @ acc_K)
        mujoco.mj_step(self._model, data, round(duration / self._model.opt.timestep))
        names = list(joints(self._tree, x.q_D, x.v_D))
        q_D = _configuration(self._tree, {n: data.joint(n).qpos for n in names})
        self.x = State(
            x.t + duration,
            q_D,
            packed(self._tree, {n: data.joint(n).qvel for n in names}),
            x.q_K + duration * (x.v_K + 0.5 * duration * acc_K),
            x.v_K + duration * acc_K,
            x.taut,
            x.slip,
        )
        return self.x

    def _slid(self, marionette: Marionette, q_K: Array) -> Array:
        """(4 strings,) where the slides are."""
        found = strings(marionette, self.x.replace(q_K=q_K))
        return np.concatenate(
            [[*np.subtract(s.world, self._stands[s.name]), _REEL - s.length] for s in found]
        )


def _configuration(tree: Tree, places: dict[str, Array]) -> Array:
    """(n_qD,) from those of the joints."""
    out = np.zeros(tree.coordinates.n_qD)
    for link in tree.links:
        if link.role is Role.DYNAMIC:
            out[link.q] = places[link.joint]
    return out


def _lead(spec: mujoco.MjSpec, string: Anchored, stiff: dict[str, Array]) -> None:
    """Leads a string over its end, that moves, to a winch."""
    end = f"{string.name}.end"
    spec.delete(spec.site(end))
    spec.delete(spec.tendon(string.name))
    body = spec.worldbody.add_body(name=end, pos=string.world)
    body.add_site(name=end)
    winch = body.add_body(name=f"{string.name}.winch")
    winch.add_site(name=winch.name)
    for part in (body, winch):
        part.mass, part.inertia, part.explicitinertial = 1.0, np.ones(3), True
    for name, axis in _AXES.items():
        (winch if name == "reel" else body).add_joint(
            name=f"{string.name}.{name}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis,
            armature=_HEAVY,
        )  # fmt: skip
    tendon = spec.add_tendon(name=string.name, limited=True, range=[0.0, _REEL], **stiff)
    for site in (winch.name, end, string.name):
        tendon.wrap_site(site)


def _limit(joint: mujoco.MjsJoint, limit: LimitRow, stiff: dict[str, Array]) -> None:
    """Limits a hinge on one side; the other may be limited already."""
    if limit.side not in ("lower", "upper"):
        raise ValueError(f"{limit.name}: only hinges are limited here")
    low, high = (
        joint.range if joint.limited == mujoco.mjtLimited.mjLIMITED_TRUE else (-_FAR, _FAR)
    )
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.range = [limit.bound, high] if limit.side == "lower" else [low, limit.bound]
    joint.solref_limit, joint.solimp_limit = stiff["solref_limit"], stiff["solimp_limit"]
