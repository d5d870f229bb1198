"""Vibration modes of a puppet at rest, hanging or standing, and which inputs excite them.

With the small motions of :mod:`.small_motions`, etaddot + D etadot + K eta = F, a mode is
eta = phi exp(s t) with (s^2 + s D + K) phi = 0. K and D are not symmetric if drives compute
torques, which have no potential, or if solids roll. Forces then act through psi with
psi^T (s^2 + s D + K) = 0.

eta are the free coordinates of a small motion, and phi is the shape of a mode. q_K are the driven
coordinates, v_K and acc_K their velocities and accelerations. In names, D stands for dynamic
coordinates, which move by the equations of motion. A row is a string or a joint limit with its gap
h <= 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, ShortRepr, StateError
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.dynamics.derivatives import HeldPoint, SmallMotions, motion_at
from fantoccini.dynamics.equilibrium.equilibrium import ACCEPTANCE
from fantoccini.motion import State


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of modes. s are eigenvalues [1/s]."""

    max_rest_motion: float = 1e-6
    """Largest speed and acceleration of a puppet at rest [rad or m per s or s^2]."""
    zero: float = 1e-6
    """|s| that counts as 0, relative to the largest: a double root errs by the root of rounding."""
    undamped: float = 1e-12  # Real part of s that counts as rounding, relative to |s|
    asymmetry: float = 1e-7
    """Asymmetry of K and D from rounding and unbalanced forces, relative to them."""
    equal: float = 1e-6  # Relative difference of s of a multiple eigenvalue, as with ``zero``
    real_basis: float = 1e-6  # Smallest singular value of a real basis, relative to the largest
    excitable: float = 1e-8
    """Gain of a mode that inputs excite, relative to the largest of all modes."""
    listed: float = 0.02  # Smallest entry in the printed table, relative to the mode's largest


TOLERANCES = Tolerances()


@dataclass(frozen=True, eq=False, repr=False)
class Mode(ShortRepr):
    """One vibration mode, or an aperiodic one.

    Attributes:
        s: eigenvalue; the motion is proportional to exp(s t) [1/s].
        shape: name of a dynamic velocity -> complex amplitude of the coordinate; the largest is 1
            [rad or m].
        share: name of a dynamic velocity -> share of the kinetic energy.
        gain: name of a driven velocity -> growth of the largest coordinate in one period while the
            driven one oscillates at the mode's frequency with amplitude 1 [per rad or m]; for an
            aperiodic mode, in one second of a steady displacement by 1.
        excitable: whether any input excites the mode.
    """

    s: complex
    shape: dict[str, complex]
    share: dict[str, float]
    gain: dict[str, float]
    excitable: bool

    @property
    def swings(self) -> bool:
        """Whether the mode oscillates."""
        return self.s.imag > 0.0

    @property
    def frequency(self) -> float:
        """Natural frequency |s| / (2 pi) [Hz]; 0 of an aperiodic mode."""
        return abs(self.s) / (2.0 * np.pi) if self.swings else 0.0

    @property
    def damping(self) -> float:
        """Damping ratio -Re(s) / |s|: 0 is undamped, 1 aperiodic."""
        return (0.0 - self.s.real) / abs(self.s) if self.s else 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Modes(ShortRepr):
    """The modes of a puppet at rest: oscillations from the slowest on, then aperiodic modes.

    ``print(modes)`` writes a table.

    Attributes:
        x: the state of rest.
        rows: names of the taut strings and limits.
        contacts: the points that carry; they stick, or slide without friction.
        modes: all modes. An oscillation stands for two eigenvalues, s and its conjugate; so does
            a coordinate with neither stiffness nor damping.
    """

    x: State
    rows: tuple[str, ...]
    contacts: tuple[HeldPoint, ...]
    modes: tuple[Mode, ...]

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, k: int) -> Mode:
        return self.modes[k]

    @property
    def swinging(self) -> tuple[Mode, ...]:
        """The modes that oscillate."""
        return tuple(mode for mode in self.modes if mode.swings)

    def __str__(self) -> str:
        moving = ["moves (share of energy)", *(_listed(m.share, "{:.0%}") for m in self.swinging)]
        excitations = ["excited by (gain per period)"]
        excitations += [
            _listed(m.gain, "{:.2g}") if m.excitable else "nothing" for m in self.swinging
        ]
        numbers = [f"{'Hz':>7}  {'damping':>7}"]
        numbers += [f"{m.frequency:7.3f}  {m.damping:7.4f}" for m in self.swinging]
        width = max(map(len, moving))
        columns = zip(numbers, moving, excitations, strict=True)
        lines = [f"{number}  {move:<{width}}  {gain}" for number, move, gain in columns]
        aperiodic = [mode for mode in self.modes if not mode.swings]
        neutral = sum(mode.s == 0 for mode in aperiodic)
        growing = sum(mode.s.real > 0 for mode in aperiodic)
        decaying = len(aperiodic) - neutral - growing
        counts = ((decaying, "decaying"), (neutral, "neutral"), (growing, "growing"))
        texts = [f"{count} {kind}" for count, kind in counts if count]
        return "\n".join(lines + (["aperiodic: " + ", ".join(texts)] if texts else []))


def _listed(values: dict[str, float], number_format: str) -> str:
    """The three largest entries, without those that are negligible."""
    largest_three = sorted(values.items(), key=lambda item: -item[1])[:3]
    smallest = TOLERANCES.listed * largest_three[0][1] if largest_three else 0.0
    return ", ".join(f"{n} {number_format.format(x)}" for n, x in largest_three if x > smallest)


def modes(marionette: CompiledPuppet, x: State) -> Modes:
    """The modes of a puppet at rest; see :meth:`Marionette.modes`."""
    motion = motion_at(marionette, x)
    speeds = np.concatenate([x.v_D, x.v_K])
    rest_rates = (
        speeds if _balanced(marionette, x, motion.acc_D) else np.append(motion.acc_D, speeds)
    )
    largest = np.max(np.abs(rest_rates), initial=0.0)
    if not largest <= TOLERANCES.max_rest_motion:
        raise StateError(
            f"the puppet does not rest there: a velocity or acceleration is {largest:.3g}; modes "
            "are those of a state that marionette.rest(...) gives"
        )
    if motion.contacts.edges:
        raise StateError(f"small motions there are not linear: {'; '.join(motion.contacts.edges)}")
    small_motions = SmallMotions.about_rest(marionette, x, motion)
    N, K, D = small_motions.N, small_motions.K, small_motions.D
    symmetric = all(
        np.linalg.norm(m - m.T) <= TOLERANCES.asymmetry * np.linalg.norm(m) for m in (K, D)
    )
    if symmetric:
        K, D = 0.5 * (K + K.T), 0.5 * (D + D.T)
    reduced = _Reduced(K, D, small_motions.forcing, symmetric)
    groups = reduced.groups()
    all_gains = [reduced.gains(s, phi, N) for s, phi in groups]
    oscillation_gains = (gains for (s, _), gains in zip(groups, all_gains, strict=True) if s)
    largest_gain = max((np.max(gains, initial=0.0) for gains in oscillation_gains), default=0.0)
    modes_at_rest = [
        _mode(marionette, s, shape, small_motions.M, gain, largest_gain)
        for (s, phi), gains in zip(groups, all_gains, strict=True)
        for shape, gain in zip((N @ phi).T, gains, strict=True)
    ]
    names = tuple(marionette.tree.row_names[i] for i in small_motions.held)
    return Modes(x, names, motion.contacts.points, tuple(modes_at_rest))


def _balanced(marionette: CompiledPuppet, x: State, acc_D: Array) -> bool:
    """Whether the forces on a puppet on chains balance, by the test of :meth:`Marionette.rest`.

    Accelerations are no test: rounding in stiff springs alone accelerates light pieces too much.
    """
    if not marionette.tree.chains:
        return False
    M = marionette.interpreted("mass_matrix", x).M
    force = np.sqrt(max(float(acc_D @ M @ acc_D), 0.0) * marionette.mass)
    return bool(force <= ACCEPTANCE.max_force_of_chains * marionette.weight)


def _mode(
    marionette: CompiledPuppet, s: complex, shape: Array, M: Array, gain: Array, largest_gain: float
) -> Mode:
    table = marionette.coordinates
    energy = np.real(np.conj(shape) * (M @ shape))
    relative = shape / shape[np.argmax(np.abs(shape))]
    return Mode(
        s,
        dict(zip(table.v_D, relative.tolist(), strict=True)),
        dict(zip(table.v_D, (energy / np.sum(energy)).tolist(), strict=True)),
        dict(zip(table.v_K, gain.tolist(), strict=True)),
        bool(np.max(gain, initial=0.0) > TOLERANCES.excitable * largest_gain),
    )


@dataclass(frozen=True, eq=False)
class _Reduced:
    """etaddot + D etadot + K eta = F_q dq_K + F_v dv_K + F_a dacc_K.

    Attributes:
        K, D: (m, m) stiffness and damping.
        forcing: F_q, F_v and F_a, (m, n_vK) each.
        symmetric: whether K and D are symmetric.
    """

    K: Array
    D: Array
    forcing: tuple[Array, Array, Array]
    symmetric: bool

    def groups(self) -> list[tuple[complex, Array]]:
        """Pairs (s, phi (m, k)) of the modes with equal s: oscillations first, from slow to fast.

        Within a group the modes are ordered by their excitation by the inputs, which separates
        those that the inputs cannot excite.
        """
        m = len(self.K)
        flow = np.block([[np.zeros((m, m)), np.eye(m)], [-self.K, -self.D]])
        values, vectors = np.linalg.eig(flow)
        values = np.asarray(values, dtype=complex)
        largest = np.max(np.abs(values), initial=0.0)
        values[np.abs(values) < TOLERANCES.zero * largest] = 0.0
        is_undamped = np.abs(values.real) < TOLERANCES.undamped * np.abs(values)
        values[is_undamped] = 1j * values.imag[is_undamped]
        half_of_pairs = np.flatnonzero(values.imag >= 0.0)
        order = sorted(
            half_of_pairs, key=lambda i: (values[i].imag == 0.0, abs(values[i]), values[i].real)
        )
        grouped: list[tuple[complex, Array]] = []
        for i in order:
            s, phi = complex(values[i]), vectors[:m, i, None]
            if grouped and abs(s - grouped[-1][0]) <= TOLERANCES.equal * abs(s):
                s, previous_phi = grouped.pop()
                phi = np.concatenate([previous_phi, phi], axis=1)
            grouped.append((s, phi))
        return [(s, self._ordered_basis(s, phi)) for s, phi in grouped]

    def _ordered_basis(self, s: complex, phi: Array) -> Array:
        """Basis of the modes of one s, real if possible, the most excited first."""
        if phi.shape[1] == 1:
            return phi
        u, size, _ = np.linalg.svd(np.concatenate([phi.real, phi.imag], axis=1))
        real_basis = u[:, : np.sum(size > TOLERANCES.real_basis * size[0])]
        is_real = s == 0.0 or real_basis.shape[1] == phi.shape[1]
        phi = real_basis if is_real else np.linalg.qr(phi)[0]
        b = self._input_matrix(s, phi)
        _, rotation_ = np.linalg.eigh(np.real(b @ b.conj().T))
        return phi @ rotation_[:, ::-1]

    def _input_matrix(self, s: complex, phi: Array) -> Array:
        """Matrix b (k, n_vK) in zdot = s z + b dq_K for eta = phi z; for s = 0 the force on z.

        psi^T (2 s + D) phi b = psi^T (F_q + s F_v + s^2 F_a)
        """
        F_q, F_v, F_a = self.forcing
        psi = self._left_vectors(s, phi)
        force = psi.T @ (F_q + s * F_v + s * s * F_a)
        if s == 0.0:
            return force if self.symmetric else np.linalg.pinv(psi.T @ phi) @ force
        inertia = psi.T @ (2.0 * s * phi + self.D @ phi)
        return np.linalg.pinv(inertia) @ force

    def _left_vectors(self, s: complex, phi: Array) -> Array:
        """Matrix psi (m, k) of one s; phi if K and D are symmetric."""
        if self.symmetric:
            return phi
        _, _, rows = np.linalg.svd((s * s * np.eye(len(phi)) + s * self.D + self.K).T)
        return rows[len(rows) - phi.shape[1] :].conj().T

    def gains(self, s: complex, phi: Array, N: Array) -> Array:
        """Growth (k, n_vK) of each mode's largest coordinate; see :class:`Mode`."""
        size = np.max(np.abs(N @ phi), axis=0, initial=0.0)
        period = 2.0 * np.pi / s.imag if s.imag > 0.0 else 1.0
        return np.abs(self._input_matrix(s, phi)) * size[:, None] * period
