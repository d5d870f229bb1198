"""Grip: bounded tension of strings, and hands that slow down when they pull at a slipping one.

Every one-sided string gets a winch that slips at a largest tension, so that a motion exists for any
motion of the hands. If a string has slipped by more than ``min_slip`` while it pulls, the hands
that pull against it slow down. The rate u at which hands lengthen the path of a string is bounded,

  u = A_K v_K <= return_rate (HELD_SLIP - s),   s: the largest slip,

which returns them until the slip is ``HELD_SLIP``. A wire cannot slip; its violation counts
instead. Motion of a hand across the string, or towards the puppet, is unchanged.

The gap of a string is the length of its path minus its own, at most 0. A_K is its derivative by the
driven coordinates, v_K their velocities. A winch changes the length of a string; its slip is the
length that it lets out because the tension reached the largest one. In names, D stands for dynamic
coordinates, which move by the equations of motion. A row is a string or a joint limit with its gap
h <= 0.
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
        is_slowed: (n_groups,) bool, groups of hand coordinates that were slowed in the last tick.

    Args:
        marionette: puppet with winches, as :func:`gripped` returns it.
        hands: hands of the puppet.
        grip: largest tension [N].
    """

    def __init__(self, marionette: Marionette, hands: Hands, grip: float):
        self.marionette, self.hands = marionette, hands
        max_tension = marionette.winches[:, WINCH_AT["max_tension"]]
        self._is_wire: Mask = np.array([s.wire for s in marionette.tree.strings], dtype=bool)
        # Winches of the puppet that slip at a lower tension do not slow the hands.
        is_limited = self._is_wire | (max_tension >= grip)
        self._no_wires = not self._is_wire.any()
        self._max_slip = np.where(is_limited, TOLERANCES.min_slip, np.inf)
        self._min_pull = np.where(is_limited, TOLERANCES.min_pull * grip, np.inf)
        self._grip = grip
        self._n_groups = len(hands.names)
        self._none_slowed = np.zeros(self._n_groups, dtype=bool)
        self.is_slowed = self._none_slowed
        self._moves_string = _string_motion_mask(marionette.tree)
        self._batches = _independent_batches(self._moves_string)

    def limited(self, x: State, tension: Array, wanted: VecK) -> VecK:
        """Velocities (n_vK,) of the hands that the strings permit [m/s or rad/s].

        Args:
            x: state.
            tension: (n_rows,) forces of strings and limits [N or N m].
            wanted: (n_vK,) wanted velocities [m/s or rad/s].
        """
        self.is_slowed = self._none_slowed
        is_slipped = x.slip > self._max_slip
        if self._no_wires and not is_slipped.any():
            return wanted
        n = len(self._min_pull)
        pull = np.where(self._is_wire, np.abs(tension[:n]), tension[:n])
        is_pulling = pull > self._min_pull
        if not (is_slipped.any() or (self._is_wire & is_pulling).any()):
            return wanted
        slip = float(np.max(x.slip[is_pulling & is_slipped], initial=0.0))
        is_strained = self._is_wire & (pull > self._grip)
        if is_strained.any():
            slip = max(slip, HELD_SLIP)
        bounds = np.full(n, np.inf)
        bounds[is_slipped] = 0.0  # slack while it rewinds
        if slip > TOLERANCES.min_slip:
            bounds[is_pulling] = TOLERANCES.return_rate * (HELD_SLIP - slip)
        if is_strained.any():
            # A wire cannot slip: its violation is taken back.
            arguments = {"q_D": x.q_D, "q_K": x.q_K, "p": self.marionette.p}
            h = self.marionette.library.evaluate("rows", **arguments).h
            bounds[is_strained] = -TOLERANCES.return_rate * np.abs(h[:n][is_strained])
        if not np.isfinite(bounds).any():
            return wanted
        self.is_slowed = self._none_slowed.copy()
        # A wire under compression bounds the opposite direction.
        bounded_rows = np.flatnonzero(np.isfinite(bounds))
        rates = (
            self.rates(x)[bounded_rows] * np.where(tension[bounded_rows] < 0, -1.0, 1.0)[:, None]
        )
        velocity, bounds = wanted.copy(), bounds[bounded_rows]
        for _ in range(TOLERANCES.max_rounds * len(bounded_rows)):
            excesses = rates @ velocity - bounds
            worst_row = int(np.argmax(excesses))
            excess = excesses[worst_row]
            if excess <= TOLERANCES.max_excess or not self._slow_down(
                rates[worst_row], velocity, excess
            ):
                break
        return self.hands.bounded_velocity(velocity)

    def messages(self, slip: Array) -> dict[str, list[str]]:
        """Reasons why handles and strings lag, by name.

        Args:
            slip: (n_strings,) slip of the strings [m].
        """
        reasons: dict[str, list[str]] = {}
        for name in dict.fromkeys(np.array(self.hands.names)[self.is_slowed].tolist()):
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
        zero_velocity, batches = np.zeros(n_D), self._batches
        unit_velocities = np.zeros((np.max(batches, initial=-1) + 1, n_K))
        unit_velocities[batches, np.arange(n_K)] = 1.0
        dynamics = self.marionette.library.evaluate(
            "dynamics",
            q_D=x.q_D,
            v_D=zero_velocity,
            q_K=x.q_K,
            v_K=unit_velocities,
            acc_K=np.zeros(n_K),
            u_D=zero_velocity,
            p=self.marionette.p,
        )
        return np.where(self._moves_string, dynamics.hdot_K[batches].T, 0.0)

    def _slow_down(self, row: Array, wanted: VecK, excess: float) -> bool:
        """Slows the groups that lengthen a string's path, in proportion; False without any."""
        group, n = self.hands.group, self._n_groups
        lengthening_rates = np.maximum(np.bincount(group, row * wanted, n), 0.0)
        total_rate = lengthening_rates.sum()
        if total_rate <= 0.0:
            return False
        squared_norm = np.bincount(group, row * row, n)
        correction = (
            excess
            * lengthening_rates
            / (total_rate * np.where(squared_norm > 0.0, squared_norm, 1.0))
        )
        wanted -= correction[group] * row
        self.is_slowed |= lengthening_rates > TOLERANCES.min_share * total_rate
        return True


def _string_motion_mask(tree: Tree) -> Mask:
    """(n_strings, n_vK) bool, whether a velocity changes the path or the length of a string."""
    mask = np.zeros((len(tree.strings), tree.coordinates.n_vK), dtype=bool)
    for row, string in zip(mask, tree.strings, strict=True):
        for point in string.points:
            for i in tree.ancestors(point.link):
                if tree.links[i].role is Role.DRIVEN:
                    row[tree.links[i].v] = True
        if string.driven_length:
            row[string.driven_length[1]] = True
    return mask


def _independent_batches(moves: Mask) -> Indices:
    """(n_vK,) batch of each driven velocity; no two of a batch move the same string."""
    batches = np.zeros(moves.shape[1], dtype=int)
    strings_of_batch: list[Mask] = []
    for j, strings in enumerate(moves.T):
        free_batches = (
            k
            for k, moved_strings in enumerate(strings_of_batch)
            if not np.any(moved_strings & strings)
        )
        batches[j] = next(free_batches, len(strings_of_batch))
        if batches[j] == len(strings_of_batch):
            strings_of_batch.append(np.zeros(len(moves), dtype=bool))
        strings_of_batch[batches[j]] |= strings
    return batches
