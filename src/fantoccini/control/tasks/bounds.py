"""Bounds of a motion: of the driven coordinates, of tensions and of joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from fantoccini.base import Array, StateError, UnknownNameError
from fantoccini.control.tasks.nodes import Nodes, number_names
from fantoccini.dynamics.compiled import Evaluation
from fantoccini.dynamics.derivatives import motion_at
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import DirectCurrent
from fantoccini.model.tree import DriveRow
from fantoccini.motion import State

Most: TypeAlias = float | Mapping[str, float]
"""The largest magnitude of all driven coordinates, or by name."""
_TAUT = 5e-3
"""Least tension of a string that is to stay taut, relative to the weight."""
_PULLS = 1e-4
"""Tension from which a string counts as taut, likewise."""

_START = 1e-9
"""How far a start may be beyond bounds: rounding [m, rad or their rates]."""
_HELD = 1e-3
"""Violation of a string or limit [m, rad] above which no motion ends in a state."""

Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Bounds:
    """What a motion may not leave.

    Attributes:
        position: driven scalar coordinate -> lowest and highest value [m or rad].
        speed, acceleration, jerk: largest magnitudes of the driven velocities and their rates, by
            name of the velocity or for all; unlimited by default.
        tension: string -> lowest and highest tension [N]; (0.1, inf) stays taut.
        force: driven velocity -> lowest and highest force that drives it, as a run's ``effort`` [N
            or N m].
        voltage, current: largest magnitudes of R i + k n v and of i = f / (n k), for the force f
            that controllers ask of dc motors, by the command's name or for all; unlimited by
            default [V, A].
        joint: dynamic scalar coordinate -> lowest and highest value [rad or m].
        held: names of driven velocities that do not move at all.
        clearance: of bodies and strings from obstacles, and of bodies of different puppets from one
            another, at least [m]; not looked at where it is None.
        own_body: whether bodies of one puppet that no joint connects keep that clearance, too.
    """

    position: Mapping[str, Interval] = field(default_factory=dict)
    speed: Most = np.inf
    acceleration: Most = np.inf
    jerk: Most = np.inf
    tension: Mapping[str, Interval] = field(default_factory=dict)
    joint: Mapping[str, Interval] = field(default_factory=dict)
    held: tuple[str, ...] = ()
    clearance: float | None = None
    own_body: bool = False
    force: Mapping[str, Interval] = field(default_factory=dict)
    voltage: Most = np.inf
    current: Most = np.inf

    @property
    def has_motors(self) -> bool:
        """Whether voltages or currents of motors have bounds."""
        return any(
            bool(given) if isinstance(given, Mapping) else bool(given != np.inf)
            for given in (self.voltage, self.current)
        )

    def magnitudes(self, marionette: Marionette, kind: str) -> Array:
        """(n_vK,) speed, acceleration or jerk of every driven velocity."""
        names, given = marionette.coordinates.v_K, getattr(self, kind)
        out = np.full(len(names), np.inf)
        if isinstance(given, Mapping):
            for name, value in given.items():
                out[_place("driven velocity", name, names)] = value
        else:
            out[:] = given
        if not np.all(out > 0.0):
            raise StateError(f"the bound of {kind} is {given!r}; it must be greater than 0")
        if kind in ("acceleration", "jerk"):
            out[[_place("driven velocity", name, names) for name in self.held]] = 0.0
        return out

    def staying_taut(self, marionette: Marionette, x0: State) -> Bounds:
        """The same, where strings that pull at the start keep pulling."""
        tensions = motion_at(marionette, x0).tension
        names = [s.name for s in marionette.tree.strings]
        tension = dict(zip(names, tensions, strict=False))
        wires = {s.name for s in marionette.tree.strings if s.wire}
        least = _TAUT * marionette.weight
        taut = {
            name: (min(least, 0.5 * pull), np.inf)
            for name, pull in tension.items()
            if pull > _PULLS * marionette.weight and name not in wires
        }
        return replace(self, tension={**taut, **self.tension})

    def intervals(self, marionette: Marionette) -> tuple[Array, Array]:
        """(n_z,) lowest and highest numbers of (q_D, v_D, q_K, v_K) as velocities count them."""
        t = marionette.coordinates
        n, k = t.n_vD, t.n_vK
        low, high = np.full(2 * (n + k), -np.inf), np.full(2 * (n + k), np.inf)
        scalars_K = {t.q_K[q]: 2 * n + v for q, v in t.scalars_K}
        scalars_D = {t.q_D[q]: v for q, v in t.scalars_D}
        for what, given, places in (
            ("driven scalar coordinate", self.position, scalars_K),
            ("dynamic scalar coordinate", self.joint, scalars_D),
        ):
            for name, (a, b) in given.items():
                if name not in places:
                    raise UnknownNameError(what, name, list(places))
                if not a < b:
                    text = f"the bounds of {name} are {a:g} to {b:g}; the first must be less"
                    raise StateError(text)
                low[places[name]], high[places[name]] = a, b
        speed = self.magnitudes(marionette, "speed")
        low[2 * n + k :], high[2 * n + k :] = -speed, speed
        return low, high

    def check_moves(self, marionette: Marionette) -> None:
        """Raises StateError where all driven coordinates are held."""
        if not np.any(self.magnitudes(marionette, "acceleration") > 0.0):
            raise StateError(
                "all driven coordinates are held, so that nothing can be optimised; needed: a "
                "driven coordinate that moves, or parameters"
            )

    def check_state(self, marionette: Marionette, x: State, when: str) -> None:
        """Raises StateError where a state is beyond the bounds of coordinates and speeds.

        Args:
            marionette: the puppet.
            x: the state.
            when: for the message, such as ``at the end``.
        """
        t = marionette.coordinates
        for name in self.held:
            if abs(x.v_K[_place("driven velocity", name, t.v_K)]) > _START:
                raise StateError(f"{name} is held, and moves {when}")
        low, high = self.intervals(marionette)
        numbers = Nodes.still(marionette, x, 1.0, 1).numbers[0]
        for name, value, a, b in zip(number_names(t), numbers, low, high, strict=True):
            if not a - _START <= value <= b + _START:
                raise StateError(f"{name} is {value:.6g} {when}, beyond its bounds {a:g} to {b:g}")

    def check_end(self, marionette: Marionette, x0: State, end: State) -> None:
        """Raises StateError where no motion from a start within bounds ends in a state."""
        self.check_state(marionette, end, "at the end")
        gap = Nodes.still(marionette, x0, 1.0, 1).gap_at_end(end)
        names = number_names(marionette.coordinates)
        first = 2 * marionette.coordinates.n_vD
        for name in self.held:
            at = first + marionette.coordinates.v_K.index(name)
            if abs(gap[at]) > _START:
                raise StateError(
                    f"{names[at]} is held, but the end is off its start by {gap[at]:.6g}; "
                    "let it move, or choose an end at its start"
                )
        h = Evaluation.of(marionette, end).h
        passed = np.where(marionette.two_sided, np.abs(h), h)
        if np.max(passed, initial=0.0) > _HELD:
            row = int(np.argmax(passed))
            raise StateError(
                f"the state at the end violates {marionette.tree.row_names[row]} by {h[row]:.3g}; "
                "marionette.project(end) gives the nearest state that does not"
            )

    def tensions(self, marionette: Marionette) -> tuple[list[int], Array, Array]:
        """Rows of strings with bounds, the lowest and the highest tensions."""
        names = [s.name for s in marionette.tree.strings]
        return _intervals("tension", "string", self.tension, names)

    def forces(self, marionette: Marionette) -> tuple[list[int], Array, Array]:
        """Places of driven velocities with bounds of force, the lowest and the highest forces."""
        if self.force and marionette.contacts is not None:
            raise StateError("bounds of forces want a puppet without contact")
        names = marionette.coordinates.v_K
        return _intervals("force", "driven velocity", self.force, names)

    def motors(self, marionette: Marionette, kind: str) -> tuple[list[DriveRow], Array]:
        """Drives whose dc motor has a bound, and the largest magnitudes.

        Args:
            marionette: the puppet.
            kind: ``voltage`` [V] or ``current`` [A].

        Raises:
            UnknownNameError: a name that is no command of a dc motor.
            StateError: a bound that is not greater than 0, no motor to bound, or contact.
        """
        names = marionette.coordinates.v_K
        drives = {
            names[row.command[1]]: row
            for row in marionette.tree.drives
            if row.command is not None and isinstance(row.drive.motor, DirectCurrent)
        }
        given = getattr(self, kind)
        if not isinstance(given, Mapping):
            if given == np.inf:
                return [], np.zeros(0)
            if not drives:
                raise StateError(
                    f"the bound of {kind} is {given!r}; needed: a puppet with a dc motor"
                )
            given = dict.fromkeys(drives, given)
        for name, most in given.items():
            if name not in drives:
                raise UnknownNameError(f"dc motor's command with a bound of {kind}", name, drives)
            if np.ndim(most) or not most > 0.0:
                raise StateError(
                    f"the bound of {kind} of {name} is {most!r}; it must be a number greater than 0"
                )
        if given and marionette.contacts is not None:
            raise StateError(f"bounds of {kind}s want a puppet without contact")
        return [drives[name] for name in given], np.array(list(given.values()), dtype=float)


def _intervals(
    kind: str, what: str, given: Mapping[str, Interval], names: Sequence[str]
) -> tuple[list[int], Array, Array]:
    """Places of names, and their lowest and highest values."""
    rows = [_place(what, name, names) for name in given]
    for name, pair in given.items():
        if np.shape(pair) != (2,) or not pair[0] < pair[1]:
            raise StateError(
                f"the {kind} of {name} is bounded by {pair!r}; needed: a lower and a higher one"
            )
    pairs = np.array(list(given.values()), dtype=float).reshape(-1, 2)
    return rows, pairs[:, 0], pairs[:, 1]


def _place(what: str, name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise UnknownNameError(what, name, list(names))
    return list(names).index(name)
