"""Grip: bounded tension of strings, and hands held back when they pull against a slipping one.

Every one-sided string gets a winch that slips at a largest tension, so that a motion exists for any
motion of the hands. If a string has slipped by more than ``min_slip`` while it pulls, the hands
that pull against it slow down. The rate u at which hands lengthen the path of a string is bounded,

  u = A_K v_K <= return_rate (HELD - s),   s: the largest slip,

which returns them until the slip is ``HELD``. A wire cannot slip; its violation counts instead.
Motion of a hand across the string, or towards the puppet, is unchanged.
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

HELD = 0.010
"""Slip to which hands are returned [m]."""


@dataclass(frozen=True)
class Tolerances:
    """Parameters of the rule."""

    max_tension: float = 20.0
    """Default tension at which winches slip, relative to the puppet's weight."""
    rewind_speed: float = 1.0
    """Speed at which a winch takes back slip of a slack string [m/s]."""
    min_slip: float = 0.005
    """Slip above which hands slow down [m]; half of ``HELD``, so that they do so in time."""
    return_rate: float = 20.0
    """Rate of the return to ``HELD`` [1/s]; well below that of ticks."""
    min_pull: float = 0.5
    """Tension above which a string counts as pulling, relative to its largest."""
    max_rounds: int = 3
    """Number of corrections for each string, as a hand may hold several."""
    max_excess: float = 1e-6
    """Accepted excess of a rate over its bound [m/s]."""
    min_share: float = 0.05
    """Share of a string's rate above which a hand is reported as held back."""


TOLERANCES = Tolerances()


def gripped(marionette: Marionette, grip: float) -> Marionette:
    """Puppet with winches that slip at ``grip`` [N] or less; wires have none."""
    winches = marionette.winches.copy()
    max_tension, rewind = WINCH_AT["max_tension"], WINCH_AT["rewind_speed"]
    for row, string in zip(winches, marionette.tree.strings, strict=True):
        if string.wire or row[max_tension] <= grip:
            continue
        row[max_tension] = grip
        if string.rewind_speed is None:
            row[rewind] = TOLERANCES.rewind_speed
    return marionette.with_winches(winches)


class Holding:
    """Rule that holds hands back in each tick.

    Attributes:
        held: (n_groups,) bool, groups that were held back in the last tick.

    Args:
        marionette: puppet with winches, as :func:`gripped` returns it.
        hands: hands of the puppet.
        grip: largest tension [N].
    """

    def __init__(self, marionette: Marionette, hands: Hands, grip: float):
        self.marionette, self.hands = marionette, hands
        own = marionette.winches[:, WINCH_AT["max_tension"]]
        self._wire: Mask = np.array([s.wire for s in marionette.tree.strings], dtype=bool)
        # A winch of the puppet that slips at a lower tension is left alone.
        self._firm = self._wire | (own >= grip)
        self._no_wires = not self._wire.any()
        self._max_slip = np.where(self._firm, TOLERANCES.min_slip, np.inf)
        self._pulls = np.where(self._firm, TOLERANCES.min_pull * grip, np.inf)
        self._grip = grip
        self._n_groups = len(hands.names)
        self._free = np.zeros(self._n_groups, dtype=bool)
        self.held = self._free
        self._moves = _moves(marionette.tree)
        self._turn = _turns(self._moves)

    def hold(self, x: State, tension: Array, wanted: VecK) -> VecK:
        """Velocities of the hands that the strings permit.

        Args:
            x: state.
            tension: (n_rows,) forces of strings and limits [N or N m].
            wanted: (n_vK,) wanted velocities [m/s or rad/s].
        """
        self.held = self._free
        slipped = x.slip > self._max_slip
        if self._no_wires and not slipped.any():
            return wanted
        n = len(self._pulls)
        pull = np.where(self._wire, np.abs(tension[:n]), tension[:n])
        pulling = pull > self._pulls
        if not (slipped.any() or (self._wire & pulling).any()):
            return wanted
        slip = float(np.max(x.slip[pulling & slipped], initial=0.0))
        strained = self._wire & (pull > self._grip)
        if strained.any():
            slip = max(slip, HELD)
        bounds = np.full(n, np.inf)
        bounds[slipped] = 0.0  # slack while it rewinds
        if slip > TOLERANCES.min_slip:
            bounds[pulling] = TOLERANCES.return_rate * (HELD - slip)
        if strained.any():
            # A wire cannot slip: its violation is taken back.
            at = {"q_D": x.q_D, "q_K": x.q_K, "p": self.marionette.p}
            h = self.marionette.library.evaluate("rows", **at).h
            bounds[strained] = -TOLERANCES.return_rate * np.abs(h[:n][strained])
        if not np.isfinite(bounds).any():
            return wanted
        self.held = self._free.copy()
        # A wire under compression bounds the opposite direction.
        bound = np.flatnonzero(np.isfinite(bounds))
        rates = self.rates(x)[bound] * np.where(tension[bound] < 0, -1.0, 1.0)[:, None]
        slower, bounds = wanted.copy(), bounds[bound]
        for _ in range(TOLERANCES.max_rounds * len(bound)):
            excess = rates @ slower - bounds
            worst = int(np.argmax(excess))
            by = excess[worst]
            if by <= TOLERANCES.max_excess or not self._slow_down(rates[worst], slower, by):
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
        for string, by in zip(self.marionette.tree.strings, slip, strict=True):
            if by > TOLERANCES.min_slip:
                reasons.setdefault(string.name, []).append(f"winch slips by {1000 * by:.0f} mm")
        return reasons

    def rates(self, x: State) -> Array:
        """(n_strings, n_vK) A_K of the strings: hdot_K of unit velocities.

        Velocities that move no string in common are evaluated together.
        """
        n_K, n_D = len(x.v_K), len(x.v_D)
        still, turn = np.zeros(n_D), self._turn
        unit = np.zeros((np.max(turn, initial=-1) + 1, n_K))
        unit[turn, np.arange(n_K)] = 1.0
        on = self.marionette.library.evaluate(
            "dynamics",
            q_D=x.q_D,
            v_D=still,
            q_K=x.q_K,
            v_K=unit,
            acc_K=np.zeros(n_K),
            u_D=still,
            p=self.marionette.p,
        )
        return np.where(self._moves, on.hdot_K[turn].T, 0.0)

    def _slow_down(self, row: Array, wanted: VecK, excess: float) -> bool:
        """Slows the groups that lengthen a string's path, in proportion; False without any."""
        group, n = self.hands.group, self._n_groups
        outward = np.maximum(np.bincount(group, row * wanted, n), 0.0)
        whole = outward.sum()
        if whole <= 0.0:
            return False
        size = np.bincount(group, row * row, n)
        back = excess * outward / (whole * np.where(size > 0.0, size, 1.0))
        wanted -= back[group] * row
        self.held |= outward > TOLERANCES.min_share * whole
        return True


def _moves(tree: Tree) -> Mask:
    """(n_strings, n_vK) whether a driven velocity changes the path or the length of a string."""
    moves = np.zeros((len(tree.strings), tree.coordinates.n_vK), dtype=bool)
    for row, string in zip(moves, tree.strings, strict=True):
        for point in string.points:
            for i in tree.ancestors(point.link):
                if tree.links[i].role is Role.DRIVEN:
                    row[tree.links[i].v] = True
        if string.driven_length:
            row[string.driven_length[1]] = True
    return moves


def _turns(moves: Mask) -> Indices:
    """(n_vK,) group of each driven velocity; no two velocities of a group move the same string."""
    turn = np.zeros(moves.shape[1], dtype=int)
    taken: list[Mask] = []
    for j, strings in enumerate(moves.T):
        free = (k for k, others in enumerate(taken) if not np.any(others & strings))
        turn[j] = next(free, len(taken))
        if turn[j] == len(taken):
            taken.append(np.zeros(len(moves), dtype=bool))
        taken[turn[j]] |= strings
    return turn
