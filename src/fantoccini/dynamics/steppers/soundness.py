"""Bounds of sound runs in fixed steps, and the check of their energy ledgers, piece by piece.

Fixed steps never stop by themselves. A run is sound only if its rows hold and its energy has a
source. Whole runs, batches and steppers are judged by the functions of this module.

A row is a string or a joint limit. The ledger is the table of energies and work; its residual is
the energy that it cannot account for. In names, D stands for dynamic coordinates, which move by the
equations of motion, and K for driven ones: ends and lengths of strings, driven joints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, Indices, StateError, Status, Times
from fantoccini.dynamics.compiled import CompiledPuppet, check_step
from fantoccini.motion import Columns


@dataclass(frozen=True)
class Bounds:
    """Bounds beyond which a run is not sound."""

    max_violation: float = 0.02  # Largest violation of a string, limit or contact [m or rad]
    max_slow_move: float = 0.02
    """Largest move in a step above which violations after the last step are computed; the curvature
    of slower steps causes violations far below ``max_violation`` [rad or m]."""
    max_gain: float = 5.0
    """Energy without a source, relative to all available energy. Near the critical step of a spring
    the energy oscillates with several times its value, and does not grow."""
    max_unbalanced: float = 0.2
    """Largest residual of the ledger, relative to the energy exchanged. Over many small impacts,
    errors of sound steps add up: the bundled walk has 0.105 with 2 ms, half of it with 1 ms."""
    n_coarse_steps: float = 20.0
    """Number of coarse steps: the energy of a fall of this duration is wrong by its own size; and
    that of springs oscillates by its own size, if this many steps are their longest stable one."""
    available_fall: float = 1e-3  # Fall of the puppet whose energy always counts as available [m]
    available_energy: float = 1e-9  # Energy that always counts as available [J]
    max_named: int = 5  # Maximum number of rows named in a message


BOUNDS = Bounds()
_ENTRIES = ("kinetic", "potential", "work", "damping", "residual")
"""Entries of a ledger that are checked."""


def faults(violation: Array, gain: Array, unbalanced: Array) -> Array:
    """``Status`` numbers (...,): DONE or the fault; NaN counts as too large.

    Args:
        violation: (...,) largest violations of strings, limits and contacts [m or rad].
        gain: (...,) gains of a :class:`LedgerCheck`.
        unbalanced: (...,) its shares.
    """
    status = np.where(unbalanced <= BOUNDS.max_unbalanced, int(Status.DONE), int(Status.UNBALANCED))
    status = np.where(gain <= BOUNDS.max_gain, status, int(Status.GAINED_ENERGY))
    return np.where(violation <= BOUNDS.max_violation, status, int(Status.OVERSTEPPED))


def fault_of_run(violation: float, gain: float, unbalanced: float) -> Status:
    """Status of one run; see :func:`faults`."""
    numbers = map(np.asarray, (violation, gain, unbalanced))
    return Status(int(faults(*numbers)))


def excused_share(method: str, share: float, springs_swing: Callable[[], bool]) -> float:
    """Share of a :class:`LedgerCheck`, or 0 if sound steps of the method have such a share too.

    Args:
        method: method of the run.
        share: share.
        springs_swing: callback for :func:`springs_swing`, which is called for large shares only.
    """
    if share > BOUNDS.max_unbalanced and (method != "timestepping" or springs_swing()):
        return 0.0
    return share


def springs_swing(marionette: CompiledPuppet, q_D: Array, q_K: Array, dt: float) -> bool:
    """Whether fast springs or chains make the energy of sound steps oscillate by a tenth.

    If the step is the fraction s of the longest stable one, it oscillates by 2 s / (1 - s), without
    growth.
    """
    try:
        check_step(marionette, "timestepping", q_D, q_K, BOUNDS.n_coarse_steps * dt)
    except StateError:
        return True
    return False


class LedgerCheck:
    """Check of the energy ledgers of one or more runs, which takes their samples piece by piece.

    The energy exchanged until a sample is the largest T, the range of V and the largest work until
    then, and the energy of a fall over the number of coarse steps. What comes later does not count:
    a run that gains energy is not sound because its inputs do more work afterwards. The damping of
    the steps beside a sample is not counted, because it is booked a step late.

    The energy available over the run is T at the start, the largest fall of V, and all work, taken
    as positive: near the longest stable step of a spring the residual oscillates, and exceeds at
    first by far what was available until then.

    Attributes:
        share: (...,) largest residuals of either sign, relative to the energy exchanged until then.
        gain: (...,) largest residuals, relative to the energy available until now.

    Args:
        marionette: the puppet.
        dt: length of the steps [s].
        ledger: entries (...,) of the ledgers at the start [J].
        t: (...,) times of the start [s].
        p: (..., n_p) parameters of the runs; by default those of the puppet.
    """

    def __init__(
        self,
        marionette: CompiledPuppet,
        dt: float,
        ledger: Mapping[str, Array],
        t: Times,
        p: Array | None = None,
    ):
        self._marionette, self._dt = marionette, dt
        self._memory = _start_memory(ledger, t) | _energy_scales(marionette, p)

    def restart(self, runs: Indices, ledger: Mapping[str, Array], t: Times, p: Array) -> None:
        """Restarts m of the runs, with their ledger entries (m,), times (m,) and parameters
        (m, n_p)."""
        for name, values in (
            _start_memory(ledger, t) | _energy_scales(self._marionette, p)
        ).items():
            self._memory[name] = self._memory[name].copy()
            self._memory[name][..., runs] = values

    def add(self, ledger: Mapping[str, Array] | Columns, t: Times) -> Array:
        """Adds samples, and returns the shares (..., T + 1) of the last sample and of these.

        Args:
            ledger: entries (..., T) of the ledgers [J].
            t: (..., T) or (T,) their times [s].
        """
        memory = self._memory
        new_entries = np.stack([np.asarray(ledger[name]) for name in _ENTRIES])
        entries = np.concatenate([memory["entries"][..., None], new_entries], axis=-1)
        t = np.concatenate(
            [memory["t"][..., None], np.broadcast_to(t, new_entries.shape[1:])], axis=-1
        )
        peaks = _exchanged_energies(entries)
        peaks[..., 0] = np.maximum(peaks[..., 0], memory["peaks"])
        peaks = np.maximum.accumulate(peaks, axis=-1)
        step = np.minimum(self._dt, t - memory["since"][..., None])
        exchanged = (
            np.sum(peaks, axis=0) + memory["coarse"][..., None] * step**2 + BOUNDS.available_energy
        )
        _, _, work, damping, residual = entries
        damping_steps = np.zeros((*t.shape[:-1], t.shape[-1] + 1))
        damping_steps[..., 0] = memory["damped"]
        damping_steps[..., 1:-1] = np.abs(np.diff(damping)) / np.maximum(np.diff(t) / self._dt, 1.0)
        damping_lag = np.maximum(damping_steps[..., 1:], damping_steps[..., :-1])
        shares = np.maximum(np.abs(residual) - damping_lag, 0.0) / exchanged
        self._memory = memory | {
            "entries": entries[..., -1],
            "t": t[..., -1],
            "peaks": peaks[..., -1],
            "damped": damping_steps[..., -2],
            "worked": memory["worked"] + np.sum(np.abs(np.diff(work)), axis=-1),
            "risen": np.maximum(memory["risen"], np.max(residual, axis=-1)),
            "earlier": np.maximum(
                memory["earlier"], np.max(shares[..., :-1], axis=-1, initial=0.0)
            ),
            "share": shares[..., -1],
        }
        return shares

    @property
    def share(self) -> Array:
        return np.maximum(self._memory["earlier"], self._memory["share"])

    @property
    def gain(self) -> Array:
        memory = self._memory
        available_potential = memory["V_0"] + memory["peaks"][2]
        return np.asarray(
            memory["risen"]
            / (memory["T_0"] + available_potential + memory["worked"] + memory["available"])
        )

    def __copy__(self) -> LedgerCheck:
        # The arrays are replaced, and never written in place.
        other = object.__new__(LedgerCheck)
        other.__dict__.update(self.__dict__, _memory=dict(self._memory))
        return other


def _energy_scales(marionette: CompiledPuppet, p: Array | None) -> dict[str, Array]:
    """Energy (...,) that always counts as available [J], and energy of a fall by its squared
    duration [J/s^2]."""
    if p is None:
        weight, mass = np.array(marionette.weight), np.array(marionette.mass)
    else:
        rows, run_index = np.unique(p, axis=0, return_inverse=True)
        puppets = [marionette.with_p(row) for row in rows]
        weight, mass = np.array([(m.weight, m.mass) for m in puppets]).T[:, run_index.ravel()]
    g = weight / np.maximum(mass, BOUNDS.available_energy)
    return {
        "available": BOUNDS.available_fall * weight + BOUNDS.available_energy,
        "coarse": 0.5 * weight * g * BOUNDS.n_coarse_steps**2,
    }


def _start_memory(ledger: Mapping[str, Array], t: Times) -> dict[str, Array]:
    """Memory of a :class:`LedgerCheck` at the start of its runs."""
    entries = np.stack([np.asarray(ledger[name], dtype=float) for name in _ENTRIES])
    t = np.array(np.broadcast_to(t, entries.shape[1:]), dtype=float)
    at = {"entries": entries, "t": t, "since": t, "peaks": _exchanged_energies(entries)}
    at |= {"T_0": entries[0], "V_0": entries[1]}
    return at | dict.fromkeys(("damped", "worked", "risen", "earlier", "share"), np.zeros(t.shape))


def _exchanged_energies(entries: Array) -> Array:
    """(4, ...) energies whose largest values are those exchanged: T, V, -V, and work [J]."""
    T, V, work = entries[:3]
    return np.stack([T, V, -V, np.abs(work)])
