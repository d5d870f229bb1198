"""HTML elements as trees of the standard library, which escapes every text and attribute."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Literal
from xml.etree.ElementTree import Element, tostring

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Content = Element | str
"""Part of an element: another element, or plain text."""


def element(tag: str, *content: Content, **attributes: str) -> Element:
    """An element with its content, in order.

    Args:
        tag: tag of HTML or SVG, such as ``p``.
        content: elements and plain texts. Unprintable characters become U+FFFD.
        attributes: ``class_`` is written as ``class``, ``stroke_width`` as ``stroke-width``;
            attributes with an empty text are left out.
    """
    names = {name.rstrip("_").replace("_", "-"): text for name, text in attributes.items()}
    parent = Element(
        tag, {name: _replace_unprintable(text) for name, text in names.items() if text}
    )
    for part in content:
        if isinstance(part, Element):
            parent.append(part)
        elif len(parent):
            parent[-1].tail = (parent[-1].tail or "") + _replace_unprintable(part)
        else:
            parent.text = (parent.text or "") + _replace_unprintable(part)
    return parent


def line_elements(texts: Iterable[str], tag: str = "div") -> list[Element]:
    """Plain texts, each in its own element."""
    return [element(tag, text) for text in texts]


def figure_image(
    figure: Figure,
    alt: str,
    image_format: Literal["svg", "png"],
    dpi: float | None = None,
    **attributes: str,
) -> Element:
    """Figure embedded as an image, so that names inside several SVGs cannot clash.

    Args:
        figure: figure to draw.
        alt: alternative text.
        image_format: format; PNG is smaller for many points.
        dpi: resolution of PNG; by default the figure's.
        attributes: attributes such as ``style``.
    """
    content = io.BytesIO()
    figure.savefig(
        content, format=image_format, dpi=dpi or "figure", facecolor=figure.get_facecolor()
    )
    data = base64.b64encode(content.getvalue()).decode("ascii")
    subtype = {"svg": "svg+xml", "png": "png"}[image_format]
    return element("img", alt=alt, src=f"data:image/{subtype};base64,{data}", **attributes)


def to_html(*parts: Element) -> str:
    """Elements as text."""
    return "".join(tostring(part, encoding="unicode", method="html") for part in parts)


def _replace_unprintable(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in text
    )
