"""Captions at the lower edge of films, and as files for players.

A caption is a text with the time at which it is shown.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fantoccini.base import replacing
from fantoccini.output.view.drawing import Sheet, one_line

if TYPE_CHECKING:
    from matplotlib.text import Text

    from fantoccini.theatre.gestures import Caption

_RELATIVE_FONT_SIZE = 1.7
"""Font size, relative to that of other text."""
_LETTER_WIDTH = 0.56
"""Mean width of a letter, relative to the font size."""
_LINE_HEIGHT = 1.45
"""Height of a line, relative to the font size."""
_SHRINK_FACTOR = 0.9
"""Factor on the font size while captions take too much of the picture."""
_MAX_LETTERS = 400
"""Largest number of letters of a caption that are shown."""


def save_captions(
    captions: Sequence[Caption], path: str | os.PathLike[str], start: float, end: float
) -> Path:
    """Writes captions as a SubRip file (``.srt``), which players show over a film.

    Args:
        captions: captions, in the motion's time.
        path: path of the file.
        start, end: times of the motion at which the film begins and ends [s]. Other captions are
            left out; times in the file count from the film's start.
    """
    shown_captions = sorted(
        (c for c in captions if c.start < end and c.end > start), key=lambda c: c.start
    )
    entries = []
    for k, caption in enumerate(shown_captions, 1):
        begin_time, end_time = max(caption.start, start) - start, min(caption.end, end) - start
        text = one_line(str(caption), len(str(caption)))  # an empty line would end the entry
        entries.append(f"{k}\n{_srt_time(begin_time)} --> {_srt_time(end_time)}\n{text}\n")
    path = Path(path)
    with replacing(path) as temporary:
        temporary.write_text("\n".join(entries), encoding="utf-8", newline="\n")
    return path


def _srt_time(seconds: float) -> str:
    """Time in a SubRip file: hours, minutes, seconds and milliseconds."""
    milliseconds = round(1e3 * seconds)
    minutes, milliseconds = divmod(milliseconds, 60_000)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02}:{minutes:02}:{milliseconds // 1000:02},{milliseconds % 1000:03}"


class Subtitles:
    """Captions of one film, drawn below the picture.

    Attributes:
        height: height of the largest number of lines shown at once [px]; 0 without captions.

    Args:
        captions: words, speakers and times, in the motion's time.
        width: width of the film [px].
        unit: font size of other text [px].
        max_height: largest height; the font shrinks to keep it [px].
    """

    def __init__(self, captions: Sequence[Caption], width: int, unit: float, max_height: float):
        self._font_size, self._centre_x = _RELATIVE_FONT_SIZE * unit, 0.5 * width
        self._text: Text | None = None
        in_order = sorted(captions, key=lambda caption: caption.start)
        while True:
            letters = max(8, int(0.92 * width / (_LETTER_WIDTH * self._font_size)))
            self._captions = [
                (
                    caption.start,
                    caption.end,
                    textwrap.wrap(one_line(str(caption), _MAX_LETTERS), letters) or [""],
                )
                for caption in in_order
            ]
            # The number of lines is largest when a caption begins.
            lines = max((len(self._lines(start)) for start, *_ in self._captions), default=0)
            self.height = lines * _LINE_HEIGHT * self._font_size
            if self.height <= max_height:
                break
            self._font_size *= _SHRINK_FACTOR

    def place(self, sheet: Sheet, bottom: float) -> None:
        """Creates the text, with its lower edge at ``bottom`` [px]."""
        if self._captions:
            self._text = sheet.add_text(
                self._centre_x,
                bottom,
                "",
                self._font_size,
                sheet.theme.text,
                ha="center",
                va="bottom",
                animated=True,
            )

    def at(self, t: float) -> list[Text]:
        """The text at time ``t`` [s]: all current captions, in the order of their start."""
        lines = self._lines(t)
        if self._text is None or not lines:
            return []
        self._text.set_text("\n".join(lines))
        return [self._text]

    def _lines(self, t: float) -> list[str]:
        return [line for start, end, words in self._captions if start <= t < end for line in words]
