"""Marionette: a puppet with its equations and compiled library, and the algorithms that use it.

In names, D stands for dynamic coordinates, which move by the equations of motion, and K for driven
ones: ends and lengths of strings, driven joints. h is the gap of a string, path length minus string
length; hdot and hddot are its rates.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from fantoccini.base import Array, StateError, UnknownNameError, output
from fantoccini.dynamics.body_map import find_body_map
from fantoccini.dynamics.compiled import (
    CompiledPuppet,
    Flow,
    ForwardDynamics,
    Method,
    MethodName,
    configurations,
    forward_dynamics,
    vector,
)
from fantoccini.dynamics.derivatives import (
    Linearisation,
    PointMode,
    Rollout,
    StepInputs,
    StepKeywords,
    StepLinearisation,
    StepLinearisations,
    StepOptions,
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
from fantoccini.model import BodyMap
from fantoccini.motion import Input, State


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Marionette(CompiledPuppet):
    """A puppet on strings: its coordinates, equations, compiled model and states.

    The equations are derived and compiled when first needed, or loaded from the cache. It is
    immutable: the ``with_`` methods return another one, without compiling again.

    Args:
        puppet_or_scene: a puppet or a scene.
        progress: callback for each stage that begins (``what``: "deriving", "compiling").
    """

    def __repr__(self) -> str:
        t = self.coordinates
        return (
            f"<Marionette {self.name}: {t.n_vD} DOF, {len(self.tree.strings)} strings, "
            f"{t.n_vK} driven>"
        )

    def _repr_html_(self) -> str | None:
        """Picture of the start pose, and tables, for notebooks; nothing is compiled."""
        return output().puppet_html(self)

    # -- body map ----------------------------------------------------------------------------

    @property
    def body_map(self) -> BodyMap:
        """Trunk, head and limbs of the puppet, and the strings that move them.

        It is computed at rest, when first needed.

        Raises:
            StateError: the puppet has no body map, or this is a scene of several puppets.
        """
        if members := self.puppet.members:
            names = ", ".join(members)
            raise StateError(f"{self.name} is a scene of {names}; body_map_of has the map of each")
        return self.body_map_of("")

    def body_map_of(self, member: str) -> BodyMap:
        """The body map of a scene's member; of a single puppet with an empty name.

        Raises:
            StateError: the member has no body map; the message has the reason.
            UnknownNameError: the scene has no such member.
        """
        members = self.puppet.members or ("",)
        if member not in members:
            raise UnknownNameError("member of a scene", member, members)
        if member not in self._body_maps:
            self._body_maps[member] = find_body_map(self, member)
        return self._body_maps[member]

    @cached_property
    def _body_maps(self) -> dict[str, BodyMap]:
        """Body maps computed so far, by member."""
        return {}

    # -- states ------------------------------------------------------------------------------

    def state(self, values: Values | None = None) -> State:
        """A state at rest: the file's pose with some values changed.

        A driven length that neither the pose nor ``values`` sets is that of the string's path, so
        that the string is taut. Commands of drives equal their coordinates.

        Args:
            values: coordinate name -> value; ``joint.rotation`` takes a quaternion (w, x, y, z)
                or a rotation vector; ``v:NAME`` sets a velocity. Angles may be ``30 deg``.

        Raises:
            StateError: a value does not fit its name.
            UnknownNameError: the puppet has no such coordinate.
        """
        return initial_state.state(self, values)

    def rest(self, values: Values | State | None = None) -> State:
        """A hanging equilibrium: a local minimum of V subject to the strings and limits.

        Args:
            values: values of :meth:`state`, or a state. It fixes the driven coordinates; the search
                begins at the dynamic ones; velocities of a state are ignored.

        Raises:
            StateError: ``values`` sets a velocity; there is no equilibrium, or none was found.
        """
        x = values if isinstance(values, State) else self.state(values)
        if not isinstance(values, State) and (np.any(x.v_D) or np.any(x.v_K)):
            raise StateError(
                f"{self.name} at rest has no velocities; needed: values of coordinates only"
            )
        return equilibrium.rest(self, x)

    def project(self, x: State) -> State:
        """The nearest state, in the metric of M_DD, that satisfies the strings and limits.

        Driven coordinates are unchanged. Rows that ``x`` marks as taut are brought to h = 0 and
        hdot = 0, unless they are inconsistent.

        Raises:
            StateError: no such state was found; the message has the remaining violations.
        """
        return projection.project(self, x)

    def difference(self, q0: Array, q1: Array, driven: bool = False) -> Array:
        """Tangent vectors dq from q0 to q1: ``integrate(q0, dq)`` is q1.

        A scalar gives q1 - q0, an orientation the shortest rotation vector in the body's frame.

        Args:
            q0, q1: (..., n_qD) dynamic configurations [rad, m or 1]; leading axes broadcast.
            driven: whether they are driven configurations (..., n_qK).

        Returns:
            Vectors (..., n_vD), or (..., n_vK) [rad or m].
        """
        return configurations.difference(self, q0, q1, driven)

    def integrate(self, q: Array, dq: Array, driven: bool = False) -> Array:
        """Configurations q (..., n_qD) moved by vectors dq (..., n_vD); see :meth:`difference`."""
        return configurations.integrate(self, q, dq, driven)

    # -- quantities at a state, in the paper's order ----------------------------------------

    def mass_matrix(self, x: State) -> Array:
        """Inertia matrix M(q_D) of Eq. 8, (n_vD, n_vD) [kg, kg m, kg m^2]."""
        return self.interpreted("mass_matrix", x).M

    def mass_matrix_DK(self, x: State) -> Array:
        """Block M_DK (n_vD, n_vK) of the inertia matrix: not 0 where a driven joint moves mass."""
        return self.interpreted("mass_matrix", x).M_DK

    def mass_matrix_KK(self, x: State) -> Array:
        """Block M_KK (n_vK, n_vK) of the inertia matrix."""
        return self.interpreted("mass_matrix", x).M_KK

    def coriolis_matrix(self, x: State) -> Array:
        """Coriolis matrix C(q, v) of Eq. 8 for the dynamic velocities, (n_vD, n_vD)."""
        n = self.coordinates.n_vD
        return self.interpreted("coriolis", x).C[:n, :n]

    def gravity(self, x: State) -> Array:
        """Gradient g(q) of the potential energy in Eq. 8, (n_vD,) [N or N m]."""
        return self.interpreted("gravity", x).g_D.ravel()

    def bias(self, x: State) -> Array:
        """Bias c(q, v) = C v + g, (n_vD,) [N or N m]: Eq. 8 is M acc + c = u."""
        return self.interpreted("bias", x).c.ravel()

    def damping(self, x: State) -> Array:
        """Damping and drag (n_vD,), with the sign of c: the force is u = -damping [N or N m]."""
        return self.interpreted("damping", x).f.ravel()

    def constraint(self, x: State) -> Array:
        """Gaps h(q), (n_rows,): path length less string length and slip [m]; limits [m, rad, 1]."""
        h = self.interpreted("constraint", x).h.ravel()
        h[: len(x.slip)] -= x.slip
        return h

    def A_D(self, x: State) -> Array:
        """String Jacobian A_D = dh/dq_D of Eq. 9, acting on velocities, (n_rows, n_vD)."""
        return self.interpreted("A_D", x).A_D

    def A_K(self, x: State) -> Array:
        """String Jacobian A_K = dh/dq_K of Eq. 9, acting on velocities, (n_rows, n_vK)."""
        return self.interpreted("A_K", x).A_K

    def Adot_v(self, x: State) -> Array:
        """Velocity terms dA/dt v = dA_D/dt v_D + dA_K/dt v_K of Eq. 11, (n_rows,)."""
        return self.interpreted("Adot_v", x).Adot_v.ravel()

    def kinetic_energy(self, x: State) -> float:
        """Kinetic energy T = sum_i 1/2 V_i^T I_i V_i (Eq. 5) [J]."""
        return float(self.interpreted("kinetic", x).T.item())

    def potential_energy(self, x: State) -> float:
        """Potential energy V of gravity and springs (Eq. 6) [J]."""
        return float(self.interpreted("potential", x).V.item())

    def lagrangian(self, x: State) -> float:
        """Lagrangian L = T - V (Eq. 7) [J]."""
        return float(self.interpreted("lagrangian", x).lagrangian.item())

    def momentum(self, x: State) -> Array:
        """Momentum (6,) about the centre of mass, in world axes: linear [N s], angular [N m s]."""
        return self.library.evaluate("momentum", **self.at(x)).momentum

    def body_velocity(self, x: State, body: str | None = None) -> Array:
        """Twist V^b (Eq. 4) of a body (6,), or of all links (n_links, 6), in their own frames.

        The linear part comes first, then the angular one [m/s, rad/s].
        """
        V = self.interpreted("body_velocity", x).V.T
        return V if body is None else V[self.link_index(body)]

    def pose(self, x: State, body: str) -> Array:
        """Homogeneous pose g (Eqs. 2, 3) of a body in the world, (4, 4)."""
        self.check_state(x)
        pose = np.eye(4)
        pose[:3] = self.poses(x.q_D, x.q_K)[self.link_index(body)]
        return pose

    def wrench_forces(self, x: State, wrenches: Mapping[str, ArrayLike]) -> Array:
        """Forces u_D (n_vD,) of wrenches on bodies, to pass as user forces [N or N m].

        Args:
            x: the state.
            wrenches: body -> (6,) force on its centre of mass [N] and torque [N m], world axes.
        """
        self.check_state(x)
        w = np.zeros((len(self.tree.links), 6))
        for body, wrench in wrenches.items():
            w[self.link_index(body)] += vector(f"wrenches[{body!r}]", wrench, 6)
        at = {"q_D": x.q_D, "q_K": x.q_K, "p": self.p}
        return self.library.evaluate("wrench_forces", **at, wrench=w.T).u_D

    # -- motion ------------------------------------------------------------------------------

    def forward_dynamics(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None
    ) -> ForwardDynamics:
        """Solves M_DD acc_D = u_D - c - M_DK acc_K + A_D^T lambda with strings that only pull.

        Over the rows that ``x`` marks as taut, and those with h = 0 and hdot = 0, it satisfies
        tau >= 0, hddot <= 0 and tau . hddot = 0. Contact forces are not included.

        Args:
            x: the state. Gaps and speeds of its taut rows, left by fixed steps, are not corrected.
            acc_K: (n_vK,) accelerations of the inputs; 0 by default.
            u_D: (n_vD,) user forces; 0 by default.

        Raises:
            StateError: no acceleration satisfies the rows, for example if both ends of a taut
                string are driven apart; or rows marked taut are slack.
        """
        return forward_dynamics(self, x, acc_K, u_D)

    def linearise(
        self,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        rows: Iterable[str] | None = None,
        contacts: Iterable[PointMode] | None = None,
    ) -> Linearisation:
        """Derivatives of acc_D and the tensions (Eqs. 10, 11), and A and B of the linear system.

        The slip of winches is constant, and a string at its winch's largest tension keeps that
        tension. Contact points stay sticking, sliding or open.

        Args:
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 by default.
            u_D: (n_vD,) user forces; 0 by default.
            rows: names of the strings and limits that stay taut (h = 0), whatever the sign of their
                tension; by default wires and those that pull at ``x``.
            contacts: contact points that keep their modes, such as those of a linearisation at a
                neighbouring state; by default those that push at ``x``.

        Raises:
            StateError: no acceleration satisfies the rows at ``x``, solids collide there, or
                neighbouring motions depend on how redundant sliding points share a force.
            UnknownNameError: the puppet does not have a row.
        """
        return linearise(self, x, acc_K, u_D, rows, contacts)

    def linearise_step(
        self, x: State, acc_K: Array | None = None, u_D: Array | None = None, dt: float = 0.002
    ) -> StepLinearisation:
        """The first step of a time-stepping run from a state, with its derivatives.

        Args:
            x: start state; strings and limits may be violated a little, as in time-stepping runs.
            acc_K: (n_vK,) accelerations of the inputs over the step; 0 by default.
            u_D: (n_vD,) user forces over the step; 0 by default.
            dt: length of the step [s].

        Raises:
            StateError: violations are so large that the velocities were scaled down, or a contact
                has no derivative. Contacts between two modes are in ``edges`` instead.
        """
        return linearise_step(self, x, acc_K, u_D, dt)

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
        **options: Unpack[StepKeywords],
    ) -> StepLinearisations:
        """One time step from each of n states with its derivatives, compiled.

        The steps are those of ``fan.TimeStepping(dt, extrapolate=False)``, and the derivatives
        those of :meth:`linearise_step`. A step is not ``settled`` if that method would raise, and
        not ``differentiable`` if its result would have ``edges``.

        Args:
            q_D, v_D, q_K, v_K: (n, ...) or (...,) states: dynamic (D) and driven (kinematic, K)
                configurations and velocities.
            acc_K: (n, n_vK) or (n_vK,) driven accelerations; 0 by default.
            u_D: (n, n_vD) or (n_vD,) user forces; 0 by default.
            p: (n, n_p) or (n_p,) parameters; by default the marionette's own.
            dt: length of the steps [s].
            options: fields of :class:`fantoccini.dynamics.derivatives.StepOptions`, such as
                ``tension_partials=True``.

        Raises:
            StateError: an array has another shape.
        """
        steps = StepInputs.from_arrays(self, (q_D, v_D, q_K, v_K), acc_K, u_D, p, dt)
        return linearise_steps(self, steps, StepOptions(**options))

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
        """Rollout of n time steps from a state; :meth:`Rollout.gradient` differentiates its cost.

        The steps are those of ``fan.TimeStepping(dt, extrapolate)`` with accelerations and forces
        that are constant over each.

        Args:
            x0: start state, without slip.
            acc_K: (n, n_vK) driven accelerations, a row for each step.
            u_D: (n, n_vD) or (n_vD,) user forces; 0 by default.
            p: (n_p,) parameters; by default the marionette's own.
            dt: length of the steps [s].
            extrapolate: option of :class:`TimeStepping`.
            throw: whether to raise if the steps cannot continue; otherwise the rollout ends, with
                its status.

        Raises:
            StateError: an array has another shape, or winches have slipped at the start.
            SimulationError: the rollout stopped.
        """
        return rollout(self, x0, acc_K, u_D, p=p, dt=dt, extrapolate=extrapolate, throw=throw)

    def modes(self, x: State) -> Modes:
        """Vibration modes about a state of rest, with the inputs that excite each.

        Args:
            x: state of rest, as from :meth:`rest`.

        Raises:
            StateError: the puppet does not rest there.
        """
        return modes(self, x)

    def stepper(self, x0: State, method: Method | MethodName = "timestepping") -> Stepper:
        """A run that is advanced piece by piece; see :class:`Stepper`.

        Args:
            x0: start state.
            method: ``timestepping``, ``variational`` or ``event``, or one with its options.
        """
        return Stepper.from_state(self, x0, method)

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
            x0: start state of all runs, or n start states of equal time.
            n: number of runs; by default the number of states or values of parameters.
            method: method of all runs; ``timestepping`` runs in lanes.
            parameters: name -> value, or (n,) values, one for each run.
            threads: number of threads; by default all processors.
        """
        return StepperBatch(self, x0, n, method, parameters, threads)

    def flow(self, x0: State, inputs: Input | None = None) -> Flow:
        """The motion from a state until a string comes taut or slack; see :class:`Flow`.

        Args:
            x0: start state.
            inputs: motion of the driven coordinates; by default they hold still.
        """
        return Flow(self, x0, inputs)
