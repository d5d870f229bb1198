"""Colours of triangles from factors, vertex colours and textures."""

from __future__ import annotations

import io
import posixpath
from dataclasses import dataclass
from urllib.parse import quote, unquote

import numpy as np

from fantoccini.base import Array
from fantoccini.model.meshes.limits import LIMITS
from fantoccini.model.meshes.linked_files import LinkedFiles

_SAMPLES_PER_SIDE = 4
"""A texture is averaged over the centres of 4 x 4 subdivisions of a triangle."""


@dataclass(frozen=True, eq=False)
class Texture:
    """An image, and its continuation beyond its edges.

    Attributes:
        pixels: (height, width, 3) sRGB bytes, rows from the top.
        repeats: (2,) whether it repeats along u and v; otherwise its edge pixels continue.
    """

    pixels: np.ndarray
    repeats: tuple[bool, bool] = (True, True)

    def over(self, uv: Array) -> Array:
        """(m, 3) linear colours of triangles, from their uv (m, 3, 2), with v from the top."""
        height, width = self.pixels.shape[:2]
        total = np.zeros((len(uv), 3))
        points = _sample_points()
        for weights in points:
            at = np.einsum("k,mkc->mc", weights, uv)
            places = []
            for axis, size in enumerate((width, height)):
                n = np.floor(np.nan_to_num(at[:, axis] * size, posinf=0.0, neginf=0.0))
                wrapped = n % size if self.repeats[axis] else np.clip(n, 0, size - 1)
                places.append(wrapped.astype(int))
            total += linear(self.pixels[places[1], places[0]] / 255.0)
        return total / len(points)


def image(content: bytes, name: str) -> np.ndarray:
    """(height, width, 3) sRGB bytes of an image in PNG, JPEG or WebP format.

    Raises:
        ValueError: the image is too large or cannot be read.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=("PNG", "JPEG", "WEBP")) as opened:
            width, height = opened.size
            if width * height <= LIMITS.max_pixels:
                return np.asarray(opened.convert("RGB"))
    except Exception as reason:  # Pillow raises errors of many classes for broken images
        text = f"its image {name} is not a PNG, JPEG or WebP that can be read"
        raise ValueError(text) from reason
    allowed = f"{LIMITS.max_pixels / 1e6:.0f} million"
    raise ValueError(f"its image {name} has {width} x {height} pixels; allowed: {allowed}")


def linked_image(path: str, beside: LinkedFiles) -> np.ndarray | None:
    """The image at a path or, if it cannot be read, the one of that name in the mesh's folder.

    Paths are often those of the machine that wrote the file. None if neither can be read.
    """
    names = [p.replace("\\", "/").removeprefix("./") for p in (unquote(path), path)]
    for place in dict.fromkeys([*names, *map(posixpath.basename, names)]):
        try:
            return image(beside.read(quote(place)), repr(place[:40]))
        except ValueError:
            continue
    return None


def linear(colour: Array) -> Array:
    """Converts sRGB to linear red, green and blue."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def srgb(colour: Array) -> Array:
    """Converts linear red, green and blue to sRGB."""
    colour = np.clip(np.nan_to_num(colour), 0.0, 1.0)
    bent = 1.055 * colour ** (1.0 / 2.4) - 0.055
    return np.where(colour <= 0.0031308, 12.92 * colour, bent)


def reduced(colours: Array) -> Array:
    """The sRGB colours (m, 3), reduced to ``LIMITS.max_colours`` by median cut; nan stays nan."""
    from PIL import Image

    out = np.array(colours, dtype=float)
    known = np.isfinite(out).all(axis=1)
    if not known.any():
        return out
    exact = np.round(255.0 * np.clip(out[known], 0.0, 1.0)).astype(np.uint8)
    if len(np.unique(exact, axis=0)) > LIMITS.max_colours:
        row = Image.fromarray(exact[None, :, :])
        merged = row.quantize(
            LIMITS.max_colours, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
        )
        exact = np.asarray(merged.convert("RGB"))[0]
    out[known] = exact / 255.0
    out[~known] = np.nan
    return out


def _sample_points() -> Array:
    """(16, 3) barycentric coordinates of the centres of the subdivisions."""
    n, out = _SAMPLES_PER_SIDE, []
    for i in range(n):
        for j in range(n - i):
            out.append((i + 1 / 3, j + 1 / 3))
            if i + j < n - 1:
                out.append((i + 2 / 3, j + 2 / 3))
    first = np.array(out) / n
    return np.column_stack([first, 1.0 - first.sum(axis=1)])
