"""Colours of triangles from factors, vertex colours and textures.

sRGB is the usual encoding of colours in files; linear colours are proportional to light, as mixing
requires.
"""

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

    def average_over(self, uv: Array) -> Array:
        """(m, 3) linear colours of triangles, from their uv (m, 3, 2), with v from the top."""
        height, width = self.pixels.shape[:2]
        total = np.zeros((len(uv), 3))
        points = _sample_points()
        for weights in points:
            pixel_uv = np.einsum("k,mkc->mc", weights, uv)
            pixel_indices = []
            for axis, size in enumerate((width, height)):
                index = np.floor(np.nan_to_num(pixel_uv[:, axis] * size, posinf=0.0, neginf=0.0))
                index_in_image = index % size if self.repeats[axis] else np.clip(index, 0, size - 1)
                pixel_indices.append(index_in_image.astype(int))
            total += linear(self.pixels[pixel_indices[1], pixel_indices[0]] / 255.0)
        return total / len(points)


def image(content: bytes, name: str) -> np.ndarray:
    """(height, width, 3) sRGB bytes of an image in PNG, JPEG or WebP format.

    Raises:
        ValueError: the image is too large or cannot be read.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=("PNG", "JPEG", "WEBP")) as picture:
            width, height = picture.size
            if width * height <= LIMITS.max_pixels:
                return np.asarray(picture.convert("RGB"))
    except Exception as reason:  # Pillow raises errors of many classes for broken images
        text = f"its image {name} is not a PNG, JPEG or WebP that can be read"
        raise ValueError(text) from reason
    allowed = f"{LIMITS.max_pixels / 1e6:.0f} million"
    raise ValueError(f"its image {name} has {width} x {height} pixels; allowed: {allowed}")


def linked_image(path: str, linked_files: LinkedFiles) -> np.ndarray | None:
    """The image at a path or, if it cannot be read, the one of that name in the mesh's folder.

    Paths are often those of the machine that wrote the file. None if neither can be read.
    """
    names = [path_text.replace("\\", "/").removeprefix("./") for path_text in (unquote(path), path)]
    for name in dict.fromkeys([*names, *map(posixpath.basename, names)]):
        try:
            return image(linked_files.read(quote(name)), repr(name[:40]))
        except ValueError:
            continue
    return None


def linear(colour: Array) -> Array:
    """Converts sRGB to linear red, green and blue."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def srgb(colour: Array) -> Array:
    """Converts linear red, green and blue to sRGB."""
    colour = np.clip(np.nan_to_num(colour), 0.0, 1.0)
    gamma_encoded = 1.055 * colour ** (1.0 / 2.4) - 0.055
    return np.where(colour <= 0.0031308, 12.92 * colour, gamma_encoded)


def reduced(colours: Array) -> Array:
    """The sRGB colours (m, 3), reduced to ``LIMITS.max_colours`` by median cut; nan stays nan."""
    from PIL import Image

    reduced_colours = np.array(colours, dtype=float)
    is_known = np.isfinite(reduced_colours).all(axis=1)
    if not is_known.any():
        return reduced_colours
    bytes_ = np.round(255.0 * np.clip(reduced_colours[is_known], 0.0, 1.0)).astype(np.uint8)
    if len(np.unique(bytes_, axis=0)) > LIMITS.max_colours:
        image_row = Image.fromarray(bytes_[None, :, :])
        quantised = image_row.quantize(
            LIMITS.max_colours, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE
        )
        bytes_ = np.asarray(quantised.convert("RGB"))[0]
    reduced_colours[is_known] = bytes_ / 255.0
    reduced_colours[~is_known] = np.nan
    return reduced_colours


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
