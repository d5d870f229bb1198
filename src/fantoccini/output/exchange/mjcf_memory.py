"""Memory check of MJCF: refusal of short models for which MuJoCo would need gigabytes.

The sizes were measured while MuJoCo 4.0 compiled such models, and slightly rounded up.

MJCF is the XML format of the simulator MuJoCo.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress

from fantoccini.output.exchange.mjcf_includes import asset_folders, find_file
from fantoccini.output.exchange.model_file import Element, ModelFile

_MAX_BYTES = 500_000_000
"""Largest memory for elements of a model that are given only by their number [bytes]."""
_PIXEL_BYTES, _HEIGHT_BYTES = 6, 16
"""Memory per pixel of a texture, and per point of a height field [bytes]."""
_NUMBER_BYTES = 24
"""Memory per number of user data, an activation or a sensor [bytes]."""
_KEYFRAME_BYTES = 300
"""Memory per element of a model in a keyframe [bytes]."""
_CORNER_BYTES = 300
"""Memory per corner of a generated mesh; there are up to the square of a parameter [bytes]."""
_SAMPLE_BYTES = 200
"""Memory per sample kept by an actuator or sensor [bytes]."""
_CELL_BYTES = 2000
"""Memory per cell of a flexcomp [bytes]."""
_MAX_NUMBER = 10**12
"""Limit to which larger numbers are clamped, so that products stay finite."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
"""Signature of a PNG; width and height follow after 8 more bytes."""
_IMAGE_KEYS = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


def check_memory(files: Iterable[tuple[ModelFile, int]]) -> None:
    """Raises ExchangeError if MuJoCo would need too much memory.

    Args:
        files: the model and the files that it attaches, each with its number of elements.
    """
    total = 0.0
    for file, n_elements in files:
        defaults = dict[str, dict[str, str]]()
        has_rangefinders = any(element.tag == "rangefinder" for element in file.elements)
        for element, is_default in _with_defaults(file):
            if is_default:
                _merge_default(defaults.setdefault(element.tag, {}), element)
                continue
            attributes = {**defaults.get(element.tag, {}), **element.attributes}
            n_bytes = _element_bytes(file, element, attributes, n_elements, has_rangefinders)
            total += n_bytes
            if total > _MAX_BYTES:
                text = (
                    f"MuJoCo would need {n_bytes / 1e6:,.0f} MB for it, {total / 1e6:,.0f} MB up "
                    f"to this line; allowed: {_MAX_BYTES / 1e6:,.0f} MB. Make it smaller"
                )
                raise file.error_at(text, element.line, element.tag)


def _with_defaults(file: ModelFile) -> Iterator[tuple[Element, bool]]:
    """Elements, each with a flag for defaults, which come first."""
    ancestors, flagged = list[str](), list[tuple[Element, bool]]()
    for element in file.elements:
        del ancestors[element.depth :]
        flagged.append((element, "default" in ancestors))
        ancestors.append(element.tag)
    yield from sorted(flagged, key=lambda pair: not pair[1])


def _merge_default(largest: dict[str, str], element: Element) -> None:
    """Merges a default's attributes, keeping the largest number of each over all classes."""
    for key, text in element.attributes.items():
        if key not in largest or max(_numbers(text)) > max(_numbers(largest[key])):
            largest[key] = text


def _element_bytes(
    file: ModelFile,
    element: Element,
    attributes: dict[str, str],
    n_elements: int,
    has_rangefinders: bool,
) -> float:
    """Memory for an element with its attributes [bytes].

    ``has_rangefinders``: whether the model has rangefinders.
    """

    def values_of(key: str) -> list[float]:
        return _numbers(attributes.get(key, ""))

    n_bytes = _SAMPLE_BYTES * values_of("nsample")[0] + _NUMBER_BYTES * values_of("actdim")[0]
    match element.tag:
        case "size":
            user = sum(_numbers(x)[0] for key, x in attributes.items() if key.startswith("nuser_"))
            n_bytes += _NUMBER_BYTES * (values_of("nuserdata")[0] + user * n_elements)
            n_bytes += _KEYFRAME_BYTES * values_of("nkey")[0] * n_elements
        case "key":
            n_bytes += _KEYFRAME_BYTES * n_elements
        case "texture":
            width, height = values_of("width")[0], values_of("height")[0]
            is_flat = element.attributes.get("type") == "2d"
            faces = 0.0 if is_flat else 6.0 * max(width, height / 6.0) ** 2
            n_bytes += _PIXEL_BYTES * (max(width * height, faces) + _pixels(file, attributes))
        case "hfield":
            n_bytes += _HEIGHT_BYTES * (
                values_of("nrow")[0] * values_of("ncol")[0] + _pixels(file, attributes)
            )
        case "mesh" if "builtin" in attributes:
            n_bytes += _CORNER_BYTES * max(values_of("params")) ** 2
        case "flexcomp":
            n_bytes += _CELL_BYTES * math.prod(max(n, 1.0) for n in values_of("cellcount"))
        case "camera":
            n_bytes += (
                _NUMBER_BYTES * math.prod(values_of("resolution")) if has_rangefinders else 0.0
            )
        case "user" | "contact":
            n_bytes += _NUMBER_BYTES * (values_of("dim")[0] + 10.0 * values_of("num")[0])
    return n_bytes


def _pixels(file: ModelFile, attributes: dict[str, str]) -> float:
    """Number of pixels of the images that an element names, from their headers."""
    names = [attributes[key] for key in _IMAGE_KEYS if attributes.get(key)]
    if not names:
        return 0.0
    folders = asset_folders(file)
    first_folder = os.path.dirname(os.fspath(file.path))
    folders += [
        os.path.join(first_folder, element.attributes["texturedir"])
        for element in file.elements
        if "texturedir" in element.attributes
    ]
    count = 0.0
    for name in names:
        path = find_file(name, *folders) or find_file(os.path.basename(name), *folders)
        with suppress(OSError), open(path or "", "rb") as image:
            header = image.read(len(_PNG_SIGNATURE) + 16)
            if header.startswith(_PNG_SIGNATURE) and len(header) == len(_PNG_SIGNATURE) + 16:
                count += math.prod(struct.unpack(">II", header[-8:]))
    return count


def _numbers(text: str) -> list[float]:
    """Absolute values of an attribute's numbers; 0 for words that are not numbers."""
    numbers = []
    for word in text.split():
        try:
            number = abs(float(word))
        except ValueError:
            number = 0.0
        numbers.append(min(number, _MAX_NUMBER) if number == number else 0.0)
    return numbers or [0.0]
