"""Model: a world of puppets with its parameters and winches, and what is compiled of it.

The algorithms of this package are functions of a model; :class:`Marionette` forwards to them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fantoccini import tree as trees
from fantoccini.arrays import Array
from fantoccini.contract import WINCH_AT
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette.compiled import Compiled
from fantoccini.marionette.parcel import Parcel
from fantoccini.marionette.rows import RowLayout
from fantoccini.motion import State, States, check_size
from fantoccini.puppet import Number, Obstacle, Parameter, Puppet
from fantoccini.runtime import Library, RunOptions
from fantoccini.tree import CoordinateTable, Tree
from fantoccini.world import World

TENSION_CAP = 1e5
"""Largest tension a string may pull, in weights of the puppet."""
LEAST_GRAVITY = 1.0
"""Gravity that sizes of forces and energies are measured with where there is less [m/s^2]."""
BRAKE = 1.0
"""Deceleration of a winch that rewinds, before it stops [m/s^2]; ``WinchTolerances::brake``."""


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """What a marionette is; nothing is derived or compiled before it is needed.

    Attributes:
        world: the puppets, obstacles and floor.
        tree: links, strings, limits and coordinates in the order of the equations.
        p: (n_p,) values of the parameters.
        winches: (n_strings, 3) largest tension [N], rewinding speed [m/s], restitution, by string.
        compiled: equations and libraries.
    """

    world: World
    tree: Tree
    p: Array
    winches: Array
    compiled: Compiled

    def __post_init__(self) -> None:
        self.p.setflags(write=False)
        self.winches.setflags(write=False)

    @classmethod
    def of(cls, world: World, progress: Callable[[str], None] | None = None) -> Model:
        """The model of a world, with the parameters and winches of its files.

        Args:
            world: the puppets.
            progress: told what takes long while it happens ("deriving", "compiling").
        """
        tree = trees.grow(world)
        p = np.array(list(tree.parameters.values()), dtype=float)
        return cls(world, tree, p, _winches(tree, p), Compiled(world, tree, progress))

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: dict) -> Model:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        # What was derived or compiled stays behind: the cache has it there, or it is made there.
        return _unpacked, (Parcel.of(self.world), self.p, self.winches)

    # -- other models of the same puppet -------------------------------------------------------

    def with_parameters(self, values: Mapping[str, float]) -> Model:
        """The same puppet with other values of its parameters, and the winches that follow.

        Raises:
            UnknownNameError: there is no such parameter.
            StateError: a value is not finite.
            PuppetError: a value that the puppet's file could not have.
        """
        names, p = list(self.tree.parameters), self.p.copy()
        for name, value in values.items():
            if name not in names:
                raise UnknownNameError("parameter", name, names)
            if not np.isfinite(value):
                raise StateError(f"parameter {name}: found {value}; it must be a finite number")
            p[names.index(name)] = value
        for member in self.world.puppets:
            prefix = f"{member.name}/" if len(self.world.puppets) > 1 else ""
            member.with_values(
                {n[len(prefix) :]: v for n, v in values.items() if n.startswith(prefix)}
            )
        return dataclasses.replace(self, p=p, winches=_winches(self.tree, p))

    def with_winches(self, winches: Array) -> Model:
        """The same puppet on other winches.

        Args:
            winches: (n_strings, 3).

        Raises:
            StateError: numbers that no winch has.
        """
        table = np.array(winches, dtype=float).reshape(self.winches.shape)
        for string, (most, rewind, bounces) in zip(self.tree.strings, table, strict=True):
            if not (most > 0.0 and 0.0 <= rewind < np.inf and 0.0 <= bounces <= 1.0):
                raise StateError(
                    f"winch of {string.name}: found a largest tension of {most:g} N, rewinding at "
                    f"{rewind:g} m/s and a restitution of {bounces:g}; they must be above 0, at "
                    "least 0 and finite, and 0 to 1"
                )
        return dataclasses.replace(self, winches=table)

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Model:
        """The same puppet among other obstacles."""
        world = dataclasses.replace(self.world, obstacles=tuple(obstacles))
        return dataclasses.replace(self, world=world)

    # -- what it is made of ------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The world's name."""
        return self.world.name

    @property
    def puppet(self) -> Puppet:
        """The puppet; the first one of a world of several."""
        return self.world.puppets[0]

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and places of all coordinates."""
        return self.tree.coordinates

    @property
    def library(self) -> Library:
        """The compiled model."""
        return self.compiled.library

    @cached_property
    def described(self) -> Puppet:
        """The puppet as a file would describe it now: its parameters have their present values."""
        present = dict(zip(self.tree.parameters, self.p.tolist(), strict=True))
        if present == self.tree.parameters:
            return self.puppet
        prefix = f"{self.puppet.name}/" if len(self.world.puppets) > 1 else ""
        own = {n[len(prefix) :]: v for n, v in present.items() if n.startswith(prefix)}
        return self.puppet.with_values(own)

    @cached_property
    def row_layout(self) -> RowLayout:
        """How the runtime lays out a trajectory's rows."""
        return RowLayout(self.tree)

    def number(self, value: Number) -> float:
        """A number of the puppet, with the present value where it is a parameter."""
        if not isinstance(value, Parameter):
            return float(value)
        return float(self.p[self._places[value.parameter]])

    @cached_property
    def _places(self) -> dict[str, int]:
        """Places of the parameters in ``p``."""
        return {name: i for i, name in enumerate(self.tree.parameters)}

    # -- sizes -------------------------------------------------------------------------------

    @cached_property
    def mass(self) -> float:
        """Mass of all links that move dynamically or hang from one that does [kg]."""
        total = 0.0
        for i, link in enumerate(self.tree.links):
            if any(self.tree.links[j].role == "dynamic" for j in self.tree.ancestors(i)):
                lumps = sum(self.number(lump.amount) * lump.volume for lump in link.lumps)
                total += lumps if link.mass is None else self.number(link.mass)
        return total

    @cached_property
    def weight(self) -> float:
        """Mass times gravity [N]; where gravity is zero, mass times 1 m/s^2."""
        g = [self.number(n) for n in self.tree.gravity]
        return self.mass * (float(np.linalg.norm(g)) or 1.0)

    @property
    def reference_force(self) -> float:
        """Size of the puppet's forces [N], which does not vanish with gravity."""
        return max(self.weight, self.mass * LEAST_GRAVITY)

    @property
    def tension_cap(self) -> float:
        """Largest tension a string may pull [N]: 1e5 times the mass times gravity or 1 m/s^2,
        whichever is more."""
        return TENSION_CAP * (self.reference_force or 1.0)

    def run_options(self, **changes) -> RunOptions:
        """Run options scaled to this puppet, with some changed."""
        options = dict(
            rtol=1e-11,
            atol=1e-11,
            first_step=1e-4,
            max_step=0.1,
            tension_cap=self.tension_cap,
            energy_scale=max(self.reference_force, 1e-9),
            force_scale=self.reference_force / (self.mass or 1.0) ** 0.5,
            recovery_speed=1.0,
            dt=0.002,
            max_steps=50_000_000,
            max_events=1_000_000,
            save_steps=True,
        )
        return RunOptions(**(options | changes))

    # -- rows --------------------------------------------------------------------------------

    @cached_property
    def upper(self) -> Array:
        """(n_rows,) largest force of every row [N]; inf where there is none."""
        return np.concatenate(
            [self.winches[:, WINCH_AT["max_tension"]], np.full(len(self.tree.limits), np.inf)]
        )

    @cached_property
    def two_sided(self) -> Array:
        """(n_rows,) bool: rows that are wires."""
        wires = [s.wire for s in self.tree.strings] + [False] * len(self.tree.limits)
        return np.array(wires, dtype=bool)

    def winding(self, slip: Array) -> Array:
        """The rate at which winches wind slips (..., n_strings) back [m/s], <= 0.

        -min(rewind_speed, sqrt(2 BRAKE slip))
        """
        return -np.minimum(self.winches[:, WINCH_AT["rewind_speed"]], np.sqrt(2.0 * BRAKE * slip))

    def row_scales(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_rows) what each row's h is measured against: string lengths [m], 1 for limits.

        Args:
            q_D, q_K: (..., n_qD), (..., n_qK) configurations [m, rad or 1].
        """
        lengths = np.maximum(self.string_lengths(q_D, q_K), 1e-3)
        limits = np.ones((*lengths.shape[:-1], len(self.tree.limits)))
        return np.concatenate([lengths, limits], axis=-1)

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """Lengths of the strings at configurations (..., n_qD), (..., n_qK): (..., n) [m]."""
        return self.tree.string_lengths(q_D, q_K, self.number)

    def rows_of(self, rows: Array, share: Array | None) -> tuple[str, ...]:
        """Names of those of some rows that have a share in something; all when none is given."""
        names = [self.tree.row_names[i] for i in rows]
        if share is None:
            return tuple(names)
        least = 1e-6 * np.max(np.abs(share), initial=0.0)
        return tuple(n for n, part in zip(names, share, strict=True) if part > least)

    # -- states ------------------------------------------------------------------------------

    def check_state(self, x: State) -> None:
        """Raises :class:`StateError` when ``x`` is a state of another puppet, or none."""
        check_size(x, self.coordinates, self.tree.n_rows)

    def states(self, states: Sequence[State]) -> States:
        """States of this puppet side by side.

        Raises:
            StateError: one is of another puppet, or what its winches have let out is no length.
        """
        tree = self.tree
        return States.of(states, self.coordinates, len(tree.strings), tree.n_rows)


def _winches(tree: Tree, p: Array) -> Array:
    """(n_strings, 3) largest tension [N], rewinding speed [m/s], restitution, as the file says."""
    values = dict(zip(tree.parameters, p.tolist(), strict=True))

    def number(value: Number) -> float:
        return float(values[value.parameter] if isinstance(value, Parameter) else value)

    table = np.zeros((len(tree.strings), len(WINCH_AT)))
    for row, string in zip(table, tree.strings, strict=True):
        own = {
            "max_tension": np.inf if string.max_tension is None else number(string.max_tension),
            "rewind_speed": 0.0 if string.rewind_speed is None else number(string.rewind_speed),
            "restitution": number(string.restitution),
        }
        row[:] = [own[name] for name in WINCH_AT]
    return table


def _unpacked(parcel: Parcel, p: Array, winches: Array) -> Model:
    made = Model.of(parcel.world())
    return dataclasses.replace(made, p=np.array(p, dtype=float), winches=winches)
