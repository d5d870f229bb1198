"""Event-driven runs with exact derivatives of their intervals, through releases and catches.

    z_{i+1} = A_i z_i + B_i u_i,   z = (dq_D, dv_D, dq_K, dv_K)

Between events the variational equation holds. At a catch z jumps by the saltation matrix, which
eliminates the time of the event by its guard h = 0
(:mod:`fantoccini.dynamics.simulation.intervals`).

At a release, a string loses its tension and goes slack; at a catch it becomes taut again, with an
impulse. h is the gap of a string, its path length minus its own. dq_D and dq_K are changes of
dynamic and driven coordinates; u_i are the driven accelerations acc_K in interval i. A node is a
time at which the inputs may change, with its state; an interval leads to the next node.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fantoccini.base import Array, SimulationError, StateError, Status
from fantoccini.control.optimal.dynamics import Ends, LinearEnds
from fantoccini.control.optimal.shooting import EventRuns, simulate_uninterrupted
from fantoccini.control.tasks import Nodes
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation import interval_derivatives
from fantoccini.motion import Trajectory

_SAME_TIME = 1e-12
"""Largest difference of times that count as equal [s]."""


class HybridRuns(EventRuns):
    """Event-driven runs, with the exact derivatives of their intervals."""

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`.

        Raises:
            SimulationError, StateError: catch without a derivative.
        """
        marionette, inputs = self.free_parameters.marionette(nodes.parameters), nodes.inputs()
        x0 = self.free_parameters.start(nodes.parameters)
        run = simulate_uninterrupted(marionette, x0, inputs, nodes.t[-1])  # with samples at breaks
        if run.status is not Status.DONE:
            raise SimulationError(run.status, f"at t = {run.t[-1]:.6g} s")
        derivatives = interval_derivatives(marionette, run, inputs)
        sample = np.searchsorted(run.t, nodes.t[1:] - _SAME_TIME)  # breaks and events have two
        rates = (run.v_D[sample], run.acc_D[sample], run.v_K[sample], nodes.acc_K)
        N, n_s = len(nodes), nodes.n_z + nodes.acc_K.shape[1]
        columns = self.free_parameters.columns
        n_p = len(marionette.p)
        pull = np.zeros((N, ends.tension.shape[1], n_s + n_p))
        acc = np.zeros((N, nodes.v_D.shape[1], n_s + n_p))
        if self.steps.with_tension:
            pull, acc = _tension_derivatives(marionette, run, nodes)
        by_p, zeros = derivatives.C[..., columns], np.zeros((nodes.n_z, 1))
        return LinearEnds(
            ends.e,
            ends.tension,
            ends.taut,
            ends.settled,
            derivatives.A,
            derivatives.B,
            pull[..., :n_s],
            acc[..., :n_s],
            dend_c=np.concatenate([np.concatenate(rates, axis=1)[..., None], by_p], axis=2),
            dtension_c=np.pad(pull[..., n_s:][..., columns], ((0, 0), (0, 0), (1, 0))),
            dacc_c=np.pad(acc[..., n_s:][..., columns], ((0, 0), (0, 0), (1, 0))),
            dstart_c=np.concatenate(
                [zeros, self.free_parameters.start_derivatives(nodes.parameters)], axis=1
            ),
        )


@dataclass(frozen=True)
class ExactRuns(HybridRuns):
    """Event-driven runs, with derivatives of time steps for motions without exact ones.

    Attributes:
        reasons: reasons why the last derivatives were those of time steps; empty if they were
            exact.
    """

    reasons: list[str] = field(default_factory=list, compare=False)

    def has_derivatives(self, nodes: Nodes, ends: Ends) -> bool:
        """Whether a motion has exact derivatives."""
        try:
            super().linearise(nodes, ends)
        except (SimulationError, StateError):
            return False
        return True

    def linearise(self, nodes: Nodes, ends: Ends) -> LinearEnds:
        """See :class:`fantoccini.control.optimal.sqp.Shooting`."""
        self.reasons.clear()
        try:
            return super().linearise(nodes, ends)
        except (SimulationError, StateError) as error:
            self.reasons.append(str(error))
            return EventRuns.linearise(self, nodes, ends)


def _tension_derivatives(
    marionette: Marionette, run: Trajectory, nodes: Nodes
) -> tuple[Array, Array]:
    """(N, n_rows or n_vD, n_z + n_vK + n_p) derivatives of tensions and accelerations at nodes."""
    samples = np.searchsorted(run.t, nodes.t[:-1] + _SAME_TIME, side="right") - 1
    names, two_sided = marionette.tree.row_names, marionette.two_sided
    pull: list[Array] = []
    acc: list[Array] = []
    for i, acc_K in zip(samples, nodes.acc_K, strict=True):
        has_force = run.limit_force.values[i] > 0.0
        is_active = np.concatenate([run.taut.values[i], has_force]) | two_sided
        rows = [name for name, active in zip(names, is_active, strict=True) if active]
        linear = marionette.linearise(run.state(int(i)), acc_K, rows=rows)
        for blocks, derivatives in ((pull, linear.tension_partials), (acc, linear.acc)):
            blocks.append(
                np.concatenate(
                    [
                        derivatives.q_D,
                        derivatives.v_D,
                        derivatives.q_K,
                        derivatives.v_K,
                        derivatives.acc_K,
                        derivatives.p,
                    ],
                    axis=1,
                )
            )
    return np.array(pull), np.array(acc)
