"""MuJoCo as a peer: the installed versions, their fastest settings, timed bursts."""

from __future__ import annotations

import itertools
import json
import math
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

from fantoccini.base.arrays import Array

from .by_joint import Joint, dynamic_joints, pack_rates
from .subject import DT, still_tree

WORKER = Path(__file__).with_name("mujoco_worker.py")

SOLVERS = ("Newton", "CG", "PGS")
JACOBIANS = ("dense", "sparse")
MODEL = "marionette"

CLOSE = 1e-3
"""Largest difference [m or rad] of a right setting from the reference after a burst."""


class PeerError(Exception):
    """A peer that is not installed, or gave no answer."""


@dataclass
class MuJoCo:
    """One version of MuJoCo, running.

    Attributes:
        version: version that it reports.
        fastest: integrator -> the fastest settings.
        tried: all timed settings.
    """

    process: subprocess.Popen
    version: str = ""
    fastest: dict[str, dict] = field(default_factory=dict)
    tried: list[Tried] = field(default_factory=list)

    @classmethod
    def start(cls, python: str) -> MuJoCo:
        """The version of an interpreter.

        Raises:
            PeerError: it has none.
        """
        try:
            process = subprocess.Popen(
                [python, str(WORKER)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        except OSError:
            raise PeerError("not installed") from None
        return cls(process)

    def load(self, text: str, name: str = MODEL) -> None:
        """A model from its MJCF text."""
        self.version = self.ask("load", name=name, text=text)["version"]

    def ask(self, task: str, **request) -> dict:
        """The worker's answer to a request.

        Raises:
            PeerError: it has ended, or reports a failure.
        """
        try:
            self.process.stdin.write(json.dumps({"task": task, **request}) + "\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise PeerError("not installed" if not self.version else "it ended")
        answer = json.loads(line)
        if "error" in answer:
            raise PeerError(answer["error"])
        return answer

    def stop(self) -> None:
        """Ends the process."""
        self.process.stdin.close()
        self.process.wait()

    def acceleration(self, q_D: Array, v_D: Array) -> Array:
        """(n_vD,) without strings, in our order."""
        q, v = state_by_joint(q_D, v_D)
        return pack_rates(still_tree(), self.ask("accelerate", model=MODEL, q=q, v=v)["acc"])

    def burst(self, settings: dict, q_D: Array, v_D: Array, steps: int) -> dict:
        """Steps from a state; ``seconds`` is the time of one step."""
        q, v = state_by_joint(q_D, v_D)
        return self.ask("step", model=MODEL, settings=settings, q=q, v=v, steps=steps)

    def trajectories(self, settings: dict, starts: list, steps: int, threads: int) -> float:
        """Time of a rollout from several (q_D, v_D) [s]."""
        states = [state_by_joint(q_D, v_D) for q_D, v_D in starts]
        answer = self.ask(
            "rollout", model=MODEL, settings=settings, states=states, steps=steps, threads=threads
        )
        if not answer["finite"]:
            raise PeerError("a rollout is not finite")
        return answer["seconds"]

    def find_fastest(self, q_D: Array, v_D: Array, steps: int, tries: int) -> None:
        """Times every solver and Jacobian, with and without islands; keeps the fastest right one.

        Dense Newton without islands is the reference; a setting with another end is wrong.
        """
        for integrator in ("Euler", "RK4"):
            candidates = [Tried(settings) for settings in all_settings(integrator)]
            for _ in range(tries):
                for candidate in candidates:
                    if candidate.wrong:
                        continue
                    try:
                        answer = self.burst(candidate.settings, q_D, v_D, steps)
                        candidate.wrong = _difference_text(
                            candidate.answer or candidates[0].answer or answer, answer
                        )
                        candidate.answer, candidate.seconds = (
                            answer,
                            min(candidate.seconds, answer["seconds"]),
                        )
                    except PeerError as error:
                        candidate.wrong = str(error)
            right = [candidate for candidate in candidates if not candidate.wrong]
            if not right:
                raise PeerError(f"no setting of {integrator} works: {candidates[0].wrong}")
            self.fastest[integrator] = min(right, key=lambda candidate: candidate.seconds).settings
            self.tried += candidates


@dataclass
class Tried:
    """A timed setting.

    Attributes:
        settings: settings in the worker's format.
        seconds: shortest time of a step [s].
        answer: answer to the last burst.
        wrong: its fault, or nothing.
    """

    settings: dict
    seconds: float = math.inf
    answer: dict | None = None
    wrong: str = ""

    @property
    def name(self) -> str:
        """``Newton, dense, islands``."""
        islands = ", islands" if self.settings["islands"] else ""
        return f"{self.settings['solver']}, {self.settings['jacobian']}{islands}"


def all_settings(integrator: str) -> list[dict]:
    """All settings that may be the fastest, the reference first."""
    return [
        {
            "integrator": integrator,
            "solver": solver,
            "jacobian": jacobian,
            "islands": islands,
            "timestep": DT,
        }
        for solver, jacobian, islands in itertools.product(SOLVERS, JACOBIANS, (False, True))
    ]


def state_by_joint(q_D: Array, v_D: Array) -> tuple[dict, dict]:
    """Positions and velocities by joint; MuJoCo's conventions are ours."""
    by_name: dict[str, Joint] = dynamic_joints(still_tree(), q_D, v_D)
    return {n: j.q for n, j in by_name.items()}, {n: j.v for n, j in by_name.items()}


def _difference_text(right: dict, other: dict) -> str:
    """Text on how the end of a burst differs from the reference; empty if they agree."""
    pairs = ((a, b) for n in right["q"] for a, b in zip(right["q"][n], other["q"][n], strict=True))
    apart = max(abs(a - b) for a, b in pairs)
    if not apart <= CLOSE:
        return f"ends {apart:.1g} away"
    slack = [name for name, pull in other["tension"].items() if not pull > 0.0]
    return f"{', '.join(slack)} slack" if slack else ""
