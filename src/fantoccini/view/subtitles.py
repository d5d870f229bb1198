"""Captions at the lower edge of films."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fantoccini.view.drawing import Sheet, plain

if TYPE_CHECKING:
    from matplotlib.text import Text

    from fantoccini.gestures import Caption

_SIZE = 1.7
"""Height of the letters over that of other text."""
_LETTER = 0.56
"""Mean width of a letter over its height."""
_LEADING = 1.45
"""Height of a line over that of its letters."""
_LONGEST = 400
"""Letters of a caption that are shown."""


class Subtitles:
    """Captions of one film, drawn below the picture.

    Attributes:
        room: height of the longest one [px]; 0 without captions.

    Args:
        captions: what is to be read when, on the motion's clock.
        width: of the film [px].
        unit: height of other text [px].
    """

    def __init__(self, captions: Sequence[Caption], width: int, unit: float):
        self._size, self._middle, self._unit = _SIZE * unit, 0.5 * width, unit
        letters = max(8, int(0.92 * width / (_LETTER * self._size)))
        self._captions = [
            (one.start, one.end, textwrap.wrap(plain(one.text, _LONGEST), letters) or [""])
            for one in captions
        ]
        most = max((len(lines) for *_, lines in self._captions), default=0)
        self.room = most * _LEADING * self._size
        self._text: Text | None = None

    def place(self, sheet: Sheet, low: float) -> None:
        """Makes the text, with its lower edge at a height [px]."""
        if self._captions:
            self._text = sheet.write(
                self._middle, low, "", self._size, sheet.theme.ink, ha="center", va="bottom",
                animated=True,
            )  # fmt: skip

    def at(self, t: float) -> list[Text]:
        """What is to be read at a time; of several captions the last that has begun."""
        shown = [one for one in self._captions if one[0] <= t < one[1]]
        if self._text is None or not shown:
            return []
        self._text.set_text("\n".join(max(shown, key=lambda one: one[0])[2]))
        return [self._text]
