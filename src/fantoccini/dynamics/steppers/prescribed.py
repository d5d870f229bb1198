"""Overlaps of solids whose relative motion is prescribed by the inputs.

Both solids follow the inputs, so no force acts between them; the overlap can only be measured.

The gap of two solids is their distance, negative in an overlap. q_K are the driven coordinates,
given by the inputs, and q_D the dynamic ones. Breaks are the times at which the pieces of an input
meet. A link is a body on its joint.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fantoccini.base import Array, MaskRows, Times
from fantoccini.dynamics.compiled import CompiledPuppet
from fantoccini.kernel.contract import EVENT, EventCode, SolidKind
from fantoccini.kernel.runtime import Contacts
from fantoccini.motion import pair_name

Motion = Callable[[Times], Array]
"""Callback: times (n,) [s] -> q_K (n, n_qK)."""


@dataclass(frozen=True)
class PrescribedTolerances:
    """Tolerances of overlaps that the inputs prescribe."""

    touching_overlap: float = 1e-6  # Overlap above which solids count as touching [m]
    max_overlap: float = 1e-3
    """Largest overlap of a sound run [m], as at the start of a run."""
    max_travel: float = 1e-3
    """Largest relative travel of two solids between measurements of a gap that may close [m]."""
    max_turn: float = 1.0  # Largest change of a driven coordinate between measurements [rad or m]
    min_samples_per_piece: int = 8  # Minimum number of measurements in each piece of the inputs
    max_samples: int = 200_000  # Maximum number of measurements of a motion
    n_bisections: int = 50  # Number of bisections of the time of a touch


TOLERANCES = PrescribedTolerances()


@dataclass(frozen=True)
class Overlap:
    """Overlap of two parts over an interval of time, prescribed by the inputs.

    Attributes:
        names: names of the two parts.
        begin: time of the touch, or of the start [s].
        end: time at which they separate; inf if they overlap until the end [s].
        depth: largest overlap [m].
        speed: closing speed at ``begin`` [m/s].
    """

    names: tuple[str, str]
    begin: float
    end: float
    depth: float
    speed: float

    def __str__(self) -> str:
        when = f"from t = {self.begin:.6g} s on"
        return f"{pair_name(self.names)} overlap by {self.depth:.3g} m {when}"


def measuring_times(breaks: Times, t: float, t_end: float) -> Times:
    """Times of the first measurements of a motion with these breaks, from t to t_end [s]."""
    inner_breaks = breaks[(breaks > t) & (breaks < t_end)]
    piece_ends = np.concatenate([[t], inner_breaks, [t_end]])
    share = np.linspace(0.0, 1.0, TOLERANCES.min_samples_per_piece, endpoint=False)
    return np.append((piece_ends[:-1, None] + np.diff(piece_ends)[:, None] * share).ravel(), t_end)


def prescribed_overlaps(
    marionette: CompiledPuppet, motion: Motion, t: Times
) -> tuple[Overlap, ...]:
    """Overlaps of the pairs with prescribed relative motion, in order of their beginning.

    A gap is measured again wherever the travel of the two solids since the last measurement may
    have closed it.

    Args:
        marionette: the puppet.
        motion: motion of the driven coordinates.
        t: (n,) increasing times of the first measurements, including both ends [s].
    """
    contacts = marionette.prescribed
    if contacts is None:
        return ()
    gaps = _Gaps(marionette, contacts, motion)
    t, gap = gaps.refined(np.unique(t))
    results: list[Overlap] = []
    for k, names in enumerate(gaps.names):
        is_overlapping = gap[:, k] < -TOLERANCES.touching_overlap
        edges = np.flatnonzero(np.diff(is_overlapping))
        begin_samples = [-1] * bool(is_overlapping[0]) + [
            int(i) for i in edges if not is_overlapping[i]
        ]
        end_samples = [int(i) for i in edges if is_overlapping[i]]
        for n, i in enumerate(begin_samples):
            begin, speed = (t[0], 0.0) if i < 0 else gaps.crossing(k, t[i], t[i + 1])
            last_sample = end_samples[n] if n < len(end_samples) else len(t) - 1
            end = (
                gaps.crossing(k, t[last_sample], t[last_sample + 1])[0]
                if n < len(end_samples)
                else np.inf
            )
            depth = -float(np.min(gap[i + 1 : last_sample + 1, k]))
            results.append(Overlap(names, float(begin), float(end), depth, speed))
    return tuple(sorted(results, key=lambda overlap: overlap.begin))


def deepest(overlaps: tuple[Overlap, ...]) -> float:
    """The largest depth beyond the tolerance [m]; 0 if all are within it."""
    return max((o.depth for o in overlaps if o.depth > TOLERANCES.max_overlap), default=0.0)


def overlap_events(marionette: CompiledPuppet, overlaps: tuple[Overlap, ...], t: float) -> Array:
    """Events (n, 5) of touches after a time [s], and of lifts, laid out as the events of a run."""
    if marionette.prescribed is None or marionette.contacts is None:
        return np.zeros((0, len(EVENT)))
    first = len(marionette.tree.attributable) + len(marionette.contacts.names)
    rows = []
    for overlap in overlaps:
        row = first + marionette.prescribed.names.index(overlap.names)
        if overlap.begin > t:
            rows.append((overlap.begin, EventCode.TOUCH, row, 0.0, overlap.speed))
        if np.isfinite(overlap.end):
            rows.append((overlap.end, EventCode.LIFT, row, 0.0, 0.0))
    return np.array(rows, dtype=float).reshape(-1, len(EVENT))


class _Gaps:
    """Gaps of the pairs over a motion; parts of one body count as one."""

    def __init__(self, marionette: CompiledPuppet, contacts: Contacts, motion: Motion):
        self._marionette, self._contacts, self._motion = marionette, contacts, motion
        self.names = tuple(dict.fromkeys(contacts.names))
        self._pair_indices = [self.names.index(names) for names in contacts.names]
        self._links = contacts.solids["link"][contacts.pairs]
        n_links = len(marionette.tree.links)
        self._reaches = np.zeros(n_links + 1)  # Last: standing solids, which do not travel
        for solid in contacts.solids:
            if solid["link"] >= 0:
                radius = _reaches(solid, contacts)
                self._reaches[solid["link"]] = max(self._reaches[solid["link"]], radius)

    def refined(self, t: Times) -> tuple[Times, Array]:
        """Times (n,) and gaps (n, pairs by name); infinite if a gap cannot close."""
        t, q_K = self._turning_little(t)
        while True:
            travelled = self._travel(q_K)
            margin = float(np.max(travelled, initial=0.0)) + TOLERANCES.max_overlap
            gap = self._gap(q_K, margin)
            gap_before, gap_after = gap[:-1], gap[1:]
            is_deep = np.maximum(gap_before, gap_after) < -TOLERANCES.max_overlap
            needs_refining = (
                (travelled > TOLERANCES.max_travel)
                & (gap_before + gap_after < travelled)
                & ~is_deep
            )
            refined = np.flatnonzero(np.any(needs_refining, axis=1))
            middle = 0.5 * (t[refined] + t[refined + 1])
            is_between = (middle > t[refined]) & (middle < t[refined + 1])
            refined, middle = refined[is_between], middle[is_between]
            if not len(refined):
                return t, gap
            if len(t) > TOLERANCES.max_samples:
                text = f"{', '.join(map(pair_name, self.names))}: gaps are measured at {len(t)} "
                text += "times of the inputs, which move too far between them to see every touch"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
                return t, gap
            q_K = np.insert(q_K, refined + 1, self._motion(middle), axis=0)
            t = np.insert(t, refined + 1, middle)

    def _turning_little(self, t: Times) -> tuple[Times, Array]:
        """Times (n,), at most 1 rad of joint rotation apart, and q_K at these.

        Without this limit a whole turn would be missed: the poses before and after it are equal.
        """
        q_K = self._motion(t)
        while len(t) <= TOLERANCES.max_samples:
            turns_too_far = (
                np.max(np.abs(np.diff(q_K, axis=0)), axis=1, initial=0.0) > TOLERANCES.max_turn
            )
            middle = 0.5 * (t[:-1] + t[1:])
            refined = np.flatnonzero(turns_too_far & (middle > t[:-1]) & (middle < t[1:]))
            if not len(refined):
                break
            q_K = np.insert(q_K, refined + 1, self._motion(middle[refined]), axis=0)
            t = np.insert(t, refined + 1, middle[refined])
        return t, q_K

    def crossing(self, k: int, t: float, t_end: float) -> tuple[float, float]:
        """Time at which a gap crosses the touching threshold [s], and its closing speed [m/s]."""
        bracket = np.array([t, t_end])
        margin = float(np.max(self._travel(self._motion(bracket)))) + 1.0

        def is_overlapping(times: Times) -> MaskRows:
            """Whether the pair overlaps: (n,) bool."""
            return self._gap(self._motion(times), margin)[:, k] < -TOLERANCES.touching_overlap

        starts_overlapping = is_overlapping(bracket[:1])[0]
        for _ in range(TOLERANCES.n_bisections):
            middle = 0.5 * (bracket[0] + bracket[1])
            if not bracket[0] < middle < bracket[1]:
                break
            bracket[0 if is_overlapping(np.array([middle]))[0] == starts_overlapping else 1] = (
                middle
            )
        crossing_time = 0.5 * (bracket[0] + bracket[1])
        step = 1e-6 * max(t_end - t, 1e-9)
        values = self._gap(
            self._motion(np.array([crossing_time - step, crossing_time + step])), margin
        )[:, k]
        speed = float((values[0] - values[1]) / (2.0 * step))
        return float(crossing_time), speed if np.isfinite(speed) else 0.0

    def _gap(self, q_K: Array, margin: float) -> Array:
        """Gaps (n, pairs by name) [m]."""
        marionette, n = self._marionette, len(q_K)
        q_D = np.tile(marionette.coordinates.start_D, (n, 1))
        results = marionette.library.gaps(self._contacts, q_D, q_K, marionette.p, margin)
        gaps = np.full((n, len(self.names)), np.inf)
        for k, pair_index in enumerate(self._pair_indices):
            gaps[:, pair_index] = np.minimum(gaps[:, pair_index], results[:, k])
        return gaps

    def _travel(self, q_K: Array) -> Array:
        """Upper bounds (n - 1, pairs by name) of the relative travel of two solids [m]."""
        marionette = self._marionette
        table = marionette.coordinates
        q_D = np.broadcast_to(table.start_D, (len(q_K), table.n_qD))
        poses = marionette.library.evaluate("poses", q_D=q_D, q_K=q_K, p=marionette.p).poses
        pose_changes = np.diff(poses, axis=0)
        rotation_travel = np.linalg.norm(pose_changes[:, :9], axis=1) * self._reaches[:-1]
        travelled = np.zeros((len(q_K) - 1, len(self._reaches)))
        travelled[:, :-1] = np.linalg.norm(pose_changes[:, 9:], axis=1) + rotation_travel
        travel = np.zeros((len(travelled), len(self.names)))
        for pair_index, links in zip(self._pair_indices, self._links, strict=True):
            travel[:, pair_index] = np.maximum(
                travel[:, pair_index], travelled[:, links].sum(axis=1)
            )
        return travel


def _reaches(solid: np.void, contacts: Contacts) -> float:
    """Largest distance of a solid from its link's origin [m]."""
    core_radius = max(float(np.linalg.norm(solid["a"])), float(np.linalg.norm(solid["b"])))
    hull_radius = contacts.hulls[solid["mesh"]].outer if solid["kind"] == SolidKind.HULL else 0.0
    return core_radius + float(solid["radius"]) + float(np.linalg.norm(solid["half"])) + hull_radius
