"""Rest: where a puppet hangs still, by whichever search finds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fantoccini.contract import WINCH_AT
from fantoccini.errors import StateError
from fantoccini.marionette import settle, statics
from fantoccini.marionette.analysis import energies
from fantoccini.marionette.closed import CLOSED
from fantoccini.marionette.dynamics import forward_dynamics, with_mode
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.model import Model
from fantoccini.marionette.projection import onto_rows, overstepped, positioned
from fantoccini.motion import State

_HAULS = 20
"""Pieces of time-stepping that may haul in what the slopes of strings alone do not."""
_BALANCED, _BALANCED_ON_CHAINS = 1e-9, 1e-6
"""Forces that may be left at rest, over the puppet's weight."""
_ABOVE = 1e-9
"""Rise of V over its start's that is rounding, over the puppet's weight [m]."""


def rest(model: Model, x: State) -> State:
    """A hanging equilibrium near a state: a local minimum of V subject to h <= 0.

    The puppet is brought onto its strings, let go and stopped (:mod:`.statics`); where that does
    not end, V is descended (:mod:`.settle`), with which puppets on chains begin. What is found
    counts where forces balance, no row is overstepped and V is not above the start's.

    Args:
        model: the puppet.
        x: where to begin; its inputs are held still.

    Raises:
        StateError: there is no equilibrium below, or it was not found, or a winch would slip in it;
            what was tried and what is in the way is told.
    """
    rewinds = model.winches[: len(x.slip), WINCH_AT["rewind_speed"]] > 0
    still = x.replace(
        v_D=np.zeros_like(x.v_D),
        v_K=np.zeros_like(x.v_K),
        slip=np.where(rewinds, 0.0, x.slip),
        taut=np.zeros_like(x.taut),  # what was taut in a motion need not be so at rest
    )
    start = _begun(model, still)
    if not len(start.q_D):
        return with_mode(model, start)
    ways = [settle.descended] if model.tree.chains else [statics.dropped, settle.descended]
    failed = []
    for way in ways:
        try:
            found = way(model, start)
            pulls = np.isin(np.arange(model.tree.n_rows), found.rows)
            found = replace(found, x=found.x.replace(taut=pulls))
            statics.check_winches(model, found)
            wrong = _wrong(model, start, found)
        except StateError as error:
            wrong = str(error)
        if not wrong:
            return with_mode(model, found.x)
        failed.append(wrong)
    raise StateError("no equilibrium was found: " + "; ".join(failed))


def _begun(model: Model, x: State) -> State:
    """The state brought onto its rows, by time-stepping where their slopes do not lead there."""
    start, left = positioned(model, x)
    for _ in range(_HAULS if left else 0):
        x = statics.hauled(model, x)
        if onto_rows(model, x)[1] <= CLOSED:
            start, left = positioned(model, x)
            break
    if left:
        raise StateError(
            f"no state of the puppet was found that fits these string ends and lengths: {left}. "
            "Tried: moves onto the strings and limits, from many places nearby, and time-stepping "
            "with the strings hauled in"
        )
    return start


def _wrong(model: Model, start: State, found: statics.Equilibrium) -> str:
    """What an equilibrium lacks, in words; "" where it holds."""
    mass, weight = statics.sizes(model)
    left = overstepped(model, found.x)
    if left:
        return f"where forces balance, {left}"
    instant = instant_at(model, found.x)
    _, tension = forward_dynamics(model, found.x)
    force = np.linalg.norm(instant.w0 - instant.W @ tension) * np.sqrt(mass) / weight
    if force > (_BALANCED_ON_CHAINS if model.tree.chains else _BALANCED):
        return f"forces of {force:.2g} of the puppet's weight are left over"
    above = energies(model, found.x)[1] - energies(model, start)[1]
    # What drives do is in no potential.
    if above > _ABOVE * weight and not model.tree.drives:
        return f"what was found lies {above:.2g} J above the start"
    return ""
