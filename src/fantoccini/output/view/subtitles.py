"""Captions at the lower edge of films."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fantoccini.output.view.drawing import Sheet, plain

if TYPE_CHECKING:
    from matplotlib.text import Text

    from fantoccini.theatre.gestures import Caption

_SIZE = 1.7
"""Height of the letters over that of other text."""
_LETTER = 0.56
"""Mean width of a letter over its height."""
_LEADING = 1.45
"""Height of a line over that of its letters."""
_SMALLER = 0.9
"""Factor of the letters' height where captions would take too much of the picture."""
_LONGEST = 400
"""Letters of a caption that are shown."""


class Subtitles:
    """Captions of one film, drawn below the picture.

    Attributes:
        room: height of the largest number of lines shown at once [px]; 0 without captions.

    Args:
        captions: words, speakers and times, on the motion's clock.
        width: of the film [px].
        unit: height of other text [px].
        most: largest height; letters become smaller to keep it [px].
    """

    def __init__(self, captions: Sequence[Caption], width: int, unit: float, most: float):
        self._size, self._middle = _SIZE * unit, 0.5 * width
        self._text: Text | None = None
        in_order = sorted(captions, key=lambda one: one.start)
        while True:
            letters = max(8, int(0.92 * width / (_LETTER * self._size)))
            self._captions = [
                (one.start, one.end, textwrap.wrap(plain(str(one), _LONGEST), letters) or [""])
                for one in in_order
            ]
            # The number of lines is largest at the beginning of a caption.
            lines = max((len(self._lines(start)) for start, *_ in self._captions), default=0)
            self.room = lines * _LEADING * self._size
            if self.room <= most:
                break
            self._size *= _SMALLER

    def place(self, sheet: Sheet, low: float) -> None:
        """Makes the text, with its lower edge at a height [px]."""
        if self._captions:
            self._text = sheet.write(
                self._middle,
                low,
                "",
                self._size,
                sheet.theme.ink,
                ha="center",
                va="bottom",
                animated=True,
            )

    def at(self, t: float) -> list[Text]:
        """The text at a time: all current captions, in order of their beginning."""
        lines = self._lines(t)
        if self._text is None or not lines:
            return []
        self._text.set_text("\n".join(lines))
        return [self._text]

    def _lines(self, t: float) -> list[str]:
        return [line for start, end, own in self._captions if start <= t < end for line in own]
