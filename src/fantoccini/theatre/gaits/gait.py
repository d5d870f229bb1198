"""Gait of a puppet on a floor: its parameters, and the motion of the string ends.

    z_body(t) = path(t),   z_leg(t) = path(tau_leg(t)),   L_leg(t) = L_stance - lift up(t)

z = x + i y is the place of string ends, path that of :class:`StepPath`, L_leg the length of a leg's
strings. While a leg stands, tau_leg is constant, and its strings' ends are at the place that the
body reaches in the middle of that time; while it swings, tau_leg advances with minimum jerk, and up
rises from 0 to 1 and returns. Lengths are shares of the legs' mean length; a step is half a cycle.

tau_leg is thus the time on the path at which the body is above the foot of this leg. The duty is
the share of a cycle in which a leg stands. A member is a puppet of a scene. The heading is the
angle of the forward direction, seen from above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from fantoccini.base import Times, check_positive, polynomial
from fantoccini.dynamics.marionette import Marionette
from fantoccini.motion import Input, State
from fantoccini.theatre.gaits.standing import standing_lengths
from fantoccini.theatre.gestures import (
    BodyParts,
    ComplexCurve,
    Curve,
    Ends,
    Gesture,
    Pattern,
    Step,
    StepPath,
    gait_phases,
    leg_length,
    leg_strings,
    legs,
    scale_curve,
)

PREPARATION_STEPS, CLOSING_STEPS = 2.5, 1.0  # steps
"""Time in which the puppet is lowered onto its feet, and time in which the last legs close up."""
HANGING_PREPARATION_STEPS, RAISING_STEPS = 4, 3  # steps
"""Time in which a puppet that hangs at both ends is lowered and sets down its feet, and time in
which it lifts them and is raised; whole numbers, as its path over the stage is planned in steps."""
_SETTING_TIME = 1.0
"""Time in which that puppet sets down its feet, or lifts them [steps]."""
_LOWERING_TIME = 2.0
"""Part of the preparation in which the puppet is lowered [steps]."""
_PIECES_PER_STEP = 24
"""Number of polynomial pieces of a step."""
_OVERSHOOT_PEAK = 0.6
"""Share of a swing at which the overshoot of a leg's strings is largest."""
_SWAY_SIGNS = {"left": 1.0, "middle": 0.0, "right": -1.0}
"""Direction of the sway towards a leg, to the left."""
_SHARE_BOUNDS = {"duty": (0.25, 0.9), "vertical_share": (0.0, 0.4), "peak_share": (0.1, 0.9)}
"""Bounds of shares of times."""


@dataclass(frozen=True)
class Gait:
    """Parameters of a gait.

    Attributes:
        pattern: order of the legs; see :func:`gait_phases`.
        step_time: duration of a step [s].
        stride: distance of the body in a step, relative to the legs' length.
        duty: share of a cycle in which a leg stands. In a trot or hop with a duty below 0.5 all
            feet are off the floor for a while, so that the strings can turn the puppet.
        lower: distance by which the puppet is lowered beyond the height at which its soles touch
            the floor.
        nod: additional length let out of the head's strings.
        slack: additional length let out of the strings of a standing leg.
        lift: length by which the strings of a swinging leg are wound in, from where they are taut.
        leg_lead: distance by which the ends of the legs' strings are carried forward.
        body_lead: distance by which the ends of all other strings are carried forward.
        overshoot: largest distance by which the string ends of a swinging leg lead its path.
        sway: distance of the other strings' ends towards the side of a lifted leg.
        vertical_share: share of a swing, at its beginning and again at its end, in which a leg
            moves only vertically.
        peak_share: share of a swing at which a leg is highest.

    Raises:
        ValueError: a time is not above 0, or a share is out of its bounds.
    """

    pattern: Pattern = "walk"
    step_time: float = 0.9
    stride: float = 0.1
    duty: float = 0.56
    lower: float = 0.025
    nod: float = 0.0
    slack: float = 0.015
    lift: float = 0.2
    leg_lead: float = -0.03
    body_lead: float = -0.1
    overshoot: float = 0.05
    sway: float = 0.0
    vertical_share: float = 0.12
    peak_share: float = 0.35

    def __post_init__(self) -> None:
        check_positive(step_time=self.step_time)
        for name, (low, high) in _SHARE_BOUNDS.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)!r}; allowed: {low} to {high}")

    @property
    def reach(self) -> float:
        """Largest distance between an end of a string and its place at rest relative to the body.

        It is relative to the legs' length.
        """
        leg_reach = abs(self.leg_lead) + abs(self.overshoot) + abs(self.stride)
        return max(abs(self.body_lead), leg_reach)

    def duration(self, steps: int) -> float:
        """Duration of a number of steps, with preparation and closing [s]."""
        return (PREPARATION_STEPS + steps + CLOSING_STEPS) * self.step_time

    def inputs(
        self,
        stage: Marionette,
        steps: int,
        x0: State | None = None,
        *,
        turn: float = 0.0,
        member: str = "",
    ) -> Input:
        """Motion of equal steps on a floor.

        Args:
            stage: puppet, or scene.
            steps: number of steps.
            x0: state at the start; ``stage.rest()`` by default.
            turn: total turn to the left [rad].
            member: the scene's member that walks; the only one by default.

        Raises:
            ValueError: there are no steps, or they are too long.
            StateError: the puppet cannot walk; the message has the reason.
        """
        if steps < 1:
            raise ValueError(f"steps is {steps!r}; at least 1 is needed")
        members = stage.puppet.members
        walker = member or (members[0] if len(members) == 1 else "")
        x0 = stage.rest() if x0 is None else x0
        ends = Ends(BodyParts.for_puppet(stage, walker), x0)
        length = self.stride * leg_length(ends.body_parts.body_map)
        return self.gesture(ends, [Step(length, turn / steps)] * steps).inputs(x0)

    def gesture(
        self,
        ends: Ends,
        steps: Sequence[Step],
        lengths: Mapping[str, float] | None = None,
        *,
        hangs_at_end: bool = False,
    ) -> Gesture:
        """Gesture of steps on the floor, with preparation and closing.

        Args:
            ends: ends of the puppet's strings; its start is a rest above the floor.
            steps: steps in order.
            lengths: result of :func:`standing_lengths`, if known already.
            hangs_at_end: whether the puppet is raised at last to where it hung at the start. It is
                then lowered and raised with lifted feet, for ``HANGING_PREPARATION_STEPS`` and
                ``RAISING_STEPS``: feet that hang would be loaded sideways as they touch the floor,
                and slide when they are first lifted.

        Raises:
            StateError: see :meth:`inputs`.
        """
        if lengths is None:
            lengths = standing_lengths(ends.body_parts, ends.start)
        return _GaitMotion(self, ends, steps, lengths, hangs_at_end).gesture()


class _GaitMotion:
    """Motion of a gait's steps; arguments as for :meth:`Gait.gesture`."""

    def __init__(
        self,
        gait: Gait,
        ends: Ends,
        steps: Sequence[Step],
        lengths: Mapping[str, float],
        hangs_at_end: bool,
    ):
        self._gait, self._ends, self._n = gait, ends, len(steps)
        body_map = ends.body_parts.body_map
        self._L, self._legs = leg_length(body_map), legs(body_map)
        self._phases = gait_phases(body_map, gait.pattern)
        self._leg_of_string = leg_strings(ends.body_parts)
        for string in self._leg_of_string:
            ends.check_driven(string)
        self._step_path = StepPath(steps, gait.step_time)
        before = HANGING_PREPARATION_STEPS if hangs_at_end else PREPARATION_STEPS
        closed = self._n + CLOSING_STEPS
        end = closed + (RAISING_STEPS if hangs_at_end else 0)
        n_pieces = round((before + end) * _PIECES_PER_STEP)
        self._preparation = before
        self._clock: Times = np.arange(n_pieces + 1) / _PIECES_PER_STEP - before
        self._lowering = self._smooth_step(-before, _LOWERING_TIME)
        self._leading, self._lifted_ends = self._lowering, scale_curve(0.0, self._lowering)
        if hangs_at_end:
            set_down = self._smooth_step(_LOWERING_TIME - before, _SETTING_TIME)
            lifted = self._smooth_step(closed, _SETTING_TIME)
            raised = self._smooth_step(closed + _SETTING_TIME, RAISING_STEPS - _SETTING_TIME)
            # Ends of strings are above their places again before the feet leave the floor.
            upright = self._smooth_step(self._n, CLOSING_STEPS + _SETTING_TIME)
            self._leading = _add_curves(self._lowering, scale_curve(-1.0, upright))
            self._lowering = _add_curves(self._lowering, scale_curve(-1.0, raised))
            feet_down = _add_curves(lifted, scale_curve(-1.0, set_down))
            self._lifted_ends = _add_curves(self._lowering, feet_down)
        self._lengths = lengths

    def gesture(self) -> Gesture:
        """The whole motion."""
        gait, ends, L = self._gait, self._ends, self._L
        path, heading = self._step_path.at(self._clock * gait.step_time)
        offset = _add_curves(scale_curve(-1j * gait.body_lead * L, self._leading), self._sway())
        other_strings = [name for name in ends.positions if name not in self._leg_of_string]
        ends.move_rigidly(path, heading, offset, other_strings)
        for string, length in self._lengths.items():
            if string in self._leg_of_string:
                self._move_leg_string(string, length)
                continue
            let_out = (gait.lower + (gait.nod if string in self._head_strings else 0.0)) * L
            change = self._change_from_start(string, length) + let_out
            self._add_length(string, scale_curve(change, self._lowering))
        marks = {"down": self._preparation * gait.step_time}
        clock = (self._clock + self._preparation) * gait.step_time
        return ends.gesture(clock, "gait", marks, travels=True)

    @property
    def _head_strings(self) -> set[str]:
        return {
            name.removeprefix(self._ends.prefix) for name in self._ends.body_parts.body_map.looking
        }

    def _change_from_start(self, string: str, length: float) -> float:
        return length - float(self._ends.start[f"{self._ends.prefix}{string}.length"])

    def _add_length(self, string: str, curve: Curve) -> None:
        self._ends.add(f"{string}.length", curve)

    def _move_leg_string(self, string: str, length: float) -> None:
        """Moves the end of a leg's string and its length."""
        gait, ends, L = self._gait, self._ends, self._L
        zero = scale_curve(0.0, self._lowering)
        tau, lift, lead = zero, self._lifted_ends, zero
        for begin, end, distance in self._swings(self._leg_of_string[string]):
            swing_time = end - begin
            vertical, peak = gait.vertical_share * swing_time, gait.peak_share * swing_time
            tau = _add_curves(
                tau,
                scale_curve(
                    distance, self._smooth_step(begin + vertical, swing_time - 2.0 * vertical)
                ),
            )
            lift = _add_curves(lift, self._rise_and_fall(begin, begin + peak, end))
            lead_bump = self._rise_and_fall(begin, begin + _OVERSHOOT_PEAK * swing_time, end)
            lead = _add_curves(lead, scale_curve(0.5 * distance, lead_bump))
        forward = _add_curves(
            scale_curve(gait.leg_lead * L, self._leading), scale_curve(gait.overshoot * L, lead)
        )
        path, heading = self._path_at(tau)
        ends.move_rigidly(path, heading, scale_curve(-1j, forward), [string])
        slack_length = (gait.lower + gait.slack) * L
        lowered = scale_curve(
            self._change_from_start(string, length) + slack_length, self._lowering
        )
        self._add_length(
            string, _add_curves(lowered, scale_curve(-(gait.lift * L + slack_length), lift))
        )

    def _swings(self, leg: str) -> list[tuple[float, float, float]]:
        """Start and end of each swing, and the distance of the leg in it, all in steps."""
        swing, swings, position = 2.0 * (1.0 - self._gait.duty), [], 0.0
        begin = 2.0 * self._phases[leg]
        while position < self._n:
            begin = min(begin, self._n + CLOSING_STEPS - swing)
            end = begin + swing
            # It lands where the body is in the middle of its stance; at last it closes up.
            landing = min(0.5 * (end + begin + 2.0), float(self._n)) if end < self._n else self._n
            swings.append((begin, end, landing - position))
            position, begin = landing, begin + 2.0
        return swings

    def _path_at(self, tau: Curve) -> tuple[ComplexCurve, Curve]:
        """Path and heading of the body at the times tau [steps]."""
        path, heading = self._step_path.at(tau[0] * self._gait.step_time)
        rate, change = tau[1] * self._gait.step_time, tau[2] * self._gait.step_time
        (z, dz, ddz), (theta, dtheta, ddtheta) = path, heading
        return (
            (z, dz * rate, ddz * rate**2 + dz * change),
            (theta, dtheta * rate, ddtheta * rate**2 + dtheta * change),
        )

    def _sway(self) -> Curve:
        """Sway towards the sides of lifted legs."""
        sway = scale_curve(0.0, self._lowering)
        for leg, limb in self._legs.items():
            amplitude = self._gait.sway * self._L * _SWAY_SIGNS[limb.side]
            for begin, end, _ in self._swings(leg):
                lift = self._rise_and_fall(begin, 0.5 * (begin + end), end)
                sway = _add_curves(sway, scale_curve(2.0 * amplitude / len(self._legs), lift))
        return sway

    def _rise_and_fall(self, begin: float, peak: float, end: float) -> Curve:
        """Curve from 0 to 1 and back, between times in steps."""
        rise, fall = self._smooth_step(begin, peak - begin), self._smooth_step(peak, end - peak)
        return _add_curves(rise, scale_curve(-1.0, fall))

    def _smooth_step(self, begin: float, width: float) -> Curve:
        """Minimum jerk from 0 to 1, from a time on and for a time, in steps."""
        progress = np.clip((self._clock - begin) / width, 0.0, 1.0)
        value, rate, change = polynomial.minimum_jerk(progress)
        duration = width * self._gait.step_time
        return value, rate / duration, change / duration**2


def _add_curves(a: Curve, b: Curve) -> Curve:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


SEARCHED_PARAMETERS = tuple(
    x.name for x in fields(Gait) if x.name not in ("pattern", "step_time", "stride")
)
"""Names of the parameters that a search changes."""
