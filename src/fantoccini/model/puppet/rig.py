"""The section `rig` of a puppet file: which parts are limbs and head, and what moves them.

A limb is an arm, leg, wing, tail or neck.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import model_validator

from fantoccini.base.documents import Direction, Model, entries, raise_if_any
from fantoccini.model.puppet.quantities import Vector

LimbKind: TypeAlias = Literal["arm", "leg", "wing", "tail", "neck"]
Side: TypeAlias = Literal["left", "right", "middle"]


class RigHead(Model):
    """The head."""

    body: str
    """Name of its body."""
    end: Vector
    """Its top, in the body's frame [m]."""


class RigLimb(Model):
    """A limb: a chain of bodies that begins at the trunk."""

    kind: LimbKind
    """Kind of limb: arm, leg, wing, tail or neck."""
    side: Side = "middle"
    """Side of the puppet, as it sees it: left, right or middle."""
    bodies: Annotated[tuple[str, ...], entries(1)]
    """Names of its bodies, from the trunk to the end."""
    end: Vector
    """Its end (hand, foot, tip) in the frame of the last body [m]."""
    strings: tuple[str, ...] = ()
    """Names of the strings that lift it, the one nearest to its end first."""


class Rig(Model):
    """Body map of a puppet; what is not given is found from its tree, shapes and strings."""

    trunk: Annotated[tuple[str, ...], entries(1)] | None = None
    """Names of the bodies of the trunk, from the one that carries the others."""
    head: RigHead | None = None
    """The head, if the puppet has one."""
    limbs: tuple[RigLimb, ...] | None = None
    """Limbs; those of one kind and side in order from the front to the back."""
    facing: Direction | None = None
    """Direction in which it looks, in the frame of the trunk's first body."""
    carrying: tuple[str, ...] | None = None
    """Names of the strings that carry the trunk."""
    looking: tuple[str, ...] | None = None
    """Names of the strings that move the head."""
    control: str | None = None
    """Name of the driven body from which the strings hang."""

    @model_validator(mode="after")
    def _all_or_none(self) -> Rig:
        missing = [key for key in ("trunk", "facing") if getattr(self, key) is None]
        if self.limbs is not None and missing:
            text = (
                f"found limbs without {' and '.join(missing)}; limbs, trunk and facing go together"
            )
            raise_if_any([(("limbs",), text)])
        if self.trunk is not None and self.limbs is None:
            text = "found trunk without limbs; limbs, trunk and facing go together"
            raise_if_any([(("trunk",), text)])
        return self
