"""Checks of the paths of strings and the ends of springs.

A path is the points of a string from end to end; a carrier is the body or world on which a point is
fixed, or a driven end.
"""

from __future__ import annotations

from fantoccini.base.documents import UNCLEAR, Number, Path, shown, value_of
from fantoccini.model.puppet.elements import Attachment
from fantoccini.model.puppet.parts import Parts

Carrier = tuple[str, str | Path | None, tuple[float, ...] | None]
"""Kind and name of a point's carrier, and the point's position there (None if unclear)."""


def check_paths(parts: Parts) -> None:
    """Checks that the points of strings and springs exist and can change their distance."""
    for i, string in enumerate(parts.puppet.strings):
        _check_path(parts, ("strings", i, "path"), string.path)
    for i, spring in enumerate(parts.puppet.springs):
        _check_path(parts, ("springs", i, "between"), spring.between)


def _check_path(parts: Parts, path: Path, points: tuple[Attachment, ...]) -> None:
    """Adds the mistakes of the points at a path of keys."""
    all_carriers = [_carrier(parts, p, (*path, k)) for k, p in enumerate(points)]
    driven_ends = [k for k, c in enumerate(all_carriers) if c and c[0] == "driven"]
    for k in driven_ends:
        if path[0] == "springs":
            parts.add_mistake((*path, k, "driven"), "a spring's end cannot be driven")
        elif k not in (0, len(all_carriers) - 1):
            parts.add_mistake((*path, k, "driven"), "only a string's two ends can be driven")
    if len(driven_ends) > 1 and path[0] == "strings":
        text = "both ends are driven; needed: a body with a driven joint at one of them"
        parts.add_mistake((*path, driven_ends[1], "driven"), text)
    carriers = [c for c in all_carriers if c is not None]
    if len(all_carriers) < 2 or len(carriers) < len(all_carriers):
        return
    if len({c[:2] for c in carriers}) == 1:
        place_text = "in the world" if carriers[0][0] == "world" else f"on {shown(carriers[0][1])}"
        positions = {c[2] for c in carriers}
        length = "its length is zero" if len(positions) == 1 else "its length can never change"
        parts.add_mistake(path, f"all points lie {place_text}: {length}")
        return
    for k in range(1, len(carriers)):
        if carriers[k] == carriers[k - 1] and carriers[k][2] is not None:
            parts.add_mistake((*path, k), "this is the same point as the one before it")


def _carrier(parts: Parts, point: Attachment, path: Path) -> Carrier | None:
    """The carrier of a point; None if the file does not determine it."""
    if point is UNCLEAR:
        return None
    if point.driven is not None:
        if point.parent != "world" and isinstance(point.parent, str):
            _check_body(parts, point.parent, (*path, "parent"), {"world"})
        return ("driven", path, _position(point.at))
    if point.world is not None:
        return ("world", None, _position(point.world))
    if point.body == "world":
        parts.add_mistake((*path, "body"), "found 'world'; write {world: [x, y, z]} instead")
    elif isinstance(point.body, str) and _check_body(parts, point.body, (*path, "body"), set()):
        return ("body", point.body, _position(point.at))
    return None


def _check_body(parts: Parts, name: str, path: Path, other_names: set[str]) -> bool:
    """Whether a body has this name; adds a mistake otherwise.

    Args:
        parts: parts of the puppet.
        name: name in the file.
        path: its path of keys.
        other_names: other allowed names, for the message.
    """
    if name not in parts.body_names:
        hint = parts.hint(name, parts.body_names | other_names)
        parts.add_mistake(path, f"no body is called {shown(name)}{hint}")
    return name in parts.body_names


def _position(point: tuple[Number, ...]) -> tuple[float, ...] | None:
    """Coordinates of a point; None if the file does not determine them."""
    if point is UNCLEAR or any(UNCLEAR in (x, getattr(x, "value", x)) for x in point):
        return None
    return tuple(map(value_of, point))
