"""Bounds of a motion: driven coordinates, tensions, joints, forces and motors.

A driven coordinate is an end or a length of a string, or a driven joint; q_K and v_K are these
coordinates and their velocities. A drive moves one by a motor towards a command. In names, D stands
for dynamic coordinates, which move by the equations of motion. A taut string pulls, a slack one
does not. A row is a condition on a number of the motion, such as a tension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias, TypeVar

import numpy as np

from fantoccini.base import Array, Mask, StateError, UnknownNameError
from fantoccini.control.tasks.ends import End
from fantoccini.control.tasks.nodes import Nodes, entry_names
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import CoordinateTable, DriveRow
from fantoccini.motion import State

Magnitudes: TypeAlias = float | Mapping[str, float]
"""The largest magnitude, for all driven coordinates or name -> magnitude."""
_MIN_TENSION_SHARE = 5e-3
"""Smallest tension of a string that must stay taut, relative to the weight."""
_TAUT_TENSION_SHARE = 1e-4
"""Tension above which a string counts as taut at the start, relative to the weight."""

_STATE_TOLERANCE = 1e-9
"""Allowed violation of bounds by a start or an end, for rounding [m, rad or their rates]."""
_MAX_ROW_VIOLATION = 1e-3
"""Violation of a string or limit above which a state cannot be an end [m, rad]."""

Interval: TypeAlias = tuple[float, float]
Value = TypeVar("Value")


@dataclass(frozen=True)
class Bounds:
    """Bounds of a motion.

    If a drive moves a coordinate, the bounds apply to the drive's command; either name is allowed.

    Attributes:
        position: driven scalar coordinate -> lowest and highest value [m or rad].
        speed, acceleration, jerk: largest magnitudes of the driven velocities and their rates, by
            name of the velocity or for all; unlimited by default. Velocities with a speed or an
            acceleration of 0 by name stay 0.
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
        own_body: whether ``clearance`` also applies to bodies of one puppet that no joint connects.
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
        table, bound = marionette.coordinates, getattr(self, kind)
        magnitudes = np.full(table.n_vK, np.inf)
        if isinstance(bound, Mapping):
            for k, (_, value) in resolve_driven(table, table.v_K, bound, kind).items():
                is_held = value == 0.0 and kind in ("speed", "acceleration")
                magnitudes[k] = np.inf if is_held else value
        else:
            magnitudes[:] = bound
        if not np.all(magnitudes > 0.0):
            raise StateError(f"the bound of {kind} is {bound!r}; it must be greater than 0")
        if kind in ("acceleration", "jerk"):
            magnitudes[list(self.held_velocities(table))] = 0.0
        return magnitudes

    def held_velocities(self, table: CoordinateTable) -> dict[int, str]:
        """Indices of the driven velocities that stay 0, and their names.

        They are in ``held``, or have a bound of speed or acceleration of 0.
        """
        held = resolve_driven(table, table.v_K, dict.fromkeys(self.held), "held")
        for kind in ("speed", "acceleration"):
            bound = getattr(self, kind)
            if isinstance(bound, Mapping):
                names = [name for name, value in bound.items() if value == 0.0]
                held |= resolve_driven(table, table.v_K, dict.fromkeys(names), kind)
        return {k: name for k, (name, _) in held.items()}

    def with_taut_strings(self, marionette: Marionette, x0: State) -> Bounds:
        """The same bounds, with strings that pull at the start kept taut."""
        tensions = motion_at(marionette, x0).tension
        names = [s.name for s in marionette.tree.strings]
        tension = dict(zip(names, tensions, strict=False))
        wires = {s.name for s in marionette.tree.strings if s.wire}
        min_tension = _MIN_TENSION_SHARE * marionette.weight
        taut = {
            name: (min(min_tension, 0.5 * force), np.inf)
            for name, force in tension.items()
            if force > _TAUT_TENSION_SHARE * marionette.weight and name not in wires
        }
        return replace(self, tension={**taut, **self.tension})

    def intervals(self, marionette: Marionette) -> tuple[Array, Array]:
        """(n_z,) lowest and highest numbers of (q_D, v_D, q_K, v_K), in the order of velocities."""
        table = marionette.coordinates
        n, k = table.n_vD, table.n_vK
        low, high = np.full(2 * (n + k), -np.inf), np.full(2 * (n + k), np.inf)
        names_K = [table.q_K[q] for q, _ in table.scalars_K]
        names_D = [table.q_D[q] for q, _ in table.scalars_D]
        driven = resolve_driven(table, names_K, self.position, "position")
        spans = [(2 * n + table.scalars_K[i][1], *entry) for i, entry in driven.items()]
        for name, span in self.joint.items():
            index = _index("dynamic scalar coordinate", name, names_D)
            spans.append((table.scalars_D[index][1], name, span))
        for index, name, (lower, upper) in spans:
            if not lower < upper:
                text = f"the bounds of {name} are {lower:g} to {upper:g}; the first must be less"
                raise StateError(text)
            low[index], high[index] = lower, upper
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

    def check_state(
        self, marionette: Marionette, x: State, moment: str, required: Mask | None = None
    ) -> None:
        """Raises StateError if a state is beyond the bounds of coordinates and speeds.

        Args:
            marionette: the puppet.
            x: the state.
            moment: time for the message, such as ``at the end``.
            required: (n_z,) bool, the entries of z to check; all by default.
        """
        table = marionette.coordinates
        checked = (
            np.ones(2 * (table.n_vD + table.n_vK), dtype=bool) if required is None else required
        )
        for k, name in self.held_velocities(table).items():
            if checked[2 * table.n_vD + table.n_vK + k] and abs(x.v_K[k]) > _STATE_TOLERANCE:
                raise StateError(f"{name} is held, but moves {moment}")
        low, high = self.intervals(marionette)
        numbers = Nodes.constant(marionette, x, 1.0, 1).scalars[0]
        entries = zip(entry_names(table), checked, numbers, low, high, strict=True)
        for name, is_checked, value, lower, upper in entries:
            if is_checked and not lower - _STATE_TOLERANCE <= value <= upper + _STATE_TOLERANCE:
                raise StateError(
                    f"{name} is {value:.6g} {moment}, beyond its bounds {lower:g} to {upper:g}"
                )

    def check_end(self, marionette: Marionette, x0: State, end: End) -> None:
        """Raises StateError if no motion from a start within bounds can reach an end."""
        self.check_state(marionette, end.state, "at the end", end.required)
        change = end.gap(Nodes.constant(marionette, x0, 1.0, 1))
        names = entry_names(marionette.coordinates)
        first_driven = 2 * marionette.coordinates.n_vD
        for k in self.held_velocities(marionette.coordinates):
            index = first_driven + k
            if abs(change[index]) > _STATE_TOLERANCE:
                raise StateError(
                    f"{names[index]} is held, but its end differs from its start by "
                    f"{change[index]:.6g}; let it move, or choose an end that leaves it there"
                )
        if not np.all(end.required):
            return
        h = Evaluation.at_state(marionette, end.state).h
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
        table = marionette.coordinates
        forces = resolve_driven(table, table.v_K, self.force, "force")
        spans = {table.v_K[k]: span for k, (_, span) in forces.items()}
        return _intervals("force", "driven velocity", spans, table.v_K)

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
        for name, limit in bound.items():
            if name not in drives:
                raise UnknownNameError(f"dc motor's command with a bound of {kind}", name, drives)
            if np.ndim(limit) or not limit > 0.0:
                raise StateError(
                    f"the bound of {kind} of {name} is {limit!r}; it must be a number "
                    "greater than 0"
                )
        if bound and marionette.contacts is not None:
            raise StateError(f"bounds of {kind}s need a puppet without contact")
        return [drives[name] for name in bound], np.array(list(bound.values()), dtype=float)


def resolve_driven(
    table: CoordinateTable, names: Sequence[str], values: Mapping[str, Value], label: str
) -> dict[int, tuple[str, Value]]:
    """Index in names -> given name and value of driven coordinates.

    Args:
        table: coordinates of the puppet.
        names: names of driven coordinates or velocities.
        values: name -> value; a coordinate with a drive may have its own name or its command's.
        label: kind of value, for messages.

    Raises:
        UnknownNameError: name that is not a driven coordinate.
        StateError: coordinate named twice.
    """
    by_index: dict[int, tuple[str, Value]] = {}
    for name, value in values.items():
        driven = table.commands.get(name, name)
        if driven not in names:
            raise UnknownNameError("driven coordinate", name, [*table.commands, *names])
        k = list(names).index(driven)
        if k in by_index:
            text = f"the {label} of {driven} is given twice: as {by_index[k][0]} and {name}"
            raise StateError(text)
        by_index[k] = name, value
    return by_index


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
