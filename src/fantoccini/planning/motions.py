"""Motions from many states at once, within bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette import Marionette
from fantoccini.planning.clearance import Clearance
from fantoccini.planning.goals import Goal, Rows
from fantoccini.runtime import Funnel, Segments, Sweeper, Terms
from fantoccini.tree import CoordinateTable

_INNER = 0.8
"""Part of the tolerance that a search goes for: its plans arrive in other simulations too."""


_FASTEST = 1e6
"""Largest bound on a speed or an acceleration [m/s or m/s^2; rad/s or rad/s^2]."""

_FASTER = 1.01
"""Part of the speed bounds that free motions keep."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """What the driven coordinates may do.

    Attributes:
        speed: (n_vK,) largest |v_K| [m/s or rad/s].
        acceleration: (n_vK,) largest |acc_K| [m/s^2 or rad/s^2].
        low, high: (n_qK,) range of the coordinates [m or rad].
    """

    speed: Array
    acceleration: Array
    low: Array
    high: Array

    @property
    def moves(self) -> Array:
        """(n_vK,) bool, the coordinates that may move."""
        return (self.speed > 0.0) & (self.acceleration > 0.0)

    @classmethod
    def of(
        cls,
        marionette: Marionette,
        speed: float | Mapping[str, float],
        acceleration: float | Mapping[str, float],
        ranges: Mapping[str, tuple[float, float]],
    ) -> Bounds:
        """Bounds from what a user gives.

        Args:
            marionette: the puppet.
            speed, acceleration: of all driven coordinates, or name -> value; coordinates that are
                not named hold still. One with a drive goes by its own name or its command's.
            ranges: name -> (low, high); the others are free, but that lengths stay positive.

        Raises:
            UnknownNameError: a name that is no driven coordinate.
            StateError: a bound that is negative or not finite, a coordinate that is named twice,
                none that may move, or a puppet with driven rotations.
        """
        table = marionette.coordinates
        if table.quaternions_K:
            raise StateError("plans move points and lengths; this puppet has a driven rotation")
        sizes = {
            "speed": _bounds(table, speed, "speed"),
            "acceleration": _bounds(table, acceleration, "acceleration"),
        }
        if not np.any((sizes["speed"] > 0.0) & (sizes["acceleration"] > 0.0)):
            raise StateError("no driven coordinate may move: speed or acceleration is 0 for all")
        low, high = np.full(table.n_qK, -np.inf), np.full(table.n_qK, np.inf)
        for string in (*marionette.tree.strings, *marionette.tree.chains):
            lead = marionette.tree.length_lead(string)
            if lead is not None:
                low[lead[0]] = 1e-3
        for k, (name, (least, most)) in _placed(table, ranges, "range").items():
            if not least < most:
                raise StateError(f"the range of {name} is {least} to {most}; it must not be empty")
            low[k], high[k] = max(low[k], least), most
        return cls(**sizes, low=low, high=high)


def _placed(table: CoordinateTable, given: Mapping[str, Any], what: str) -> dict[int, tuple]:
    """Place in q_K -> name and value, for names of driven coordinates or of those with a drive."""
    found: dict[int, tuple] = {}
    for name, value in given.items():
        driven = table.commands.get(name, name)
        if driven not in table.q_K:
            raise UnknownNameError("driven coordinate", name, [*table.commands, *table.q_K])
        k = table.q_K.index(driven)
        if k in found:
            raise StateError(f"the {what} of {driven} is given twice: as {found[k][0]} and {name}")
        found[k] = name, value
    return found


def _bounds(table: CoordinateTable, given: float | Mapping[str, float], what: str) -> Array:
    if not isinstance(given, Mapping):
        given = dict.fromkeys(table.q_K, given)
    found = np.zeros(table.n_qK)
    for k, (name, value) in _placed(table, given, what).items():
        if not 0.0 <= value <= _FASTEST:
            raise StateError(
                f"the {what} of {name} is {value}; it must be at least 0 and at most {_FASTEST:g}"
            )
        found[k] = value
    return found


class Motions:
    """Makes motions by time-stepping in lanes on all threads, and looks whether they are clear.

    Motions are made of segments in which every driven coordinate has a constant acceleration.

    Attributes:
        inner: distance from the goal at which motions end.
        funnels: the laws that motions may be led by; empty where there is none.

    Args:
        marionette: the puppet.
        clearance: what it keeps clear of.
        bounds: of the driven coordinates.
        goal: that motions end at.
        tolerance: of the goal's distance.
        margin: least clearance [m].
        slack: whether strings that pull may go slack on the way.
        dt: step [s].
        look: steps from one look for collisions and the goal to the next.
        looks: of a segment.
        threads: that share the work; the results do not depend on it.
    """

    def __init__(
        self,
        marionette: Marionette,
        clearance: Clearance,
        bounds: Bounds,
        goal: Goal,
        *,
        tolerance: float,
        margin: float,
        slack: bool,
        dt: float,
        look: int,
        looks: int = 5,
        threads: int = 1,
    ):
        self.marionette, self.clearance, self.bounds, self.goal = (
            marionette,
            clearance,
            bounds,
            goal,
        )
        self.inner, self.margin, self.dt, self.look = _INNER * tolerance, margin, dt, look
        self.slack = slack
        self.looks, self.threads = looks, threads
        self.funnels: list[Funnel] = []
        # Motions begin anew at every node: a step that depends on its state alone does not notice.
        self.options = marionette.model.run_options(dt=dt, save_every=look, extrapolate=False)
        limits = {n: getattr(bounds, n) for n in ("speed", "acceleration", "low", "high")}
        terms = Terms(
            self.options, looks, marionette.p, marionette.winches, limits, margin, slack,
            clearance.solids, goal.numbers, self.inner,
        )  # fmt: skip
        self._sweeper = Sweeper(marionette.model.compiled.motions, terms, threads)

    def where(self, *, tolerance: float, free: bool = False) -> Motions:
        """The same motions with another tolerance; ``free``: that nothing but it ends, and a
        little faster where that is asked."""
        bounds, far = self.bounds, np.full(len(self.bounds.low), np.inf)
        if free:
            bounds = replace(bounds, speed=_FASTER * bounds.speed, low=-far, high=far)
        made = Motions(
            self.marionette,
            self.clearance,
            bounds,
            self.goal,
            tolerance=tolerance,
            margin=-np.inf if free else self.margin,
            slack=self.slack or free,
            dt=self.dt,
            look=self.look,
            looks=self.looks,
            threads=self.threads,
        )
        made.funnels = self.funnels
        return made

    @cached_property
    def ends(self) -> tuple[Array, int]:
        """(n_vK,) which end a driven coordinate belongs to, by its name's first part; how many."""
        names = [name.rsplit(".", 1)[0] for name in self.marionette.coordinates.v_K]
        found = sorted(set(names))
        return np.array([found.index(name) for name in names]), len(found)

    @property
    def interval(self) -> float:
        """From one look to the next [s]."""
        return self.dt * self.look

    def sweep(
        self,
        starts: Rows,
        chosen: Array,
        acceleration: Array,
        *,
        given: Array | None = None,
        made: Array | None = None,
        which: Array | None = None,
        reach: Array | None = None,
        looks: int | None = None,
    ) -> Segments:
        """Motions, each until it is done, reaches the goal, or comes into collision.

        Segments whose end is not written were not made whole: something was nearer than the margin,
        or out of its bounds, on their way.

        Args:
            starts: (m,) states.
            chosen: (n,) the one that a motion begins at.
            acceleration: (n, segments, n_vK) of the driven coordinates.
            given: (n,) how many of these hold, the others are led by a funnel; all by default.
            made: (n,) how many segments a motion has, at most; all by default.
            which: (n,) the funnel; the first by default.
            reach: (n,) by how much motions that are led hurry [s].
            looks: of a segment.
        """
        n, segments = acceleration.shape[:2]
        given = np.full(n, segments) if given is None else given
        found = self._sweeper(
            starts.parts, chosen, acceleration, given, made, self.funnels, which, reach, looks
        )
        if self.goal.function is not None:
            whole = found.looks > 0
            found.distance[whole] = self.goal.distance(Rows(*found.states.values())[whole])
        return found

    def replay(self, before: Rows, acceleration: Array, looks: int) -> Rows | None:
        """The end of one segment, made again; None where it is not clear.

        Args:
            before: (1,) state.
            acceleration: (n_vK,).
            looks: that it lasts.
        """
        made = self.sweep(before, np.zeros(1), acceleration[None, None], looks=looks)
        return Rows(*made.states.values())[:, 0] if made.looks[0, 0] == looks else None
