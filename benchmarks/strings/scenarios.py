"""The problems: a puppet, a start, inputs, and an independent reference of the final state."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import fantoccini as fan
from fantoccini.base.arrays import Array
from fantoccini.dynamics.compiled import MethodName, as_method
from fantoccini.motion import Input, State, Trajectory
from harness import polynomial_input, start
from oracles import arm2d_events, point_mass_events
from oracles.arm2d_sympy import Arm, model
from oracles.pendulum_chain import Chain
from oracles.reeling_pendulum import PUPPET, Reeling

SECONDS = 5.0
"""Duration of every run whose error is reported [s]."""

GRAVITY, LENGTH, MASS = 9.81, 1.0, 0.5
"""Gravity, string length and mass of the bundled string pendulum [m/s^2], [m], [kg]."""

CHAIN_K = 2.4
"""v0^2 / (g L) of the pendulum that is thrown repeatedly."""

DROP_X = 0.6
"""Horizontal distance from the pivot at which the mass is dropped, at the same height [m]."""

ARM = Arm(m1=0.12, m2=0.08, I1=9e-4, I2=6e-4, L1=0.3, L2=0.3, height=0.9, gravity=GRAVITY)
"""The parameters of the bundled arm2d."""

FALL = {"shoulder": 0.5, "elbow": -0.5, "hand.x": 0.45, "hand.length": 1.02}
"""The slack pose from which the arm is dropped [rad], [m]."""

LED_X = [
    (0, 0.41),
    (0.44, 0.42),
    (0.77, 0.45),
    (1.06, 0.44),
    (1.41, 0.34),
    (1.76, 0.42),
    (2.02, 0.35),
    (2.42, 0.4),
    (2.84, 0.46),
    (3.3, 0.4),
    (3.9, 0.44),
    (5.0, 0.45),
]
LED_LENGTH = [0.58, 0.75, 0.82, 0.77, 0.63, 0.65, 0.73, 0.77, 0.6, 0.75, 0.75]
"""Waypoints (s, m) of the led arm's string end, and the lengths at them after the first [m]."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """A motion with a known end.

    Attributes:
        name: name in tables.
        marionette: the puppet.
        x0: its start state.
        inputs: its inputs; None for constant ones.
        reference: (n_qD + n_vD,) q_D and v_D after 5 s [m or rad, and per s].
        exact: method of the reference.
        events: (time [s], kind, impulse [N s]) of the reference.
        doubt: change of the reference with ten times its tolerance.
    """

    name: str
    marionette: fan.Marionette
    x0: State
    inputs: Input | None
    reference: Array
    exact: str
    events: tuple[tuple[float, str, float], ...] = ()
    doubt: float = 0.0

    def run(
        self,
        t_end: float = SECONDS,
        method: MethodName = "event",
        save_at: Array | None = None,
        **options,
    ) -> Trajectory:
        """Our motion; options of the method, ``tolerance`` for rtol and atol."""
        if "tolerance" in options:
            options["rtol"] = options["atol"] = options.pop("tolerance")
        return fan.simulate(
            self.marionette,
            self.x0,
            self.inputs,
            t_end=t_end,
            effort=False,
            method=as_method(method, **options),
            save_at=save_at,
        )

    def errors(self, run: Trajectory) -> tuple[float, float]:
        """Largest error of a coordinate and of a velocity at the end."""
        return self.apart(run.q_D[-1], run.v_D[-1])

    def apart(self, q: Array, v: Array) -> tuple[float, float]:
        """Largest difference of coordinates and of velocities from the reference."""
        n = len(q)
        return (
            float(np.max(np.abs(q - self.reference[:n]))),
            float(np.max(np.abs(v - self.reference[n:]))),
        )

    def growth(self, size: float = 1e-8) -> float:
        """Growth of a small change of the start until the end: the problem's condition number.

        Args:
            size: change of every start coordinate and velocity [m or rad, and per s].
        """
        starts, ends = [], []
        for sign in (-0.5, 0.5):
            q, v = self.x0.q_D + sign * size, self.x0.v_D + sign * size
            x = self.marionette.project(self.x0.replace(q_D=q, v_D=v))
            run = fan.simulate(
                self.marionette,
                x,
                self.inputs,
                t_end=SECONDS,
                method=fan.Event(rtol=1e-13, atol=1e-13),
            )
            starts.append(np.concatenate([x.q_D, x.v_D]))
            ends.append(np.concatenate([run.q_D[-1], run.v_D[-1]]))
        apart = [float(np.max(np.abs(b - a))) for a, b in (starts, ends)]
        return apart[1] / apart[0]


def evaluations(run: Trajectory) -> int:
    """Estimated evaluations of the model, which the runtime does not count.

    An accepted step takes 14 (11 stages, the end, and two for the projection). Locating an event
    took 90 to 150 when counted once, including rejected steps. A time step takes one.
    """
    steps = len(np.unique(run.t)) - 1
    return steps if run.method == "timestepping" else 14 * steps + 150 * len(run.events)


@functools.cache
def pendulum() -> fan.Marionette:
    """The bundled point mass on a string."""
    return fan.puppets.string_pendulum()


def pendulum_start(x: float, z: float, vx: float = 0.0) -> State:
    """The pendulum at a place [m], with a horizontal velocity [m/s]."""
    return pendulum().state({"bob.x": x, "bob.z": z, "v:bob.x": vx})


@functools.cache
def chain() -> Scenario:
    """A pendulum thrown up and caught repeatedly, in closed form."""
    known = Chain.until(SECONDS, CHAIN_K, LENGTH, MASS, GRAVITY)
    x0 = pendulum_start(0.0, -LENGTH, float(np.sqrt(CHAIN_K * GRAVITY * LENGTH)))
    return Scenario(
        "pendulum, thrown up and caught",
        pendulum(),
        x0,
        None,
        known.state(SECONDS),
        "closed form",
        tuple(known.events(SECONDS)),
    )


def launched_pendulum(k: float) -> Scenario:
    """A pendulum launched once from the bottom with v0^2 = k g L."""
    speed = float(np.sqrt(k * GRAVITY * LENGTH))
    known = point_mass_events.simulate([0.0, -LENGTH, speed, 0.0], SECONDS, LENGTH, GRAVITY)
    events = tuple((t, kind, MASS * lost) for t, kind, lost in known.events)
    x0 = pendulum_start(0.0, -LENGTH, speed)
    name = f"pendulum, launched with k = {k:g}"
    return Scenario(name, pendulum(), x0, None, known.state, "SciPy", events)


def dropped_mass(x: float, z: float, name: str) -> Scenario:
    """A mass dropped from rest on a slack string."""
    known = point_mass_events.simulate([x, z, 0.0, 0.0], SECONDS, LENGTH, GRAVITY)
    events = tuple((t, kind, MASS * lost) for t, kind, lost in known.events)
    x0 = pendulum_start(x, z)
    return Scenario(name, pendulum(), x0, None, known.state, "SciPy", events)


@functools.cache
def drop() -> Scenario:
    """A mass dropped next to the pivot, caught, then swinging."""
    return dropped_mass(DROP_X, 0.0, "mass, dropped beside its pivot")


@functools.cache
def drop_below() -> Scenario:
    """A mass dropped straight below the pivot, caught, then hanging."""
    return dropped_mass(0.0, -0.3, "mass, dropped below its pivot")


@functools.cache
def arm() -> fan.Marionette:
    """The bundled two-link arm on one string."""
    return fan.puppets.arm2d()


@functools.cache
def arm_fall() -> Scenario:
    """The arm dropped from a slack pose, string end and length fixed."""
    x, length = FALL["hand.x"], FALL["hand.length"]
    drive = arm2d_events.waypoints([(0, x), (SECONDS, x)], [(0, length), (SECONDS, length)])
    x0 = start(arm(), FALL, {})
    return _arm("arm, dropped on a slack string", x0, None, drive)


@functools.cache
def arm_led() -> Scenario:
    """The arm thrown and caught by a moving, reeled string."""
    pose, x = (-0.35, 0.85), LED_X[0][1]
    taut = float(model()["h"](pose, (0, 0), (x, 0.0), (0, 0), ARM.numbers()))
    times = [t for t, _ in LED_X]
    drive = arm2d_events.waypoints(LED_X, list(zip(times, [taut, *LED_LENGTH], strict=True)))
    values = {"shoulder": pose[0], "elbow": pose[1], "hand.x": x, "hand.length": taut}
    x0 = start(arm(), values, {})
    coef = {"hand.x": drive.coef[:, 0], "hand.length": drive.coef[:, 1]}
    inputs = polynomial_input(arm(), drive.breaks, coef, x0.q_K)
    return _arm("arm, led by a moving string", x0, inputs, drive)


def _arm(name: str, x0: State, inputs: Input | None, drive: arm2d_events.Polynomials) -> Scenario:
    known, other = (
        arm2d_events.simulate(ARM, x0.q_D, x0.v_D, drive, SECONDS, tolerance=tolerance)
        for tolerance in (1e-13, 1e-12)
    )
    doubt = float(np.max(np.abs(known.state - other.state)))
    events = tuple((t, kind, impulse) for t, kind, impulse, _ in known.events)
    return Scenario(name, arm(), x0, inputs, known.state, "SciPy", events, doubt)


@functools.cache
def reeling(pieces: int) -> tuple[Scenario, Callable[[Array], tuple[Array, Array]]]:
    """The reeled pendulum with a moving pivot, and a function for its states and tensions.

    Args:
        pieces: number of quintic pieces that approximate the sines, also in the reference.
    """
    oracle, marionette = Reeling(), fan.loads(PUPPET)
    drive = oracle.polynomials(SECONDS, pieces)
    states, _ = oracle.solve(drive, drive.breaks[[0, -1]])
    (X, L), (dX, dL), _ = drive.at(0, 0.0)
    x, z, vx, vz = states[0]
    x0 = start(
        marionette,
        {"bob.x": x, "bob.z": z, "line.x": X, "line.length": L},
        {"bob.x": vx, "bob.z": vz, "line.x": dX, "line.length": dL},
    )
    coef = {"line.x": drive.coef[:, 0], "line.length": drive.coef[:, 1]}
    inputs = polynomial_input(marionette, drive.breaks, coef, x0.q_K)
    name = "pendulum, reeled, its pivot moving"
    scenario = Scenario(name, marionette, x0, inputs, states[-1], "SciPy")
    return scenario, lambda times: oracle.solve(drive, times)
