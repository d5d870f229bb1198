"""Contact rules: which solids touch, their friction and restitution.

A solid is a shape of a body or an obstacle. Restitution is the part of the speed that an impact
gives back.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Discriminator, Field, Tag, model_validator

from fantoccini.base.documents import Model, NotNegative, RealShare, entries, validation_error

Group = Literal["floor", "obstacles", "props", "puppets", "self"]
"""Possible partners in contact: ``puppets`` are the other ones, ``self`` are its own bodies."""

GROUPS: tuple[Group, ...] = get_args(Group)
FLOOR = "floor"
"""Name of the floor in contact pairs, and in the results of runs."""


class ContactPair(Model):
    """Contact rule for two parts, which overrides the general rules."""

    between: Annotated[tuple[str, str], entries(2, 2)]
    """Names of the two parts: a body, a prop, a puppet of a scene, an obstacle, or `floor`."""
    friction: NotNegative | None = None
    """Coefficient of friction of this pair."""
    restitution: RealShare | None = None
    """Ratio of the normal speeds after and before an impact: 0 to 1."""
    meet: bool = Field(default=True, strict=True)
    """False if they pass through one another."""

    @model_validator(mode="after")
    def _changes_something(self) -> ContactPair:
        if self.meet and self.friction is None and self.restitution is None:
            raise validation_error(
                "this pair changes nothing; give friction, restitution or meet: false"
            )
        return self


class Contact(Model):
    """General contact rules: solids do not overlap, and have Coulomb friction."""

    friction: NotNegative = 0.5
    """Coefficient of friction: largest tangential force / normal force."""
    restitution: RealShare = 0.0
    """Ratio of the normal speeds after and before an impact: 0 to 1."""
    meets: tuple[Group, ...] = GROUPS
    """Partners in contact: floor, obstacles, props, puppets (other ones), self (own bodies)."""
    pairs: tuple[ContactPair, ...] = ()
    """Pairs with their own rules, which override `meets`; later pairs override earlier ones."""


def _rule_kind(value: Any) -> str:
    return "<flag>" if isinstance(value, bool) else "<rules>"


ContactRule = Annotated[
    Annotated[bool, Tag("<flag>")] | Annotated[Contact, Tag("<rules>")], Discriminator(_rule_kind)
]
"""``true`` is a :class:`Contact` with default rules; ``false`` is no contact."""
