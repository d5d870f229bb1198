"""Marionette: the public face of a model and of the algorithms that are functions of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from fantoccini.base import Array, output
from fantoccini.dynamics.compiled import (
    Flow,
    ForwardDynamics,
    Method,
    MethodName,
    Model,
    Quantities,
    configurations,
    forward_dynamics,
)
from fantoccini.dynamics.derivatives import (
    Linearisation,
    PointMode,
    Rollout,
    StepLinearisation,
    StepLinearisations,
    linearise,
    linearise_step,
    linearise_steps,
    rollout,
)
from fantoccini.dynamics.equilibrium import (
    Modes,
    Values,
    equilibrium,
    initial_state,
    modes,
    projection,
)
from fantoccini.dynamics.steppers import Stepper, StepperBatch
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene import Scene, assembled
from fantoccini.model.tree import CoordinateTable, Tree
from fantoccini.motion import Input, State

if TYPE_CHECKING:
    from fantoccini.kernel.equations import Equations


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Marionette(Quantities):
    """A puppet on strings: its coordinates, equations, compiled model, states.

    It is derived and compiled when first needed, or loaded from the cache. A marionette does not
    change: the ``with_`` methods return another one, and nothing is compiled again.

    Attributes:
        model: the object that the algorithms of the package are functions of.

    Args:
        what: a puppet or a scene.
        progress: called with the stage that begins ("deriving", "compiling").
    """

    model: Model

    def __init__(self, what: Puppet | Scene | Model, progress: Callable[[str], None] | None = None):
        if isinstance(what, Scene):
            what = assembled(what)
        model = what if isinstance(what, Model) else Model.of(what, progress)
        object.__setattr__(self, "model", model)

    def __repr__(self) -> str:
        t = self.coordinates
        return (
            f"<Marionette {self.name}: {t.n_vD} DOF, {len(self.tree.strings)} strings, "
            f"{t.n_vK} driven>"
        )

    def _repr_html_(self) -> str | None:
        """A picture of the start pose and tables, for notebooks; nothing is compiled for it."""
        return output().puppet_html(self)

    # -- its parts ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The puppet's name, or the scene's."""
        return self.model.name

    @property
    def puppet(self) -> Puppet:
        """The puppet as its file describes it; a scene assembled."""
        return self.model.puppet

    @property
    def tree(self) -> Tree:
        """Links, strings, limits and coordinates in the order of the equations."""
        return self.model.tree

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and places of all coordinates."""
        return self.model.coordinates

    @property
    def p(self) -> Array:
        """(n_p,) values of the parameters."""
        return self.model.p

    @property
    def winches(self) -> Array:
        """(n_strings, 3) largest tension [N], rewinding speed [m/s], restitution."""
        return self.model.winches

    @property
    def mass(self) -> float:
        """Mass of all links that move dynamically or hang from one that does [kg]."""
        return self.model.mass

    @property
    def weight(self) -> float:
        """Mass times gravity [N]; where gravity is zero, mass times 1 m/s^2."""
        return self.model.weight

    @property
    def equations(self) -> Equations:
        """The symbolic equations and the CasADi functions made from them."""
        return self.model.compiled.equations

    def compile(self) -> None:
        """Loads the compiled model, or makes it, before anything needs it.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        _ = self.model.library

    # -- other marionettes -------------------------------------------------------------------

    def with_parameters(self, values: Mapping[str, float]) -> Marionette:
        """The same puppet with other values of its parameters, and the winches of its file.

        Raises:
            UnknownNameError: there is no such parameter.
            StateError: a value is not finite.
            PuppetError: a value that the puppet's file could not have.
        """
        return Marionette(self.model.with_parameters(values))

    def with_winches(self, winches: Array) -> Marionette:
        """The same puppet on other winches (n_strings, 3); see :attr:`winches`.

        Raises:
            StateError: numbers that no winch can have.
        """
        return Marionette(self.model.with_winches(winches))

    # -- states ------------------------------------------------------------------------------

    def state(self, values: Values | None = None) -> State:
        """A state at rest: the file's pose with some values changed.

        Driven lengths that neither the pose nor ``values`` give just reach; commands of drives are
        where their coordinates are.

        Args:
            values: coordinate name -> value; ``joint.rotation`` takes a quaternion (w, x, y, z)
                or a rotation vector; ``v:NAME`` sets a velocity. Angles may be ``30 deg``.

        Raises:
            StateError: a value is not what the name takes.
            UnknownNameError: the puppet has no such coordinate.
        """
        return initial_state.state(self.model, values)

    def rest(self, values: Values | State | None = None) -> State:
        """A hanging equilibrium: a local minimum of V subject to the strings and limits.

        Args:
            values: as in :meth:`state`, or a state. Driven coordinates are held there; the search
                begins at the dynamic ones; velocities do not matter.

        Raises:
            StateError: there is none, or it was not found.
        """
        x = values if isinstance(values, State) else self.state(values)
        return equilibrium.rest(self.model, x)

    def project(self, x: State) -> State:
        """The nearest state, in the metric of M_DD, that satisfies the strings and limits.

        Driven coordinates stay. Rows that ``x`` marks as taut are brought to h = 0 and hdot = 0, as
        far as they do not contradict one another.

        Raises:
            StateError: no such state was found; the violation left in each row is reported.
        """
        return projection.project(self.model, x)

    def difference(self, q0: Array, q1: Array, driven: bool = False) -> Array:
        """The tangent vectors dq from q0 to q1: ``integrate(q0, dq)`` is q1.

        For a scalar q1 - q0, for an orientation the shortest rotation vector in the body's frame.

        Args:
            q0, q1: (..., n_qD) dynamic configurations [rad, m or 1]; leading axes broadcast.
            driven: they are driven ones, (..., n_qK).

        Returns:
            (..., n_vD), or (..., n_vK) [rad or m].
        """
        return configurations.difference(self.model, q0, q1, driven)

    def integrate(self, q: Array, dq: Array, driven: bool = False) -> Array:
        """q (..., n_qD) moved by tangent vectors dq (..., n_vD); see :meth:`difference`."""
        return configurations.integrate(self.model, q, dq, driven)

    # -- motion ------------------------------------------------------------------------------

    def forward_dynamics(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None
    ) -> ForwardDynamics:
        """M_DD acc_D = u_D - c - M_DK acc_K + A_D^T lambda, with strings that only pull.

        Over the rows that ``x`` marks as taut, and those with h = 0 and hdot = 0: tau >= 0,
        hddot <= 0, tau . hddot = 0. Without the forces of contact.

        Args:
            x: the state. Gaps and speeds that a fixed step left in its taut rows stay.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.

        Raises:
            StateError: no acceleration satisfies the rows, as when two inputs pull a string apart;
                or rows marked taut are slack.
        """
        return forward_dynamics(self.model, x, acc_K, u_D)

    def linearise(
        self,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        rows: Iterable[str] | None = None,
        contacts: Iterable[PointMode] | None = None,
    ) -> Linearisation:
        """Derivatives of acc_D and the tensions (Eqs. 10, 11), and A and B of the linear system.

        The slip of winches is held; a string at its winch's largest tension keeps it. Points of
        contact stick, slide or are open, and stay so.

        Args:
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.
            rows: names of the strings and limits to hold, as equalities whatever they would pull;
                wires and those that pull at ``x`` when not given.
            contacts: points to hold in their modes, as another linearisation near by has them;
                those that push at ``x`` when not given.

        Raises:
            StateError: no acceleration satisfies the rows at ``x``, solids strike there, or the
                motion near by depends on how redundant points that slide share their force.
            UnknownNameError: a row that the puppet does not have.
        """
        return linearise(self.model, x, acc_K, u_D, rows, contacts)

    def linearise_step(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None, dt: float = 0.002
    ) -> StepLinearisation:
        """The first step of a time-stepping run from a state, with its derivatives.

        Args:
            x: where the step starts; rows may be violated, as time-stepping allows.
            acc_K: (n_vK,) accelerations of the inputs over the step; 0 when not given.
            u_D: (n_vD,) user forces over the step; 0 when not given.
            dt: its length [s].

        Raises:
            StateError: violation is so large that the step was cut short, or the step's contacts
                have no derivative: what lies between two modes is in ``edges`` instead.
        """
        return linearise_step(self.model, x, acc_K, u_D, dt)

    def linearise_steps(
        self,
        q_D: Array,
        v_D: Array,
        q_K: Array,
        v_K: Array,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        *,
        p: Array | None = None,
        dt: float = 0.002,
        forces: bool = False,
        pull: bool = False,
        threads: int | None = None,
        method: Literal["timestepping", "variational"] = "timestepping",
    ) -> StepLinearisations:
        """One time step from each of n states with its derivatives, compiled.

        The steps are those of ``fan.TimeStepping(dt, extrapolate=False)``, and the derivatives
        those of :meth:`linearise_step`. Where that would raise, a step is not ``settled``, and
        where it names edges between modes of contact, not ``sharp``.

        Args:
            q_D, v_D, q_K, v_K: (n, ...) or (...,) states.
            acc_K: (n, n_vK) or (n_vK,) driven accelerations; 0 when not given.
            u_D: (n, n_vD) or (n_vD,) user forces; 0 when not given.
            p: (n, n_p) or (n_p,) parameters; the marionette's own when not given.
            dt: length of the steps [s].
            forces: differentiate by the user's forces, too.
            pull: also the tensions' derivatives.
            threads: all processors when not given.
            method: ``variational`` for steps of that method, in which no driven joint turns.

        Raises:
            StateError: an array has another shape.
        """
        return linearise_steps(
            self.model,
            q_D,
            v_D,
            q_K,
            v_K,
            acc_K,
            u_D,
            p=p,
            dt=dt,
            forces=forces,
            pull=pull,
            threads=threads,
            method=method,
        )

    def rollout(
        self,
        x0: State,
        acc_K: Array,
        u_D: Array | None = None,
        *,
        p: Array | None = None,
        dt: float = 0.002,
        extrapolate: bool = True,
        throw: bool = True,
    ) -> Rollout:
        """n time steps from a state, with gradients of their cost by :meth:`Rollout.gradient`.

        The steps are those of ``fan.TimeStepping(dt, extrapolate)`` with accelerations and forces
        that are constant over each.

        Args:
            x0: the start, without slip.
            acc_K: (n, n_vK) driven accelerations, a row for each step.
            u_D: (n, n_vD) or (n_vD,) user forces; 0 when not given.
            p: (n_p,) parameters; the marionette's own when not given.
            dt: length of the steps [s].
            extrapolate: as in :class:`TimeStepping`.
            throw: raise when the steps cannot go on; otherwise the rollout ends there, with its
                status.

        Raises:
            StateError: an array has another shape, or winches have slipped at the start.
            SimulationError: the rollout stopped.
        """
        return rollout(self.model, x0, acc_K, u_D, p=p, dt=dt, extrapolate=extrapolate, throw=throw)

    def modes(self, x: State) -> Modes:
        """Vibration modes about a state of rest, and which inputs excite each.

        Args:
            x: a state of rest, as from :meth:`rest`.

        Raises:
            StateError: the puppet does not rest there.
        """
        return modes(self.model, x)

    def stepper(self, x0: State, method: Method | MethodName = "timestepping") -> Stepper:
        """A run that is advanced piece by piece; see :class:`Stepper`.

        Args:
            x0: where it starts.
            method: ``timestepping``, ``variational`` or ``event``, or one with its options.
        """
        return Stepper.of(self.model, x0, method)

    def stepper_batch(
        self,
        x0: State | Sequence[State],
        n: int | None = None,
        method: Method | MethodName = "timestepping",
        *,
        parameters: Mapping[str, Array | float] | None = None,
        threads: int | None = None,
    ) -> StepperBatch:
        """Many runs that are advanced together, piece by piece; see :class:`StepperBatch`.

        Args:
            x0: where they start: one state, or n of one time.
            n: number of runs; as many as states or values of parameters when not given.
            method: of all; ``timestepping`` runs in lanes.
            parameters: name -> value, or (n,) values, one for each run.
            threads: all processors when not given.
        """
        return StepperBatch(self.model, x0, n, method, parameters, threads)

    def flow(self, x0: State, inputs: Input | None = None) -> Flow:
        """The motion from a state while no string catches or releases; see :class:`Flow`.

        Args:
            x0: where it starts.
            inputs: motion of the driven coordinates; they hold still when not given.
        """
        return Flow(self.model, x0, inputs)
