"""sensitivity: derivatives of a run with respect to its start state, parameters and inputs.

q_D and v_D are the dynamic coordinates and velocities, q_K and v_K the driven ones, x0 is the start
state, and p the parameters. A taut string pulls, a slack one does not.
"""

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

MAX_ROTATION_ROUNDING = 1e-12
"""Largest 1 - |cos(angle / 2)| of orientations that count as equal."""


@dataclass(frozen=True, eq=False, repr=False)
class RunSensitivity(ShortRepr):
    """Derivatives of the state (q_D, v_D) of a run with method ``event``, at some of its times.

    D stands for the dynamic coordinates, K for the driven (kinematic) ones. Changes of q_D are
    tangent vectors: the change of a scalar, or a small rotation in the body's frame. Equal times
    in ``t`` are those before and after an event.

    Attributes:
        run: the run.
        t: (T,) times [s].
        by_x0: (T, 2 n_vD, 2 n_vD) derivatives by (q_D, v_D) at the start. A change that would
            stretch or slacken a taut string, or leave a limit, is replaced by the nearest one that
            does not, in the metric of M_DD.
        by_p: (T, 2 n_vD, n_p) derivatives by the parameters; the start state changes with them so
            that taut strings stay taut.
        toward: (T, 2 n_vD, m) derivatives by s for the inputs + s (other - inputs), for each of the
            other inputs.
        along: (T, 2 n_vD, m) derivatives by s for the inputs q_K + s q', for each derivative q' of
            the inputs.
        passages: events of the run: strings that came taut, impacts, and contact points that
            stopped sliding.
    """

    run: Trajectory
    t: Times
    by_x0: Array
    by_p: Array
    toward: Array
    along: Array
    passages: tuple[Passage, ...]

    @property
    def differentiable(self) -> bool:
        """Whether the derivative exists.

        It does not if events coincide by chance, or a contact only grazes; see :class:`Passage`.
        """
        return all(passage.differentiable for passage in self.passages)


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
    """Derivatives of a run with respect to x0, p and the inputs, through all of its events.

    The run is that of ``fan.simulate`` with its default tolerances. The derivative holds for
    nearby runs with the same sequence of events.

    Args:
        marionette: the puppet.
        x0: start state.
        inputs: motion of the driven coordinates; by default they hold still.
        t_end: end of the run [s]; by default the end of the inputs.
        toward: other inputs, with the same rotations; they may begin at another position. For
            derivatives by the values of waypoints use ``along``: the moves are not linear in them.
        along: derivatives of the inputs, such as those of ``InputDerivative.of_waypoints``.
        save_at: (n,) times to save besides the start, the end and both sides of every event [s].
        rtol, atol: tolerances with which the derivatives are integrated, along the same run.

    Raises:
        StateError: there is no derivative: a winch slips, bounces of solids follow one another ever
            faster, or the motion depends on how sliding points share a force.
        SimulationError: the run stopped early.
    """
    check_positive(rtol=rtol, atol=atol)
    marionette.check_state(x0)
    inputs = Input.hold(marionette).shifted(x0.t) if inputs is None else inputs
    run = simulate(marionette, x0, inputs, t_end, effort=False)
    check_differentiable(run)
    t_end = inputs.end if t_end is None else t_end
    bound = bind_input(marionette, inputs, x0.q_K, x0.v_K, x0.t, t_end)
    other_inputs = _bind_others(marionette, toward, bound, x0) if toward else None
    _check_along(marionette, along)
    changes = InputChanges(marionette, bound, other_inputs, along)
    save_times = np.zeros(0) if save_at is None else np.unique(floats(save_at))
    outside_run = save_times[~((save_times >= run.t[0]) & (save_times <= run.t[-1]))]
    if len(outside_run):
        raise ValueError(
            f"save_at has {outside_run[0]:g} s; it must lie between {run.t[0]:g} s and "
            f"{run.t[-1]:g} s"
        )
    run_changes = RunChanges(run, changes, Variation(marionette, rtol, atol))
    t, Z = zip(*run_changes.samples(save_times), strict=True)
    n, n_p = marionette.coordinates.n_vD, len(marionette.p)
    split_at = np.cumsum([2 * n, n_p, len(toward)])
    by_x0, by_p, by_toward, by_along = np.split(np.array(Z), split_at, axis=2)
    return RunSensitivity(
        run=run,
        t=np.array(t),
        by_x0=by_x0,
        by_p=by_p,
        toward=by_toward,
        along=by_along,
        passages=tuple(run_changes.passages),
    )


def _bind_others(
    marionette: Marionette, toward: Sequence[Input], inputs: Input, x0: State
) -> Inputs:
    """Other inputs, bound to the puppet at their own start; coordinates without input are held."""
    coordinates, batch = marionette.coordinates, Inputs.stack(toward)
    check_same_puppet([coordinates, batch.coordinates])
    q_K, start = np.tile(x0.q_K, (len(batch), 1)), batch.evaluate(x0.t)[0]
    for q, v in coordinates.scalars_K:
        q_K[:, q] = np.where(batch.named[:, v], start[:, q], q_K[:, q])
    batch = batch.bound(q_K, x0.t)
    if not coordinates.rotations:
        return batch
    for i in range(len(batch)):
        single = batch[i]
        times = np.union1d(inputs.breaks, single.breaks)
        times = np.union1d(times, 0.5 * (times[1:] + times[:-1]))
        for name, (q, _) in coordinates.rotations.items():
            from_inputs, from_other = (x.evaluate(times)[0][:, q : q + 4] for x in (inputs, single))
            if (
                np.max(np.abs(np.abs(np.sum(from_inputs * from_other, axis=1)) - 1.0))
                > MAX_ROTATION_ROUNDING
            ):
                text = "differs from the run's; only scalar coordinates may differ in `toward`"
                raise InputError([Mistake("toward", None, name, text)])
    return batch


def _check_along(marionette: Marionette, along: Sequence[InputDerivative]) -> None:
    """Raises InputError unless derivatives of inputs are for this puppet."""
    coordinates = marionette.coordinates
    for i, derivative in enumerate(along):
        if derivative.coordinates.v_K != coordinates.v_K:
            text = (
                "was made for a puppet with the driven velocities "
                f"{', '.join(derivative.coordinates.v_K) or 'none'}; {marionette.name} has "
                f"{', '.join(coordinates.v_K) or 'none'}"
            )
            raise InputError([Mistake("along", None, f"[{i}]", text)])
