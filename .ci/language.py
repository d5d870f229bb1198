"""Lint of language: fragments, filler names and unknown words in docstrings, comments and messages.

    python .ci/language.py           checks ROOTS, without the remaining files of language.toml
    python .ci/language.py PATH ...  checks these files and folders

It prints `file:line: text: remedy` for every finding, and its exit status is 1 if there are any. A
word is known if the dictionary (in American or British spelling), the glossary, the identifiers of
the package or language.toml contain it. Python, headers of C++ and Markdown are checked, but not
code in backticks.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from spellchecker import SpellChecker

FOLDER = Path(__file__).resolve().parents[1]
ROOTS = ("src", "docs", "examples", "tests", "benchmarks", ".ci")
TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))

_QUOTED = re.compile(
    r"```.*?```|``.*?``|`[^`]*`|https?://\S+|[^\s`]+\.(?:py|hpp|md|yaml)\b", re.DOTALL
)
_CODE = re.compile(r"[;{}]\s*\n|#(include|define|if|pragma|undef)|\b(const|static|void)\b|::|</")
_WORD = re.compile(r"(?<![\w.'/\\:#{<%=*^-])[a-z]{3,}(?:-[a-z]{3,})*(?![\w`(/}=^]|\.\w)")
_ENTRY = re.compile(r"^ +[*\w]+(?:, [*\w]+)*: (?=[a-z])", re.MULTILINE)
_BRITISH = ("our/or", "is/iz", "ys/yz", "tre/ter", "ll/l", "ence/ense")

Finding = tuple[int, str, str]
"""Line, text, remedy."""


def findings(path: Path) -> list[Finding]:
    """Every finding of a file, in the order of its lines."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        texts = _python(source)
    elif path.suffix == ".md":
        texts = iter([("page", 1, source)])
    else:
        comments = re.finditer("//.*", source)
        texts = (("comment", source.count("\n", 0, m.start()) + 1, m[0]) for m in comments)
    return sorted({finding for kind, line, text in texts for finding in _check(kind, line, text)})


def _python(source: str) -> Iterator[tuple[str, int, str]]:
    """Kind, line and text of docstrings, comments, messages, locals and constants."""
    tree = ast.parse(source)
    nodes = list(ast.walk(tree))
    docstrings = {n.value for n in nodes if isinstance(n, ast.Expr)}
    fields = {
        s.target for n in nodes if isinstance(n, ast.ClassDef) for s in n.body if _is_field(s)
    }
    constants = {t for n in tree.body if isinstance(n, ast.Assign) for t in n.targets}
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if node in docstrings:
                yield "docstring", node.lineno, node.value
            elif re.search(r"\w,? [a-z]\w", node.value) and not _CODE.search(node.value):
                yield "message", node.lineno, node.value
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node not in fields:
            yield "constant" if node in constants else "local", node.lineno, node.id
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT and not re.match("# (noqa|type)", token.string):
            yield "comment", token.start[0], token.string


def _is_field(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.AnnAssign)


def _check(kind: str, line: int, text: str) -> Iterator[Finding]:
    """Findings of a text that begins in a line."""
    is_name = kind in ("local", "constant")
    plain = text if is_name else _QUOTED.sub(lambda m: "`" + "\n" * m[0].count("\n"), text)
    starts = {
        kind: [0],
        "opening": [0] if kind == "docstring" else [],
        "entry": [m.end() for m in _ENTRY.finditer(plain)] if kind == "docstring" else [],
    }
    for pattern in TABLE["patterns"]:
        regex = re.compile(pattern["pattern"])
        if "prose" in pattern["kinds"]:
            matches = [] if is_name else [*regex.finditer(plain)]
        else:
            places = [k for name in pattern["kinds"] for k in starts.get(name, ())]
            matches = [m for k in places if (m := regex.match(plain, k))]
        for match in matches:
            yield line + plain.count("\n", 0, match.start()), match[0], pattern["remedy"]
    for match in () if is_name else _WORD.finditer(plain):
        for word in match[0].split("-"):
            if not known(word):
                remedy = "unknown word; spell it, put code in backticks, or add it to the glossary"
                yield line + plain.count("\n", 0, match.start()), word, remedy


@cache
def known(word: str) -> bool:
    """Whether a lower-case word is known; names of derivatives such as `phidot` are."""
    if word.endswith("dot") or word in _names():
        return True
    pairs = (pair.split("/") for pair in _BRITISH)
    return any(w in _dictionary() for w in (word, *(word.replace(a, b) for a, b in pairs)))


@cache
def _dictionary() -> SpellChecker:
    return SpellChecker()


@cache
def _names() -> set[str]:
    """Words of the table, the glossary and the identifiers of the package."""
    glossary = (FOLDER / "docs/glossary.md").read_text("utf-8").lower()
    words = {*TABLE["words"], *re.findall("[a-z]+", glossary)}
    for path in (FOLDER / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            for field in ("id", "name", "attr", "arg", "module"):
                if isinstance(name := getattr(node, field, None), str):
                    words.update(part.lower() for part in re.findall("[A-Z]?[a-z]+", name))
    return words


def files(paths: list[Path], left_out: list[str]) -> Iterator[Path]:
    """The files to check among files and folders."""
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            is_left_out = any(file.is_relative_to(FOLDER / name) for name in left_out)
            if file.suffix in (".py", ".hpp", ".md") and not is_left_out:
                yield file


if __name__ == "__main__":
    arguments = [Path(argument).resolve() for argument in sys.argv[1:]]
    left_out = [] if arguments else TABLE["remaining"]
    n_findings = 0
    for checked in files(arguments or [FOLDER / root for root in ROOTS], left_out):
        for line, text, remedy in findings(checked):
            n_findings += 1
            print(f"{checked.relative_to(FOLDER)}:{line}: {text!r}: {remedy}")
    sys.exit(n_findings > 0)
