"""What an optimisation found."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fantoccini.arrays import Array, Times
from fantoccini.motion import Input, Trajectory
from fantoccini.optimal.gains import riccati_gains
from fantoccini.optimal.nodes import Nodes
from fantoccini.optimal.objective import Objective
from fantoccini.optimal.residuals import Looks, residual_of
from fantoccini.optimal.shooting import EventRuns
from fantoccini.optimal.sqp import Iterate
from fantoccini.optimal.task import Task


class OptimalStatus(enum.Enum):
    """How an optimisation ended."""

    SOLVED = "the residual of the conditions of optimality is below the tolerance"
    SETTLED = "steps save hardly any cost any more; the residual is above the tolerance"
    STALLED = "no step lowers the cost any more, but the residual is above the tolerance"
    ITERATIONS = "the iterations ended first; this is the best motion so far"
    TIMEOUT = "the time ended first; this is the best motion so far"
    STOPPED = "it was interrupted; this is the best motion so far"
    VIOLATED = "the motion leaves its bounds, or does not reach its end"

    @property
    def message(self) -> str:
        """In words."""
        return self.value


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best motion found, as an event-driven run. True where it holds its bounds and its end.

    Attributes:
        task: what was asked for.
        status: how the search ended.
        run: the event-driven run.
        inputs: motion of the driven coordinates.
        cost: J of the run.
        kkt: residual of the conditions of optimality: the largest of ``stationarity``, of what is
            left at the end and of violated bounds. Its derivatives are those of time steps.
        stationarity: largest change of the cost's slope over the last step, relative to 1 or the
            largest slope.
        violation: how far the run is beyond its bounds [N, m, rad or their rates].
        end_gap: how far it ends from the end asked for [m, rad or their rates].
        iterations: made.
        seconds: they took [s].
        curve: (seconds, cost) after every iteration.
    """

    task: Task
    status: OptimalStatus
    run: Trajectory
    inputs: Input
    cost: float
    kkt: float
    stationarity: float
    violation: float
    end_gap: float
    iterations: int
    seconds: float
    curve: tuple[tuple[float, float], ...]
    _iterate: Iterate
    _objective: Objective
    _runs: EventRuns

    def __bool__(self) -> bool:
        return self.status is not OptimalStatus.VIOLATED

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

        z = (dq_D, dv_D, dq_K, dv_K); of the cost with no bound in force.
        """
        at = self._iterate
        linear = self._runs.linearise(at.nodes, at.ends)
        program = self._objective.program(at.nodes, linear, at.damping, at.force)
        return self._objective.widened_gains(riccati_gains(program))

    def errors(self) -> dict[str, Array]:
        """Name of every track -> (N + 1,) |r| at the nodes: how far from its path."""
        looks = Looks(self.task.marionette, self.nodes)
        out = {}
        for track in self.task.tracks:
            if track.kind == "tension":
                continue
            r = residual_of(self.task.marionette, track, self.nodes).value(looks)
            out[track.name] = np.linalg.norm(r, axis=1)
        return out

    def rms(self) -> dict[str, float]:
        """Name of every track -> root mean square of :meth:`errors`."""
        return {name: float(np.sqrt(np.mean(np.square(e)))) for name, e in self.errors().items()}

    def summary(self) -> str:
        """What was found, in lines."""
        lines = [f"{self.status.name}: {self.status.message}"]
        lines.append(f"cost {self.cost:.6g}, KKT residual {self.kkt:.2g}, {self.iterations} "
                     f"iterations in {self.seconds:.2f} s")  # fmt: skip
        for name, e in self.rms().items():
            lines.append(f"{name}: {e:.3g} from its path (root mean square)")
        if self.task.end is not None:
            lines.append(f"ends within {self.end_gap:.2g} of the state asked for")
        if self.violation:
            lines.append(f"bounds passed by {self.violation:.3g}")
        return "\n".join(lines)

    def save(self, path: str | Path) -> None:
        """Writes the run; see :meth:`Trajectory.save`."""
        self.run.save(path)
