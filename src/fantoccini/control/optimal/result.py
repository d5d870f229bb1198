"""What an optimisation found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import Array, Times, output
from fantoccini.control.optimal.hybrid import ExactRuns, HybridRuns
from fantoccini.control.optimal.objective import Objective
from fantoccini.control.optimal.shooting import EventRuns
from fantoccini.control.optimal.sqp import Iterate
from fantoccini.control.tasks import (
    Answer,
    AnswerStatus,
    Looks,
    Nodes,
    Task,
    Touched,
    Track,
    path_of,
    residual_of,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, Trajectory

_DAMPING = 1e-6
"""Of the Hessian of gains, in units of the cost."""


@dataclass(frozen=True, eq=False)
class Optimum(Answer):
    """The best motion found, as an event-driven run. True where it is ``SOLVED``; see
    :class:`Answer`.

    Where ``status`` is ``NO_RUN``, which with contact it may be, all is of time steps.

    Attributes:
        task: what was asked for.
        status: how the search ended.
        run: the event-driven run.
        inputs: motion of the driven coordinates.
        cost: J of the run.
        kkt: residual of the conditions of optimality: the largest of ``stationarity``, of what is
            left at the end and of violated bounds. Its derivatives are those of time steps, or
            exact ones; see :func:`fantoccini.optimise`.
        stationarity: of the step before, the larger of the change of the cost's gradient along it,
            relative to the gradient, and of the decrease that the slope promises, relative to J.
        violation: how far the run is beyond its bounds [N, m, rad or their rates].
        end_gap: how far it ends from the end asked for [m, rad or their rates].
        touched: how near the run came to the places of the task's touches, and when.
        iterations: made.
        seconds: they took [s].
        curve: (seconds, cost) after every iteration.
        reason: the bound, coordinate and time of the largest residual, where it is not solved.
    """

    task: Task
    status: AnswerStatus
    run: Trajectory
    inputs: Input
    cost: float
    kkt: float
    stationarity: float
    violation: float
    end_gap: float
    touched: tuple[Touched, ...]
    iterations: int
    seconds: float
    curve: tuple[tuple[float, float], ...]
    reason: str
    _iterate: Iterate
    _objective: Objective
    _runs: EventRuns

    def __repr__(self) -> str:
        return (
            f"<Optimum {self.status.name}: cost {self.cost:.6g}, KKT {self.kkt:.2g}, "
            f"{self.iterations} iterations, {self.seconds:.2f} s>"
        )

    @property
    def nodes(self) -> Nodes:
        """States at the nodes, and the accelerations between them."""
        return self._iterate.nodes

    @property
    def parameters(self) -> dict[str, float]:
        """The values of the parameters that were chosen."""
        names = self._runs.chosen.names
        return dict(zip(names, self.nodes.parameters.tolist(), strict=True))

    @property
    def marionette(self) -> Marionette:
        """The puppet, with the parameters that were chosen."""
        return self._runs.chosen.marionette(self.nodes.parameters)

    @property
    def t(self) -> Times:
        """(N + 1,) times of the nodes [s]."""
        return self.nodes.t

    @property
    def costate(self) -> Array | None:
        """(N, n) multipliers of the dynamics in the last step; None where none was made."""
        solution = self._iterate.solution
        return None if solution is None else solution.costate

    @property
    def gains(self) -> Array:
        """(N, n_vK, n_z) K of the best feedback near the motion, acc_K += K (x - x_node).

        z = (dq_D, dv_D, dq_K, dv_K); of the cost without jerks, with no bound in force.
        """
        at = self._iterate
        linear = self._runs.linearise(at.nodes, at.ends)
        task = replace(
            self.task,
            marionette=self.marionette,
            parameters={},
            duration=self.nodes.interval * len(self.nodes),
            smooth=replace(self.task.smooth, jerk=0.0),
        )
        objective = Objective(task)
        nodes = replace(at.nodes, parameters=np.zeros(0))
        objective.take_unit(nodes, linear)
        program = objective.program(nodes, linear, _DAMPING * objective.unit, at.force)
        return objective.widened_gains(program.gains)

    def errors(self) -> dict[str, Array]:
        """Name of every track -> (N + 1,) |r| at the nodes: how far from its path.

        Where several tracks have one name, the later ones have their kind or place as well.
        """
        looks = Looks(self.marionette, self.nodes)
        out = {}
        for name, track in self._named():
            if track.kind == "tension":
                continue
            r = residual_of(self.task.marionette, track, self.nodes).value(looks)
            out[name] = np.linalg.norm(r, axis=1)
        return out

    def rms(self) -> dict[str, float]:
        """Name of every track -> root mean square of :meth:`errors`."""
        return {name: float(np.sqrt(np.mean(np.square(e)))) for name, e in self.errors().items()}

    def paths(self) -> dict[str, tuple[Array, Array]]:
        """Name of every body of a point that is tracked -> (N + 1, 3) its path, and where it is."""
        looks = Looks(self.marionette, self.nodes)
        out = {}
        for name, track in self._named():
            if track.kind != "point":
                continue
            off = residual_of(self.task.marionette, track, self.nodes).value(looks)
            path = self.target(track)
            out[name] = path, path + off
        return out

    def _named(self) -> list[tuple[str, Track]]:
        """The tracks with names of their own."""
        out: dict[str, Track] = {}
        for k, track in enumerate(self.task.tracks):
            tries = (track.name, f"{track.name} ({track.kind})", f"{track.name} ({track.kind} {k})")
            out[next(name for name in tries if name not in out)] = track
        return list(out.items())

    def target(self, track: Track) -> Array:
        """(N + 1, m) the path of a track at the nodes."""
        return path_of(self.task.marionette, track, self.t)

    def plot(self, path: str | Path, **options: Any) -> Path:
        """Draws the puppet with the paths of its points, its errors, tensions and inputs.

        Args:
            path: ends in ``.png``, ``.svg`` or ``.pdf``.
            options: of :func:`fantoccini.output.optimum_picture`.
        """
        return output().optimum_picture(self, path, **options)

    @property
    def message(self) -> str:
        """How the search ended, with the largest residual where it is not solved."""
        return self.status.message + (f": {self.reason}" if self.reason else "")

    @property
    def is_exact(self) -> bool:
        """Whether ``kkt`` is by the derivatives of the run itself, not by those of time steps."""
        if isinstance(self._runs, ExactRuns):
            return not self._runs.reasons
        return isinstance(self._runs, HybridRuns)

    @property
    def reservations(self) -> list[str]:
        """Sentences on what the status does not guarantee."""
        nodes = self.nodes
        grid = f"{len(nodes)} intervals of {nodes.interval:.4g} s"
        found = [
            f"bounds are kept at the nodes, accelerations are constant over {grid}: shorter "
            "intervals may save more, and other local minima may be lower"
        ]
        if not self.is_exact:
            why = f" ({self._runs.reasons[-1]})" if isinstance(self._runs, ExactRuns) else ""
            found.append(
                f"the residual is by derivatives of time steps of at most {self.task.dt:g} s, "
                f"which differ from those of the run in the order of the step{why}"
            )
        return found

    def summary(self) -> str:
        """What was found, in lines."""
        lines = [f"{self.status.name}: {self.message}"]
        lines.append(
            f"cost {self.cost:.6g}, KKT residual {self.kkt:.2g}, {self.iterations} "
            f"iterations in {self.seconds:.2f} s"
        )
        for name, value in self.parameters.items():
            lines.append(f"{name} = {value:.6g}")
        for name, e in self.rms().items():
            lines.append(f"{name}: {e:.3g} from its path (root mean square)")
        lines += [str(one) for one in self.touched]
        if self.task.goal is not None:
            lines.append(f"ends within {self.end_gap:.2g} of the state asked for")
        if self.violation:
            lines.append(f"bounds passed by {self.violation:.3g}")
        lines += self.reservations
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Writes the run; see :meth:`Trajectory.save`."""
        self.run.save(path)
