"""Wavefront OBJ with its materials: triangles by material, with colours and images.

OBJ is a text format of triangles, whose materials are in a second file.
"""

from __future__ import annotations

import posixpath
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn
from urllib.parse import quote, unquote

import numpy as np

from fantoccini.base import Array, decoded, lines_of
from fantoccini.model.meshes.colours import Texture, linked_image, srgb
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles
from fantoccini.model.meshes.part import Part, TriangleCount, ignored_properties

_MIN_VALUES = {"v": 3, "vt": 1}
"""Keyword -> minimum number of values after it."""
_NO_COLOUR = (np.nan, np.nan, np.nan)
_COMMENT = re.compile(r"(?:^|\s)#")
"""Start of a comment; inside a word, ``#`` is part of a name."""
_ANY_COMMENT = re.compile("#")
"""Start of a comment in a line of numbers."""
_NUMERIC = ("v", "vt", "vn", "f")
"""Keywords of lines of numbers."""

_OPTIONS = {"-s": (1, 3), "-o": (1, 3), "-t": (1, 3), "-mm": (2, 2)} | dict.fromkeys(
    ("-blendu", "-blendv", "-clamp", "-cc", "-bm", "-boost", "-texres", "-imfchan", "-type"), (1, 1)
)
"""Options of images -> smallest and largest number of values."""


@dataclass
class _Material:
    """A material: diffuse colour, name of its image, and whether it is transparent."""

    diffuse: tuple[float, ...] = ()
    image: str = ""
    transparent: bool = False


@dataclass
class _Faces:
    """Triangles of one material: each has three indices of vertices and of texture coordinates.

    An index of -1 means that there is no texture coordinate.
    """

    vertices: array[int] = field(default_factory=lambda: array("q"))
    textures: array[int] = field(default_factory=lambda: array("q"))


def read_obj(content: bytes, linked_files: LinkedFiles) -> list[Part]:
    """The parts of a file, one for each material.

    Faces with more than three corners become triangle fans. Free-form surfaces, lines and points,
    and materials and images missing from the file's folder, are left out.

    Args:
        content: content of the file.
        linked_files: reader of materials and images.

    Raises:
        ValueError: the file is broken; the message contains the line.
    """
    reader = _Reader(linked_files)
    reader.read(decoded(content))
    return list(reader.parts())


class _Reader:
    """Reads the lines of a file.

    Attributes:
        vertices: x, y, z of each vertex.
        vertex_colours: red, green, blue of each vertex; nan for no colour.
        textures: u, v of each pair of texture coordinates.
        faces: name of a material, or an empty name -> its faces.
        materials: name -> material.
    """

    def __init__(self, linked_files: LinkedFiles):
        self.linked_files, self.line = linked_files, 0
        self.vertices, self.vertex_colours, self.textures = array("d"), array("d"), array("d")
        self.faces: dict[str, _Faces] = {}
        self.materials: dict[str, _Material] = {}
        self._material, self._count = "", TriangleCount()
        self._libraries = set[str]()
        self._largest_index = (0, 0)  # the largest index of a vertex, and its line

    def read(self, text: str) -> None:
        """Reads a text."""
        for self.line, words, line in _lines_with_words(text):
            key = words[0]
            if key == "f" and "-" not in line and "/0" not in line and self._plain_face(words):
                continue
            match key.lower():
                case "v":
                    x = self._numbers(words)
                    self.vertices.extend(x[:3])
                    self.vertex_colours.extend(x[3:6] if len(x) >= 6 else _NO_COLOUR)
                case "vt":
                    self.textures.extend((*self._numbers(words), 0.0)[:2])
                case "f" | "fo":
                    self._face(words[1:])
                case "usemtl":
                    self._material = " ".join(words[1:])
                case "mtllib":
                    self._library(_text_after_keyword(line, words))
        largest, self.line = self._largest_index
        if 3 * largest > len(self.vertices):
            self._raise_at_line(f"names vertex {largest}; the file has {len(self.vertices) // 3}")

    def parts(self) -> Iterator[Part]:
        """The triangles of each material."""
        vertices = np.array(self.vertices).reshape(-1, 3)
        vertex_colours = np.array(self.vertex_colours).reshape(-1, 3)
        if np.nanmax(vertex_colours, initial=0.0) > 1.0:
            vertex_colours /= 255.0
        for name, faces in self.faces.items():
            corners = np.array(faces.vertices, dtype=int).reshape(-1, 3)
            used_vertices, new_indices = np.unique(corners, return_inverse=True)
            material = self.materials.get(name)
            colours = None if material is None else self._colours(material, faces)
            if material is None and np.isfinite(vertex_colours[used_vertices]).all():
                colours = np.clip(vertex_colours[corners].mean(axis=1), 0.0, 1.0)
            ignored = ignored_properties(False, False)
            if material is not None:
                ignored = ignored_properties(bool(material.image), material.transparent)
            yield Part(vertices[used_vertices], new_indices.reshape(-1, 3), colours, ignored)

    def _colours(self, material: _Material, faces: _Faces) -> Array | None:
        """sRGB of triangles, from the image or the diffuse colour; None if there is no colour."""
        corners = np.array(faces.textures, dtype=int).reshape(-1, 3)
        is_textured = np.all((corners >= 0) & (2 * corners < len(self.textures)), axis=1)
        colours: Array = np.full((len(corners), 3), np.nan)
        if len(material.diffuse) == 3:
            colours[:] = np.clip(material.diffuse, 0.0, 1.0)
        pixels = linked_image(material.image, self.linked_files) if material.image else None
        if pixels is not None and is_textured.any():
            uv = np.array(self.textures).reshape(-1, 2)[corners[is_textured]]
            colours[is_textured] = srgb(Texture(pixels).average_over(uv * [1.0, -1.0] + [0.0, 1.0]))
        return colours if np.isfinite(colours).any() else None

    def _numbers(self, words: list[str]) -> list[float]:
        try:
            numbers = [float(word) for word in words[1:]]
        except ValueError:
            numbers = []
        minimum = _MIN_VALUES[words[0].lower()]
        if len(numbers) < minimum:
            needed = f"{minimum} number{'s' if minimum > 1 else ''} with decimal points"
            self._raise_at_line(f"found {' '.join(words)[:60]!r}; needed: {needed}")
        return numbers

    def _plain_face(self, words: list[str]) -> bool:
        """Adds a triangle with positive indices, the common case; returns whether it was one."""
        try:
            a, b, c = (corner.split("/", 2) for corner in words[1:])
            i, j, k = int(a[0]), int(b[0]), int(c[0])
            if "" in (a[1:2] + b[1:2] + c[1:2]) or len(a) == 1 or len(b) == 1 or len(c) == 1:
                u = v = w = 0
            else:
                u, v, w = int(a[1]), int(b[1]), int(c[1])
        except ValueError:
            return False
        largest = max(i, j, k)
        if min(i, j, k) < 1 or max(largest, u, v, w) > LIMITS.max_bytes:
            return False
        if largest > self._largest_index[0]:
            self._largest_index = largest, self.line
        faces = self.faces.get(self._material)
        if faces is None:
            faces = self.faces[self._material] = _Faces()
        self._count.add(1)
        faces.vertices.extend((i - 1, j - 1, k - 1))
        faces.textures.extend((u - 1, v - 1, w - 1))
        return True

    def _face(self, corners: list[str]) -> None:
        """Adds a face; indices count from 1, and negative ones backwards from this line."""
        try:
            indices = [[int(n) if n else None for n in corner.split("/")[:2]] for corner in corners]
        except ValueError:
            indices = [[None]]
        if any(vertex is None for vertex, *_ in indices):
            self._raise_at_line(
                f"found {' '.join(corners)[:60]!r}; needed: vertices such as 1, -1 or 1/2/3"
            )
        n_vertices, n_textures = len(self.vertices) // 3, len(self.textures) // 2
        vertices = [self._index(vertex, n_vertices) for vertex, *_ in indices]
        textures = [
            self._index(texture_indices[0], n_textures) if texture_indices else -1
            for _, *texture_indices in indices
        ]
        if len(corners) < 3:
            return  # it has no area
        self._count.add(len(corners) - 2)
        self._largest_index = max(self._largest_index, (max(vertices) + 1, self.line))
        faces = self.faces.setdefault(self._material, _Faces())
        for k in range(1, len(corners) - 1):
            faces.vertices.extend((vertices[0], vertices[k], vertices[k + 1]))
            faces.textures.extend((textures[0], textures[k], textures[k + 1]))

    def _index(self, number: int | None, count: int) -> int:
        """The 0-based index of a file's number after ``count`` entries; -1 for None."""
        if number is None:
            return -1
        index = number - 1 if number > 0 else count + number
        if number == 0 or not 0 <= index < LIMITS.max_bytes:
            allowed = f"1 and more, or {-count} to -1" if count else "1 and more"
            self._raise_at_line(f"found the index {number}; allowed here: {allowed}")
        return index

    def _library(self, names: str) -> None:
        """Reads one material file, whose name may contain spaces, or several."""
        if not self._add_library(names):
            for name in names.split():
                self._add_library(name)

    def _add_library(self, uri: str) -> bool:
        name = unquote(uri).replace("\\", "/").removeprefix("./")
        for path in dict.fromkeys((name, posixpath.basename(name))):
            try:
                if not path.lower().endswith(".mtl"):
                    return False
                if path in self._libraries:
                    return True
                self.materials |= _materials(decoded(self.linked_files.read(quote(path))))
            except ValueError:
                continue
            self._libraries.add(path)
            return True
        return False

    def _raise_at_line(self, text: str) -> NoReturn:
        raise ValueError(f"line {self.line}: {text}")


def _materials(text: str) -> dict[str, _Material]:
    """Name -> material of a material file."""
    materials: dict[str, _Material] = {}
    material = _Material()
    for _, words, line in _lines_with_words(text):
        value = _text_after_keyword(line, words)
        match words[0].lower():
            case "newmtl":
                material = materials[" ".join(words[1:])] = _Material()
            case "kd":
                material.diffuse = _colour(words[1:])
            case "map_kd" if value:
                material.image = _image_name(value)
            case "d":
                material.transparent |= _last_number(words, 1.0) != 1.0
            case "tr":
                material.transparent |= _last_number(words, 0.0) != 0.0
            case "map_d":
                material.transparent = True
    return materials


def _lines_with_words(text: str) -> Iterator[tuple[int, list[str], str]]:
    """Number, words and text, without comments, of each line that has words.

    A line that ends in a backslash is continued by the next one.
    """
    continued, number = "", 0
    for number, line in enumerate(lines_of(text.replace("\ufeff", "")), 1):
        if "#" in line:
            words = line.split(maxsplit=1)
            comment = _ANY_COMMENT if words[0].lower() in _NUMERIC else _COMMENT
            line = comment.split(line, maxsplit=1)[0]
        # The second byte of a character, read as Latin-1, may look like a backslash.
        if line.endswith("\\") and not (len(line) > 1 and line[-2] > "\x7f"):
            continued += line[:-1]
            continue
        line, continued = continued + line, ""
        if words := line.split():
            yield number, words, line
    if words := continued.split():
        yield number, words, continued


def _text_after_keyword(line: str, words: list[str]) -> str:
    """The rest of a line after its first word."""
    return line.strip()[len(words[0]) :].strip()


def _image_name(text: str) -> str:
    """Name of an image, which may contain spaces, behind its options such as ``-s 2 2 1``."""
    while (option := text.split(maxsplit=1)) and option[0].lower() in _OPTIONS:
        n_min, n_max = _OPTIONS[option[0].lower()]
        if len(option) < 2:
            return ""
        text = option[1]
        for k in range(n_max):
            value, *tail = text.split(maxsplit=1)
            if not tail or (k >= n_min and not _is_number(value)):
                break
            text = tail[0]
    if text.startswith("-"):  # an unknown option
        text = text.split()[-1]
    return text.strip('"')


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _colour(words: list[str]) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        return ()


def _last_number(words: list[str], default: float) -> float:
    try:
        return float(words[-1])
    except ValueError:
        return default
