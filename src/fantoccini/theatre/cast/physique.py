"""Sizes and strings of a puppet for gestures with props and seats, from its body map.

A body map says which bodies and strings are the trunk, head and limbs of a puppet. A member is a
puppet of a scene. In names, D stands for dynamic coordinates, which move by the equations of
motion, and K for driven ones: ends and lengths of strings, driven joints. A row of the tree
describes a string, limit, spring or drive, a row of the coordinate table one coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.base import Array, StateError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model import Limb
from fantoccini.motion import State, pieces
from fantoccini.theatre.cast.contacts import forearm_of
from fantoccini.theatre.gestures import BodyParts, leg_ratio

_ARM = 0.19
"""Length of an arm for which gestures with props are written [m]."""
_SIZE_DIGITS = 6
"""Decimals of the ratio of sizes, so that it is exactly 1 for a body of these lengths."""


@dataclass(frozen=True, eq=False)
class Physique:
    """Sizes and strings of a puppet or of a scene's member.

    Attributes:
        body_parts: parts of its body.
    """

    body_parts: BodyParts

    @classmethod
    def of(cls, stage: Marionette, who: str = "") -> Physique:
        """Physique of a member of a scene.

        Raises:
            StateError: it has no body map.
        """
        return cls(BodyParts.for_puppet(stage, who))

    @property
    def stage(self) -> Marionette:
        """Scene of the puppet."""
        return self.body_parts.marionette

    def limb(self, part: str) -> Limb:
        """A limb, such as ``arm_left``.

        Raises:
            StateError: the puppet lacks it.
        """
        parts = self.body_parts.body_map.parts
        if part not in parts:
            raise StateError(
                f"the puppet has no {part}; its body map has {', '.join(parts) or 'no limbs'}"
            )
        return parts[part]

    def arm_ratio(self, side: str) -> float:
        """Length of an arm relative to that for which gestures are written."""
        return round(self.limb(f"arm_{side}").length / _ARM, _SIZE_DIGITS)

    @property
    def leg_ratio(self) -> float:
        """Length of the legs relative to that for which gestures are written."""
        return round(leg_ratio(self.body_parts), _SIZE_DIGITS)

    def hand_string(self, side: str) -> str:
        """Name of the string that lifts a hand.

        Raises:
            StateError: no string lifts it.
        """
        return self.body_parts.strings(f"arm_{side}")[0]

    def knee_string(self, side: str) -> str:
        """Name of the string that lifts a leg by its thigh; else the one nearest to its foot.

        Raises:
            StateError: no string lifts it.
        """
        part = f"leg_{side}"
        names = self.body_parts.strings(part)
        return next((name for name in names if self._is_at_root(part, name)), names[0])

    def forearm(self, side: str) -> str:
        """Name in the scene of the body of an arm on which props hang."""
        return forearm_of(self.limb(f"arm_{side}"))

    def forearm_direction(self, side: str) -> Array:
        """(3,) unit vector from the elbow towards the hand, in the forearm's frame.

        Raises:
            StateError: the puppet lacks the arm, or its end in the body map is the elbow.
        """
        part = f"arm_{side}"
        limb, forearm = self.limb(part), self.forearm(side)
        end = np.array(limb.end)
        if (hand := limb.bodies[-1]) != forearm:
            x = self.stage.state()
            elbow, wrist = (self.stage.pose(x, body) for body in (forearm, hand))
            end = elbow[:3, :3].T @ (wrist[:3, 3] - elbow[:3, 3])
        length = float(np.linalg.norm(end))
        if length == 0.0:
            raise StateError(f"{part} ends at its elbow; needed: `end` of its limb in `rig`")
        return np.asarray(end / length)

    @cached_property
    def strings(self) -> tuple[str, ...]:
        """Names of all strings with ends that move along x and y."""
        prefix = self.body_parts.prefix
        channels = pieces.channel_names(self.body_parts.marionette.coordinates)
        own = [name.removeprefix(prefix) for name in channels if name.startswith(prefix)]
        ends = [name.removesuffix(".x") for name in own if name.endswith(".x")]
        return tuple(name for name in ends if f"{name}.length" in own and f"{name}.y" in own)

    @cached_property
    def trunk_strings(self) -> tuple[str, ...]:
        """Names of the strings that move with the trunk.

        They are tied to the trunk, or to parts on it: head, neck, wings, tail, upper arms.
        """
        own = {name: part for part, name in self._limb_strings}
        return tuple(
            name
            for name in self.strings
            if name not in own
            or (own[name].startswith("arm") and self._is_at_root(own[name], name))
        )

    def tie_height_ratio(self, string: str) -> float:
        """Relative height at which a string is tied, in the pose of the file.

        It is 0 at the hips and 1 at the highest tie of the strings that carry the trunk; it is
        clipped to this range.
        """
        points = self.stage.string_points(*self._file_pose)
        low = self.place(self.limb("leg_left").bodies[0])[2]
        ties = {
            name: float(points[self.body_parts.prefix + name][:, 2].min()) - low
            for name in (string, *self.body_parts.strings("trunk"))
        }
        top = max(ties[name] for name in self.body_parts.strings("trunk"))
        return float(np.clip(ties[string] / top, 0.0, 1.0)) if top > 0.0 else 1.0

    @property
    def _file_pose(self) -> tuple[Array, Array]:
        x = self.stage.state()
        return x.q_D, x.q_K

    @cached_property
    def holds_pelvis(self) -> bool:
        """Whether a string is tied to the trunk nearer to the hips than to its top."""
        return any(
            self._is_tied(name, self.body_parts.body_map.trunk)
            and self.tie_height_ratio(name) < 0.5
            for name in self.trunk_strings
        )

    @cached_property
    def followers(self) -> Mapping[str, str]:
        """Second string of a limb -> leading string, whose offsets it copies.

        Strings of forearms copy :meth:`hand_string`, those of thighs :meth:`knee_string`. Strings
        that are not fully driven, and those of limbs without a side, have no leader.
        """
        leaders: dict[str, str] = {}
        for part, name in self._limb_strings:
            kind, _, side = part.partition("_")
            if not side or name not in self.strings:
                continue
            leader = self.hand_string(side) if kind == "arm" else self.knee_string(side)
            if name != leader and self._is_at_root(part, name) == (kind == "leg"):
                leaders[name] = leader
        return leaders

    @cached_property
    def _limb_strings(self) -> list[tuple[str, str]]:
        """Arms and legs, each with the name of a string that is tied to it."""
        return [
            (part, name)
            for part, limb in self.body_parts.body_map.parts.items()
            if limb.kind in ("arm", "leg") and limb.strings
            for name in self.body_parts.strings(part)
        ]

    def _is_at_root(self, part: str, string: str) -> bool:
        """Whether a string is tied to the first body of a limb."""
        return self._is_tied(string, self.limb(part).bodies[:1])

    def _is_tied(self, string: str, bodies: tuple[str, ...]) -> bool:
        tree = self.stage.tree
        links = {self.stage.link_index(body) for body in bodies}
        rows = (*tree.strings, *tree.chains)
        row = next(row for row in rows if row.name == self.body_parts.prefix + string)
        return any(point.link in links for point in row.points)

    def end(self, start: State, string: str) -> complex:
        """End of a string relative to the middle between those that carry the trunk [m].

        The real part is forward, the imaginary part to the left.
        """

        def at(name: str) -> complex:
            x, y = (float(start[f"{self.body_parts.prefix}{name}.{part}"]) for part in "xy")
            return complex(x, y)

        carrying = self.body_parts.strings("trunk")
        middle = sum(map(at, carrying)) / len(carrying)
        return complex((at(string) - middle) * np.exp(-1j * self.body_parts.heading))

    def place(self, body: str) -> Array:
        """(3,) place of a body's origin in the pose of the file [m].

        Forward and left are measured from the middle between the upper ends of the strings that
        carry the trunk, up from the world's origin.
        """
        stage = self.body_parts.marionette
        x = stage.state()
        points = stage.string_points(x.q_D, x.q_K)
        carrying = [
            points[f"{self.body_parts.prefix}{name}"] for name in self.body_parts.strings("trunk")
        ]
        middle = np.mean([string[np.argmax(string[:, 2]), :2] for string in carrying], axis=0)
        place = stage.pose(x, body)[:3, 3]
        # The heading is relative to the frame of the scene's member.
        frame = (
            stage.pose(x, self.body_parts.prefix[:-1])[:2, :2]
            if self.body_parts.prefix
            else np.eye(2)
        )
        xy = complex(*(frame.T @ (place[:2] - middle))) * np.exp(-1j * self.body_parts.heading)
        return np.array([xy.real, xy.imag, float(place[2])])
