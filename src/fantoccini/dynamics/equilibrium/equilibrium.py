"""Rest: a hanging equilibrium, by relaxation, settling or descent.

V is the potential energy, h the gap of a string (path length minus string length, at most 0), and a
row a string or a joint limit. q_D and v_D are the dynamic coordinates and velocities, q_K and v_K
the driven ones: ends and lengths of strings, driven joints. Slip is the length of string that a
winch lets out at its largest tension. A taut string pulls, a slack one does not. With the inertia
matrix M_DD = F^T F, w0 = F^-T f are the scaled forces f without strings, and W = F^-T A_D^T those
of unit tensions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fantoccini.base import StateError
from fantoccini.dynamics.compiled import (
    ROW_TOLERANCES,
    CompiledPuppet,
    Evaluation,
    check_apart,
    forward_dynamics,
)
from fantoccini.dynamics.derivatives import balanced_state, with_active_set
from fantoccini.dynamics.equilibrium import descent, relaxation
from fantoccini.dynamics.equilibrium.newton import Equilibrium, nearest_to_requested, sizes
from fantoccini.dynamics.equilibrium.projection import moved_onto_rows, onto_rows, violated_rows
from fantoccini.dynamics.equilibrium.settling import settled
from fantoccini.dynamics.equilibrium.support import no_support_message, unsupported_groups
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.motion import State


@dataclass(frozen=True)
class Acceptance:
    """Acceptance bounds of an equilibrium, and bounds of the search for a start."""

    max_force: float = 1e-9  # Unbalanced force at rest, relative to the weight
    max_force_of_chains: float = 1e-6
    """Unbalanced force of puppets on chains, whose stiff springs cause more rounding."""
    max_rise: float = 1e-9
    """Rise of V above the start that counts as rounding, divided by the puppet's weight [m]."""
    max_hauls: int = 20  # Maximum number of time-stepping runs that haul in strings


ACCEPTANCE = Acceptance()


def rest(marionette: CompiledPuppet, x: State) -> State:
    """A local minimum of V subject to h <= 0, near a state; see :meth:`Marionette.rest`.

    The puppet is moved until its strings reach, and relaxed (:mod:`.relaxation`). If that fails,
    or it would overlap another solid, a puppet with contact is let go until it rests
    (:mod:`.settling`).
    Otherwise, and first for puppets on chains, V is descended (:mod:`.descent`). Results of
    relaxation and descent are accepted if forces balance, no row is violated and V is not above
    the start. Neutral coordinates, such as a load's angle about its string, keep their values in
    ``x``.

    Raises:
        StateError: nothing holds a part of the puppet, no equilibrium was found, or a winch would
            slip in it; the message has the reason for each search.
    """
    if groups := unsupported_groups(marionette):
        raise StateError(
            "there is no equilibrium: "
            + "; ".join(no_support_message(marionette, group) for group in groups)
        )
    has_rewind = marionette.winches[: len(x.slip), WINCH_AT["rewind_speed"]] > 0
    at_rest = x.replace(
        v_D=np.zeros_like(x.v_D),
        v_K=np.zeros_like(x.v_K),
        slip=np.where(has_rewind, 0.0, x.slip),
        taut=np.zeros_like(x.taut),  # rows taut in a motion may be slack at rest
    )
    start = _moved_onto_rows(marionette, at_rest)
    if not len(start.q_D):
        return with_active_set(marionette, start)
    contact_searches = [] if marionette.contacts is None else [_settled]
    searches: list[Callable[[CompiledPuppet, State, State], State]] = (
        [_descended, *contact_searches]
        if marionette.tree.chains
        else [_relaxed, *contact_searches, _descended]
    )
    failures = []
    for search in searches:
        try:
            return with_active_set(marionette, search(marionette, start, at_rest))
        except StateError as error:
            failures.append(str(error))
    raise StateError("no equilibrium was found: " + "; ".join(failures))


def _relaxed(marionette: CompiledPuppet, start: State, requested: State) -> State:
    resting_point = relaxation.relaxed(marionette, start)
    return _accepted_state(
        marionette, start, nearest_to_requested(marionette, requested, resting_point)
    )


def _descended(marionette: CompiledPuppet, start: State, requested: State) -> State:
    resting_point = descent.descended(marionette, start)
    return _accepted_state(
        marionette, start, nearest_to_requested(marionette, requested, resting_point)
    )


def _settled(marionette: CompiledPuppet, start: State, requested: State) -> State:
    try:
        return balanced_state(marionette, settled(marionette, start))
    except StateError:
        check_apart(marionette, marionette.states([start]))  # the likelier reason of the failure
        raise


def _accepted_state(marionette: CompiledPuppet, start: State, resting_point: Equilibrium) -> State:
    """The state of an equilibrium; StateError if it is not accepted."""
    is_pulling = np.isin(np.arange(marionette.tree.n_rows), resting_point.rows)
    resting_point = replace(resting_point, x=resting_point.x.replace(taut=is_pulling))
    relaxation.check_winches(marionette, resting_point)
    if rejection := _rejection(marionette, start, resting_point):
        raise StateError(rejection)
    if marionette.overlaps(resting_point.x.q_D, resting_point.x.q_K):
        raise StateError("hung from its strings alone it overlaps solids that it touches")
    return resting_point.x


def _moved_onto_rows(marionette: CompiledPuppet, x: State) -> State:
    """The state moved until no row is violated, with time-stepping if gradients fail."""
    start, remaining = moved_onto_rows(marionette, x)
    for _ in range(ACCEPTANCE.max_hauls if remaining else 0):
        x = relaxation.pulled_towards_rows(marionette, x)
        if onto_rows(marionette, x)[1] <= ROW_TOLERANCES.start_gap:
            start, remaining = moved_onto_rows(marionette, x)
            break
    if remaining:
        raise StateError(
            "no state of the puppet was found that fits these string ends and lengths: "
            f"{remaining}. "
            "Tried: moves onto the strings and limits, from many places nearby, and time-stepping "
            "with the strings hauled in"
        )
    return start


def _rejection(marionette: CompiledPuppet, start: State, resting_point: Equilibrium) -> str:
    """Reason for not accepting an equilibrium, in words; "" if it is accepted."""
    mass, weight = sizes(marionette)
    violations = violated_rows(marionette, resting_point.x)
    if violations:
        return f"where forces balance, {violations}"
    evaluation = Evaluation.at_state(marionette, resting_point.x)
    _, tension = forward_dynamics(marionette, resting_point.x)
    force = np.linalg.norm(evaluation.w0 - evaluation.W @ tension) * np.sqrt(mass) / weight
    if force > (ACCEPTANCE.max_force_of_chains if marionette.tree.chains else ACCEPTANCE.max_force):
        return f"forces of {force:.2g} of the puppet's weight are unbalanced"
    rise = marionette.energies(resting_point.x)[1] - marionette.energies(start)[1]
    # V does not include the work of drives.
    if rise > ACCEPTANCE.max_rise * weight and not marionette.tree.drives:
        return f"the equilibrium found lies {rise:.2g} J above the start"
    return ""
