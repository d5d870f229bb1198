"""The package keeps its shape: import order, size of modules, public names, symbols.

A module or package of ``fantoccini`` imports only from those before it in ``ORDER``. Imports
inside functions count as well, except those of ``view`` that ``LATE_VIEWS`` lists: methods that
draw import it when they are called, so that nobody pays for matplotlib who does not draw.
"""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import ModuleType

import pytest
from docs import architecture

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "fantoccini"

ORDER = (
    "errors",
    "arrays",
    "files",
    "datagrams",
    "media",
    "progress",
    "meshes",
    "puppet",
    "scene",
    "tree",
    "contract",
    "equations",
    "codegen",
    "build",
    "motion",
    "runtime",
    "marionette",
    "puppets",  # the bundled puppets: beside the modules, for users of `marionette`
    "simulation",
    "clearance",
    "optimal",
    "gestures",  # key poses are reached
    "capture",
    "retarget",  # hanging poses are reached, motions predicted
    "plays",
    "lab",
    "sweeps",
    "demo",  # the bundled performance: inputs for a bundled puppet
    "perform",
    "exchange",  # plans are verified in what it makes of a puppet
    "planning",
    "stand",
    "identification",
    "view",
    "animation",
    "web",
    "cli",
)

EXEMPT = {"__init__", "__main__"}

LATE_VIEWS = {
    ("motion", "plot"),
    ("motion", "show"),
    ("motion", "_repr_html_"),
    ("marionette", "plot"),
    ("optimal", "plot"),
    ("planning", "plot"),
    ("planning", "animate"),
    ("marionette", "show"),
    ("marionette", "_repr_html_"),
}
"""(module or package, function) pairs that import ``view`` when they are called."""

ONLY_IN = {
    "subprocess": {"build", "media", "view"},  # the compiler; sounds; the film encoder
    "ctypes": {"runtime"},
    "cffi": {"runtime"},
    "ray": {"sweeps"},
    "mujoco": {"exchange"},
    "coacd": {"runtime"},  # convex pieces
    "coal": {"clearance", "runtime"},  # exact meshes; how well pieces fit them
    "mcap_protobuf": {"animation"},
    "foxglove_schemas_protobuf": {"animation"},
    "pythonosc": {"perform", "stand"},
    "pxr": {"animation"},
    "pyvista": {"view"},
    "viser": {"web"},
    "yourdfpy": {"exchange"},
}
"""Libraries and the modules that may use them."""

OF_OTHERS = {
    "_fields_",  # of ctypes
    "_replace",  # of named tuples
    "_repr_html_",  # of IPython
    # Of viser, without a public way: tests/show/test_viser_private.py
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
"""Functions that are given attributes by name."""

MOST_LINES = 450

GENERATED = {"cpp/fantoccini/contract.hpp"}
"""Files that nobody writes; tests check that they are fresh."""


@dataclass(frozen=True)
class Import:
    """One imported name: by which file, inside which function, on which line."""

    file: Path
    owner: str
    name: str
    function: str | None
    line: int

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line} imports {self.name}"


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def owner_of(file: Path) -> str:
    """The module or package directly below ``fantoccini`` that a file belongs to."""
    return file.relative_to(PACKAGE).with_suffix("").parts[0]


@cache
def imports_of(file: Path) -> list[Import]:
    """Every name that a file imports, at the top and inside functions."""
    found: list[Import] = []

    def visit(node: ast.AST, function: str | None) -> None:
        for name in names_of(node, file):
            found.append(Import(file, owner_of(file), name, function, node.lineno))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            function = node.name
        for child in ast.iter_child_nodes(node):
            visit(child, function)

    visit(ast.parse(file.read_text(encoding="utf-8")), None)
    return found


def names_of(node: ast.AST, file: Path) -> list[str]:
    """The dotted names an import statement asks for; relative ones resolved."""
    match node:
        case ast.Import():
            return [alias.name for alias in node.names]
        case ast.ImportFrom(level=0):
            return [f"{node.module}.{alias.name}" for alias in node.names]
        case ast.ImportFrom():
            here = ("fantoccini", *file.relative_to(PACKAGE).parts)[: -node.level]
            start = ".".join([*here, node.module] if node.module else here)
            return [f"{start}.{alias.name}" for alias in node.names]
    return []


@cache
def all_imports() -> list[Import]:
    return [each for file in modules() for each in imports_of(file)]


def internal_imports() -> list[Import]:
    return [each for each in all_imports() if each.name.split(".")[0] == "fantoccini"]


def test_every_module_has_its_place_in_the_order():
    known = {*ORDER, *EXEMPT}
    assert [f.name for f in modules() if owner_of(f) not in known] == []


def test_the_architecture_page_describes_every_package_in_order():
    """18.7: one sentence for each."""
    assert tuple(architecture.PACKAGES) == ORDER


def test_a_module_imports_only_from_those_before_it():
    wrong = []
    for found in internal_imports():
        if found.owner in EXEMPT:
            continue
        target = found.name.split(".")[1] if "." in found.name else ""
        if target == found.owner:
            continue
        if target == "view" and (found.owner, found.function) in LATE_VIEWS:
            continue
        if target not in ORDER or ORDER.index(target) > ORDER.index(found.owner):
            wrong.append(str(found))
    assert wrong == []


@cache
def file_of(name: str) -> Path | None:
    """The file that defines a dotted name; names that a package passes on are followed."""
    place = PACKAGE.parent.joinpath(*name.split("."))
    if (place / "__init__.py").exists():
        return place / "__init__.py"
    if place.with_suffix(".py").exists():
        return place.with_suffix(".py")
    if "." not in name:
        return None
    package, last = name.rsplit(".", 1)
    file = file_of(package)
    if file is not None and file.name == "__init__.py":
        passed_on = {found.name.rsplit(".", 1)[1]: found.name for found in imports_of(file)}
        if passed_on.get(last, name) != name:
            return file_of(passed_on[last])
    return file


def test_no_file_imports_itself_in_a_circle():
    """18: imports for type checking and inside functions count, those of late views do not."""
    graph: dict[Path, set[Path]] = {}
    for found in internal_imports():
        late = (found.owner, found.function) in LATE_VIEWS and found.name.split(".")[1] == "view"
        target = file_of(found.name)
        if found.file.name != "__init__.py" and target not in (None, found.file) and not late:
            graph.setdefault(found.file, set()).add(target)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        circle = " <- ".join(str(file.relative_to(PACKAGE)) for file in error.args[1])
        pytest.fail(f"these files import one another: {circle}")


def private(name: str) -> bool:
    """Whether a name begins with one underscore."""
    return name.startswith("_") and not name.startswith("__")


def private_uses(text: str) -> set[str]:
    """Private names that a file takes from elsewhere, as ``line: name``.

    Imports; attributes of anything but ``self``, ``cls`` and ``super()``; and names in strings:
    dotted ones, and those given to functions that read or set attributes.
    """
    found: set[tuple[int, str]] = set()
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
                given = (one.value for one in node.args if isinstance(one, ast.Constant))
                names = [one.rsplit(".", 1)[-1] for one in given if isinstance(one, str)]
            case ast.Constant(value=str() as value) if re.fullmatch(r"fantoccini[\w.]+", value):
                names = value.split(".")
        found |= {(node.lineno, name) for name in names if private(name)}
    return {f"{line}: {name}" for line, name in found if name not in OF_OTHERS}


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "docs", "examples"])
def test_nothing_outside_touches_private_names(folder):
    """Other modules' private names may change without anybody else."""
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


def test_each_outside_world_has_one_door():
    """Processes are started, libraries loaded, in known places."""
    wrong = [
        str(found)
        for found in all_imports()
        if found.owner not in ONLY_IN.get(found.name.split(".")[0], {found.owner})
    ]
    assert wrong == []


def test_modules_are_short():
    files = [*modules(), *PACKAGE.rglob("*.hpp"), *PACKAGE.rglob("*.h")]
    lengths = {f: len(f.read_text(encoding="utf-8").splitlines()) for f in files}
    long = {str(f.relative_to(PACKAGE)): n for f, n in lengths.items() if n >= MOST_LINES}
    assert {name: n for name, n in long.items() if name not in GENERATED} == {}


def test_every_public_name_exists():
    fantoccini = importlib.import_module("fantoccini")
    assert len(set(fantoccini.__all__)) == len(fantoccini.__all__)
    assert [name for name in fantoccini.__all__ if not hasattr(fantoccini, name)] == []


@pytest.mark.parametrize("file", [f for f in modules() if f.name == "__init__.py"], ids=owner_of)
def test_every_name_a_package_exports_exists(file):
    parts = file.relative_to(PACKAGE.parent).parent.parts
    package = importlib.import_module(".".join(parts))
    exported = getattr(package, "__all__", ())
    assert [name for name in exported if not hasattr(package, name)] == []


@pytest.mark.parametrize("file", [f for f in modules() if f.name == "__init__.py"], ids=owner_of)
def test_no_exported_name_hides_a_module(file):
    """18.3: ``fantoccini.plan`` was a package until it was imported from, and then a function."""
    package = importlib.import_module(".".join(file.relative_to(PACKAGE.parent).parent.parts))
    beside = {path.stem for path in file.parent.iterdir() if path.suffix in ("", ".py")}
    hidden = [
        name
        for name in beside & set(getattr(package, "__all__", ()))
        if not isinstance(getattr(package, name), ModuleType)
    ]
    assert hidden == []


def test_importing_fantoccini_imports_no_library():
    """18.9: what takes long is imported when it is first needed."""
    code = "import sys, fantoccini; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    heavy = {"numpy", "scipy", "casadi", "matplotlib", "pydantic", "coal", "viser", "sympy", "rich"}
    assert "fantoccini" in loaded.split() and not heavy & set(loaded.split())


def test_the_version_is_written_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert importlib.import_module("fantoccini").__version__ == project["version"]
    assert f"\nversion: {project['version']}\n" in citation


def symbols() -> list[str]:
    """The first column of the table in docs/symbols.md; a cell may hold several."""
    rows = (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8").splitlines()
    first = [row.split("|")[1] for row in rows if row.startswith("| `")]
    return [symbol for cell in first for symbol in re.findall(r"`([^`]+)`", cell)]


def test_the_symbol_table_holds_the_papers_symbols():
    wanted = "q_D v_D acc_D q_K v_K acc_K M C g_D bias_D u_D h A_D A_K Adot_v tension impulse"
    assert set(wanted.split()) <= set(symbols())
    assert len(set(symbols())) == len(symbols())


@pytest.mark.parametrize("symbol", symbols())
def test_a_symbol_of_the_table_occurs_in_the_source(symbol):
    """A table that names what is gone is worse than none."""
    files = [*modules(), *PACKAGE.rglob("*.hpp")]
    word = re.compile(rf"(?<![A-Za-z0-9_]){re.escape(symbol)}(?![A-Za-z0-9_])")
    assert any(word.search(f.read_text(encoding="utf-8")) for f in files)
