"""HTML elements: trees of the standard library, which escapes every text and attribute."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Literal
from xml.etree.ElementTree import Element, tostring

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Content = Element | str
"""A part of an element: another element, or plain text."""


def element(tag: str, *content: Content, **attributes: str) -> Element:
    """An element with its content in order.

    Args:
        tag: ``p``; of SVG as well.
        content: elements and plain texts. What cannot be printed becomes U+FFFD.
        attributes: ``class_`` is written as ``class``, ``stroke_width`` as ``stroke-width``; an
            empty text leaves an attribute out.
    """
    names = {name.rstrip("_").replace("_", "-"): text for name, text in attributes.items()}
    made = Element(tag, {name: _printable(text) for name, text in names.items() if text})
    for part in content:
        if isinstance(part, Element):
            made.append(part)
        elif len(made):
            made[-1].tail = (made[-1].tail or "") + _printable(part)
        else:
            made.text = (made.text or "") + _printable(part)
    return made


def lines(texts: Iterable[str], tag: str = "div") -> list[Element]:
    """Plain texts, each in an element of its own."""
    return [element(tag, text) for text in texts]


def picture(
    figure: Figure, alt: str, form: Literal["svg", "png"], dpi: float | None = None, **look: str
) -> Element:
    """A drawing inside the page; in SVG, its names cannot clash with those of another.

    Args:
        figure: to draw.
        alt: words that replace it.
        form: PNG is smaller for many points.
        dpi: resolution of PNG; the figure's own when not given.
        look: attributes such as ``style``.
    """
    content = io.BytesIO()
    figure.savefig(content, format=form, dpi=dpi or "figure", facecolor=figure.get_facecolor())
    data = base64.b64encode(content.getvalue()).decode("ascii")
    kind = {"svg": "svg+xml", "png": "png"}[form]
    return element("img", alt=alt, src=f"data:image/{kind};base64,{data}", **look)


def to_html(*parts: Element) -> str:
    """Elements as text."""
    return "".join(tostring(part, encoding="unicode", method="html") for part in parts)


def _printable(text: str) -> str:
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c.isspace() else "\N{REPLACEMENT CHARACTER}" for c in text
    )
