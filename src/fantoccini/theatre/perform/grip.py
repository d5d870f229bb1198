"""Grip: bounded tension of strings, and hands that slow down when they pull at a slipping one.

Every one-sided string gets a winch that slips at a largest tension, so that a motion exists for any
motion of the hands. If a string has slipped by more than ``min_slip`` while it pulls, the hands
that pull against it slow down. The rate u at which hands lengthen the path of a string is bounded,

  u = A_K v_K <= return_rate (HELD_SLIP - s),   s: the largest slip,

which returns them until the slip is ``HELD_SLIP``. A wire cannot slip; its violation counts
instead. Motion of a hand across the string, or towards the puppet, is unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, Mask, VecK
from fantoccini.dynamics.marionette import Marionette
from fantoccini.kernel.contract import WINCH_AT
from fantoccini.model.tree import Role, Tree
from fantoccini.motion import State
from fantoccini.theatre.perform.hands import Hands

HELD_SLIP = 0.010
"""Slip at which hands that pulled too far come to rest [m]."""


@dataclass(frozen=True)
class Tolerances:
    """Parameters of the rule."""

    max_tension: float = 20.0
    """Default tension at which winches slip, relative to the puppet's weight."""
    rewind_speed: float = 1.0
    """Speed at which a winch takes back slip of a slack string [m/s]."""
    min_slip: float = 0.005
    """Slip above which hands slow down [m]; half of ``HELD_SLIP``, so that they do so in time."""
    return_rate: float = 20.0
    """Rate of the return to ``HELD_SLIP`` [1/s]; well below that of ticks."""
    min_pull: float = 0.5
    """Tension above which a string counts as pulling, relative to its largest tension."""
    max_rounds: int = 3
    """Number of corrections for each string, as a hand may hold several."""
    max_excess: float = 1e-6
    """Accepted excess of a rate over its bound [m/s]."""
    min_share: float = 0.05
    """Share of a string's rate above which a hand is reported as held back."""


TOLERANCES = Tolerances()


def with_slipping_winches(marionette: Marionette, grip: float) -> Marionette:
    """Puppet whose winches slip at a tension of ``grip`` [N] or less; wires have no winches."""
    winches = marionette.winches.copy()
    max_tension, rewind = WINCH_AT["max_tension"], WINCH_AT["rewind_speed"]
    for row, string in zip(winches, marionette.tree.strings, strict=True):
        if string.wire or row[max_tension] <= grip:
            continue
        row[max_tension] = grip
        if string.rewind_speed is None:
            row[rewind] = TOLERANCES.rewind_speed
    return marionette.with_winches(winches)


class HandLimiter:
    """Limits the velocities of hands in each tick, so that strings do not slip too far.

    Attributes:
        held: (n_groups,) bool, groups of hand coordinates that were slowed in the last tick.

    Args:
        marionette: puppet with winches, as :func:`gripped` returns it.
        hands: hands of the puppet.
        grip: largest tension [N].
    """

    def __init__(self, marionette: Marionette, hands: Hands, grip: float):
        self.marionette, self.hands = marionette, hands
        max_tension = marionette.winches[:, WINCH_AT["max_tension"]]
        self._wire: Mask = np.array([s.wire for s in marionette.tree.strings], dtype=bool)
        # Winches of the puppet that slip at a lower tension do not slow the hands.
        is_limited = self._wire | (max_tension >= grip)
        self._no_wires = not self._wire.any()
        self._max_slip = np.where(is_limited, TOLERANCES.min_slip, np.inf)
        self._min_pull = np.where(is_limited, TOLERANCES.min_pull * grip, np.inf)
        self._grip = grip
        self._n_groups = len(hands.names)
        self._none_held = np.zeros(self._n_groups, dtype=bool)
        self.held = self._none_held
        self._moves = _moves(marionette.tree)
        self._batch = _independent_batches(self._moves)

    def limited(self, x: State, tension: Array, wanted: VecK) -> VecK:
        """Velocities (n_vK,) of the hands that the strings permit [m/s or rad/s].

        Args:
            x: state.
            tension: (n_rows,) forces of strings and limits [N or N m].
            wanted: (n_vK,) wanted velocities [m/s or rad/s].
        """
        self.held = self._none_held
        slipped = x.slip > self._max_slip
        if self._no_wires and not slipped.any():
            return wanted
        n = len(self._min_pull)
        pull = np.where(self._wire, np.abs(tension[:n]), tension[:n])
        pulling = pull > self._min_pull
        if not (slipped.any() or (self._wire & pulling).any()):
            return wanted
        slip = float(np.max(x.slip[pulling & slipped], initial=0.0))
        strained = self._wire & (pull > self._grip)
        if strained.any():
            slip = max(slip, HELD_SLIP)
        bounds = np.full(n, np.inf)
        bounds[slipped] = 0.0  # slack while it rewinds
        if slip > TOLERANCES.min_slip:
            bounds[pulling] = TOLERANCES.return_rate * (HELD_SLIP - slip)
        if strained.any():
            # A wire cannot slip: its violation is taken back.
            at = {"q_D": x.q_D, "q_K": x.q_K, "p": self.marionette.p}
            h = self.marionette.library.evaluate("rows", **at).h
            bounds[strained] = -TOLERANCES.return_rate * np.abs(h[:n][strained])
        if not np.isfinite(bounds).any():
            return wanted
        self.held = self._none_held.copy()
        # A wire under compression bounds the opposite direction.
        bounded = np.flatnonzero(np.isfinite(bounds))
        rates = self.rates(x)[bounded] * np.where(tension[bounded] < 0, -1.0, 1.0)[:, None]
        slower, bounds = wanted.copy(), bounds[bounded]
        for _ in range(TOLERANCES.max_rounds * len(bounded)):
            excesses = rates @ slower - bounds
            worst = int(np.argmax(excesses))
            excess = excesses[worst]
            if excess <= TOLERANCES.max_excess or not self._slow_down(rates[worst], slower, excess):
                break
        return self.hands.bounded(slower)

    def messages(self, slip: Array) -> dict[str, list[str]]:
        """Reasons why handles and strings lag, by name.

        Args:
            slip: (n_strings,) slip of the strings [m].
        """
        reasons: dict[str, list[str]] = {}
        for name in dict.fromkeys(np.array(self.hands.names)[self.held].tolist()):
            reasons[name] = ["hand pulls against its limit"]
        for string, length in zip(self.marionette.tree.strings, slip.tolist(), strict=True):
            if length > TOLERANCES.min_slip:
                text = f"winch slips by {1000 * length:.0f} mm"
                reasons.setdefault(string.name, []).append(text)
        return reasons

    def rates(self, x: State) -> Array:
        """(n_strings, n_vK) A_K of the strings: hdot_K of unit velocities.

        Velocities that move no string in common are evaluated together.
        """
        n_K, n_D = len(x.v_K), len(x.v_D)
        still, batch = np.zeros(n_D), self._batch
        unit = np.zeros((np.max(batch, initial=-1) + 1, n_K))
        unit[batch, np.arange(n_K)] = 1.0
        dynamics = self.marionette.library.evaluate(
            "dynamics",
            q_D=x.q_D,
            v_D=still,
            q_K=x.q_K,
            v_K=unit,
            acc_K=np.zeros(n_K),
            u_D=still,
            p=self.marionette.p,
        )
        return np.where(self._moves, dynamics.hdot_K[batch].T, 0.0)

    def _slow_down(self, row: Array, wanted: VecK, excess: float) -> bool:
        """Slows the groups that lengthen a string's path, in proportion; False without any."""
        group, n = self.hands.group, self._n_groups
        lengthening = np.maximum(np.bincount(group, row * wanted, n), 0.0)
        total = lengthening.sum()
        if total <= 0.0:
            return False
        square = np.bincount(group, row * row, n)
        correction = excess * lengthening / (total * np.where(square > 0.0, square, 1.0))
        wanted -= correction[group] * row
        self.held |= lengthening > TOLERANCES.min_share * total
        return True


def _moves(tree: Tree) -> Mask:
    """(n_strings, n_vK) bool, whether a velocity changes the path or the length of a string."""
    moves = np.zeros((len(tree.strings), tree.coordinates.n_vK), dtype=bool)
    for row, string in zip(moves, tree.strings, strict=True):
        for point in string.points:
            for i in tree.ancestors(point.link):
                if tree.links[i].role is Role.DRIVEN:
                    row[tree.links[i].v] = True
        if string.driven_length:
            row[string.driven_length[1]] = True
    return moves


def _independent_batches(moves: Mask) -> Indices:
    """(n_vK,) batch of each driven velocity; no two of a batch move the same string."""
    batch = np.zeros(moves.shape[1], dtype=int)
    moved: list[Mask] = []
    for j, strings in enumerate(moves.T):
        free = (k for k, others in enumerate(moved) if not np.any(others & strings))
        batch[j] = next(free, len(moved))
        if batch[j] == len(moved):
            moved.append(np.zeros(len(moves), dtype=bool))
        moved[batch[j]] |= strings
    return batch
