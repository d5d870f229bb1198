"""Memory check of MJCF: short models for which MuJoCo would take gigabytes are refused.

The sizes were measured while MuJoCo 4.0 compiled such models, and rounded up a little.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress

from fantoccini.output.exchange.mjcf_includes import asset_folders, found_beside
from fantoccini.output.exchange.model_file import Element, ModelFile

_MAX_BYTES = 500_000_000
"""Memory allowed for a model's elements given by their number only [bytes]."""
_PIXEL, _HEIGHT = 6, 16
"""Memory per pixel of a texture, and per point of a height field [bytes]."""
_NUMBER = 24
"""Memory per number of user data, an activation or a sensor [bytes]."""
_KEY = 300
"""Memory per element of a model in a keyframe [bytes]."""
_CORNER = 300
"""Memory per corner of a generated mesh, which has up to the square of a parameter [bytes]."""
_SAMPLE = 200
"""Memory per sample kept by an actuator or sensor [bytes]."""
_CELL = 2000
"""Memory per cell of a flexcomp [bytes]."""
_MAX_NUMBER = 10**12
"""Larger numbers are cut to this one, so that products stay finite."""

_PNG = b"\x89PNG\r\n\x1a\n"
"""Begins a PNG; its width and height follow after 8 bytes."""
_FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


def refuse_large(files: Iterable[tuple[ModelFile, int]]) -> None:
    """Raises ExchangeError where MuJoCo would take too much memory.

    Args:
        files: the model and the files it attaches, each with its number of elements.
    """
    total = 0.0
    for file, elements in files:
        defaults = dict[str, dict[str, str]]()
        ranges = any(element.tag == "rangefinder" for element in file.elements)
        for element, inside in _with_defaults(file):
            if inside:
                _widen(defaults.setdefault(element.tag, {}), element)
                continue
            given = {**defaults.get(element.tag, {}), **element.attributes}
            need = _bytes(file, element, given, elements, ranges)
            total += need
            if total > _MAX_BYTES:
                text = (
                    f"MuJoCo would take {need / 1e6:,.0f} MB for it, {total / 1e6:,.0f} MB up to "
                    f"here; allowed: {_MAX_BYTES / 1e6:,.0f} MB. Make it smaller"
                )
                raise file.mistake(text, element.line, element.tag)


def _with_defaults(file: ModelFile) -> Iterator[tuple[Element, bool]]:
    """Elements, defaults first, each with a flag for defaults."""
    above, found = list[str](), list[tuple[Element, bool]]()
    for element in file.elements:
        del above[element.depth :]
        found.append((element, "default" in above))
        above.append(element.tag)
    yield from sorted(found, key=lambda one: not one[1])


def _widen(known: dict[str, str], element: Element) -> None:
    """Adds a default's attributes, keeping the larger number of each over all classes."""
    for key, text in element.attributes.items():
        if key not in known or max(_numbers(text)) > max(_numbers(known[key])):
            known[key] = text


def _bytes(
    file: ModelFile, element: Element, given: dict[str, str], elements: int, ranges: bool
) -> float:
    """Memory for an element, of attributes given and by default; ``ranges``: with rangefinders."""

    def of(key: str) -> list[float]:
        return _numbers(given.get(key, ""))

    need = _SAMPLE * of("nsample")[0] + _NUMBER * of("actdim")[0]
    match element.tag:
        case "size":
            user = sum(_numbers(x)[0] for key, x in given.items() if key.startswith("nuser_"))
            need += _NUMBER * (of("nuserdata")[0] + user * elements)
            need += _KEY * of("nkey")[0] * elements
        case "key":
            need += _KEY * elements
        case "texture":
            width, height = of("width")[0], of("height")[0]
            is_flat = element.attributes.get("type") == "2d"
            faces = 0.0 if is_flat else 6.0 * max(width, height / 6.0) ** 2
            need += _PIXEL * (max(width * height, faces) + _pixels(file, given))
        case "hfield":
            need += _HEIGHT * (of("nrow")[0] * of("ncol")[0] + _pixels(file, given))
        case "mesh" if "builtin" in given:
            need += _CORNER * max(of("params")) ** 2
        case "flexcomp":
            need += _CELL * math.prod(max(n, 1.0) for n in of("cellcount"))
        case "camera":
            need += _NUMBER * math.prod(of("resolution")) if ranges else 0.0
        case "user" | "contact":
            need += _NUMBER * (of("dim")[0] + 10.0 * of("num")[0])
    return need


def _pixels(file: ModelFile, given: dict[str, str]) -> float:
    """Pixels of the images that an element names, as their headers say."""
    names = [given[key] for key in _FILES if given.get(key)]
    if not names:
        return 0.0
    folders = asset_folders(file)
    first = os.path.dirname(os.fspath(file.path))
    folders += [
        os.path.join(first, element.attributes["texturedir"])
        for element in file.elements
        if "texturedir" in element.attributes
    ]
    count = 0.0
    for name in names:
        place = found_beside(name, *folders) or found_beside(os.path.basename(name), *folders)
        with suppress(OSError), open(place or "", "rb") as image:
            head = image.read(len(_PNG) + 16)
            if head.startswith(_PNG) and len(head) == len(_PNG) + 16:
                count += math.prod(struct.unpack(">II", head[-8:]))
    return count


def _numbers(text: str) -> list[float]:
    """The absolute values of an attribute's numbers; 0 for words that are not numbers."""
    found = []
    for word in text.split():
        try:
            number = abs(float(word))
        except ValueError:
            number = 0.0
        found.append(min(number, _MAX_NUMBER) if number == number else 0.0)
    return found or [0.0]
