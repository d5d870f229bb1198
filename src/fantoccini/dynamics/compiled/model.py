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

from fantoccini.base import Array, Indices, MaskRows, StateError, UnknownNameError, floats
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.compiled.libraries import Compiled
from fantoccini.dynamics.compiled.methods import Event, TimeStepping
from fantoccini.dynamics.compiled.portable import PortablePuppet
from fantoccini.dynamics.compiled.samples import SampleLayout
from fantoccini.dynamics.compiled.touching import contacts_of, overlaps
from fantoccini.kernel.contract import LEAST_LENGTH, TENSION_CAP, WINCH_AT, WINCH_DECELERATION
from fantoccini.kernel.runtime import Contacts, Library, RunOptions
from fantoccini.model import tree as trees
from fantoccini.model.puppet import Obstacle, Puppet
from fantoccini.model.tree import CoordinateTable, Tree
from fantoccini.motion import State, States, check_size


@dataclass(frozen=True)
class Limits:
    """Bounds of a run, and sizes that a puppet's forces and lengths are measured with."""

    least_gravity: float = 1.0
    """Stands in for a smaller gravity [m/s^2], so that forces have a size without one."""
    least_share: float = 1e-6  # Part of the largest share from which a row is named as contributing
    first_step: float = 1e-4
    """First step of the event-driven integrator [s]; it adapts within a few steps."""
    recovery_speed: float = 1.0
    """Fastest that time-stepping takes back a violation [m/s], so that no string kicks."""
    max_steps: int = 50_000_000
    max_events: int = 1_000_000


LIMITS = Limits()


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A puppet with its parameters; it is derived and compiled when first needed.

    Attributes:
        puppet: as its file describes it; a scene assembled.
        tree: links, strings, limits and coordinates in the order of the equations.
        p: (n_p,) values of the parameters.
        winches: (n_strings, 3) largest tension [N], rewinding speed [m/s], restitution.
        compiled: equations and libraries.
    """

    puppet: Puppet
    tree: Tree
    p: Array
    winches: Array
    compiled: Compiled

    def __post_init__(self) -> None:
        self.p.setflags(write=False)
        self.winches.setflags(write=False)

    @classmethod
    def of(cls, puppet: Puppet, progress: Callable[[str], None] | None = None) -> Model:
        """The model of a puppet, with the parameters and winches of its file.

        Args:
            puppet: as its file describes it.
            progress: called with the stage that begins ("deriving", "compiling").
        """
        tree = trees.grow(puppet)
        p = np.array(list(tree.parameters.values()), dtype=float)
        return cls(puppet, tree, p, _winches(tree, p), Compiled(puppet, tree, progress))

    def __copy__(self) -> Model:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Model:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        # What was derived or compiled stays behind: the cache has it there, or it is made there.
        return _unpacked, (PortablePuppet.of(self.puppet), self.p, self.winches)

    # -- other models of the same puppet -------------------------------------------------------

    def with_parameters(self, values: Mapping[str, float]) -> Model:
        """The same puppet with other parameters; see :meth:`Marionette.with_parameters`."""
        names, p = list(self.tree.parameters), self.p.copy()
        for name, value in values.items():
            if name not in names:
                raise UnknownNameError("parameter", name, names)
            if not np.isfinite(value):
                raise StateError(f"parameter {name}: found {value}; it must be a finite number")
            p[names.index(name)] = value
        self.puppet.with_values(dict(values))
        return dataclasses.replace(self, p=p, winches=_winches(self.tree, p))

    def with_p(self, p: Array) -> Model:
        """The same puppet with parameters (n_p,) that are known to be right."""
        return self if np.array_equal(p, self.p) else dataclasses.replace(self, p=p.copy())

    def with_winches(self, winches: Array) -> Model:
        """The same puppet on other winches; see :meth:`Marionette.with_winches`."""
        table = floats(winches)
        if table.shape != self.winches.shape:
            raise StateError(
                f"winches have the shape {table.shape}; it must be {self.winches.shape}: largest "
                "tension, rewinding speed and restitution of every string"
            )
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
        puppet = self.puppet.model_copy(update={"obstacles": tuple(obstacles)})
        return dataclasses.replace(self, puppet=puppet)

    # -- its parts ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The puppet's name, or the scene's."""
        return self.puppet.name

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and places of all coordinates."""
        return self.tree.coordinates

    @property
    def library(self) -> Library:
        """The compiled model."""
        return self.compiled.library

    @cached_property
    def _touching(self) -> tuple[Contacts, Contacts] | None:
        if self.puppet.touching is None:
            return None
        found = self.puppet.expanded(), self.tree, self.library, self.compiled.solids
        return contacts_of(*found)

    @property
    def contacts(self) -> Contacts | None:
        """The solids that may touch; None where the puppet's file says nothing of contact."""
        return None if self._touching is None else self._touching[0]

    @property
    def prescribed(self) -> Contacts | None:
        """Pairs of solids that may touch and are moved by the inputs only; None without any."""
        found = None if self._touching is None else self._touching[1]
        return found if found is not None and len(found.pairs) else None

    def overlaps(self, q_D: Array, q_K: Array, depth: float = 0.0) -> dict[str, float]:
        """The parts that overlap by more than a depth [m], and by how much [m]."""
        if self.contacts is None:
            return {}
        return overlaps(self.library, self.contacts, q_D, q_K, self.p, depth)

    @cached_property
    def described(self) -> Puppet:
        """The puppet as a file would describe it now, with the present parameters."""
        present = dict(zip(self.tree.parameters, self.p.tolist(), strict=True))
        if present == self.tree.parameters:
            return self.puppet
        return self.puppet.with_values(present)

    @cached_property
    def sample_layout(self) -> SampleLayout:
        """How the runtime lays out the samples of a trajectory."""
        return SampleLayout(self.tree)

    def number(self, value: Number) -> float:
        """A number of the puppet, with the present value where it is a parameter."""
        if not isinstance(value, Parameter):
            return float(value)
        return float(self.p[self.parameter_index[value.parameter]])

    @cached_property
    def parameter_index(self) -> dict[str, int]:
        """Name of a parameter -> its place in ``p``."""
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
        """Mass times gravity or 1 m/s^2, whichever is more [N]."""
        return max(self.weight, self.mass * LIMITS.least_gravity)

    @property
    def tension_cap(self) -> float:
        """Largest tension a string may pull [N]: 1e5 times :attr:`reference_force`."""
        return TENSION_CAP * (self.reference_force or 1.0)

    def run_options(self, **changes: Any) -> RunOptions:
        """Run options scaled to this puppet, with some changed."""
        return RunOptions(**(self._scaled_options | changes))

    @cached_property
    def _scaled_options(self) -> dict[str, Any]:
        return (
            Event().options
            | TimeStepping().options
            | {
                "first_step": LIMITS.first_step,
                "tension_cap": self.tension_cap,
                "energy_scale": max(self.reference_force, 1e-9),
                "force_scale": self.reference_force / (self.mass or 1.0) ** 0.5,
                "recovery_speed": LIMITS.recovery_speed,
                "max_steps": LIMITS.max_steps,
                "max_events": LIMITS.max_events,
                "save_steps": True,
                "contacts": self.contacts,
            }
        )

    # -- rows --------------------------------------------------------------------------------

    @cached_property
    def upper(self) -> Array:
        """(n_rows,) largest force of every row [N]; inf where it has no winch that slips."""
        return np.concatenate(
            [self.winches[:, WINCH_AT["max_tension"]], np.full(len(self.tree.limits), np.inf)]
        )

    @cached_property
    def two_sided(self) -> MaskRows:
        """(n_rows,) bool, wires."""
        wires = [s.wire for s in self.tree.strings] + [False] * len(self.tree.limits)
        return np.array(wires, dtype=bool)

    def rewinding(self, slip: Array) -> Array:
        """-min(rewind_speed, sqrt(2 a slip)): the rate of slips (..., n_strings) [m/s]."""
        braked = np.sqrt(2.0 * WINCH_DECELERATION * slip)
        return -np.minimum(self.winches[:, WINCH_AT["rewind_speed"]], braked)

    def row_scales(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_rows) scale of each row's h: string lengths [m], 1 for limits."""
        lengths = np.maximum(self.string_lengths(q_D, q_K), LEAST_LENGTH)
        limits = np.ones((*lengths.shape[:-1], len(self.tree.limits)))
        return np.concatenate([lengths, limits], axis=-1)

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """Lengths of the strings at configurations (..., n_qD), (..., n_qK): (..., n) [m]."""
        return self.tree.string_lengths(q_D, q_K, self.number)

    def names_of(self, rows: Indices, share: Array | None) -> tuple[str, ...]:
        """Names of the rows whose share is not negligible; of all when no share is given."""
        names = [self.tree.row_names[i] for i in rows]
        if share is None:
            return tuple(names)
        least = LIMITS.least_share * np.max(np.abs(share), initial=0.0)
        return tuple(n for n, part in zip(names, share, strict=True) if part > least)

    # -- states ------------------------------------------------------------------------------

    def check_state(self, x: State) -> None:
        """Raises :class:`StateError` unless ``x`` is a state of this puppet."""
        check_size(x, self.coordinates, self.tree.n_rows)

    def at(self, x: State | States, p: Array | None = None) -> dict[str, Array]:
        """Arguments of compiled functions: q_D, v_D, q_K, v_K and p, by default the model's own."""
        p = self.p if p is None else p
        return {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "p": p}

    def states(self, states: Sequence[State]) -> States:
        """States of this puppet, stacked.

        Raises:
            StateError: one is of another puppet, or its slip is not a length >= 0 for each string.
        """
        tree = self.tree
        return States.of(states, self.coordinates, len(tree.strings), tree.n_rows)


def _winches(tree: Tree, p: Array) -> Array:
    """(n_strings, 3) largest tension [N], rewinding speed [m/s], restitution, as the file says."""
    values = dict(zip(tree.parameters, p.tolist(), strict=True))
    defaults = {"max_tension": np.inf, "rewind_speed": 0.0}

    def number(value: Number) -> float:
        return float(values[value.parameter] if isinstance(value, Parameter) else value)

    table = np.zeros((len(tree.strings), len(WINCH_AT)))
    for row, string in zip(table, tree.strings, strict=True):
        given = [(name, getattr(string, name)) for name in WINCH_AT]
        row[:] = [defaults[name] if x is None else number(x) for name, x in given]
    return table


def _unpacked(portable: PortablePuppet, p: Array, winches: Array) -> Model:
    made = Model.of(portable.puppet())
    return dataclasses.replace(made, p=np.array(p, dtype=float), winches=winches)
