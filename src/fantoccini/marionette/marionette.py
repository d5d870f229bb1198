"""Marionette: the public face of a model and of the algorithms that are functions of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fantoccini.arrays import Array
from fantoccini.marionette import (  # fmt: skip
    analysis,
    configurations,
    equilibrium,
    initial_state,
    projection,
)
from fantoccini.marionette.analysis import interpreted
from fantoccini.marionette.contact_rows import PointMode
from fantoccini.marionette.dynamics import ForwardDynamics, forward_dynamics
from fantoccini.marionette.flow import Flow
from fantoccini.marionette.initial_state import Values
from fantoccini.marionette.linearisation import Linearisation, linearise
from fantoccini.marionette.methods import Method, MethodName
from fantoccini.marionette.model import Model
from fantoccini.marionette.modes import Modes, modes
from fantoccini.marionette.step_linearisation import StepLinearisation, linearise_step
from fantoccini.marionette.stepper import Stepper
from fantoccini.marionette.stepper_batch import StepperBatch
from fantoccini.motion import Input, State
from fantoccini.puppet import Puppet
from fantoccini.scene import Scene, assembled
from fantoccini.tree import CoordinateTable, Tree

if TYPE_CHECKING:
    from fantoccini.equations import Equations


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Marionette:
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
        from fantoccini.view.notebook import puppet_html

        return puppet_html(self)

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

    # -- the paper's quantities ----------------------------------------------------------------

    def mass_matrix(self, x: State) -> Array:
        """M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
        return interpreted(self.model, "mass_matrix", x).M

    def mass_matrix_DK(self, x: State) -> Array:
        """M_DK, (n_vD, n_vK): non-zero where a driven joint moves mass."""
        return interpreted(self.model, "mass_matrix", x).M_DK

    def mass_matrix_KK(self, x: State) -> Array:
        """M_KK, (n_vK, n_vK)."""
        return interpreted(self.model, "mass_matrix", x).M_KK

    def coriolis_matrix(self, x: State) -> Array:
        """C(q, v) of Eq. 8 over the dynamic velocities, (n_vD, n_vD)."""
        n = self.coordinates.n_vD
        return analysis.coriolis_full(self.model, x)[:n, :n]

    def gravity(self, x: State) -> Array:
        """g(q) of Eq. 8, (n_vD,): gradient of the potential energy [N or N m]."""
        return interpreted(self.model, "gravity", x).g_D.ravel()

    def bias(self, x: State) -> Array:
        """c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
        return interpreted(self.model, "bias", x).c.ravel()

    def damping(self, x: State) -> Array:
        """(n_vD,) force of damping and drag, on the side of c: u = -damping [N or N m]."""
        return interpreted(self.model, "damping", x).f.ravel()

    def constraint(self, x: State) -> Array:
        """h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad or 1]."""
        return analysis.constraint(self.model, x)

    def A_D(self, x: State) -> Array:
        """A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
        return interpreted(self.model, "A_D", x).A_D

    def A_K(self, x: State) -> Array:
        """A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
        return interpreted(self.model, "A_K", x).A_K

    def Adot_v(self, x: State) -> Array:
        """dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
        return interpreted(self.model, "Adot_v", x).Adot_v.ravel()

    def kinetic_energy(self, x: State) -> float:
        """T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
        return float(interpreted(self.model, "kinetic", x).T.item())

    def potential_energy(self, x: State) -> float:
        """V (Eq. 6, with gravity's acceleration), plus the energy of springs [J]."""
        return float(interpreted(self.model, "potential", x).V.item())

    def lagrangian(self, x: State) -> float:
        """L = T - V (Eq. 7) [J]."""
        return float(interpreted(self.model, "lagrangian", x).lagrangian.item())

    def momentum(self, x: State) -> Array:
        """(6,) momentum about the centre of mass, in world axes: linear [N s], angular [N m s]."""
        state = {"q_D": x.q_D, "v_D": x.v_D, "q_K": x.q_K, "v_K": x.v_K}
        return self.model.library.evaluate("momentum", **state, p=self.model.p).momentum

    def body_velocity(self, x: State, body: str | None = None) -> Array:
        """V^b (Eq. 4) of a body (6,), or of all (n_links, 6), in their own frames.

        Linear, then angular [m/s, rad/s].
        """
        return analysis.body_velocity(self.model, x, body)

    def pose(self, x: State, body: str) -> Array:
        """g (Eqs. 2, 3): (4, 4) homogeneous pose of a body in the world."""
        return analysis.pose(self.model, x, body)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """World poses (R | r) of all links at (..., n_qD), (..., n_qK): (..., n_links, 3, 4)."""
        return analysis.poses(self.model, q_D, q_K)

    def string_points(self, q_D: Array, q_K: Array) -> list[Array]:
        """World positions of every string's points: per string (..., n_points, 3) [m]."""
        return analysis.string_points(self.model, q_D, q_K)

    def effort(
        self, q_D: Array, v_D: Array, q_K: Array, v_K: Array, acc_D: Array, acc_K: Array,
        tension: Array,
    ) -> Array:  # fmt: skip
        """Force on every driven coordinate: M_KD acc_D + M_KK acc_K + c_K - A_K^T lambda.

        How heavy the control is in the hand, (..., n_vK) [N or N m]. The arguments are (..., n)
        each, ``tension`` (..., n_strings), or (..., n_rows) as of :meth:`forward_dynamics`: limits
        do not pull on driven coordinates.
        """
        return analysis.effort(self.model, q_D, v_D, q_K, v_K, acc_D, acc_K, tension)

    def wrench_forces(self, x: State, wrenches: Mapping[str, Array]) -> Array:
        """u_D (n_vD,) of wrenches on bodies, to pass as user forces [N or N m].

        Args:
            x: the state.
            wrenches: body -> (6,) force on its centre of mass [N] and torque [N m], world axes.
        """
        return analysis.wrench_forces(self.model, x, wrenches)
