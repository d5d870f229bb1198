"""HTML of reports, displays in notebooks and the panels of the browser's pages.

Texts are escaped where elements are written: no other module writes markup.

To escape a text is to replace its special characters, so that a browser does not read them as
markup.
"""

from fantoccini.output.html.elements import (
    Content,
    Element,
    element,
    figure_image,
    line_elements,
    to_html,
)
from fantoccini.output.html.page import Page, Table, write_page

__all__ = [
    "Content",
    "Element",
    "Page",
    "Table",
    "element",
    "figure_image",
    "line_elements",
    "to_html",
    "write_page",
]
