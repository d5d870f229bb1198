"""Which strings and limits are closed in a state: the one place that decides it.

A row that is taut in the state's mode is closed. The others are where h = 0 and hdot = 0, but for
rounding. What a closed row pulls, if it does, follows from tau >= 0, hddot <= 0, tau . hddot = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array, MaskRows
from fantoccini.errors import StateError
from fantoccini.marionette.instant import Instant
from fantoccini.marionette.model import Model
from fantoccini.motion import State

TOUCH = 1e-12
"""-h below which a row counts as closed, relative to 1 or the string's length."""
CLOSED = 1e-9
"""|h| below which it does so where a run begins, which brings it to h = 0; likewise."""
STILL = 1e-5
"""|hdot| below which it counts as at rest, relative to 1 or the largest velocity;
``max_rest_speed`` of the runtime."""
STEPPED = 1e-3
"""What a fixed step may leave of h, relative to 1 or the string's length."""
MODE = 1e-2
"""-h up to which a row that is said to be taut counts as closed, likewise; and the speed, relative
to 1 or the largest velocity, from which on the winch of one that is not at h = 0 slips."""


@dataclass(frozen=True, eq=False)
class Closed:
    """The rows of a state, by what they do.

    Attributes:
        held: (n_rows,) bool, closed rows, and wires.
        slipping: (n_rows,) bool, strings whose winch gives way: they pull with its largest tension.
    """

    held: MaskRows
    slipping: MaskRows


def closed_rows(model: Model, x: State, instant: Instant) -> Closed:
    """The rows that are closed in a state.

    Args:
        model: the puppet.
        x: the state.
        instant: the model there.
    """
    scale = model.row_scales(x.q_D, x.q_K)
    taut = known_mode(model, x) & ~_far(model, instant.h, scale)
    top = max(1.0, float(np.max(np.abs(x.v_D), initial=0.0)))
    reaches = instant.h >= -TOUCH * scale
    gives = np.isfinite(model.upper) & (taut | reaches)
    # What a fixed step leaves of hdot is no slipping.
    at_bound = np.abs(instant.h) <= CLOSED * scale
    slipping = gives & (instant.hdot > np.where(taut & ~at_bound, MODE, STILL) * top)
    held = taut | (reaches & (np.abs(instant.hdot) <= STILL * top))
    return Closed((held | model.two_sided) & ~slipping, slipping)


def known_mode(model: Model, x: State) -> MaskRows:
    """(n_rows,) bool, the rows that are taut in the state's mode."""
    return x.taut if len(x.taut) else np.zeros(model.tree.n_rows, dtype=bool)


def check_mode(model: Model, x: State, instant: Instant) -> None:
    """Raises where rows are taut in a state's mode and far from it in its configuration.

    Raises:
        StateError: naming them and how far they are off.
    """
    scale = model.row_scales(x.q_D, x.q_K)
    wrong = np.flatnonzero(known_mode(model, x) & _far(model, instant.h, scale))
    if not len(wrong):
        return
    names = model.tree.row_names
    said = "; ".join(f"{names[r]} by {-instant.h[r]:.3g}" for r in wrong)
    raise StateError(
        f"these strings and limits are taut in the state's mode, but lack more than {MODE:g} of "
        f"their length or range of being so: {said}. x.replace(taut=...) corrects the mode, "
        "marionette.project(x) finds it"
    )


def _far(model: Model, h: Array, scale: Array) -> MaskRows:
    return ~(h >= -MODE * scale) & ~model.two_sided
