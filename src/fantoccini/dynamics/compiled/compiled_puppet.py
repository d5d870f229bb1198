"""CompiledPuppet: a puppet or scene with its parameters and winches, and its compiled functions.

The functions of ``fantoccini.dynamics`` take it as argument; :class:`Marionette` adds them as
methods.

q_D are the dynamic and q_K the driven coordinates. A winch changes the length of a string. Slip is
the length of string that a winch lets out at its largest tension. A link is a body on its joint. A
row is a string or a joint limit with its gap h <= 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.base import Array, Indices, MaskRows, OnProgress, StateError, UnknownNameError
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.compiled.libraries import Libraries
from fantoccini.dynamics.compiled.limits import LIMITS
from fantoccini.dynamics.compiled.methods import Event, TimeStepping
from fantoccini.dynamics.compiled.portable import PortablePuppet
from fantoccini.dynamics.compiled.samples import SampleLayout
from fantoccini.dynamics.compiled.touching import contacts_of, overlaps
from fantoccini.dynamics.compiled.winches import checked_winches, winches_of
from fantoccini.kernel.contract import (
    FUNCTIONS,
    MIN_SCALE_LENGTH,
    TENSION_CAP,
    WINCH_AT,
    WINCH_DECELERATION,
)
from fantoccini.kernel.runtime import Contacts, Library, RunOptions
from fantoccini.model import tree as trees
from fantoccini.model.puppet import Obstacle, Puppet
from fantoccini.model.scene import Scene, assembled
from fantoccini.model.tree import CoordinateTable, Tree
from fantoccini.motion import State, States, check_size

if TYPE_CHECKING:
    from typing import Self

    from fantoccini.kernel.equations import Equations


@dataclass(frozen=True, eq=False, init=False, repr=False)
class CompiledPuppet:
    """A puppet with its parameters; equations are derived and compiled when first needed.

    It is immutable: the ``with_`` methods return another one, without compiling again.

    Attributes:
        puppet: the puppet of the file; of a scene the puppet assembled from its members.
        tree: links, strings, limits and coordinates in the order of the equations.
        p: (n_p,) values of the parameters.
        winches: (n_strings, 3) largest tension [N], rewinding speed [m/s], restitution.
        libraries: equations and compiled libraries, shared with the results of ``with_`` methods.

    Args:
        puppet_or_scene: a puppet or a scene.
        progress: callback for each stage that begins (``what``: "deriving", "compiling").
    """

    puppet: Puppet
    tree: Tree
    p: Array
    winches: Array
    libraries: Libraries

    def __init__(self, puppet_or_scene: Puppet | Scene, progress: OnProgress | None = None):
        puppet = (
            assembled(puppet_or_scene) if isinstance(puppet_or_scene, Scene) else puppet_or_scene
        )
        tree = trees.grow(puppet)
        p = np.array(list(tree.parameters.values()), dtype=float)
        self._assign(puppet, tree, p, winches_of(tree, p), Libraries(puppet, tree, progress))

    def _assign(
        self, puppet: Puppet, tree: Tree, p: Array, winches: Array, libraries: Libraries
    ) -> Self:
        p.setflags(write=False)
        winches.setflags(write=False)
        vars(self).update(puppet=puppet, tree=tree, p=p, winches=winches, libraries=libraries)
        return self

    def _with(
        self, *, puppet: Puppet | None = None, p: Array | None = None, winches: Array | None = None
    ) -> Self:
        return object.__new__(type(self))._assign(
            self.puppet if puppet is None else puppet,
            self.tree,
            self.p if p is None else p,
            self.winches if winches is None else winches,
            self.libraries,
        )

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        # Equations and libraries are not copied: they come from the cache or are built again.
        return _unpacked, (
            type(self),
            PortablePuppet.from_puppet(self.puppet),
            self.p,
            self.winches,
        )

    # -- variants of the same puppet -------------------------------------------------------------

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same puppet with other values of parameters, and with the winches of its file.

        Raises:
            UnknownNameError: there is no such parameter.
            StateError: a value is not finite.
            PuppetError: a value is not allowed in the puppet's file.
        """
        names, p = list(self.tree.parameters), self.p.copy()
        for name, value in values.items():
            if name not in names:
                raise UnknownNameError("parameter", name, names)
            if not np.isfinite(value):
                raise StateError(f"parameter {name}: found {value}; it must be a finite number")
            p[names.index(name)] = value
        self.puppet.with_values(dict(values))
        return self._with(p=p, winches=winches_of(self.tree, p))

    def with_p(self, p: Array) -> Self:
        """The same puppet with other parameters (n_p,), without checks."""
        return self if np.array_equal(p, self.p) else self._with(p=p.copy())

    def with_winches(self, winches: Array) -> Self:
        """The same puppet with other winches (n_strings, 3); see :attr:`winches`.

        Raises:
            StateError: a winch cannot have one of the numbers.
        """
        return self._with(winches=checked_winches(self.tree, winches))

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Self:
        """The same puppet with other obstacles."""
        return self._with(puppet=self.puppet.model_copy(update={"obstacles": tuple(obstacles)}))

    # -- parts ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """Name of the puppet or scene."""
        return self.puppet.name

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and indices of all coordinates."""
        return self.tree.coordinates

    @property
    def equations(self) -> Equations:
        """The symbolic equations and the CasADi functions made from them."""
        return self.libraries.equations

    @property
    def library(self) -> Library:
        """The compiled functions of ``docs/functions.md``, by their names there."""
        return self.libraries.library

    def compile(self) -> None:
        """Loads or builds the compiled functions, before anything needs them.

        Raises:
            BuildError: there is no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        _ = self.library

    @cached_property
    def _contacts_and_prescribed(self) -> tuple[Contacts, Contacts] | None:
        if self.puppet.touching is None:
            return None
        arguments = self.puppet.expanded(), self.tree, self.library, self.libraries.solids
        return contacts_of(*arguments)

    @property
    def contacts(self) -> Contacts | None:
        """The solids that may touch; None if the puppet's file has no contact."""
        return None if self._contacts_and_prescribed is None else self._contacts_and_prescribed[0]

    @property
    def prescribed(self) -> Contacts | None:
        """Pairs of solids that may touch and that only inputs move; None if there are none."""
        contacts = (
            None if self._contacts_and_prescribed is None else self._contacts_and_prescribed[1]
        )
        return contacts if contacts is not None and len(contacts.pairs) else None

    def overlaps(self, q_D: Array, q_K: Array, depth: float = 0.0) -> dict[str, float]:
        """Pairs of parts that overlap by more than a depth [m] -> their overlap [m]."""
        if self.contacts is None:
            return {}
        return overlaps(self.library, self.contacts, q_D, q_K, self.p, depth)

    @cached_property
    def current_puppet(self) -> Puppet:
        """The puppet as for a file, with the present values of its parameters."""
        values = dict(zip(self.tree.parameters, self.p.tolist(), strict=True))
        if values == self.tree.parameters:
            return self.puppet
        return self.puppet.with_values(values)

    @cached_property
    def sample_layout(self) -> SampleLayout:
        """Layout of the samples of a trajectory in the runtime."""
        return SampleLayout(self.tree)

    def number(self, value: Number) -> float:
        """Value of a number in the puppet's file, which may be a parameter."""
        if not isinstance(value, Parameter):
            return float(value)
        return float(self.p[self.parameter_index[value.parameter]])

    @cached_property
    def parameter_index(self) -> dict[str, int]:
        """Name of a parameter -> its index in ``p``."""
        return {name: i for i, name in enumerate(self.tree.parameters)}

    @cached_property
    def cap_parameters(self) -> Indices:
        """(n_rows,) index in ``p`` of each row's largest tension; -1 if it is no parameter."""
        indices = np.full(self.tree.n_rows, -1)
        for i, string in enumerate(self.tree.strings):
            if isinstance(string.max_tension, Parameter):
                indices[i] = self.parameter_index[string.max_tension.parameter]
        return indices

    # -- sizes -------------------------------------------------------------------------------

    @cached_property
    def mass(self) -> float:
        """Mass of all links that are dynamic or hang from a dynamic one [kg]."""
        total = 0.0
        for i, link in enumerate(self.tree.links):
            if any(self.tree.links[j].role == "dynamic" for j in self.tree.ancestors(i)):
                shape_mass = sum(self.number(s.amount) * s.volume for s in link.mass_shares)
                total += shape_mass if link.mass is None else self.number(link.mass)
        return total

    @cached_property
    def weight(self) -> float:
        """Mass times gravity [N]; where gravity is zero, mass times 1 m/s^2."""
        g = [self.number(n) for n in self.tree.gravity]
        return self.mass * (float(np.linalg.norm(g)) or 1.0)

    @property
    def reference_force(self) -> float:
        """Mass times gravity or 1 m/s^2, whichever is larger [N]."""
        return max(self.weight, self.mass * LIMITS.least_gravity)

    @property
    def tension_cap(self) -> float:
        """Largest tension of any string [N]: 1e5 times :attr:`reference_force`."""
        return TENSION_CAP * (self.reference_force or 1.0)

    def run_options(self, **changes: Any) -> RunOptions:
        """Run options scaled to this puppet, with changes."""
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
    def max_forces(self) -> Array:
        """(n_rows,) largest force of every string and limit [N]; inf without a winch that slips."""
        return np.concatenate(
            [self.winches[:, WINCH_AT["max_tension"]], np.full(len(self.tree.limits), np.inf)]
        )

    @cached_property
    def two_sided(self) -> MaskRows:
        """(n_rows,) bool, the rows that also push: wires."""
        wires = [s.wire for s in self.tree.strings] + [False] * len(self.tree.limits)
        return np.array(wires, dtype=bool)

    def rewinding(self, slip: Array) -> Array:
        """(..., n_strings) rates of rewound slips, -min(rewind_speed, sqrt(2 a slip)) [m/s]."""
        braking_speed = np.sqrt(2.0 * WINCH_DECELERATION * slip)
        return -np.minimum(self.winches[:, WINCH_AT["rewind_speed"]], braking_speed)

    def row_scales(self, q_D: Array, q_K: Array) -> Array:
        """Scales (..., n_rows) of the rows' gaps h: string lengths [m], 1 for limits."""
        lengths = np.maximum(self.string_lengths(q_D, q_K), MIN_SCALE_LENGTH)
        limits = np.ones((*lengths.shape[:-1], len(self.tree.limits)))
        return np.concatenate([lengths, limits], axis=-1)

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """(..., n) lengths of the strings at configurations (..., n_qD), (..., n_qK) [m]."""
        return self.tree.string_lengths(q_D, q_K, self.number)

    def names_of(self, rows: Indices, share: Array | None) -> tuple[str, ...]:
        """Names of the rows whose share is not negligible; of all rows if no shares are given."""
        names = [self.tree.row_names[i] for i in rows]
        if share is None:
            return tuple(names)
        threshold = LIMITS.least_share * np.max(np.abs(share), initial=0.0)
        return tuple(n for n, row_share in zip(names, share, strict=True) if row_share > threshold)

    # -- states ------------------------------------------------------------------------------

    def check_state(self, x: State) -> None:
        """Raises :class:`StateError` unless ``x`` is a state of this puppet."""
        check_size(x, self.coordinates, self.tree.n_rows)

    def at(self, x: State | States, p: Array | None = None) -> dict[str, Array]:
        """Arguments of compiled functions: q_D, v_D, q_K, v_K and p, by default the puppet's."""
        p = self.p if p is None else p
        return {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K, "p": p}

    def states(self, states: Sequence[State]) -> States:
        """States of this puppet, stacked.

        Raises:
            StateError: a state is of another puppet, or a slip is not a length >= 0.
        """
        tree = self.tree
        return States.stack(states, self.coordinates, len(tree.strings), tree.n_rows)

    # -- functions of a state --------------------------------------------------------------------

    def interpreted(self, name: str, x: State) -> SimpleNamespace:
        """The results of a function of ``docs/functions.md`` by name, as matrices.

        CasADi's interpreter evaluates it: no compiler is needed.
        """
        self.check_state(x)
        values = {**vars(x), "p": self.p}
        arguments = {a.name: values[a.name] for a in FUNCTIONS[name].arguments}
        results = self.equations[name](**arguments)
        return SimpleNamespace(**{result: np.array(value) for result, value in results.items()})

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_links, 3, 4) world poses (R | r) of all links at (..., n_qD), (..., n_qK)."""
        flat = self.library.evaluate("poses", q_D=q_D, q_K=q_K, p=self.p).poses.swapaxes(-1, -2)
        return np.swapaxes(flat.reshape(*flat.shape[:-1], 4, 3), -1, -2)

    def string_points(self, q_D: Array, q_K: Array) -> dict[str, Array]:
        """String -> (..., n_points, 3) positions of its points in the world [m]."""
        counts = [len(s.points) for s in self.tree.strings]
        points = self.library.evaluate("points", q_D=q_D, q_K=q_K, p=self.p).points
        parts = np.split(points.swapaxes(-1, -2), np.cumsum(counts)[:-1], axis=-2)
        return dict(zip((s.name for s in self.tree.strings), parts, strict=False))

    def effort(
        self,
        q_D: Array,
        v_D: Array,
        q_K: Array,
        v_K: Array,
        acc_D: Array,
        acc_K: Array,
        tension: Array,
    ) -> Array:
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        Its result (..., n_vK) is the load on the controls [N or N m]. The arguments are (..., n)
        each; ``tension`` is (..., n_strings), or (..., n_rows) as from :meth:`forward_dynamics`:
        limits do not act on driven coordinates.
        """
        return self.library.evaluate(
            "effort",
            q_D=q_D,
            v_D=v_D,
            q_K=q_K,
            v_K=v_K,
            acc_D=acc_D,
            acc_K=acc_K,
            lam=-np.asarray(tension)[..., : len(self.tree.strings)],
            p=self.p,
        ).f_K

    def energies(self, x: State) -> tuple[float, float]:
        """Kinetic and potential energy (T, V) [J]."""
        self.check_state(x)
        results = self.library.evaluate("energy", **self.at(x))
        return float(results.T), float(results.V)

    def link_index(self, body: str) -> int:
        """Index of a body among the links.

        Raises:
            UnknownNameError: there is no such body.
        """
        names = [link.name for link in self.tree.links]
        if body not in names:
            raise UnknownNameError("body", body, names)
        return names.index(body)


def _unpacked(
    kind: type[CompiledPuppet], portable: PortablePuppet, p: Array, winches: Array
) -> CompiledPuppet:
    return kind(portable.puppet())._with(p=np.array(p, dtype=float), winches=winches)
