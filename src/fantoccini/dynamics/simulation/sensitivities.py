"""sensitivity: derivatives of a whole run by its start, its parameters and its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, InputError, Mistake, ShortRepr, Times, check_positive, floats
from fantoccini.dynamics.compiled import bind_input
from fantoccini.dynamics.marionette import Marionette
from fantoccini.dynamics.simulation.input_piece import InputChanges
from fantoccini.dynamics.simulation.run import simulate
from fantoccini.dynamics.simulation.run_changes import RunChanges, check_differentiable
from fantoccini.dynamics.simulation.saltation import Passage
from fantoccini.dynamics.simulation.variation import Variation
from fantoccini.motion import Input, InputDerivative, Inputs, State, Trajectory, check_same_puppet

SAME_ROTATION = 1e-12
"""Largest 1 - |cos(angle / 2)| of orientations that count as equal: rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class RunSensitivity(ShortRepr):
    """Derivatives of the state of an event-driven run, at some of its times.

    A record has the derivatives of (dq_D, dv_D) at ``t``, with tangent vectors dq_D: a scalar adds,
    an orientation turns in the body's frame. Two records with equal times are before and after an
    event.

    Attributes:
        run: the run.
        t: (T,) times [s].
        x0: (T, 2 n_vD, 2 n_vD) derivatives by (dq_D, dv_D) at the start. A change that would
            stretch or slacken taut rows is replaced by the nearest one that does not, in the metric
            of M_DD.
        p: (T, 2 n_vD, n_p) derivatives by the parameters; the start moves to keep its taut strings.
        toward: (T, 2 n_vD, m) derivatives by s for inputs + s (other - inputs), for each other.
        along: (T, 2 n_vD, m) derivatives by s for inputs + s dq_K/ds, for each input derivative.
        passages: catches, impacts and stops of contact points of the run.
    """

    run: Trajectory
    t: Times
    x0: Array
    p: Array
    toward: Array
    along: Array
    passages: tuple[Passage, ...]

    @property
    def sharp(self) -> bool:
        """Whether the derivative exists: no simultaneous events, or grazing contacts, by chance.

        See :class:`Passage` for each event.
        """
        return all(passage.sharp for passage in self.passages)


def sensitivity(
    marionette: Marionette,
    x0: State,
    inputs: Input | None = None,
    t_end: float | None = None,
    *,
    toward: Sequence[Input] = (),
    along: Sequence[InputDerivative] = (),
    save_at: Times | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-10,
) -> RunSensitivity:
    """Derivatives of a run by x0, p and changes of the inputs, through all of its events.

    The run is that of ``fan.simulate`` with its default tolerances. The derivative holds for
    nearby runs with the same sequence of events.

    Args:
        marionette: the puppet.
        x0: start state.
        inputs: motion of the driven coordinates; by default they hold still.
        t_end: end of the run [s]; by default the end of the inputs.
        toward: other inputs; they may begin elsewhere. Rotations must be the same in all. For
            derivatives by waypoints use ``along``: moves through them are not linear in them.
        along: derivatives of the inputs, such as those of ``InputDerivative.of_waypoints`` by the
            values of waypoints.
        save_at: (n,) times to save besides the start, the end and both sides of every event [s].
        rtol, atol: tolerances of the integration of state and derivatives.

    Raises:
        StateError: a winch slips, bounces of solids accumulate, or the motion depends on the
            distribution of force among redundant sliding points: there is no derivative.
        SimulationError: the run stopped.
    """
    check_positive(rtol=rtol, atol=atol)
    marionette.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    run = simulate(marionette, x0, inputs, t_end, effort=False)
    check_differentiable(run)
    t_end = inputs.end if t_end is None else t_end
    bound = bind_input(marionette, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    others = _bound(marionette, toward, bound, x0) if toward else None
    _check_along(marionette, along)
    changes = InputChanges(marionette, bound, others, along)
    saved = np.zeros(0) if save_at is None else np.unique(floats(save_at))
    outside = saved[~((saved >= run.t[0]) & (saved <= run.t[-1]))]
    if len(outside):
        raise ValueError(
            f"save_at has {outside[0]:g} s; it must lie between {run.t[0]:g} s and {run.t[-1]:g} s"
        )
    pieces = RunChanges(run, changes, Variation(marionette, rtol, atol))
    records = list(pieces.samples(saved))
    n, n_p = marionette.coordinates.n_vD, len(marionette.p)
    Z = np.array([Z for _, Z in records])
    last = 2 * n + n_p + len(toward)
    return RunSensitivity(
        run=run,
        t=np.array([t for t, _ in records]),
        x0=Z[:, :, : 2 * n],
        p=Z[:, :, 2 * n : 2 * n + n_p],
        toward=Z[:, :, 2 * n + n_p : last],
        along=Z[:, :, last:],
        passages=tuple(pieces.passages),
    )


def _bound(marionette: Marionette, toward: Sequence[Input], inputs: Input, x0: State) -> Inputs:
    """Other inputs, each bound at its own start; coordinates that they do not name are held."""
    table, others = marionette.coordinates, Inputs.of(toward)
    check_same_puppet([table, others.coordinates])
    q_K, start = np.tile(x0.q_K, (len(others), 1)), others.evaluate(x0.t)[0]
    for q, v in table.scalars_K:
        q_K[:, q] = np.where(others.named[:, v], start[:, q], q_K[:, q])
    others = others.bound(q_K, x0.t)
    if not table.rotations:
        return others
    for i in range(len(others)):
        other = others[i]
        times = np.union1d(inputs.breaks, other.breaks)
        times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        for name, (q, _) in table.rotations.items():
            ours, theirs = (x.evaluate(times)[0][:, q : q + 4] for x in (inputs, other))
            if np.max(np.abs(np.abs(np.sum(ours * theirs, axis=1)) - 1.0)) > SAME_ROTATION:
                text = "differs from the run's; only scalar coordinates may differ in `toward`"
                raise InputError([Mistake("toward", None, name, text)])
    return others


def _check_along(marionette: Marionette, along: Sequence[InputDerivative]) -> None:
    """Raises InputError unless derivatives of inputs are for this puppet."""
    own = marionette.coordinates
    for i, derivative in enumerate(along):
        if derivative.coordinates.v_K != own.v_K:
            text = (
                "was made for a puppet with the driven velocities "
                f"{', '.join(derivative.coordinates.v_K) or 'none'}; {marionette.name} has "
                f"{', '.join(own.v_K) or 'none'}"
            )
            raise InputError([Mistake("along", None, f"[{i}]", text)])
