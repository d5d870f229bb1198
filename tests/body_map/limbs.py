"""Limbs of a body map in short."""

from __future__ import annotations

from fantoccini.model import BodyMap


def limbs(body_map: BodyMap) -> dict[str, tuple[tuple[str, ...], tuple[str, ...]]]:
    """Name of a limb -> its bodies and strings."""
    return {name: (limb.bodies, limb.strings) for name, limb in body_map.parts.items()}
