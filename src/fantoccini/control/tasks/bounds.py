"""Bounds of a motion: driven coordinates, tensions, joints, forces and motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.control.tasks.nodes import Nodes, entry_names
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import DriveRow
from fantoccini.motion import State

Magnitudes: TypeAlias = float | Mapping[str, float]
"""The largest magnitude of all driven coordinates, or by name."""
_MIN_TENSION_SHARE = 5e-3
"""Smallest tension of a string that must stay taut, relative to the weight."""
_TAUT_TENSION_SHARE = 1e-4
"""Tension above which a string counts as taut at the start, relative to the weight."""

_STATE_TOLERANCE = 1e-9
"""Allowed violation of bounds by a start or an end, for rounding [m, rad or their rates]."""
_MAX_ROW_VIOLATION = 1e-3
"""Violation of a string or limit above which a state cannot be an end [m, rad]."""

Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Bounds:
    """Bounds of a motion.

    Attributes:
        position: driven scalar coordinate -> lowest and highest value [m or rad].
        speed, acceleration, jerk: largest magnitudes of the driven velocities and their rates, by
            name of the velocity or for all; unlimited by default.
        tension: string -> lowest and highest tension [N]; (0.1, inf) stays taut.
        force: driven velocity -> lowest and highest force that drives it, a run's ``effort`` [N or
            N m].
        voltage, current: largest magnitudes of R i + k n v and of i = f / (n k), for the force f
            that controllers ask of dc motors, by the command's name or for all; unlimited by
            default [V, A].
        joint: dynamic scalar coordinate -> lowest and highest value [rad or m].
        held: names of driven velocities that stay 0.
        clearance: least distance of bodies and strings from obstacles, and of bodies of different
            puppets from one another [m]; None for no check.
        own_body: whether bodies of one puppet that no joint connects keep that clearance, too.
    """

    position: Mapping[str, Interval] = field(default_factory=dict)
    speed: Magnitudes = np.inf
    acceleration: Magnitudes = np.inf
    jerk: Magnitudes = np.inf
    tension: Mapping[str, Interval] = field(default_factory=dict)
    joint: Mapping[str, Interval] = field(default_factory=dict)
    held: tuple[str, ...] = ()
    clearance: float | None = None
    own_body: bool = False
    force: Mapping[str, Interval] = field(default_factory=dict)
    voltage: Magnitudes = np.inf
    current: Magnitudes = np.inf

    @property
    def has_motors(self) -> bool:
        """Whether voltages or currents of motors have bounds."""
        return any(
            bool(bound) if isinstance(bound, Mapping) else bool(bound != np.inf)
            for bound in (self.voltage, self.current)
        )

    def magnitudes(self, marionette: Marionette, kind: str) -> Array:
        """(n_vK,) largest speed, acceleration or jerk of every driven velocity."""
        names, bound = marionette.coordinates.v_K, getattr(self, kind)
        magnitudes = np.full(len(names), np.inf)
        if isinstance(bound, Mapping):
            for name, value in bound.items():
                magnitudes[_index("driven velocity", name, names)] = value
        else:
            magnitudes[:] = bound
        if not np.all(magnitudes > 0.0):
            raise StateError(f"the bound of {kind} is {bound!r}; it must be greater than 0")
        if kind in ("acceleration", "jerk"):
            magnitudes[[_index("driven velocity", name, names) for name in self.held]] = 0.0
        return magnitudes

    def staying_taut(self, marionette: Marionette, x0: State) -> Bounds:
        """The same bounds, with strings that pull at the start kept taut."""
        tensions = motion_at(marionette, x0).tension
        names = [s.name for s in marionette.tree.strings]
        tension = dict(zip(names, tensions, strict=False))
        wires = {s.name for s in marionette.tree.strings if s.wire}
        min_tension = _MIN_TENSION_SHARE * marionette.weight
        taut = {
            name: (min(min_tension, 0.5 * pull), np.inf)
            for name, pull in tension.items()
            if pull > _TAUT_TENSION_SHARE * marionette.weight and name not in wires
        }
        return replace(self, tension={**taut, **self.tension})

    def intervals(self, marionette: Marionette) -> tuple[Array, Array]:
        """(n_z,) lowest and highest numbers of (q_D, v_D, q_K, v_K), in the order of velocities."""
        t = marionette.coordinates
        n, k = t.n_vD, t.n_vK
        low, high = np.full(2 * (n + k), -np.inf), np.full(2 * (n + k), np.inf)
        scalars_K = {t.q_K[q]: 2 * n + v for q, v in t.scalars_K}
        scalars_D = {t.q_D[q]: v for q, v in t.scalars_D}
        for label, bounds, indices in (
            ("driven scalar coordinate", self.position, scalars_K),
            ("dynamic scalar coordinate", self.joint, scalars_D),
        ):
            for name, (a, b) in bounds.items():
                if name not in indices:
                    raise UnknownNameError(label, name, list(indices))
                if not a < b:
                    text = f"the bounds of {name} are {a:g} to {b:g}; the first must be less"
                    raise StateError(text)
                low[indices[name]], high[indices[name]] = a, b
        speed = self.magnitudes(marionette, "speed")
        low[2 * n + k :], high[2 * n + k :] = -speed, speed
        return low, high

    def check_moves(self, marionette: Marionette) -> None:
        """Raises StateError if all driven coordinates are held."""
        if not np.any(self.magnitudes(marionette, "acceleration") > 0.0):
            raise StateError(
                "all driven coordinates are held, so that nothing can be optimised; needed: a "
                "driven coordinate that moves, or parameters"
            )

    def check_state(self, marionette: Marionette, x: State, when: str) -> None:
        """Raises StateError if a state is beyond the bounds of coordinates and speeds.

        Args:
            marionette: the puppet.
            x: the state.
            when: time for the message, such as ``at the end``.
        """
        t = marionette.coordinates
        for name in self.held:
            if abs(x.v_K[_index("driven velocity", name, t.v_K)]) > _STATE_TOLERANCE:
                raise StateError(f"{name} is held, but moves {when}")
        low, high = self.intervals(marionette)
        numbers = Nodes.still(marionette, x, 1.0, 1).numbers[0]
        for name, value, a, b in zip(entry_names(t), numbers, low, high, strict=True):
            if not a - _STATE_TOLERANCE <= value <= b + _STATE_TOLERANCE:
                raise StateError(f"{name} is {value:.6g} {when}, beyond its bounds {a:g} to {b:g}")

    def check_end(self, marionette: Marionette, x0: State, end: State) -> None:
        """Raises StateError if no motion from a start within bounds can end in a state."""
        self.check_state(marionette, end, "at the end")
        change = Nodes.still(marionette, x0, 1.0, 1).change_to(end)
        names = entry_names(marionette.coordinates)
        first_driven = 2 * marionette.coordinates.n_vD
        for name in self.held:
            index = first_driven + marionette.coordinates.v_K.index(name)
            if abs(change[index]) > _STATE_TOLERANCE:
                raise StateError(
                    f"{names[index]} is held, but its end differs from its start by "
                    f"{change[index]:.6g}; let it move, or choose an end that leaves it there"
                )
        h = Evaluation.of(marionette, end).h
        violation = np.where(marionette.two_sided, np.abs(h), h)
        if np.max(violation, initial=0.0) > _MAX_ROW_VIOLATION:
            row = int(np.argmax(violation))
            raise StateError(
                f"the state at the end violates {marionette.tree.row_names[row]} by {h[row]:.3g}; "
                "marionette.project(end) gives the nearest state that does not"
            )

    def tensions(self, marionette: Marionette) -> tuple[list[int], Array, Array]:
        """Rows of strings with bounds, and their lowest and highest tensions."""
        names = [s.name for s in marionette.tree.strings]
        return _intervals("tension", "string", self.tension, names)

    def forces(self, marionette: Marionette) -> tuple[list[int], Array, Array]:
        """Indices of driven velocities with bounds of force, and the lowest and highest forces."""
        if self.force and marionette.contacts is not None:
            raise StateError("bounds of forces need a puppet without contact")
        names = marionette.coordinates.v_K
        return _intervals("force", "driven velocity", self.force, names)

    def motors(self, marionette: Marionette, kind: str) -> tuple[list[DriveRow], Array]:
        """Drives with bounds of their dc motors, and the largest magnitudes.

        Args:
            marionette: the puppet.
            kind: ``voltage`` [V] or ``current`` [A].

        Raises:
            UnknownNameError: name that is not the command of a dc motor.
            StateError: bound that is not greater than 0, no motor to bound, or contact.
        """
        names = marionette.coordinates.v_K
        drives = {
            names[row.command[1]]: row
            for row in marionette.tree.drives
            if row.command is not None and isinstance(row.drive.motor, DirectCurrent)
        }
        bound = getattr(self, kind)
        if not isinstance(bound, Mapping):
            if bound == np.inf:
                return [], np.zeros(0)
            if not drives:
                raise StateError(
                    f"the bound of {kind} is {bound!r}; needed: a puppet with a dc motor"
                )
            bound = dict.fromkeys(drives, bound)
        for name, cap in bound.items():
            if name not in drives:
                raise UnknownNameError(f"dc motor's command with a bound of {kind}", name, drives)
            if np.ndim(cap) or not cap > 0.0:
                raise StateError(
                    f"the bound of {kind} of {name} is {cap!r}; it must be a number greater than 0"
                )
        if bound and marionette.contacts is not None:
            raise StateError(f"bounds of {kind}s need a puppet without contact")
        return [drives[name] for name in bound], np.array(list(bound.values()), dtype=float)


def _intervals(
    kind: str, label: str, intervals: Mapping[str, Interval], names: Sequence[str]
) -> tuple[list[int], Array, Array]:
    """Indices of names, and their lowest and highest values."""
    rows = [_index(label, name, names) for name in intervals]
    for name, pair in intervals.items():
        if np.shape(pair) != (2,) or not pair[0] < pair[1]:
            raise StateError(
                f"the {kind} of {name} is bounded by {pair!r}; needed: a lower and a higher one"
            )
    pairs = np.array(list(intervals.values()), dtype=float).reshape(-1, 2)
    return rows, pairs[:, 0], pairs[:, 1]


def _index(label: str, name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise UnknownNameError(label, name, list(names))
    return list(names).index(name)
