"""Lint of language: fragments, filler names and unknown words in docstrings, comments and messages.

    python .ci/language.py           checks CHECKED, without REMAINING; exit status 1 on any finding
    python .ci/language.py PATH ...  checks these files and folders instead

Every finding is `file:line: text: reason; remedy`. Words are known from the dictionary, the
glossary, the identifiers of the code and TERMS.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from spellchecker import SpellChecker

ROOT = Path(__file__).parent.parent

# Files and folders that pass. It grows until it is `src tests docs examples benchmarks .ci`.
CHECKED = (".ci/language.py", "tests/test_language.py")
# Not yet, inside CHECKED: remove a line to get the list of its findings.
REMAINING: tuple[str, ...] = ()

# (kind of text, pattern, reason and remedy). Kinds: opening of a docstring; entry of its Args,
# Attributes, Returns or Raises; prose (docstrings, comments, messages); local name; constant.
PATTERNS = [
    (
        "opening",
        r"(What|How|Who|Whose|Whom|By|Of|From|Within|Where|When|Why|In|As|On|With|That|Those)\b",
        "fragment; begin with a noun or a verb: what the caller gets",
    ),
    (
        "entry",
        r"(of|by|as|from|what|how|who|whose|whom|where|when|why|in|on|that|those|with)\b(?! of)",
        "fragment; begin with the noun: `mass: mass of the body [kg]`",
    ),
    (
        "prose",
        r"\b(by|of|for|from|on) (what|whom)\b|\bwhat (it|they|there|comes|lies|remains|one)\b",
        "clause in the place of a noun; name the thing",
    ),
    ("prose", r"\b(by|of) how (much|many|far)\b", "clause in the place of a quantity; name it"),
    (
        "prose",
        r"\b(ever (less|more)|astray|untold|whomsoever|whatsoever)\b",
        "dialect; say it plainly",
    ),
    (
        "prose",
        r"\b(is|are|was|were|has|have) none\b|\bnone of (this|these|those)\b",
        "dialect; say `there is no ...` or `is not a ...`",
    ),
    (
        "local",
        r"(found|one|made|given|kept|some|far|most|least|anyway|room|told|looks|much|few)$",
        "filler; name it after its value: `pose`, `string`",
    ),
    (
        "constant",
        r"_?(LEAST|MOST|STILL|FAR|NEAR|MUCH|MANY|FEW|WILD|FOREVER|ENOUGH|LONG|SMALL|TINY|CLOSE)"
        r"(_|$)",
        "names no quantity; write `MIN_STEP_LENGTH = 1e-3  # m`",
    ),
]

# Words of mathematics, computing and references that neither dictionary nor glossary has.
TERMS = set(
    """
    """.split()
)

_QUOTED = re.compile(
    r"``.*?``|:\w+:`.*?`|`[^`\n]*`|https?://\S+|\S+\.(?:py|hpp|md|yaml)\b", re.DOTALL
)
_WORD = re.compile(r"(?<![\w.'/\\:{<%=-])[a-z]+(?:-[a-z]+)*(?![\w`(/}=]|\.\w)")
_ENTRY = re.compile(r"^ +[*\w]+(?:, [*\w]+)*: (?=[a-z])", re.MULTILINE)
_BRITISH = [
    ("our", "or"),
    ("is", "iz"),
    ("ys", "yz"),
    ("tre", "ter"),
    ("ll", "l"),
    ("ence", "ense"),
]

Texts = Iterator[tuple[str, int, str]]  # kind, line, text


def python_texts(source: str) -> Texts:
    """Docstrings, comments, messages, names of locals and constants of a Python file."""
    tree = ast.parse(source)
    nodes = list(ast.walk(tree))
    documented = {n.value for n in nodes if isinstance(n, ast.Expr)}
    constants = {t for n in tree.body if isinstance(n, ast.Assign) for t in n.targets}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if node in documented:
                yield "docstring", node.lineno, node.value
            elif re.search(r"\w,? [a-z]\w", node.value):
                yield "message", node.lineno, node.value
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield "constant" if node in constants else "local", node.lineno, node.id
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT and "noqa" not in token.string:
            yield "comment", token.start[0], token.string.lstrip("# ").split("type: ignore")[0]


def other_texts(path: Path, source: str) -> Texts:
    """Comments of a C++ file, or the prose of a page without its code."""
    if path.suffix == ".md":
        prose = re.sub(r"```.*?```", lambda m: "\n" * m[0].count("\n"), source, flags=re.DOTALL)
        yield "page", 1, prose
    else:
        for match in re.finditer(r"//(.*)|/\*.*?\*/", source, re.DOTALL if False else 0):
            yield "comment", source.count("\n", 0, match.start()) + 1, match[0].lstrip("/ ")


def findings(path: Path) -> Iterator[str]:
    """Every finding of a file, in the order of its lines."""
    source = path.read_text(encoding="utf-8")
    texts = python_texts(source) if path.suffix == ".py" else other_texts(path, source)
    name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    lines = [
        (line + extra, text, why) for kind, line, t in texts for extra, text, why in check(kind, t)
    ]
    for line, text, why in sorted(set(lines)):
        yield f"{name}:{line}: {text!r}: {why}"


def check(kind: str, text: str) -> Iterator[tuple[int, str, str]]:
    """Findings of a text: line within it, the words, reason and remedy."""
    if kind in ("local", "constant"):
        for wanted, pattern, why in PATTERNS:
            if wanted == kind and re.match(pattern, text):
                yield 0, text, why
        return
    plain = _QUOTED.sub(lambda m: "`" + "\n" * m[0].count("\n"), text)
    for wanted, pattern, why in PATTERNS:
        places: list[re.Match[str] | None] = []
        if wanted == "opening" and kind == "docstring":
            places = [re.match(pattern, plain)]
        elif wanted == "entry" and kind == "docstring":
            places = [re.compile(pattern).match(plain, m.end()) for m in _ENTRY.finditer(plain)]
        elif wanted == "prose":
            places = list(re.finditer(pattern, plain))
        for match in filter(None, places):
            yield plain.count("\n", 0, match.start()), match[0], why
    for match in _WORD.finditer(plain):
        for word in match[0].split("-"):
            if len(word) > 2 and not known(word):
                why = "unknown word; spell it, put code in backticks, or define it in the glossary"
                yield plain.count("\n", 0, match.start()), word, why


@cache
def known(word: str) -> bool:
    """Whether the dictionary (in either spelling), the glossary, the code or TERMS has a word."""
    if word in _names() or word in TERMS:
        return True
    variants = {word} | {word.replace(a, b) for a, b in _BRITISH}
    return any(variant in _dictionary() for variant in variants)


@cache
def _dictionary() -> SpellChecker:
    return SpellChecker()


@cache
def _names() -> set[str]:
    """Words of the glossary and of the identifiers of the package."""
    words = set(re.findall(r"[a-z]+", (ROOT / "docs/glossary.md").read_text("utf-8").lower()))
    for path in (ROOT / "src").rglob("*.py"):
        for token in tokenize.generate_tokens(io.StringIO(path.read_text("utf-8")).readline):
            if token.type == tokenize.NAME:
                words.update(part.lower() for part in re.findall("[A-Z]?[a-z]+", token.string))
    return words


def files(paths: list[Path]) -> Iterator[Path]:
    """Python, C++ and Markdown files of files and folders, without those of REMAINING."""
    left_out = [ROOT / name for name in REMAINING]
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.suffix in (".py", ".hpp", ".cpp", ".md") and not any(
                file.is_relative_to(folder) for folder in left_out
            ):
                yield file


if __name__ == "__main__":
    chosen = [Path(name).resolve() for name in sys.argv[1:]] or [ROOT / name for name in CHECKED]
    lines = [line for file in files(chosen) for line in findings(file)]
    print(*lines, sep="\n", end="\n" if lines else "")
    sys.exit(bool(lines))
