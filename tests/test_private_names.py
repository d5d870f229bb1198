"""Private names stay private: no other module uses them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

OF_OTHERS = {
    "_fields_",  # of ctypes
    "_replace",  # of named tuples
    "_repr_html_",  # of IPython
    # Of viser, which has no public way: tests/show/test_viser_private.py
    "_background_event_loop",
    "_broadcast_buffer",
    "_client_state_from_id",
    "_impl",
    "_incoming_handlers",
    "_messages",
    "_websock_server",
}
"""Private names of libraries, and protocols, that tests and benchmarks use."""


ATTRIBUTES = {"getattr", "setattr", "delattr", "hasattr", "attrgetter"}
"""Functions with attribute names as arguments."""


def private(name: str) -> bool:
    """Whether a name begins with one underscore."""
    return name.startswith("_") and not name.startswith("__")


def private_uses(text: str) -> set[str]:
    """Private names that a file takes from elsewhere, as ``line: name``.

    Imports; attributes of anything but ``self``, ``cls`` and ``super()``; and names in strings:
    dotted ones, and those given to functions that read or set attributes.
    """
    uses: set[tuple[int, str]] = set()
    for node in ast.walk(ast.parse(text)):
        names: list[str] = []
        match node:
            case ast.Import():
                names = [part for alias in node.names for part in alias.name.split(".")]
            case ast.ImportFrom():
                names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
            case ast.Attribute(value=ast.Name(id="self" | "cls")):
                pass
            case ast.Attribute(value=ast.Call(func=ast.Name(id="super"))):
                pass
            case ast.Attribute():
                names = [node.attr]
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in ATTRIBUTES:
                texts = (
                    argument.value for argument in node.args if isinstance(argument, ast.Constant)
                )
                names = [text.rsplit(".", 1)[-1] for text in texts if isinstance(text, str)]
            case ast.Constant(value=str() as value) if re.fullmatch(r"fantoccini[\w.]+", value):
                names = value.split(".")
        uses |= {(node.lineno, name) for name in names if private(name)}  # type: ignore[attr-defined]
    return {f"{line}: {name}" for line, name in uses if name not in OF_OTHERS}


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "docs", "examples"])
def test_nothing_outside_touches_private_names(folder):
    """Private names of a module may change without changes elsewhere."""
    files = sorted((ROOT / folder).rglob("*.py"))
    assert files
    uses = {
        f"{file.relative_to(ROOT)}:{use}"
        for file in files
        for use in private_uses(file.read_text(encoding="utf-8"))
    }
    assert uses == set()


@pytest.mark.parametrize(
    "text",
    [
        "from fantoccini.kernel.build.closure import _PACKAGE",
        "from fantoccini import _hidden as shown",
        "import fantoccini._hidden",
        "from fantoccini._hidden import x",
        "closure._PACKAGE",
        "fan.kernel.build.closure._cache.clear()",
        "made().page._views = 1",
        'monkeypatch.setattr("fantoccini.kernel.build.closure._PACKAGE", 1)',
        'monkeypatch.setattr(closure, "_PACKAGE", 1)',
        'getattr(closure, "_PACKAGE")',
    ],
)
def test_uses_of_private_names_are_recognised(text):
    assert len(private_uses(text)) == 1
    assert private_uses(text.replace("._", ".").replace(" _", " ").replace('"_', '"')) == set()


def test_own_private_names_and_those_of_others_are_allowed():
    assert private_uses("self._x\ncls._x\nsuper()._x()\n_x = 1\nrun._repr_html_()\n") == set()
    assert private_uses("fantoccini.__version__\nx.__dict__") == set()
