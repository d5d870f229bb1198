"""The active set of a state: its taut strings and closed limits.

A row that the state's ``taut`` marks is active, and so is every row with h = 0 and hdot = 0, up to
rounding. The tension tau of an active row follows from tau >= 0, hddot <= 0, tau . hddot = 0.

A row is a string or a joint limit; its gap h is path length minus string length, and hdot and hddot
are its rates. In names, D stands for dynamic coordinates, which move by the equations of motion,
and K for driven ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, MaskRows, StateError
from fantoccini.dynamics.compiled.compiled_puppet import CompiledPuppet
from fantoccini.dynamics.compiled.evaluation import Evaluation
from fantoccini.kernel.contract import CLOSED_GAP, REST_SPEED, START_GAP
from fantoccini.motion import State


@dataclass(frozen=True)
class ActiveSetTolerances:
    """Gaps h relative to 1 or the string's length; speeds hdot relative to 1 or the largest."""

    closed_gap: float = CLOSED_GAP  # Rows with -h below this rounding error are closed
    start_gap: float = START_GAP
    """Rows with |h| below it are closed at the start of a run, which brings them to h = 0."""
    stepped_gap: float = 1e-3  # Largest |h| after a fixed step
    touching: float = 1e-6  # Overlap of solids that an event-driven run corrects at its start [m]
    taut_gap: float = 1e-2
    """Rows marked taut are active up to this -h: far above the gaps after coarse fixed steps."""
    rest_speed: float = REST_SPEED  # |hdot| that counts as rest
    slip_speed: float = 1e-2
    """hdot from which the winch of a taut string slips; it is lower after fixed steps."""


ROW_TOLERANCES = ActiveSetTolerances()


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """The active rows of a state: held ones and slipping ones.

    Attributes:
        held: (n_rows,) mask of closed rows and wires.
        slipping: (n_rows,) mask of strings whose winch slips at its largest tension.
    """

    held: MaskRows
    slipping: MaskRows

    @classmethod
    def at_state(cls, marionette: CompiledPuppet, x: State, evaluation: Evaluation) -> ActiveSet:
        """The active set of a state, with the model evaluated there."""
        scale = marionette.row_scales(x.q_D, x.q_K)
        taut = taut_mask(marionette, x) & ~_is_far_open(marionette, evaluation.h, scale)
        speed_scale = max(1.0, float(np.max(np.abs(x.v_D), initial=0.0)))
        is_closed = evaluation.h >= -ROW_TOLERANCES.closed_gap * scale
        can_slip = np.isfinite(marionette.max_forces) & (taut | is_closed)
        at_bound = np.abs(evaluation.h) <= ROW_TOLERANCES.start_gap * scale
        was_stepped = taut & ~at_bound
        slip_speed = np.where(was_stepped, ROW_TOLERANCES.slip_speed, ROW_TOLERANCES.rest_speed)
        slipping = can_slip & (evaluation.hdot > slip_speed * speed_scale)
        held = taut | (
            is_closed & (np.abs(evaluation.hdot) <= ROW_TOLERANCES.rest_speed * speed_scale)
        )
        return cls((held | marionette.two_sided) & ~slipping, slipping)


def taut_mask(marionette: CompiledPuppet, x: State) -> MaskRows:
    """Mask (n_rows,) of taut rows, ``x.taut``; all False for a state without this mask."""
    return x.taut if len(x.taut) else np.zeros(marionette.tree.n_rows, dtype=bool)


def check_active_set(marionette: CompiledPuppet, x: State, evaluation: Evaluation) -> None:
    """Raises StateError with names and gaps if rows marked taut are slack."""
    scale = marionette.row_scales(x.q_D, x.q_K)
    slack_rows = np.flatnonzero(
        taut_mask(marionette, x) & _is_far_open(marionette, evaluation.h, scale)
    )
    if not len(slack_rows):
        return
    names = marionette.tree.row_names
    gaps = "; ".join(f"{names[r]} by {-evaluation.h[r]:.3g}" for r in slack_rows)
    raise StateError(
        f"the state marks these strings and limits as taut, but they are slack by more than "
        f"{ROW_TOLERANCES.taut_gap:g} of their length or range: {gaps}. x.replace(taut=...) "
        "corrects the active set, marionette.project(x) finds it"
    )


def _is_far_open(marionette: CompiledPuppet, h: Array, scale: Array) -> MaskRows:
    return ~(h >= -ROW_TOLERANCES.taut_gap * scale) & ~marionette.two_sided
