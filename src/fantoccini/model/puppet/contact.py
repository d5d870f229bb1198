"""Contact: which solids touch, and with what friction and restitution."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from fantoccini.base.documents import Model, NotNegative, RealShare, entries, mistake

Group = Literal["floor", "obstacles", "props", "puppets", "self"]
"""What the bodies of a puppet may touch: ``puppets`` are the others, ``self`` its own bodies."""

GROUPS: tuple[Group, ...] = get_args(Group)
FLOOR = "floor"
"""The floor's name in pairs, and in what a run says of contacts."""


class ContactPair(Model):
    """Two parts that touch otherwise than the rest, or not at all."""

    between: Annotated[tuple[str, str], entries(2, 2)]
    """Their names: a body, a prop, a puppet of a scene, an obstacle, or `floor`."""
    friction: NotNegative | None = None
    """Coefficient of friction of this pair."""
    restitution: RealShare | None = None
    """Part of the normal speed that an impact gives back: 0 to 1."""
    meet: bool = Field(default=True, strict=True)
    """False where they pass through one another."""

    @model_validator(mode="after")
    def _says_something(self) -> ContactPair:
        if self.meet and self.friction is None and self.restitution is None:
            raise mistake("this pair changes nothing; give friction, restitution or meet: false")
        return self


class Contact(Model):
    """Contact of solids: they do not overlap, and rub with Coulomb's friction."""

    friction: NotNegative = 0.5
    """Coefficient of friction: the largest tangential over the normal force."""
    restitution: RealShare = 0.0
    """Part of the normal speed that an impact gives back: 0 to 1."""
    meets: tuple[Group, ...] = GROUPS
    """What bodies touch: floor, obstacles, props, puppets (the others), self (own bodies)."""
    pairs: tuple[ContactPair, ...] = ()
    """Pairs with rules of their own, which meet whatever `meets` says; later ones go first."""


def _form(value: Any) -> str:
    return "<flag>" if isinstance(value, bool) else "<rules>"


ContactRule = Annotated[
    Annotated[bool, Tag("<flag>")] | Annotated[Contact, Tag("<rules>")], Discriminator(_form)
]
"""``true`` stands for a :class:`Contact` with its defaults, ``false`` for none."""
