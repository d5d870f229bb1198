"""Random puppets on two, four and six legs, of 0.15 to 1.5 m, some with wings, tails and arms."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

import fantoccini as fan
from fantoccini.model.puppet import Puppet, loads
from fantoccini.model.scene import Member, Scene

SIZES = (0.15, 1.5)
"""Smallest and largest height or length [m]."""
_WORDS = ("alma", "bruk", "cori", "dema", "elto", "fosk", "gilo", "hurn", "ikat", "jolm", "kerz")
_DENSITY = 400.0
"""Density of limbs; feet carry lead [kg/m^3]."""
_FRICTION = 0.8


class Rig:
    """A random puppet.

    Attributes:
        n_pairs: number of pairs of legs.
        size: height on two legs, length on more [m].
        legs: names of its feet.

    Args:
        seed: seed of all its numbers and names.
    """

    def __init__(self, seed: int):
        self._rng = np.random.default_rng(seed)
        self.n_pairs = seed % 3 + 1
        self.size = float(np.exp(self._rng.uniform(*np.log(SIZES))))
        self._bodies: list[dict[str, Any]] = []
        self._strings: list[dict[str, Any]] = []
        self._words = self._rng.permutation(_WORDS).tolist()
        self._leg = self.size * float(self._rng.uniform(0.42, 0.5) if self.n_pairs == 1 else 0.3)
        self._top = self.size * float(self._rng.uniform(1.8, 2.6))
        self._trunk()
        hips = np.linspace(0.38, -0.38, self.n_pairs) if self.n_pairs > 1 else [0.0]
        self.legs = [
            name for x in hips for side in (1.0, -1.0) if (name := self._limb(x * self.size, side))
        ]
        self._head()
        if self.n_pairs == 1:
            self._arms(bool(seed % 2))
        elif self._rng.random() < 0.5:
            self._tail()

    @property
    def puppet(self) -> Puppet:
        """The puppet, just above the floor."""
        data = {
            "puppet": "rig",
            "floor": 0.0,
            "bodies": self._bodies,
            "strings": self._strings,
            "pose": {f"{self._words[0]}.z": self._height},
        }
        return loads(json.dumps(data))

    @property
    def stage(self) -> fan.Marionette:
        """The puppet on a floor that carries it."""
        member = Member(name="rig", puppet=self.puppet)
        contact: Any = {"friction": _FRICTION}
        return fan.Marionette(Scene(scene="floor", floor=0.0, puppets=(member,), contact=contact))

    def _trunk(self) -> None:
        S, name = self.size, self._words[0]
        upright = self.n_pairs == 1
        half = [0.06 * S, 0.09 * S, 0.14 * S] if upright else [0.45 * S, 0.09 * S, 0.09 * S]
        # Hips are at the trunk's origin; feet hang 2 % of the legs above the floor.
        self._height = 1.02 * self._leg
        self._trunk_top = 2.0 * half[2]
        shape = {"type": "ellipsoid", "radii": half, "at": [0, 0, half[2]], "density": 250}
        drag = {"linear": 0.2 * S, "angular": 0.01 * S**3}
        self._bodies.append(
            {"name": name, "joint": {"type": "free"}, "drag": drag, "shapes": [shape]}
        )
        z = self._trunk_top * 0.9
        if upright:
            for side, y in (("a", 0.08 * S), ("b", -0.08 * S)):
                self._string(f"s_{side}", name, [0, y, z], [0, y * 1.2])
        else:
            spread = 0.3 * S
            for k, x in enumerate((spread, -spread)):
                self._string(f"s_{k}", name, [x, 0, z], [x, 0])

    def _limb(self, x: float, side: float) -> str:
        """A leg of two bodies with a hinge; its string is tied to the knee or to the foot."""
        S, L, word = self.size, self._leg, self._words[1]
        name = f"{word}{len(self._bodies)}"
        thigh, shin = 0.5 * L, 0.5 * L
        y, r = side * (0.06 if self.n_pairs == 1 else 0.09) * S, 0.035 * L + 0.008 * S
        forward = self.n_pairs == 1 or x < 0.0 or self._rng.random() < 0.5
        ball = {
            "type": "ball",
            "at": [x, y, 0],
            "damping": 0.02 * S**4,
            "cone": {"max": "65 deg", "axis": [0.4, 0.2 * side, -1], "of": [0, 0, -1]},
            "twist": {"lower": "-20 deg", "upper": "20 deg"},
        }
        hinge = {
            "type": "revolute",
            "axis": [0, 1 if forward else -1, 0],
            "at": [0, 0, -thigh],
            "damping": 0.01 * S**4,
            "limits": {"lower": "-2 deg", "upper": "120 deg"},
        }
        down = -shin + 0.12 * L
        foot = {
            "type": "box",
            "size": [0.24 * L, 0.13 * L, 0.06 * L],
            "at": [0.04 * L, 0, -shin + 0.03 * L],
            "density": 1500,
        }
        joints = (f"{name}_j", f"{name}_k")
        self._bodies += [
            self._body(name, self._words[0], joints[0], ball, [0, 0, -0.9 * thigh], r),
            self._body(f"{name}e", name, joints[1], hinge, [0, 0, down], 0.8 * r, [foot]),
        ]
        self._string(f"l_{name}", name, [r, 0, -0.95 * thigh], [x + 0.3 * L, 1.4 * y])
        return f"{name}e"

    def _head(self) -> None:
        S, name = self.size, self._words[2]
        upright = self.n_pairs == 1
        at = [0, 0, self._trunk_top] if upright else [0.44 * S, 0, 0.75 * self._trunk_top]
        r = (0.09 if upright else 0.07) * S
        joint = {
            "type": "ball",
            "at": at,
            "damping": 0.02 * S**4,
            "spring": {"stiffness": 0.2 * S**4},
            "cone": {"max": "45 deg", "axis": [0, 0, 1]},
            "twist": {"lower": "-60 deg", "upper": "60 deg"},
        }
        nose = {
            "type": "capsule",
            "from": [r, 0, r],
            "to": [1.7 * r, 0, 0.9 * r],
            "radius": 0.25 * r,
            "density": 300,
        }
        self._bodies.append(
            self._body(name, self._words[0], f"{name}_j", joint, [0, 0, 1.2 * r], 0.8 * r, [nose])
        )
        self._string(f"h_{name}", name, [0.2 * r, 0, 2.0 * r], at[:2])

    def _arms(self, wings: bool) -> None:
        S = self.size
        for side in (1.0, -1.0):
            name = f"{self._words[3]}{'l' if side > 0 else 'r'}"
            y, z, length = 0.11 * S, 0.8 * self._trunk_top, 0.3 * S
            to = [0, side * length, 0] if wings else [0, 0, -length]
            joint = {
                "type": "ball",
                "at": [0, side * y, z],
                "damping": 0.01 * S**4,
                "cone": {"max": "100 deg", "axis": [0.4, 0.6 * side, -0.7], "of": [0, 0, -1]},
                "twist": {"lower": "-80 deg", "upper": "80 deg"},
            }
            if wings:
                joint["cone"] = {"max": "80 deg", "axis": [0, side, -0.3], "of": [0, side, 0]}
            self._bodies.append(self._body(name, self._words[0], f"{name}_j", joint, to, 0.02 * S))
            tip = [0.9 * c for c in to]
            out = [0.15 * S, side * (y + 0.2 * S)] if not wings else [0, side * (y + 0.9 * length)]
            self._string(f"a_{name}", name, tip, out)

    def _tail(self) -> None:
        S, name = self.size, self._words[4]
        joint = {
            "type": "ball",
            "at": [-0.44 * S, 0, 0.6 * self._trunk_top],
            "damping": 0.01 * S**4,
            "cone": {"max": "50 deg", "axis": [-1, 0, 0.4], "of": [-1, 0, 0.4]},
            "twist": {"lower": "-20 deg", "upper": "20 deg"},
        }
        to = [-0.25 * S, 0, 0.1 * S]
        self._bodies.append(self._body(name, self._words[0], f"{name}_j", joint, to, 0.02 * S))
        self._string(f"t_{name}", name, to, [-0.69 * S, 0])

    def _body(
        self,
        name: str,
        parent: str,
        joint_name: str,
        joint: dict[str, Any],
        to: list[float],
        radius: float,
        more: list[dict[str, Any]] | None = None,
    ) -> dict[str, Any]:
        rod = {
            "type": "capsule",
            "from": [0, 0, 0],
            "to": to,
            "radius": radius,
            "density": _DENSITY,
        }
        return {
            "name": name,
            "parent": parent,
            "joint": {"name": joint_name, **joint},
            "shapes": [rod, *(more or [])],
        }

    def _string(self, name: str, body: str, at: list[float], end: list[float]) -> None:
        driven = {"driven": ["x", "y"], "at": [*end, self._top]}
        self._strings.append(
            {"name": name, "path": [{"body": body, "at": at}, driven], "length": "driven"}
        )
