"""Steadying: common shifts of a player's hands that damp swing beyond that of the play.

A player is modelled as a pendulum whose pivot its hands shift: with the deviation e of its centre
of mass from that in the play, and the shift s of all its hands, both horizontal,

    e'' = -w^2 (e - s) - 2 D w e',   s'' = -k (e, e', s, s'),   w^2 = g/height,

with g the vertical part of the stage's own gravity, and k the gains of the linear-quadratic
regulator that minimises the integral of e^2 + (e'/w)^2 plus weights times s^2 + (s'/w)^2 and
(s''/w^2)^2.

D is the damping ratio of the pendulum, and a prime a derivative by time. In names, D stands for
dynamic coordinates, which move by the equations of motion, and K for driven ones: ends and lengths
of strings, driven joints. A link is a body on its joint. A tick is the interval at which a
performance advances.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from fantoccini.base import Array, VecK, riccati
from fantoccini.model.tree import link_inertia
from fantoccini.motion import State
from fantoccini.theatre.perform.performance import Performance
from fantoccini.theatre.perform.score_voice import ScoreVoice
from fantoccini.theatre.plays import Play, combine_runs


class _Weights(NamedTuple):
    """Weights of the regulator, relative to that of the deviation, and its bounds."""

    shift: float = 0.1
    acceleration: float = 0.1  # Of s''/w^2
    damping: float = 0.02
    """D: damping of a puppet's swing, which decays slowly."""
    acceleration_share: float = 0.25
    """Share of the bound of acceleration for the shift."""
    max_deviation: float = 0.05
    """Bound of the deviation [m]: a larger one is a hand's pull, not swing."""
    max_deviation_rate: float = 0.5
    """Bound of the deviation's rate [m/s]."""
    doublings: int = 16
    """Number of doublings of the regulator's horizon: 2^16 ticks."""
    rate: float = 120.0
    """Sampling rate of the play's run [1/s]."""


_WEIGHTS = _Weights()
_MIN_HEIGHT = 0.05
"""Least height of hands above the centre of mass of a pendulum [m]."""


class Steadying:
    """Shifts of the hands of players against their swing.

    Attributes:
        frequencies: (n_players,) natural frequencies w of the pendulums [rad/s]; 0 for players
            that are not steadied.

    Args:
        play: play whose simulated run determines the wanted motion.
        performance: performance whose hands are shifted.
    """

    def __init__(self, play: Play, performance: Performance):
        self._play, self._performance = play, performance
        self._bodies = PlayerBodies(play)
        run = combine_runs(play.cast, play.runs())
        self._sample_times = np.arange(run.t[0], run.t[-1], 1.0 / _WEIGHTS.rate)
        samples = run.resample(self._sample_times)
        self._wanted_places = self._bodies.mass_centres(samples.q_D, samples.q_K)[..., :2]
        tick = performance.tick
        marionette = play.marionette
        gravity = -marionette.number(marionette.tree.gravity[2])
        self.frequencies = np.array(
            [natural_frequency(height, gravity) for height in self._heights(performance)]
        )
        self._gains = np.array([_gains(w, tick) for w in self.frequencies])
        self._max_acceleration = _WEIGHTS.acceleration_share * play.cast.file.stage.acceleration
        n_players = len(self.frequencies)
        self._shift, self._shift_rate = np.zeros((n_players, 2)), np.zeros((n_players, 2))
        self._last_deviation: Array | None = None
        self._last_time = 0.0

    def end_shift(self, who: str) -> None:
        """Ends the shift of a player whose hands stop, at their shifted places."""
        i = self._bodies.names.index(who)
        self._shift[i] = self._shift_rate[i] = 0.0

    def update(self, voice: ScoreVoice, x: State, taken: frozenset[str]) -> None:
        """Updates the shifts for the next tick, from a state of the stage.

        Args:
            voice: score that is played.
            x: state.
            taken: players that a person moves instead of the play.
        """
        tick, t = self._performance.tick, voice.t
        wanted_places = np.array(
            [
                [np.interp(t, self._sample_times, path) for path in path_of_player.T]
                for path_of_player in self._wanted_places.swapaxes(0, 1)
            ]
        )
        deviation = self._bodies.mass_centres(x.q_D, x.q_K)[..., :2] - wanted_places
        has_jumped = self._last_deviation is None or abs(t - self._last_time) > 1.5 * tick
        deviation_rate = (
            np.zeros_like(deviation) if has_jumped else (deviation - self._last_deviation) / tick
        )
        self._last_deviation, self._last_time = deviation, t
        is_following = not voice.is_leading and (
            voice.running or voice.conductor.waiting is not None
        )
        is_steadied = np.array(
            [[is_following and name not in taken] for name in self._bodies.names]
        )
        deviation = _bounded(deviation, _WEIGHTS.max_deviation) * is_steadied
        deviation_rate = _bounded(deviation_rate, _WEIGHTS.max_deviation_rate) * is_steadied
        gains = self._gains[:, :, None]
        feedback_of_shift = gains[:, 2] * self._shift + gains[:, 3] * self._shift_rate
        acceleration = _bounded(
            -(gains[:, 0] * deviation + gains[:, 1] * deviation_rate + feedback_of_shift),
            self._max_acceleration,
        )
        self._shift += tick * self._shift_rate + 0.5 * tick**2 * acceleration
        self._shift_rate += tick * acceleration
        voice.shift = (
            self._bodies.hand_motion(self._shift),
            self._bodies.hand_motion(self._shift_rate),
        )

    def _heights(self, performance: Performance) -> list[float]:
        """Heights of the hands of all players above their centres of mass [m]."""
        x = self._play.x0
        mass_centres = self._bodies.mass_centres(x.q_D, x.q_K)
        heights = []
        for name, mass_centre in zip(self._bodies.names, mass_centres, strict=True):
            prefix = self._play.cast.prefix(name)
            hands = [
                performance.place(handle.name)[0][2]
                for handle in performance.handles
                if handle.name.startswith(prefix)
            ]
            heights.append(float(np.mean(hands) - mass_centre[2]) if hands else 0.0)
        return heights


class PlayerBodies:
    """Bodies and hands of every player."""

    def __init__(self, play: Play):
        self._marionette, cast = play.marionette, play.cast
        marionette, names = self._marionette, self._marionette.coordinates.v_K
        self.names = list(cast.players)
        inertia = [link_inertia(link, marionette.number)[:2] for link in marionette.tree.links]
        self._local_centres = np.array([np.asarray(com, dtype=float) for _, com in inertia])
        masses = [
            [
                mass * (cast.owner(link.name) == who)
                for link, (mass, _) in zip(marionette.tree.links, inertia, strict=True)
            ]
            for who in self.names
        ]
        masses_of_players = np.array(masses, dtype=float)
        self._mass_shares = masses_of_players / np.maximum(
            masses_of_players.sum(axis=1, keepdims=True), 1e-12
        )
        self._channels = np.array(
            [
                [
                    [name.startswith(cast.prefix(who)) and name.endswith(axis) for name in names]
                    for axis in (".x", ".y")
                ]
                for who in self.names
            ],
            dtype=float,
        )

    def mass_centres(self, q_D: Array, q_K: Array) -> Array:
        """(..., n_players, 3) centres of mass [m]."""
        poses = self._marionette.poses(q_D, q_K)
        places = poses[..., 3] + np.einsum("...ij,...j->...i", poses[..., :3], self._local_centres)
        return np.einsum("pn,...nj->...pj", self._mass_shares, places)

    def hand_motion(self, shifts: Array) -> VecK:
        """(n_vK,) motion of all hands from shifts (n_players, 2) of the players."""
        return np.einsum("pa,pan->n", shifts, self._channels)


def natural_frequency(height: float, gravity: float) -> float:
    """w = sqrt(g/height) [rad/s]; 0 if the hands are too low, or gravity does not pull down.

    Args:
        height: height of the hands above the centre of mass [m].
        gravity: downward acceleration g [m/s^2].
    """
    return float(np.sqrt(gravity / height)) if height >= _MIN_HEIGHT and gravity > 0.0 else 0.0


def _gains(w: float, tick: float) -> Array:
    """(4,) gains of (e, e', s, s') for a pendulum's natural frequency [rad/s]; 0 for 0."""
    if w == 0.0:
        return np.zeros(4)
    w_squared = w * w
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = A[3, 4] = 1.0
    A[1, :3] = -w_squared, -2.0 * _WEIGHTS.damping * w, w_squared
    transition = expm(A * tick)
    A, B = transition[:4, :4], transition[:4, 4:]
    Q = np.diag([1.0, 1.0 / w_squared, _WEIGHTS.shift, _WEIGHTS.shift / w_squared])
    R = np.array([[_WEIGHTS.acceleration / w_squared**2]])
    return riccati.stationary_gain(A, B, Q, R, _WEIGHTS.doublings)[0]


def _bounded(values: Array, max_length: float) -> Array:
    """(n, 2) vectors with lengths bounded by ``max_length``."""
    lengths = np.linalg.norm(values, axis=-1, keepdims=True)
    return np.asarray(values * np.minimum(1.0, max_length / np.maximum(lengths, max_length)))
