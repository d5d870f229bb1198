"""Marionette: the handle a user holds. Everything about one puppet (or one world of them)."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Literal

import numpy as np

from fantoccini import tree
from fantoccini.arrays import Array
from fantoccini.contract import WINCH_AT
from fantoccini.errors import StateError, UnknownNameError
from fantoccini.marionette import checks, hanging, projection, values_by_name
from fantoccini.marionette.analysis import Analysis
from fantoccini.marionette.closed import check_mode, closed_rows
from fantoccini.marionette.compiled import Compiled
from fantoccini.marionette.configurations import Configurations
from fantoccini.marionette.differentiable import Differentiable
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.instant import Instant
from fantoccini.marionette.portable import Portable
from fantoccini.marionette.rows import RowLayout
from fantoccini.marionette.stepper import Stepper
from fantoccini.motion import Input, State
from fantoccini.puppet import Number, Obstacle, Parameter, Puppet
from fantoccini.runtime import RunOptions
from fantoccini.tree import CoordinateTable, Tree
from fantoccini.world import World

TENSION_CAP = 1e5
"""Largest tension a string may pull, in weights of the puppet."""
LEAST_GRAVITY = 1.0
"""Gravity that sizes of forces and energies are measured with where there is less [m/s^2]."""
ROUNDED = 1e-14
"""hddot below which it is rounding, relative to its largest terms or gravity."""
BRAKE = 1.0
"""Deceleration of a winch that rewinds, before it stops [m/s^2]; ``kBrake`` of ``winch.hpp``."""


class Marionette(Compiled, Portable, Analysis, Differentiable, Configurations):
    """A puppet on strings: its coordinates, equations, compiled model, states.

    Nothing is derived or compiled before it is needed; a puppet that was compiled before loads
    from the cache without deriving anything. Instances do not change; :meth:`with_parameters`
    gives another one.

    Attributes:
        world: the puppets, obstacles and floor.
        tree: links, strings, limits and coordinates in the order of the equations.
        p: (n_p,) values of the parameters.

    Args:
        what: a puppet or a world.
        progress: told what takes long while it happens ("deriving", "compiling").
    """

    def __init__(self, what: Puppet | World, progress: Callable[[str], None] | None = None):
        self.world = what if isinstance(what, World) else World.of(what)
        self.tree: Tree = tree.grow(self.world)
        self.p: Array = np.array(list(self.tree.parameters.values()), dtype=float)
        self._progress = progress

    def __repr__(self) -> str:
        t = self.coordinates
        return (
            f"<Marionette {self.world.name}: {t.n_vD} DOF, {len(self.tree.strings)} strings, "
            f"{t.n_vK} driven>"
        )

    def _repr_html_(self) -> str | None:
        """A picture of the start pose and tables, for notebooks; nothing is compiled for it."""
        from fantoccini.view.notebook import puppet_html

        return puppet_html(self)

    # -- what it is made of ------------------------------------------------------------------

    @property
    def puppet(self) -> Puppet:
        """The puppet; the first one of a world of several."""
        return self.world.puppets[0]

    @property
    def name(self) -> str:
        """The world's name."""
        return self.world.name

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and places of all coordinates."""
        return self.tree.coordinates

    def with_parameters(self, values: Mapping[str, float]) -> Marionette:
        """The same puppet with other values of its parameters; nothing is compiled again.

        Args:
            values: parameter name -> value.

        Raises:
            PuppetError: a value that the puppet's file could not have.
        """
        names = list(self.tree.parameters)
        other = copy.copy(self)
        other.p = self.p.copy()
        for name, value in values.items():
            if name not in names:
                raise UnknownNameError("parameter", name, names)
            if not np.isfinite(value):
                raise StateError(f"parameter {name}: found {value}; it must be a finite number")
            other.p[names.index(name)] = value
        for kept in ("described", "mass", "weight", "reference_force", "tension_cap", "winches"):
            other.__dict__.pop(kept, None)
        for member in self.world.puppets:
            prefix = f"{member.name}/" if len(self.world.puppets) > 1 else ""
            member.with_values(
                {n[len(prefix) :]: v for n, v in values.items() if n.startswith(prefix)}
            )
        return other

    @cached_property
    def described(self) -> Puppet:
        """The puppet as a file would describe it now: its parameters have their present values."""
        present = dict(zip(self.tree.parameters, self.p.tolist(), strict=True))
        if present == self.tree.parameters:
            return self.puppet
        prefix = f"{self.puppet.name}/" if len(self.world.puppets) > 1 else ""
        own = {n[len(prefix) :]: v for n, v in present.items() if n.startswith(prefix)}
        return self.puppet.with_values(own)

    def among(self, obstacles: Iterable[Obstacle]) -> Marionette:
        """The same puppet with other obstacles about it; nothing is compiled again."""
        other = copy.copy(self)
        other.world = dataclasses.replace(self.world, obstacles=tuple(obstacles))
        return other

    @cached_property
    def row_layout(self) -> RowLayout:
        """How the runtime lays out a trajectory's rows."""
        return RowLayout(self.tree)

    @cached_property
    def mass(self) -> float:
        """Mass of all links that move dynamically or hang from one that does [kg]."""
        total = 0.0
        for i, link in enumerate(self.tree.links):
            if any(self.tree.links[j].role == "dynamic" for j in self.tree.ancestors(i)):
                lumps = sum(self.number(lump.amount) * lump.volume for lump in link.lumps)
                total += lumps if link.mass is None else self.number(link.mass)
        return total

    def number(self, value: Number) -> float:
        """A number of the puppet, with the present value where it is a parameter."""
        if not isinstance(value, Parameter):
            return float(value)
        return float(self.p[self._places[value.parameter]])

    @cached_property
    def _places(self) -> dict[str, int]:
        """Places of the parameters in ``p``."""
        return {name: i for i, name in enumerate(self.tree.parameters)}

    @cached_property
    def weight(self) -> float:
        """Mass times gravity [N]; where gravity is zero, mass times 1 m/s^2."""
        g = [self.number(n) for n in self.tree.gravity]
        return self.mass * (float(np.linalg.norm(g)) or 1.0)

    @cached_property
    def tension_cap(self) -> float:
        """Largest tension a string may pull [N]: 1e5 times the mass times gravity or 1 m/s^2,
        whichever is more."""
        return TENSION_CAP * (self.reference_force or 1.0)

    @cached_property
    def reference_force(self) -> float:
        """Size of the puppet's forces [N], which does not vanish with gravity."""
        return max(self.weight, self.mass * LEAST_GRAVITY)

    @cached_property
    def winches(self) -> Array:
        """(n_strings, 3) largest tension [N], rewinding speed [m/s], restitution, by string."""
        table = np.zeros((len(self.tree.strings), len(WINCH_AT)))
        for row, string in zip(table, self.tree.strings, strict=True):
            slips, rewinds = string.max_tension is not None, string.rewind_speed is not None
            own = {
                "max_tension": self.number(string.max_tension) if slips else np.inf,
                "rewind_speed": self.number(string.rewind_speed) if rewinds else 0.0,
                "restitution": self.number(string.restitution),
            }
            row[:] = [own[name] for name in WINCH_AT]
        return table

    def with_winches(self, winches: Array) -> Marionette:
        """The same puppet on other winches; nothing is compiled again.

        :meth:`with_parameters` gives those of the file again.

        Args:
            winches: (n_strings, 3) as in :attr:`winches`.

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
        other = copy.copy(self)
        other.__dict__["winches"] = table
        return other

    def winding(self, slip: Array) -> Array:
        """The rate at which winches wind slips (..., n_strings) back [m/s], <= 0.

        -min(rewind_speed, sqrt(2 BRAKE slip))
        """
        return -np.minimum(self.winches[:, WINCH_AT["rewind_speed"]], np.sqrt(2.0 * BRAKE * slip))

    @property
    def upper(self) -> Array:
        """(n_rows,) largest force of every row [N]; inf where there is none."""
        most = self.winches[:, WINCH_AT["max_tension"]]
        return np.concatenate([most, np.full(len(self.tree.limits), np.inf)])

    @cached_property
    def two_sided(self) -> Array:
        """(n_rows,) bool: rows that are wires."""
        wires = [s.wire for s in self.tree.strings] + [False] * len(self.tree.limits)
        return np.array(wires, dtype=bool)

    def row_scales(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_rows) what each row's h is measured against: string lengths [m], 1 for limits.

        Args:
            q_D, q_K: (..., n_qD), (..., n_qK) configurations [m, rad or 1].
        """
        lengths = np.maximum(self.string_lengths(q_D, q_K), 1e-3)
        limits = np.ones((*lengths.shape[:-1], len(self.tree.limits)))
        return np.concatenate([lengths, limits], axis=-1)

    # -- states ------------------------------------------------------------------------------

    def state(self, values: Mapping[str, float | Iterable[float]] | None = None) -> State:
        """A state at rest: the file's pose with some values changed.

        Driven lengths that neither the pose nor ``values`` name are those that just reach, and
        commands of drives are where their coordinates are, at rest.

        Args:
            values: coordinate name -> value; ``joint.rotation`` takes a quaternion (w, x, y, z)
                or a rotation vector; ``v:NAME`` sets a velocity. Angles may be ``30 deg``.
        """
        if values is not None and not isinstance(values, Mapping):
            raise StateError(
                f"found {values!r}; a state is given as names and values: {{'hand.length': 0.8}}"
            )
        table = self.coordinates
        q_D, q_K = table.start_D.copy(), table.start_K.copy()
        v_D, v_K = np.zeros(table.n_vD), np.zeros(table.n_vK)
        for name, value in (values or {}).items():
            values_by_name.put(table, name, value, q_D, v_D, q_K, v_K)
        # The masses of chains lie between the ends of this state, not of the file's pose.
        q_D, q_K = tree.placed(self.tree, q_D, q_K, self.number, frozenset(values or ()))
        if np.any(np.isnan(q_K)) or np.any(np.isnan(q_D)):
            places = {"q_D": np.nan_to_num(q_D), "q_K": np.nan_to_num(q_K)}
            h = self.library.evaluate("rows", **places, p=self.p).h
            for string, span in zip(self.tree.strings, h, strict=False):
                string.just_reaches(span, q_D, q_K)
        values_by_name.put_commands(self.tree.drives, values or {}, q_D, q_K)
        taut, slip = np.zeros(self.tree.n_rows, dtype=bool), np.zeros(len(self.tree.strings))
        return State(0.0, q_D, v_D, q_K, v_K, taut, slip, table)

    def rest(self, values: Mapping[str, float | Iterable[float]] | State | None = None) -> State:
        """A hanging equilibrium: a local minimum of V subject to the strings and limits.

        Args:
            values: as in :meth:`state`, or a state to settle from. Driven coordinates are held at
                them; dynamic ones are where the search begins; velocities do not matter.

        Raises:
            StateError: there is none, or it was not found.
        """
        x = values if isinstance(values, State) else self.state(values)
        return hanging.rest(self, x)

    def project(self, x: State) -> State:
        """The nearest state that no string or limit forbids; see :func:`projection.project`."""
        return projection.project(self, x)

    def check_start(
        self, x: State, method: Literal["event", "timestepping", "variational"] = "event"
    ) -> None:
        """Raises :class:`StateError` when a run of a method cannot begin at ``x``."""
        checks.check_start(self, x, method)

    def instant(self, x: State, acc_K: Array | None = None, u_D: Array | None = None) -> Instant:
        """The compiled model's quantities at a state.

        Args:
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.
        """
        table = self.coordinates
        acc_K = checks.vector("acc_K", acc_K, table.n_vK)
        u_D = checks.vector("u_D", u_D, table.n_vD)
        self.states([x])
        made = Instant.of(self.library, self.tree, x, self.p, acc_K, u_D)
        if len(x.slip):
            speed, braked = self.winches[:, WINCH_AT["rewind_speed"]], np.sqrt(2.0 * BRAKE * x.slip)
            made.hdot[: len(x.slip)] -= self.winding(x.slip)
            made.gamma[: len(x.slip)] -= np.where((braked > 0) & (braked < speed), BRAKE, 0.0)
        return made

    def accelerations(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None
    ) -> tuple[Array, Array]:
        """acc_D and the forces of the rows, from Eqs. 10 and 11 and the rules of Sec. IV.

        Over the rows that are taut in the state's mode, and those with h = 0 and hdot = 0:
        tau >= 0, hddot <= 0, tau . hddot = 0.

        Args:
            x: the state. Gaps and speeds that a fixed step has left of its taut rows stay as they
                are.
            acc_K, u_D: as in :meth:`instant`.

        Returns:
            acc_D (n_vD,), tension (n_rows,) of strings and then limits, >= 0; the least-norm one
            where several give the same motion.

        Raises:
            StateError: no acceleration keeps the rows, as when two inputs pull a string apart; or
                the mode says of slack rows that they are taut.
        """
        instant = self.instant(x, acc_K, u_D)
        check_mode(self, x, instant)
        closed = closed_rows(self, x, instant)
        tension = np.where(closed.slipping, self.upper, 0.0)
        w0 = instant.w0 - instant.W[:, closed.slipping] @ tension[closed.slipping]
        rows = np.flatnonzero(closed.held)
        hddot = instant.gamma[rows] + instant.W[:, rows].T @ w0
        # Rounding alone must not set rows that oppose one another at odds.
        terms = np.abs(instant.gamma[rows]) + np.abs(instant.W[:, rows]).T @ np.abs(w0)
        top = max(float(np.max(terms, initial=0.0)), self.weight / (self.mass or 1.0))
        hddot[np.abs(hddot) <= ROUNDED * top] = 0.0
        found = instant.complementarity(rows, hddot, self.two_sided, self.upper)
        if not found.solved:
            raise StateError(
                "no acceleration keeps these strings and limits: "
                + ", ".join(self.rows_of(rows, found.ray))
            )
        tension[rows] = found.x
        return instant.back(w0 - instant.W[:, rows] @ found.x), tension

    def rows_of(self, rows: Array, share: Array | None) -> tuple[str, ...]:
        """Names of those of some rows that have a share in something; all when none is given."""
        names = [self.tree.row_names[i] for i in rows]
        if share is None:
            return tuple(names)
        least = 1e-6 * np.max(np.abs(share), initial=0.0)
        return tuple(n for n, part in zip(names, share, strict=True) if part > least)

    def driven_velocity(self, name: str) -> int:
        """Place of a driven velocity in v_K."""
        names = self.coordinates.v_K
        if name not in names:
            raise UnknownNameError("driven velocity", name, names)
        return names.index(name)

    def stepper(
        self,
        x0: State,
        method: Literal["timestepping", "variational", "event"] = "timestepping",
        *,
        dt: float = 0.002,
        rtol: float = 1e-11,
        atol: float = 1e-11,
        extrapolate: bool = True,
    ) -> Stepper:
        """A run that is advanced piece by piece; see :class:`Stepper`.

        Args:
            x0: where it starts.
            method: ``timestepping``, ``variational`` or ``event``.
            dt: step of the first two [s].
            rtol, atol: tolerances of the event-driven integrator.
            extrapolate: time-stepping takes velocity products half a step on, from the steps
                before; False makes each step depend on its state alone, as
                :meth:`linearise_step` has it.
        """
        checks.check_method(method)
        checks.check_positive(dt=dt, rtol=rtol, atol=atol)
        self.check_start(x0, method)
        checks.check_step(self, method, x0.q_D, x0.q_K, dt)
        options = self.run_options(dt=dt, rtol=rtol, atol=atol, extrapolate=extrapolate)
        return Stepper(self, x0, method, options)

    def flow(self, x0: State, inputs: Input | None = None) -> Flow:
        """The motion from a state while no string catches or releases; see :class:`Flow`.

        Args:
            x0: where it starts.
            inputs: what the driven coordinates do; they hold still when not given.
        """
        return Flow(self, x0, inputs)

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

    def with_mode(self, x: State) -> State:
        """The state with its taut rows found."""
        _, tension = self.accelerations(x)
        return x.replace(taut=(tension > 0.0) | self.two_sided, coordinates=self.coordinates)
