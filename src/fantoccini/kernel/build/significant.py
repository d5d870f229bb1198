"""Source text without its insignificant parts: comments, docstrings, blank lines.

It is scanned, not parsed: a parser's output depends on the Python version, and all versions share
one cache.
"""

from __future__ import annotations

import re

_PYTHON = re.compile(
    r"""\#[^\n]*
    | "{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"{3} | "[^"\\\n]*(?:\\.[^"\\\n]*)*"
    | '{3}[^'\\]*(?:(?:\\.|'(?!''))[^'\\]*)*'{3} | '[^'\\\n]*(?:\\.[^'\\\n]*)*'
    | [()\[\]{}\n]""",
    re.VERBOSE | re.DOTALL,
)
_LINE_END = re.compile(r"[ ]*(?:#[^\n]*)?(?:\n|\Z)")
_CPP = re.compile(r'("[^"\\]*(?:\\.[^"\\]*)*"|\'(?:\\.|[^\'\\])\')|//[^\n]*|/\*.*?\*/', re.DOTALL)


def significant_python(text: str) -> str:
    """A module's text without comments and blank lines, and with empty docstrings."""
    lines: list[str] = []
    line, depth, end = "", 0, 0
    for match in _PYTHON.finditer(text):
        line += text[end : match.start()]
        token, end = match[0], match.end()
        if token == "\n":
            if line.strip():
                lines.append(line.rstrip(" "))
            line = ""
        elif token[0] != "#":
            continued = depth or (lines and lines[-1].endswith("\\"))
            alone = not (continued or line.strip()) and _LINE_END.match(text, end)
            line += "''" if alone and token.startswith('"""') else token
            depth += (token in "([{") - (token in ")]}")
    return "\n".join([*lines, line + text[end:]])


def significant_cpp(text: str) -> str:
    """A header's text without comments, trailing blanks and blank lines."""
    text = _CPP.sub(lambda match: match[1] or " ", text)
    return "\n".join(line for line in map(str.rstrip, text.splitlines()) if line)
