"""All installed peers, each with the same puppet, and the proof that it is the same."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import fantoccini as fan
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.mujoco import mjcf
from fantoccini.motion import State

from ..strings import ROOT
from ..strings.report import Section, Table, number
from .by_joint import anchored_strings
from .drake_peer import Drake
from .figures import Chapter
from .mujoco_peer import MuJoCo, PeerError
from .pinocchio_peer import Pinocchio
from .subject import DT, KNEES, hanging, marionette, still_air, swinging_state

OLDER = ROOT / ".venv-mujoco317" / "bin" / "python"
"""Interpreter with the older MuJoCo of ``make bench``."""

SAME = 1e-9
"""Difference of accelerations, relative to the largest, that makes a comparison void."""

CLOSE = 1e-3
"""The same for tensions at rest, relative to the weight, and for the lengths of strings [m]."""

SETTLED = 100
"""Number of steps after which strings have their tensions and little has moved."""

STIFF = {
    "integrator": "Euler",
    "solver": "Newton",
    "jacobian": "dense",
    "timestep": DT,
    "solref": [2 * DT, 1.0],
    "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0],
}
"""MuJoCo's strings as hard as they can be: their tensions at rest are those of rigid ones."""


@dataclass
class Peers:
    """The installed peers.

    Attributes:
        mujoco: name -> running version.
        pinocchio, drake: None if not installed.
        missing: name -> reason.
        checks: rows of the table that proves that all simulate the same puppet.
    """

    mujoco: dict[str, MuJoCo] = field(default_factory=dict)
    pinocchio: Pinocchio | None = None
    drake: Drake | None = None
    missing: dict[str, str] = field(default_factory=dict)
    checks: list[list[str]] = field(default_factory=list)

    @property
    def no_mujoco(self) -> str:
        """Reason why there is no MuJoCo."""
        return self.missing.get("MuJoCo", "not installed")

    def stop(self) -> None:
        """Ends the processes."""
        for peer in self.mujoco.values():
            peer.stop()


def start_peers(older: Path) -> Peers:
    """Starts and checks all of them.

    Args:
        older: interpreter with the older MuJoCo.
    """
    peers, hung = Peers(), anchored_strings(marionette(), hanging())
    whole, bare = peers_mjcf(strung=True), peers_mjcf(strung=False)

    def admit(name: str, start: Callable[[], Any], rest: Callable | None = None):
        try:
            peer = start()
            accelerations, rested = _acceleration_difference(peer), rest(peer) if rest else None
        except PeerError as error:
            peers.missing[name] = str(error)
            return None
        right = accelerations <= SAME and (rested is None or rested <= CLOSE)
        peers.checks.append(
            [
                name,
                peer.version,
                number(accelerations),
                "-" if rested is None else number(rested),
                "yes" if right else "**no**",
            ]
        )
        if not right:
            peers.missing[name] = "void: it is not the same puppet"
        return peer if right else None

    for name, python in (("MuJoCo", sys.executable), ("MuJoCo 3.17", str(older))):
        version = admit(name, functools.partial(_mujoco, python, whole), _tension_difference)
        if version:
            peers.mujoco[name] = version
    peers.pinocchio = admit("Pinocchio", lambda: Pinocchio(bare))
    peers.drake = admit("Drake", lambda: Drake(bare, hung), _stretch)
    return peers


def chapter(peers: Peers) -> Chapter:
    """The section with the proof."""
    rows = [*peers.checks, *([name, why, "-", "-", "-"] for name, why in peers.missing.items())]
    header = ["peer", "version", "accelerations apart", "strings apart", "same puppet"]
    speed, limits = float(np.abs(swinging_state().v_D).max()), len(marionette().tree.limits)
    text = (
        "All programs simulate the bundled `marionette`: 25 DOF, 7 strings, all taut, hanging "
        f"and swinging gently (velocities up to {number(speed)} m/s or rad/s), with fixed upper "
        "ends. The other programs read it as MJCF: the same masses, inertia, joints and damping; "
        "strings are tendons with a limited length in MuJoCo and distances in Drake. Pinocchio's "
        "constrained dynamics has no distance constraints, so it is measured without strings. "
        "The other programs do not compute the costume's drag and the neck's spring, which they "
        f"do not have in the same form, the {limits} limits of the joints, and moving strings. "
        "Ours computes all of them."
    )
    proof = (
        "Before the measurement, models are compared: unconstrained accelerations at random "
        f"states, relative to the largest, must agree to {number(SAME)}. MuJoCo's tensions of the "
        "hanging puppet with its hardest strings, relative to the weight, and the length error "
        f"of Drake's strings after half a second [m] must be within {number(CLOSE)}."
    )
    return Chapter(Section("1. The same puppet", [text, proof, Table(header, rows)]))


def peers_mjcf(strung: bool) -> str:
    """MJCF of the peers' puppet, with fixed ends of the strings.

    Args:
        strung: whether it has its strings.
    """
    puppet = still_air() if strung else still_air().model_copy(update={"strings": ()})
    return mjcf(fan.Marionette(puppet), hanging().q_K)


def _mujoco(python: str, text: str) -> MuJoCo:
    peer = MuJoCo.start(python)
    peer.load(text)
    return peer


@functools.cache
def _resting_peer() -> tuple[fan.Marionette, State]:
    """The peers' puppet as our marionette, at rest."""
    puppet = fan.Marionette(still_air())
    return puppet, puppet.rest(KNEES)


def _acceleration_difference(peer) -> float:
    """The largest difference at several states, relative to the largest acceleration."""
    puppet, rest = _resting_peer()
    worst = 0.0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        q_D = rest.q_D + 0.3 * rng.normal(size=len(rest.q_D))
        for q, _ in puppet.coordinates.quaternions_D:
            q_D[q : q + 4] /= np.linalg.norm(q_D[q : q + 4])
        x = rest.replace(q_D=q_D, v_D=rng.normal(size=len(rest.v_D)))
        instant = Evaluation.at_state(puppet, x)
        ours = instant.solve_factor(instant.w0)
        worst = max(
            worst,
            float(np.abs(peer.acceleration(x.q_D, x.v_D) - ours).max()) / float(np.abs(ours).max()),
        )
    return worst


def _tension_difference(peer: MuJoCo) -> float:
    puppet, x = _resting_peer()
    tension = peer.burst(STIFF, x.q_D, x.v_D, SETTLED)["tension"]
    _, ours = puppet.forward_dynamics(x)
    names = [s.name for s in puppet.tree.strings]
    apart = max(abs(tension[n] - t) for n, t in zip(names, ours, strict=False))
    return float(apart) / puppet.weight


def _stretch(peer: Drake) -> float:
    _, x = _resting_peer()
    return peer.stretch(x.q_D, x.v_D)
