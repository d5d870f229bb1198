"""Grip: no string pulls harder than a hand can hold, and a hand that slips does not go farther.

Every one-sided string gets a winch that slips at a largest tension, so that a motion exists
whatever the hands do. Where one has slipped by more than ``SLIPPED`` while it pulls, the hands that
pull against it are slowed down. With the rate u at which hands lengthen the way of a string,

  u = A_K v_K <= RETURN (HELD - s),   s: the largest slip,

takes them back to where it has slipped by ``HELD``; a wire cannot slip, and s is what it is
overstepped by beyond that. What a hand does across the string, or towards
the puppet, stays as it was.
"""

from __future__ import annotations

import numpy as np

from fantoccini.arrays import Array, VecK
from fantoccini.contract import WINCH_AT
from fantoccini.marionette import Marionette
from fantoccini.motion import State
from fantoccini.perform.hands import Hands

GRIP = 20.0
"""Largest tension of a string, in weights of the puppet."""
REWIND = 1.0
"""Speed at which a winch takes back what slipped, where the puppet does not say [m/s]."""
SLIPPED = 0.005
"""Slip from which on hands are slowed down [m]."""
HELD = 0.010
"""Slip to which hands are taken back [m]."""
RETURN = 20.0
"""Rate at which they are [1/s]."""
_PULLS = 0.5
"""Part of its largest tension from which on a string counts as pulling."""
_ROUNDS = 3
"""Times a string is looked at, as a hand may hold several."""
_ENOUGH = 1e-6
"""Rate beyond what is allowed that is let be [m/s]."""
_SHARE = 0.05
"""Part of a string's rate from which on a hand is said to be held back."""


def gripped(marionette: Marionette, grip: float) -> Marionette:
    """The puppet on winches that slip at ``grip`` [N] at the latest; wires do not."""
    winches = marionette.winches.copy()
    most, rewind = WINCH_AT["max_tension"], WINCH_AT["rewind_speed"]
    for row, string in zip(winches, marionette.tree.strings, strict=True):
        if string.wire or row[most] <= grip:
            continue
        row[most] = grip
        if string.rewind_speed is None:
            row[rewind] = REWIND
    return marionette.with_winches(winches)


class Holding:
    """Which hands are held back, tick by tick.

    Attributes:
        held: (n_groups,) bool, the groups that the last tick held back.

    Args:
        marionette: on its winches.
        hands: of the puppet.
        grip: [N].
    """

    def __init__(self, marionette: Marionette, hands: Hands, grip: float):
        self.marionette, self.hands = marionette, hands
        n = len(marionette.tree.strings)
        own = marionette.winches[:, WINCH_AT["max_tension"]]
        self._wire = marionette.model.two_sided[:n]
        # A winch that the puppet lets slip earlier slips as it is meant to.
        self._firm = self._wire | (own >= grip)
        self._pulls = np.where(self._firm, _PULLS * grip, np.inf)
        self._grip = grip
        self._n_groups = len(hands.names)
        self._free = np.zeros(self._n_groups, dtype=bool)
        self.held = self._free

    def hold(self, x: State, tension: Array, wanted: VecK) -> VecK:
        """Velocities without what the strings do not let hands do.

        Args:
            x: where the puppet is.
            tension: (n_rows,) forces of strings and limits [N or N m].
            wanted: (n_vK,) velocities [m/s or rad/s].
        """
        self.held = self._free
        n = len(self._pulls)
        pull = np.where(self._wire, np.abs(tension[:n]), tension[:n])
        pulling, slipped = pull > self._pulls, self._firm & (x.slip > SLIPPED)
        if not (slipped.any() or (self._wire & pulling).any()):
            return wanted
        slip = float(np.max(x.slip[pulling & slipped], initial=0.0))
        strained = self._wire & (pull > self._grip)
        if strained.any():
            slip = max(slip, HELD)
        most = np.full(n, np.inf)
        most[slipped] = 0.0  # it is slack, and being wound back
        if slip > SLIPPED:
            most[pulling] = RETURN * (HELD - slip)
        if strained.any():
            # A wire cannot slip: what it is overstepped by is taken back.
            at = {"q_D": x.q_D, "q_K": x.q_K, "p": self.marionette.p}
            h = self.marionette.model.library.evaluate("rows", **at).h
            most[strained] = -RETURN * np.abs(h[:n][strained])
        if not np.isfinite(most).any():
            return wanted
        self.held = self._free.copy()
        # A wire that is pushed hinders its hand the other way.
        bound = np.flatnonzero(np.isfinite(most))
        rates = self.rates(x)[bound] * np.where(tension[bound] < 0, -1.0, 1.0)[:, None]
        slower, most = wanted.copy(), most[bound]
        for _ in range(_ROUNDS * len(bound)):
            excess = rates @ slower - most
            worst = int(np.argmax(excess))
            if excess[worst] <= _ENOUGH or not self._slow_down(rates[worst], slower, excess[worst]):
                break
        return self.hands.bounded(slower)

    def said(self, slip: Array) -> dict[str, list[str]]:
        """Names of handles and strings -> what holds them back, in words.

        Args:
            slip: (n_strings,) [m].
        """
        found: dict[str, list[str]] = {}
        for name in dict.fromkeys(np.array(self.hands.names)[self.held].tolist()):
            found[name] = ["hand pulls against its limit"]
        for string, by in zip(self.marionette.tree.strings, slip, strict=True):
            if by > SLIPPED:
                found.setdefault(string.name, []).append(f"winch slips by {1000 * by:.0f} mm")
        return found

    def rates(self, x: State) -> Array:
        """A_K of the strings, (n_strings, n_vK): hdot_K of a unit velocity at a time."""
        n_K, n_D = len(x.v_K), len(x.v_D)
        still, unit = np.zeros(n_D), np.eye(n_K)
        on = self.marionette.model.library.evaluate(
            "dynamics", q_D=x.q_D, v_D=still, q_K=x.q_K, v_K=unit, acc_K=np.zeros(n_K), u_D=still,
            p=self.marionette.p,
        )  # fmt: skip
        return on.hdot_K.T

    def _slow_down(self, row: Array, wanted: VecK, excess: float) -> bool:
        """Takes the groups back that lengthen a string's way, each in proportion.

        Returns:
            Whether there are any.
        """
        group, n = self.hands.group, self._n_groups
        outward = np.maximum(np.bincount(group, row * wanted, n), 0.0)
        whole = outward.sum()
        if whole <= 0.0:
            return False
        size = np.bincount(group, row * row, n)
        back = excess * outward / (whole * np.where(size > 0.0, size, 1.0))
        wanted -= back[group] * row
        self.held |= outward > _SHARE * whole
        return True
