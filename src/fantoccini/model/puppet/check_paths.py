"""Mistakes in the paths of strings and the ends of springs."""

from __future__ import annotations

from typing import Any

from fantoccini.base.documents import Path, shown
from fantoccini.model.puppet.written import Written, is_number, items, word


def _place(point: Any) -> tuple[float, ...] | None:
    """Coordinates of a point; None if they are not three numbers."""
    if not isinstance(point, list):
        return None
    numbers: list[Any] = [n.get("value") if isinstance(n, dict) else n for n in point]
    return tuple(numbers) if len(numbers) == 3 and all(map(is_number, numbers)) else None


def check_paths(written: Written) -> None:
    """Checks that the points of strings and springs exist and can change their distance."""
    for key, points in (("strings", "path"), ("springs", "between")):
        for i, item in items(written.data, key):
            if isinstance(item.get(points), list):
                _path(written, (key, i, points), item[points])


def _path(written: Written, path: Path, points: list[Any]) -> None:
    found = [_carrier(written, p, (*path, k)) for k, p in enumerate(points)]
    driven = [k for k, c in enumerate(found) if c and c[0] == "driven"]
    for k in driven:
        if path[0] == "springs":
            written.say((*path, k, "driven"), "a spring's end cannot be driven")
        elif k not in (0, len(points) - 1):
            written.say((*path, k, "driven"), "only a string's two ends can be driven")
    if len(driven) > 1 and path[0] == "strings":
        text = "both ends are driven; let one be a body with a driven joint"
        written.say((*path, driven[1], "driven"), text)
    carriers = [c for c in found if c is not None]
    if len(found) < 2 or len(carriers) < len(found):
        return
    if len({c[:2] for c in carriers}) == 1:
        where = "in the world" if carriers[0][0] == "world" else f"on {shown(carriers[0][1])}"
        places = {c[2] for c in carriers}
        what = "its length is zero" if len(places) == 1 else "its length can never change"
        written.say(path, f"all points lie {where}: {what}")
        return
    for k in range(1, len(carriers)):
        if carriers[k] == carriers[k - 1] and carriers[k][2] is not None:
            written.say((*path, k), "this is the same point as the one before it")


def _carrier(written: Written, point: Any, path: Path) -> tuple[str, Any, Any] | None:
    """Kind and name of a point's carrier, and the place on it; None if unclear."""
    if not isinstance(point, dict):
        return None
    at = _place(point.get("at", [0.0, 0.0, 0.0]))
    if point.get("driven") is not None:
        parent = word(point, "parent")
        if parent is not None and parent != "world" and parent not in written.known:
            hint = written.near(parent, written.known | {"world"})
            written.say((*path, "parent"), f"no body is called {shown(parent)}{hint}")
        return ("driven", path, at)
    if point.get("world") is not None:
        return ("world", None, _place(point["world"]))
    name = word(point, "body")
    if name == "world":
        written.say((*path, "body"), "found 'world'; write {world: [x, y, z]} instead")
    elif name is not None and name not in written.known:
        hint = written.near(name, written.known)
        written.say((*path, "body"), f"no body is called {shown(name)}{hint}")
    elif name is not None:
        return ("body", name, at)
    return None
