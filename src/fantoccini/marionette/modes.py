"""Modes: how a hanging puppet swings, and which hand makes it swing.

Near rest every small motion on the taut strings is dq_D = N eta + Y dq_K, with A_D N = 0,
N^T M N = 1 and Y the move that follows the hands:

    etaddot + D etadot + K eta = -N^T (r_q Y + r_qK) dq_K - N^T (r_v Y + r_vK) dv_K
                                 - N^T M_DK dacc_K
    D = N^T r_v N,   K = N^T r_q N,   Y = -M^-1 A_D^T (A_D M^-1 A_D^T)^-1 A_K

r_q is the derivative of gravity, springs and A_D^T tension: what the tensions stiffen is in it. A
mode is eta = phi exp(s t) with (s^2 + s D + K) phi = 0. What drives make of computed torques is no
potential's: K and D are not symmetric then, and forces act through psi, psi^T (s^2 + s D + K) = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import StateError
from fantoccini.marionette.analysis import mass_matrix
from fantoccini.marionette.dynamics import forward_dynamics
from fantoccini.marionette.instant import instant_at
from fantoccini.marionette.linearisation import Answer, slopes_at
from fantoccini.marionette.model import Model
from fantoccini.motion import State

_PULLS = 1e-9
"""Tension of a row that holds, over the puppet's weight."""
_RESTS = 1e-6
"""Largest speed and acceleration of a puppet at rest [rad or m per s or s^2]."""
_NONE = 1e-6
"""|s| below which a mode stands still, relative to the fastest: the root of rounding."""
_LOPSIDED = 1e-7
"""Asymmetry of K and D that counts as what is left of forces at rest, and rounding."""
_SAME = 1e-6
"""Relative difference of s of modes that count as one."""
_DEAF = 1e-8
"""Gain below which inputs do not excite a mode, relative to the largest of all modes."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One way to swing, or to creep back.

    Attributes:
        s: eigenvalue; the motion goes with exp(s t) [1/s].
        shape: name of a dynamic velocity -> how far the coordinate goes, complex: its phase is that
            of the argument. The largest is 1 [rad or m].
        share: name of a dynamic velocity -> its share in the kinetic energy.
        gain: name of a driven velocity -> by how much the largest coordinate grows in one swing
            while the driven one goes to and fro at the mode's frequency with amplitude 1 [per rad
            or m]. Of a mode that does not swing: the same in one second of a steady move by 1.
        excitable: whether any input moves it.
    """

    s: complex
    shape: dict[str, complex]
    share: dict[str, float]
    gain: dict[str, float]
    excitable: bool

    @property
    def swings(self) -> bool:
        """Whether it goes to and fro."""
        return self.s.imag > 0.0

    @property
    def frequency(self) -> float:
        """Natural frequency |s| / (2 pi) [Hz]; 0 of a mode that does not swing."""
        return abs(self.s) / (2.0 * np.pi) if self.swings else 0.0

    @property
    def damping(self) -> float:
        """Damping ratio -Re(s) / |s|: 0 goes on for ever, 1 does not swing any more."""
        return (0.0 - self.s.real) / abs(self.s) if self.s else 0.0


@dataclass(frozen=True, eq=False)
class Modes:
    """The modes of a puppet at rest, the slowest swing first, then what does not swing.

    ``print(modes)`` writes a table.

    Attributes:
        x: the state of rest.
        rows: names of the strings and limits that hold.
        modes: all of them. A swing stands for two eigenvalues, s and its conjugate; so does a
            coordinate that nothing drives back and nothing damps.
    """

    x: State
    rows: tuple[str, ...]
    modes: tuple[Mode, ...]

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, k: int) -> Mode:
        return self.modes[k]

    @property
    def swinging(self) -> tuple[Mode, ...]:
        """The modes that swing."""
        return tuple(mode for mode in self.modes if mode.swings)

    def __str__(self) -> str:
        moves = ["moves (share of energy)", *(_listed(m.share, "{:.0%}") for m in self.swinging)]
        by = ["excited by (gain a swing)"]
        by += [_listed(m.gain, "{:.2g}") if m.excitable else "nothing" for m in self.swinging]
        numbers = [f"{'Hz':>7}  {'damping':>7}"]
        numbers += [f"{m.frequency:7.3f}  {m.damping:7.4f}" for m in self.swinging]
        width = max(map(len, moves))
        columns = zip(numbers, moves, by, strict=True)
        lines = [f"{number}  {move:<{width}}  {gain}" for number, move, gain in columns]
        others = [mode for mode in self.modes if not mode.swings]
        still = sum(mode.s == 0 for mode in others)
        growing = sum(mode.s.real > 0 for mode in others)
        creeping = len(others) - still - growing
        ends = [(creeping, "creep back"), (still, "stand anywhere"), (growing, "fall over")]
        texts = [f"{n} {what}" for n, what in ends if n]
        return "\n".join(lines + (["without swinging: " + ", ".join(texts)] if texts else []))


def _listed(values: dict[str, float], shown: str) -> str:
    """The three largest entries, without what is next to nothing beside the first."""
    first = sorted(values.items(), key=lambda item: -item[1])[:3]
    return ", ".join(f"{n} {shown.format(x)}" for n, x in first if x > 0.02 * first[0][1])


def modes(model: Model, x: State) -> Modes:
    """The modes of a puppet at rest.

    Args:
        model: the puppet.
        x: a state of rest, as :meth:`Marionette.rest` gives it.

    Raises:
        StateError: the puppet does not rest there.
    """
    acc_D, tension = forward_dynamics(model, x)
    largest = np.max(np.abs(np.concatenate([acc_D, x.v_D, x.v_K])), initial=0.0)
    if not largest <= _RESTS:
        raise StateError(
            f"the puppet does not rest there: a velocity or acceleration is {largest:.3g}; modes "
            "are those of a state that marionette.rest(...) gives"
        )
    held = np.flatnonzero(model.two_sided | (tension > _PULLS * model.weight))
    instant = instant_at(model, x)
    found = slopes_at(model, x, np.zeros_like(acc_D), np.zeros_like(x.v_K), tension)
    u, size, _ = np.linalg.svd(instant.W[:, held], full_matrices=True)
    rank = int(np.sum(size > 1e-9 * np.max(size, initial=0.0)))
    N = instant.back(u[:, rank:].T).T
    still = np.zeros((len(acc_D), len(x.v_K)))
    Y, _ = Answer(instant, held).to(still, found["A_K"][held])
    K, D = (N.T @ found[name] @ N for name in ("r_q", "r_v"))
    forcing = tuple(
        -N.T @ part
        for part in (
            found["r_q"] @ Y + found["r_qK"], found["r_v"] @ Y + found["r_vK"], found["M_DK"]
        )
    )  # fmt: skip
    symmetric = all(
        np.linalg.norm(m - m.T) <= _LOPSIDED * np.linalg.norm(m) for m in (K, D)
    )
    if symmetric:
        K, D = 0.5 * (K + K.T), 0.5 * (D + D.T)
    reduced = _Reduced(K, D, forcing, symmetric)
    groups = reduced.groups()
    all_gains = [reduced.gains(s, phi, N) for s, phi in groups]
    swinging = (gains for (s, _), gains in zip(groups, all_gains, strict=True) if s)
    loudest = max((np.max(gains, initial=0.0) for gains in swinging), default=0.0)
    M = mass_matrix(model, x)
    made = [
        _mode(model, s, shape, M, gain, loudest)
        for (s, phi), gains in zip(groups, all_gains, strict=True)
        for shape, gain in zip((N @ phi).T, gains, strict=True)
    ]
    names = tuple(model.tree.row_names[i] for i in held)
    return Modes(x, names, tuple(made))


def _mode(
    model: Model, s: complex, shape: Array, M: Array, gain: Array, loudest: float
) -> Mode:
    table = model.coordinates
    energy = np.real(np.conj(shape) * (M @ shape))
    relative = shape / shape[np.argmax(np.abs(shape))]
    return Mode(
        s,
        dict(zip(table.v_D, relative.tolist(), strict=True)),
        dict(zip(table.v_D, (energy / np.sum(energy)).tolist(), strict=True)),
        dict(zip(table.v_K, gain.tolist(), strict=True)),
        bool(np.max(gain, initial=0.0) > _DEAF * loudest),
    )


@dataclass(frozen=True, eq=False)
class _Reduced:
    """etaddot + D etadot + K eta = F_q dq_K + F_v dv_K + F_a dacc_K.

    Attributes:
        K, D: (m, m).
        forcing: F_q, F_v and F_a, (m, n_vK) each.
        symmetric: whether K and D are.
    """

    K: Array
    D: Array
    forcing: tuple[Array, Array, Array]
    symmetric: bool

    def groups(self) -> list[tuple[complex, Array]]:
        """(s, phi (m, k)) of modes with one s, those that swing first, from slow to fast.

        Within a group the modes are ordered by how strongly the inputs excite them, so that what
        they cannot reach stands by itself.
        """
        m = len(self.K)
        flow = np.block([[np.zeros((m, m)), np.eye(m)], [-self.K, -self.D]])
        values, vectors = np.linalg.eig(flow)
        values = np.asarray(values, dtype=complex)
        top = np.max(np.abs(values), initial=0.0)
        values[np.abs(values) < _NONE * top] = 0.0
        undamped = np.abs(values.real) < 1e-12 * np.abs(values)
        values[undamped] = 1j * values.imag[undamped]
        one_of_two = np.flatnonzero(values.imag >= 0.0)
        order = sorted(
            one_of_two, key=lambda i: (values[i].imag == 0.0, abs(values[i]), values[i].real)
        )
        found: list[tuple[complex, Array]] = []
        for i in order:
            s, phi = complex(values[i]), vectors[:m, i, None]
            if found and abs(s - found[-1][0]) <= _SAME * abs(s):
                s, before = found.pop()
                phi = np.concatenate([before, phi], axis=1)
            found.append((s, phi))
        return [(s, self._turned(s, phi)) for s, phi in found]

    def _turned(self, s: complex, phi: Array) -> Array:
        """A basis of the modes of one s, real where there is one, the most excited first."""
        if phi.shape[1] == 1:
            return phi
        u, size, _ = np.linalg.svd(np.concatenate([phi.real, phi.imag], axis=1))
        real = u[:, : np.sum(size > 1e-6 * size[0])]
        is_real = s == 0.0 or real.shape[1] == phi.shape[1]
        phi = real if is_real else np.linalg.qr(phi)[0]
        b = self._input(s, phi)
        _, turn = np.linalg.eigh(np.real(b @ b.conj().T))
        return phi @ turn[:, ::-1]

    def _input(self, s: complex, phi: Array) -> Array:
        """(k, n_vK) b of zdot = s z + b dq_K for eta = phi z; of s = 0 the force on z.

        psi^T (2 s + D) phi b = psi^T (F_q + s F_v + s^2 F_a)
        """
        F_q, F_v, F_a = self.forcing
        psi = self._left(s, phi)
        force = psi.T @ (F_q + s * F_v + s * s * F_a)
        if s == 0.0:
            return force if self.symmetric else np.linalg.pinv(psi.T @ phi) @ force
        inertia = psi.T @ (2.0 * s * phi + self.D @ phi)
        return np.linalg.pinv(inertia) @ force

    def _left(self, s: complex, phi: Array) -> Array:
        """psi (m, k) of one s; where K and D are symmetric it is phi."""
        if self.symmetric:
            return phi
        _, _, rows = np.linalg.svd((s * s * np.eye(len(phi)) + s * self.D + self.K).T)
        return rows[len(rows) - phi.shape[1] :].conj().T

    def gains(self, s: complex, phi: Array, N: Array) -> Array:
        """(k, n_vK) growth of each mode's largest coordinate; see :class:`Mode`."""
        size = np.max(np.abs(N @ phi), axis=0, initial=0.0)
        swing = 2.0 * np.pi / s.imag if s.imag > 0.0 else 1.0
        return np.abs(self._input(s, phi)) * size[:, None] * swing
