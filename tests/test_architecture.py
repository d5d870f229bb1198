"""Rules of the architecture: import order, exports, file sizes, public names, symbols.

The eleven packages import only from those before them in ``ORDER``, and only names exported by the
``__init__`` of a package or sub-package. Imports inside functions count as well.
The single exception is ``base/drawing.py``, which imports ``fantoccini.output`` when a method that
draws is called.
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

pytestmark = pytest.mark.medium

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "fantoccini"

ORDER = tuple(architecture.PACKAGES)
DRAWING = "base/drawing.py"
"""The only module that imports a later package, by name, when a method is called."""

MAX_FILES = 28
"""Files in a folder, without sub-packages."""

ONLY_IN = {
    # the compiler; sounds; the film encoder
    "subprocess": {"kernel.build", "base", "output.view"},
    "ctypes": {"kernel.runtime"},
    "cffi": {"kernel.runtime"},
    "ray": {"lab.sweeps"},
    "mujoco": {"dynamics.mujoco", "output.exchange"},
    "coacd": {"kernel.runtime"},  # convex pieces
    "coal": {"dynamics.clearance", "kernel.runtime"},  # exact meshes; how well pieces fit them
    "mcap_protobuf": {"output.animation"},
    "foxglove_schemas_protobuf": {"output.animation"},
    "pythonosc": {"base"},
    "pxr": {"output.animation"},
    "pyvista": {"output.view"},
    "viser": {"app.web", "app.pages", "app.live"},
    "yourdfpy": {"output.exchange"},
}
"""Libraries and the packages that may use them."""


MAX_LINES = 450

KINDS = {
    "app.pages.loop.PageLoop": "a thread of a page, which starts and ends it",
    "base.documents.document.Document": "a file that users write",
    "base.documents.located.Located": "a file with the lines of its keys",
    "base.documents.values.Model": "a part of a file, by pydantic",
    "base.errors.FantocciniError": "an error",
    "base.errors.Outcome": "a status with its message",
    "base.errors.StateError": "an error",
    "base.short_repr.ShortRepr": "a dataclass with arrays, whose representation is one line",
    "control.optimal.shooting.EventRuns": "runs, by the method of their derivatives",
    "control.tasks.answer.Answer": "an answer to a problem of control, and its truth",
    "control.tasks.control_file.ControlFile": "a file with a puppet and its start",
    "dynamics.compiled.compiled_puppet.CompiledPuppet": "a marionette without its algorithms",
    "kernel.runtime.compiled.Run": "a run, held at its start",
    "kernel.runtime.functions.Functions": "a library that evaluates functions, by ctypes",
    "kernel.runtime.functions.Loaded": "a library, by ctypes",
    "stand.timed_moves.Limits": "limits of a controller, with its other settings",
}
"""Classes that those of other files inherit from, and what all of these are."""

GENERATED = {"kernel/cpp/fantoccini/contract.hpp"}
"""Generated files, exempt from the length limit."""


@dataclass(frozen=True)
class Import:
    """One imported name: importing file, package and line."""

    file: Path
    package: str
    name: str
    line: int
    module: str  # module that must be imported for it

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line} imports {self.name}"


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def package_of(file: Path) -> str:
    """The package of a file, without ``fantoccini``: ``kernel.build``; empty at the top."""
    return ".".join(file.parent.relative_to(PACKAGE).parts)


def top_package_of(name: str) -> str:
    """The top package in a dotted name that begins with ``fantoccini``."""
    return [*name.split("."), ""][1]


@cache
def imports_of(file: Path) -> list[Import]:
    """Every name that a file imports, at the top and inside functions, and in a package's stub."""
    text = file.read_text(encoding="utf-8")
    stub = file.with_suffix(".pyi")
    if stub.exists():
        text += stub.read_text(encoding="utf-8")
    return [
        Import(file, package_of(file), name, node.lineno, module)  # type: ignore[attr-defined]
        for node in ast.walk(ast.parse(text))
        for name in names_of(node, file)
        for module in [name if isinstance(node, ast.Import) else name.rsplit(".", 1)[0]]
    ]


def names_of(node: ast.AST, file: Path) -> list[str]:
    """The dotted names of an import statement; relative ones are resolved."""
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


def test_every_folder_is_a_room_of_the_order():
    packages = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
    assert packages == set(ORDER)
    assert [file.name for file in PACKAGE.glob("*.py")] == ["__init__.py"]


def test_a_room_imports_only_from_those_above_it():
    order = {package: k for k, package in enumerate(ORDER)}
    wrong = [
        str(item)
        for item in internal_imports()
        if item.package
        and order.get(top_package_of(item.name), len(ORDER)) > order[item.package.split(".")[0]]
    ]
    assert len(internal_imports()) > 2000
    assert wrong == []


def test_other_packages_import_from_faces():
    """Names come from the `__init__` of another package or from one of its modules."""
    wrong = []
    for item in internal_imports():
        file = PACKAGE.parent.joinpath(*item.module.split("."))
        other = ".".join(item.module.split(".")[1:-1])
        reaches = file.with_suffix(".py").exists() and other != item.package
        if reaches and item.file.name != "__init__.py":
            wrong.append(str(item))
    assert wrong == []


def test_an_init_exports_only_names_from_its_own_package():
    wrong = [
        str(item)
        for item in internal_imports()
        if item.file.name == "__init__.py"
        and not f"{item.name}.".startswith(f"fantoccini.{item.package}".rstrip(".") + ".")
    ]
    assert wrong == []


def imported_by_name(text: str) -> list[str]:
    """Arguments of `import_module` and `__import__`; "?" for those that are not strings."""
    names = []
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Call(func=ast.Name(id=called) | ast.Attribute(attr=called)):
                if called in ("import_module", "__import__"):
                    argument = node.args[0]
                    argument = (
                        argument.values[0] if isinstance(argument, ast.JoinedStr) else argument
                    )
                    names.append(argument.value if isinstance(argument, ast.Constant) else "?")
    return names


def test_modules_are_imported_by_name_in_their_own_package_or_for_drawing():
    """Nothing else evades the import order by ``import_module`` with a string."""
    by_name = {
        (file.relative_to(PACKAGE).as_posix(), name)
        for file in modules()
        for name in imported_by_name(file.read_text(encoding="utf-8"))
    }
    elsewhere = {
        (file, name)
        for file, name in by_name
        if name.startswith(("fantoccini", "?"))
        and not name.startswith(f"fantoccini.{package_of(PACKAGE / file)}")
    }
    assert elsewhere == {(DRAWING, "fantoccini.output")}


@pytest.mark.parametrize("package", ["motion", "dynamics", "control"])
def test_packages_above_output_do_not_import_it(package):
    code = f"import sys, fantoccini.{package} as r; [getattr(r, n) for n in r.__all__]; " + (
        "print(*[n for n in sys.modules if n.startswith('fantoccini.output')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


@cache
def file_of(name: str) -> Path | None:
    """The file that defines a dotted name; re-exported names are followed."""
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
        passed_on = {item.name.rsplit(".", 1)[1]: item.name for item in imports_of(file)}
        if passed_on.get(last, name) != name:
            return file_of(passed_on[last])
    return file


def circle(graph: dict[object, set[object]]) -> list[object]:
    """Nodes of a graph that depend on one another in a circle; empty if there are none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_file_imports_itself_in_a_circle():
    """Imports for type checking and inside functions count."""
    graph: dict[Path, set[Path]] = {}
    for item in internal_imports():
        target = file_of(item.name)
        if item.file.name != "__init__.py" and target not in (None, item.file):
            graph.setdefault(item.file, set()).add(target)
    assert circle(graph) == []
    module, other = modules()[-2:]
    assert circle({**graph, module: {other}, other: {module}}) != []


def test_no_sub_package_imports_itself_in_a_circle():
    graph: dict[str, set[str]] = {}
    for item in internal_imports():
        target = file_of(item.name)
        if item.file.name != "__init__.py" and target is not None:
            graph.setdefault(item.package, set()).add(package_of(target))
    graph = {package: targets - {package} for package, targets in graph.items()}
    assert len(graph) > 40
    assert circle(graph) == []


def test_folders_are_small():
    folders = {file.parent for file in modules()}
    counts = {folder: len(list(folder.glob("*.py"))) - 1 for folder in folders}
    assert {str(f.relative_to(ROOT)): n for f, n in counts.items() if n > MAX_FILES} == {}


def test_external_libraries_are_imported_only_by_listed_packages():
    """This includes `subprocess` and `ctypes`."""
    wrong = [
        str(item)
        for item in all_imports()
        if item.package not in ONLY_IN.get(item.name.split(".")[0], {item.package})
    ]
    assert wrong == []


def length(file: Path) -> int:
    """Lines of a file; imports and includes do not count."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        return sum(not line.startswith("#include") for line in text.splitlines())
    imports = [n for n in ast.parse(text).body if isinstance(n, ast.Import | ast.ImportFrom)]
    return len(text.splitlines()) - sum(n.end_lineno - n.lineno + 1 for n in imports)


def test_modules_are_short():
    files = [*modules(), *PACKAGE.rglob("*.hpp"), *PACKAGE.rglob("*.h")]
    lengths = {f: length(f) for f in files}
    long = {str(f.relative_to(PACKAGE)): n for f, n in lengths.items() if n >= MAX_LINES}
    assert {name: n for name, n in long.items() if name not in GENERATED} == {}


def foreign_bases(text: str, file: Path) -> list[tuple[str, str]]:
    """The classes of a file, each with a base class that another file of the package defines."""
    nodes, names = list(ast.walk(ast.parse(text))), {}
    for node in nodes:
        for alias, name in zip(getattr(node, "names", ()), names_of(node, file), strict=False):
            whole = alias.asname or isinstance(node, ast.ImportFrom)
            own = alias.asname or alias.name.split(".")[0]
            names[own] = name if whole else own
    pairs = []
    for node in (node for node in nodes if isinstance(node, ast.ClassDef)):
        for base in node.bases:
            base = base.value if isinstance(base, ast.Subscript) else base
            first, *others = ast.unparse(base).split(".")
            name = ".".join([names.get(first, first), *others])
            home = file_of(name) if name.startswith("fantoccini.") else None
            if home not in (None, file):
                module = home.relative_to(PACKAGE).with_suffix("").parts
                pairs.append((node.name, ".".join([*module, name.rsplit(".", 1)[1]])))
    return pairs


def test_no_class_is_spread_over_files():
    """A class has members, not a base class in another file, unless it is a kind of that class."""
    pairs = {
        (f"{file.relative_to(ROOT)}: {name}", base)
        for file in modules()
        for name, base in foreign_bases(file.read_text(encoding="utf-8"), file)
    }
    assert len(pairs) > 80
    assert {pair for pair in pairs if pair[1] not in KINDS} == set()
    assert {base for _, base in pairs} == set(KINDS)


@pytest.mark.parametrize(
    "text",
    [
        "from fantoccini.theatre.perform.player import MotionPlayer\nclass Live(MotionPlayer): ...",
        "from fantoccini.theatre.perform.player import MotionPlayer as P\nclass Live(P): ...",
        "from .player import MotionPlayer\nclass Live(Generic[T], MotionPlayer): ...",
        "from fantoccini.theatre.perform import player\nclass Live(player.MotionPlayer[T]): ...",
        "import fantoccini.theatre.perform.player\n"
        "class Live(fantoccini.theatre.perform.player.MotionPlayer): ...",
        "import fantoccini.theatre.perform.player as p\nclass Live(p.MotionPlayer): ...",
        "def f():\n    from .player import MotionPlayer\n    class Live(MotionPlayer): ...",
    ],
)
def test_base_classes_of_other_files_are_recognised(text):
    folder = PACKAGE / "theatre" / "perform"
    (pair,) = foreign_bases(text, folder / "performance.py")
    assert pair == ("Live", "theatre.perform.player.MotionPlayer")
    assert foreign_bases(text, folder / "player.py") == []


def test_base_classes_through_a_face_are_those_of_their_files():
    text = "from fantoccini.base import StateError\nclass Late(StateError, Exception): ..."
    file = PACKAGE / "theatre" / "perform" / "performance.py"
    assert foreign_bases(text, file) == [("Late", "base.errors.StateError")]


def test_every_public_name_exists():
    fantoccini = importlib.import_module("fantoccini")
    assert len(set(fantoccini.__all__)) == len(fantoccini.__all__)
    assert [name for name in fantoccini.__all__ if not hasattr(fantoccini, name)] == []


@pytest.mark.parametrize("file", [f for f in modules() if f.name == "__init__.py"], ids=package_of)
def test_every_name_a_package_exports_exists(file):
    parts = file.relative_to(PACKAGE.parent).parent.parts
    package = importlib.import_module(".".join(parts))
    exported = getattr(package, "__all__", ())
    assert [name for name in exported if not hasattr(package, name)] == []


@pytest.mark.parametrize("file", [f for f in modules() if f.name == "__init__.py"], ids=package_of)
def test_no_exported_name_hides_a_module(file):
    """Otherwise `fantoccini.plan` would be a package or a function, by earlier imports."""
    package = importlib.import_module(".".join(file.relative_to(PACKAGE.parent).parent.parts))
    beside = {path.stem for path in file.parent.iterdir() if path.suffix in ("", ".py")}
    hidden = [
        name
        for name in beside & set(getattr(package, "__all__", ()))
        if not isinstance(getattr(package, name), ModuleType)
    ]
    assert hidden == []


def test_importing_fantoccini_imports_no_library():
    """Slow libraries are imported at first use."""
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
    """The first column of the table in docs/symbols.md; a cell may contain several symbols."""
    rows = (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8").splitlines()
    first = [row.split("|")[1] for row in rows if row.startswith("| `")]
    return [symbol for cell in first for symbol in re.findall(r"`([^`]+)`", cell)]


def test_the_symbol_table_holds_the_papers_symbols():
    wanted = "q_D v_D acc_D q_K v_K acc_K M C g_D bias_D u_D h A_D A_K Adot_v tension impulse"
    assert set(wanted.split()) <= set(symbols())
    assert len(set(symbols())) == len(symbols())


@pytest.mark.parametrize("symbol", symbols())
def test_a_symbol_of_the_table_occurs_in_the_source(symbol):
    """No entry of docs/symbols.md is out of date."""
    files = [*modules(), *PACKAGE.rglob("*.hpp")]
    word = re.compile(rf"(?<![A-Za-z0-9_]){re.escape(symbol)}(?![A-Za-z0-9_])")
    assert any(word.search(f.read_text(encoding="utf-8")) for f in files)
