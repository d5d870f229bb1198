"""Marionette: what a user holds. A model, and the algorithms that are functions of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fantoccini.arrays import Array
from fantoccini.equations import Equations
from fantoccini.marionette import analysis, configurations, hanging, projection, start
from fantoccini.marionette.checks import check_start, check_step
from fantoccini.marionette.dynamics import ForwardDynamics, forward_dynamics
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.linearisation import Linearisation, linearise
from fantoccini.marionette.methods import Method, MethodName, as_method
from fantoccini.marionette.model import Model
from fantoccini.marionette.modes import Modes, modes
from fantoccini.marionette.step_linearisation import StepLinearisation, linearise_step
from fantoccini.marionette.stepper import Stepper
from fantoccini.motion import Input, State
from fantoccini.puppet import Obstacle, Puppet
from fantoccini.tree import CoordinateTable, Tree
from fantoccini.world import World

Values = Mapping[str, float | Iterable[float]]


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Marionette:
    """A puppet on strings: its coordinates, equations, compiled model, states.

    Nothing is derived or compiled before it is needed; a puppet that was compiled before loads
    from the cache without deriving anything. A marionette does not change: the ``with_`` methods
    give another one, and nothing is compiled again.

    Attributes:
        model: what the algorithms of the package are functions of.

    Args:
        what: a puppet or a world.
        progress: told what takes long while it happens ("deriving", "compiling").
    """

    model: Model

    def __init__(self, what: Puppet | World | Model, progress: Callable[[str], None] | None = None):
        if isinstance(what, Puppet):
            what = World.of(what)
        model = what if isinstance(what, Model) else Model.of(what, progress)
        object.__setattr__(self, "model", model)

    def __copy__(self) -> Marionette:
        return self

    def __deepcopy__(self, memo: dict) -> Marionette:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Marionette, (self.model,)

    def __repr__(self) -> str:
        t = self.coordinates
        return (
            f"<Marionette {self.name}: {t.n_vD} DOF, {len(self.tree.strings)} strings, "
            f"{t.n_vK} driven>"
        )

    def _repr_html_(self) -> str | None:
        """A picture of the start pose and tables, for notebooks; nothing is compiled for it."""
        from fantoccini.view.notebook import puppet_html

        return puppet_html(self)

    # -- what it is made of ------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The world's name."""
        return self.model.name

    @property
    def world(self) -> World:
        """The puppets, obstacles and floor."""
        return self.model.world

    @property
    def puppet(self) -> Puppet:
        """The puppet; the first one of a world of several."""
        return self.model.puppet

    @property
    def tree(self) -> Tree:
        """Links, strings, limits and coordinates in the order of the equations."""
        return self.model.tree

    @property
    def coordinates(self) -> CoordinateTable:
        """Names and places of all coordinates."""
        return self.model.tree.coordinates

    @property
    def p(self) -> Array:
        """(n_p,) values of the parameters."""
        return self.model.p

    @property
    def winches(self) -> Array:
        """(n_strings, 3) largest tension [N], rewinding speed [m/s], restitution, by string."""
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

        Args:
            values: parameter name -> value.

        Raises:
            UnknownNameError: there is no such parameter.
            StateError: a value is not finite.
            PuppetError: a value that the puppet's file could not have.
        """
        return Marionette(self.model.with_parameters(values))

    def with_winches(self, winches: Array) -> Marionette:
        """The same puppet on other winches; see :attr:`winches`.

        Raises:
            StateError: numbers that no winch has.
        """
        return Marionette(self.model.with_winches(winches))

    def with_obstacles(self, obstacles: Iterable[Obstacle]) -> Marionette:
        """The same puppet among other obstacles."""
        return Marionette(self.model.with_obstacles(obstacles))

    # -- states ------------------------------------------------------------------------------

    def state(self, values: Values | None = None) -> State:
        """A state at rest: the file's pose with some values changed.

        Driven lengths that neither the pose nor ``values`` name are those that just reach, and
        commands of drives are where their coordinates are, at rest.

        Args:
            values: coordinate name -> value; ``joint.rotation`` takes a quaternion (w, x, y, z)
                or a rotation vector; ``v:NAME`` sets a velocity. Angles may be ``30 deg``.

        Raises:
            StateError: a value is not what the name takes.
            UnknownNameError: the puppet has no such coordinate.
        """
        return start.state(self.model, values)

    def rest(self, values: Values | State | None = None) -> State:
        """A hanging equilibrium: a local minimum of V subject to the strings and limits.

        Args:
            values: as in :meth:`state`, or a state to settle from. Driven coordinates are held at
                them; dynamic ones are where the search begins; velocities do not matter.

        Raises:
            StateError: there is none, or it was not found.
        """
        x = values if isinstance(values, State) else self.state(values)
        return hanging.rest(self.model, x)

    def project(self, x: State) -> State:
        """The nearest state that no string or limit forbids; see :func:`projection.project`."""
        return projection.project(self.model, x)

    def check_start(self, x: State, method: Method | MethodName = "event") -> None:
        """Raises :class:`StateError` when a run of a method cannot begin at ``x``."""
        check_start(self.model, x, as_method(method).name)

    def difference(self, q0: Array, q1: Array, driven: bool = False) -> Array:
        """The tangent vectors dq that move q0 to q1: ``integrate(q0, dq)`` is q1.

        A scalar's is q1 - q0, an orientation's the shortest rotation vector in the body's frame:
        as in :meth:`linearise`, ordered and sized as the velocities.

        Args:
            q0, q1: (..., n_qD) dynamic configurations [rad, m or 1]; leading axes broadcast.
            driven: they are driven ones, (..., n_qK).

        Returns:
            (..., n_vD), or (..., n_vK) [rad or m].
        """
        return configurations.difference(self.model, q0, q1, driven)

    def integrate(self, q: Array, dq: Array, driven: bool = False) -> Array:
        """q moved by tangent vectors: scalars add, orientations turn; see :meth:`difference`.

        Args:
            q: (..., n_qD) dynamic configurations [rad, m or 1].
            dq: (..., n_vD) tangent vectors [rad or m]; leading axes broadcast.
            driven: they are driven ones, (..., n_qK) and (..., n_vK).

        Returns:
            (..., n_qD), or (..., n_qK).
        """
        return configurations.integrate(self.model, q, dq, driven)

    # -- motion ------------------------------------------------------------------------------

    def forward_dynamics(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None
    ) -> ForwardDynamics:
        """M_DD acc_D = u_D - c - M_DK acc_K + A_D^T lambda, with strings that only pull.

        Over the rows that are taut in the state's mode, and those with h = 0 and hdot = 0:
        tau >= 0, hddot <= 0, tau . hddot = 0.

        Args:
            x: the state. Gaps and speeds that a fixed step has left of its taut rows stay as they
                are.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.

        Raises:
            StateError: no acceleration keeps the rows, as when two inputs pull a string apart; or
                the mode says of slack rows that they are taut.
        """
        return forward_dynamics(self.model, x, acc_K, u_D)

    def linearise(
        self,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        rows: Iterable[str] | None = None,
    ) -> Linearisation:
        """Derivatives of acc_D and the tensions at a state, and A and B of the linear system.

        Args:
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.
            rows: names of the strings and limits to hold; those that pull when not given.
        """
        return linearise(self.model, x, acc_K, u_D, rows)

    def linearise_step(
        self,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        dt: float = 0.002,
    ) -> StepLinearisation:
        """One step of the time-stepper with its derivatives, in the mode that it chooses.

        Args:
            x: where the step starts.
            acc_K: (n_vK,) accelerations of the inputs over the step; 0 when not given.
            u_D: (n_vD,) user forces over the step; 0 when not given.
            dt: its length [s].
        """
        return linearise_step(self.model, x, acc_K, u_D, dt)

    def modes(self, x: State) -> Modes:
        """How the puppet swings about a state of rest, and which inputs excite each swing.

        Args:
            x: a state of rest, as :meth:`rest` gives it.

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
        chosen = as_method(method)
        check_start(self.model, x0, chosen.name)
        options = self.model.run_options(**chosen.options)
        check_step(self.model, chosen.name, x0.q_D, x0.q_K, options.dt)
        return Stepper(self.model, x0, chosen.name, options)

    def flow(self, x0: State, inputs: Input | None = None) -> Flow:
        """The motion from a state while no string catches or releases; see :class:`Flow`.

        Args:
            x0: where it starts.
            inputs: what the driven coordinates do; they hold still when not given.
        """
        return Flow(self.model, x0, inputs)

    # -- the paper's quantities ----------------------------------------------------------------

    def mass_matrix(self, x: State) -> Array:
        """M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
        return analysis.mass_matrix(self.model, x)

    def mass_matrix_DK(self, x: State) -> Array:
        """M_DK, (n_vD, n_vK): non-zero where a driven joint moves mass."""
        return analysis.mass_matrix_DK(self.model, x)

    def mass_matrix_KK(self, x: State) -> Array:
        """M_KK, (n_vK, n_vK)."""
        return analysis.mass_matrix_KK(self.model, x)

    def coriolis_matrix(self, x: State) -> Array:
        """C(q, v) of Eq. 8 over the dynamic velocities, (n_vD, n_vD); see ``coriolis_full``."""
        return analysis.coriolis_matrix(self.model, x)

    def gravity(self, x: State) -> Array:
        """g(q) of Eq. 8, (n_vD,): gradient of the potential energy [N or N m]."""
        return analysis.gravity(self.model, x)

    def bias(self, x: State) -> Array:
        """c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
        return analysis.bias(self.model, x)

    def damping(self, x: State) -> Array:
        """(n_vD,) force of damping and drag, on the side of c: u = -damping [N or N m]."""
        return analysis.damping(self.model, x)

    def constraint(self, x: State) -> Array:
        """h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad or 1]."""
        return analysis.constraint(self.model, x)

    def A_D(self, x: State) -> Array:
        """A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
        return analysis.A_D(self.model, x)

    def A_K(self, x: State) -> Array:
        """A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
        return analysis.A_K(self.model, x)

    def Adot_v(self, x: State) -> Array:
        """dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
        return analysis.Adot_v(self.model, x)

    def kinetic_energy(self, x: State) -> float:
        """T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
        return analysis.kinetic_energy(self.model, x)

    def potential_energy(self, x: State) -> float:
        """V (Eq. 6, with gravity's acceleration), plus the energy of springs [J]."""
        return analysis.potential_energy(self.model, x)

    def lagrangian(self, x: State) -> float:
        """L = T - V (Eq. 7) [J]."""
        return analysis.lagrangian(self.model, x)

    def body_velocity(self, x: State, body: str | None = None) -> Array:
        """V^b (Eq. 4): (v, w) of bodies in their own frames.

        Args:
            x: the state.
            body: its name; all bodies when not given.

        Returns:
            (6,) of one body or (n_links, 6): linear, then angular [m/s, rad/s].
        """
        return analysis.body_velocity(self.model, x, body)

    def pose(self, x: State, body: str) -> Array:
        """g (Eqs. 2, 3): (4, 4) homogeneous pose of a body in the world."""
        return analysis.pose(self.model, x, body)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """World poses (R | r) of all links.

        Args:
            q_D: (..., n_qD).
            q_K: (..., n_qK).

        Returns:
            (..., n_links, 3, 4).
        """
        return analysis.poses(self.model, q_D, q_K)

    def string_points(self, q_D: Array, q_K: Array) -> list[Array]:
        """World positions of every string's points: per string (..., n_points, 3) [m]."""
        return analysis.string_points(self.model, q_D, q_K)

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

        How heavy the control is in the hand. Arguments (..., n) each; ``tension`` (..., n_strings).

        Returns:
            (..., n_vK) [N or N m].
        """
        return analysis.effort(self.model, q_D, v_D, q_K, v_K, acc_D, acc_K, tension)

    def wrench_forces(self, x: State, wrenches: dict[str, Array]) -> Array:
        """u_D of wrenches on bodies, to pass as user forces.

        Args:
            x: the state.
            wrenches: body -> (6,) force on its centre of mass [N] and torque [N m], world axes.

        Returns:
            (n_vD,) [N or N m].
        """
        return analysis.wrench_forces(self.model, x, wrenches)
