"""The result of an optimisation.

An event-driven run locates the times at which strings become slack or taut. acc_K are the
accelerations of the driven coordinates, the ends and lengths of strings. A node is a time at which
the inputs may change, with its state; an interval leads to the next node.
"""

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
    Bounds,
    ClosestApproach,
    NodeKinematics,
    Nodes,
    Task,
    Track,
    track_path,
    track_residual,
)
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, Trajectory

_GAIN_DAMPING = 1e-6
"""Damping of the Hessian for gains, in units of the cost."""


@dataclass(frozen=True, eq=False)
class Optimum(Answer):
    """The best motion, as an event-driven run. It is true if it is ``SOLVED``; see :class:`Answer`.

    With contact, ``status`` may be ``NO_RUN``; then all results are those of time steps.

    Attributes:
        task: the task.
        status: status at the end of the search.
        run: the event-driven run.
        inputs: motion of the driven coordinates.
        cost: J of the run.
        kkt: residual of the conditions of optimality: the largest of ``stationarity``, the error at
            the end and the violation of bounds. Its derivatives are those of time steps, or exact
            ones; see :func:`fantoccini.optimise`.
        stationarity: for the last step, the larger of the change of the cost's gradient along it,
            relative to the gradient, and of the decrease predicted by the slope, relative to J.
        violation: largest violation of bounds in the run [N, m, rad or their rates].
        end_gap: largest error at the end, or distance from a place of the end [m, rad or their
            rates].
        closest_approaches: distances and times of the run's closest approaches to the places of
            touches and of the end.
        iterations: number of iterations.
        seconds: time that they took [s].
        curve: (seconds, cost) after every iteration.
        reason: bound, coordinate and time of the largest residual, if it is not solved; with
            ``GUESS``, of the motion at which the search ended.
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
    closest_approaches: tuple[ClosestApproach, ...]
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
    def bounds(self) -> Bounds:
        """Bounds of the search: the task's, and those of strings that must stay taut."""
        return self._objective.task.bounds

    @property
    def parameters(self) -> dict[str, float]:
        """The values of the parameters that were chosen."""
        names = self._runs.free_parameters.names
        return dict(zip(names, self.nodes.parameters.tolist(), strict=True))

    @property
    def marionette(self) -> Marionette:
        """The puppet with the parameters that were chosen."""
        return self._runs.free_parameters.marionette(self.nodes.parameters)

    @property
    def t(self) -> Times:
        """(N + 1,) times of the nodes [s]."""
        return self.nodes.t

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def costate(self) -> Array | None:
        """(N, n) multipliers of the dynamics in the last step; None if there was no step."""
        solution = self._iterate.solution
        return None if solution is None else solution.costate

    @property
    def gains(self) -> Array:
        """(N, n_vK, n_z) gains K of the best feedback near the motion, acc_K += K (x - x_node).

        z = (dq_D, dv_D, dq_K, dv_K); for the cost without jerks, without active bounds.
        """
        iterate = self._iterate
        linear = self._runs.linearise(iterate.nodes, iterate.ends)
        task = replace(
            self.task,
            bounds=self.bounds,
            marionette=self.marionette,
            parameters={},
            duration=self.nodes.interval * len(self.nodes),
            smooth=replace(self.task.smooth, jerk=0.0),
        )
        objective = Objective(task)
        nodes = replace(iterate.nodes, parameters=np.zeros(0))
        objective.set_unit(nodes, linear)
        program = objective.program(nodes, linear, _GAIN_DAMPING * objective.unit, iterate.force)
        return objective.expanded_gains(program.gains)

    def errors(self) -> dict[str, Array]:
        """Name of every track -> (N + 1,) |r| at the nodes, the distance from its path.

        If several tracks have one name, the later ones have their kind or index added.
        """
        evaluation = NodeKinematics(self.marionette, self.nodes)
        errors = {}
        for name, track in self._named_tracks():
            if track.kind == "tension":
                continue
            r = track_residual(self.task.marionette, track, self.nodes).value(evaluation)
            errors[name] = np.linalg.norm(r, axis=1)
        return errors

    def rms(self) -> dict[str, float]:
        """Name of every track -> root mean square of :meth:`errors`."""
        return {name: float(np.sqrt(np.mean(np.square(e)))) for name, e in self.errors().items()}

    def paths(self) -> dict[str, tuple[Array, Array]]:
        """Name of every body with a tracked point -> (N + 1, 3) path and positions of the point."""
        evaluation = NodeKinematics(self.marionette, self.nodes)
        paths = {}
        for name, track in self._named_tracks():
            if track.kind != "point":
                continue
            offset = track_residual(self.task.marionette, track, self.nodes).value(evaluation)
            path = self.target(track)
            paths[name] = path, path + offset
        return paths

    def _named_tracks(self) -> list[tuple[str, Track]]:
        """The tracks with distinct names."""
        tracks: dict[str, Track] = {}
        for k, track in enumerate(self.task.tracks):
            candidates = (
                track.name,
                f"{track.name} ({track.kind})",
                f"{track.name} ({track.kind} {k})",
            )
            tracks[next(name for name in candidates if name not in tracks)] = track
        return list(tracks.items())

    def target(self, track: Track) -> Array:
        """(N + 1, m) path of a track at the nodes."""
        return track_path(self.task.marionette, track, self.t)

    def plot(self, path: str | Path, **options: Any) -> Path:
        """Draws the puppet with the paths of its points, its errors, tensions and inputs.

        Args:
            path: path of the picture; ends in ``.png``, ``.svg`` or ``.pdf``.
            options: options of :func:`fantoccini.output.optimum_picture`.
        """
        return output().optimum_picture(self, path, **options)

    @property
    def message(self) -> str:
        """Description of the search's end, with the largest residual if it is not solved."""
        return self.status.message + (f": {self.reason}" if self.reason else "")

    @property
    def is_exact(self) -> bool:
        """Whether ``kkt`` uses derivatives of the run itself, not those of time steps."""
        if isinstance(self._runs, ExactRuns):
            return not self._runs.reasons
        return isinstance(self._runs, HybridRuns)

    @property
    def reservations(self) -> list[str]:
        """Sentences on results that the status does not guarantee."""
        nodes = self.nodes
        grid = f"{len(nodes)} intervals of {nodes.interval:.4g} s"
        sentences = [
            f"bounds are kept at the nodes, accelerations are constant over {grid}: shorter "
            "intervals may save more, and other local minima may be lower"
        ]
        if not self.is_exact:
            reason = f" ({self._runs.reasons[-1]})" if isinstance(self._runs, ExactRuns) else ""
            sentences.append(
                f"the residual is by derivatives of time steps of at most {self.task.dt:g} s, "
                f"which differ from those of the run in the order of the step{reason}"
            )
        return sentences

    def summary(self) -> str:
        """Description of the result, in lines."""
        lines = [f"{self.status.name}: {self.message}"]
        lines.append(
            f"cost {self.cost:.6g}, KKT residual {self.kkt:.2g}, {self.iterations} "
            f"iterations in {self.seconds:.2f} s"
        )
        for name, value in self.parameters.items():
            lines.append(f"{name} = {value:.6g}")
        for name, e in self.rms().items():
            lines.append(f"{name}: {e:.3g} from its path (root mean square)")
        lines += [str(approach) for approach in self.closest_approaches]
        if self.task.required_end is not None:
            lines.append(f"ends within {self.end_gap:.2g} of the required state")
        if self.violation:
            lines.append(f"bounds passed by {self.violation:.3g}")
        lines += self.reservations
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Writes the run; see :meth:`Trajectory.save`."""
        self.run.save(path)
