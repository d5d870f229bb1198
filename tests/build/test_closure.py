"""What shapes a library is found by a rule: a module, and all that it imports."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import fantoccini
from fantoccini.dynamics.compiled import libraries as compiled
from fantoccini.kernel.build import closure
from fantoccini.kernel.build.significant import significant_cpp, significant_python

PACKAGE = Path(fantoccini.__file__).parent


def test_imports_are_found_wherever_they_stand():
    """18.1: they are found as text; Python's own parser finds no others."""
    for file in PACKAGE.rglob("*.py"):
        wanted = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and not node.level:
                wanted |= {(node.module, alias.name) for alias in node.names}
            elif isinstance(node, ast.Import):
                wanted |= {(alias.name, None) for alias in node.names}
        found = {asked for asked, _ in closure.imports_of(file)}
        assert wanted <= found, file


def test_what_shapes_numbers_counts_and_what_shows_them_does_not():
    """18.1: inertia of shapes is folded into compiled code, but the list of before left it out."""
    files = {f.relative_to(PACKAGE).as_posix() for f in closure.closure(compiled.SOURCE_MODULES)}
    assert {
        "model/puppet/shapes.py",
        "model/tree/chains.py",
        "kernel/contract/functions.py",
        "kernel/contract/analysis_functions.py",
        "base/arrays.py",
    } <= files
    assert {"kernel/equations/variational.py", "kernel/codegen/straight.py"} <= files
    others = ("dynamics", "output", "kernel/runtime", "kernel/build")
    assert not {f for f in files if f.startswith(others)}
    unused = {"kernel/equations/printing.py", "kernel/codegen/c99.py", "model/tree/size.py"}
    assert not unused & files


def test_names_that_a_face_imports_when_asked_are_followed():
    """Faces of rooms have a stub: without it the cache would keep what has become stale."""
    imported = dict(closure.imports_of(PACKAGE / "model" / "__init__.py"))
    assert imported["fantoccini.model.puppet", "Puppet"] == "Puppet"
    assert imported["fantoccini.model", "tree"] == "tree"


@pytest.fixture
def package(tmp_path, monkeypatch):
    root = tmp_path / "fantoccini"
    for name, text in {
        "one.py": "from fantoccini.two import a\n",
        "two/__init__.py": (
            "from fantoccini.two.a import a\nfrom fantoccini.two.b import b\n"
            "def own():\n    import fantoccini.own\n"
        ),
        "two/a.py": "def a():\n    import fantoccini.late\n",
        "two/b.py": "",
        "late.py": "",
        "own.py": "",
        "asks.py": "from fantoccini.two import own\n",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    monkeypatch.setattr(closure, "ROOT", root)
    for cached in (closure.file_of, closure.imports_of, closure.code_fingerprint):
        cached.cache_clear()
    yield root
    for cached in (closure.file_of, closure.imports_of, closure.code_fingerprint):
        cached.cache_clear()


@pytest.mark.parametrize(("file", "counts"), [("late.py", True), ("two/b.py", False)])
def test_the_hash_changes_with_what_is_imported_alone(package, file, counts):
    """18.1: of a package, the names that are asked of it."""
    before = closure.code_fingerprint("fantoccini.one")
    (package / file).write_text("x = 1\n", encoding="utf-8")
    closure.code_fingerprint.cache_clear()
    assert (closure.code_fingerprint("fantoccini.one") != before) == counts


def test_a_package_counts_where_it_defines_a_name_itself(package):
    """18.1: then all that it imports counts too."""
    files = {f.relative_to(package).as_posix() for f in closure.closure(["fantoccini.asks"])}
    assert files == {"asks.py", "two/__init__.py", "own.py", "two/a.py", "two/b.py", "late.py"}


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ('"""In other\nwords."""\n\n# A comment.\nfrom fantoccini.two import a  # x\n', False),
        ('"""One."""\nfrom fantoccini.two import a\nx = 1\n', True),
    ],
)
def test_words_do_not_change_the_hash(package, text, counts):
    """18.1: an edit of comments and docstrings compiles nothing again."""
    hashes = []
    for written in ('"""One."""\nfrom fantoccini.two import a\n', text):
        (package / "one.py").write_text(written, encoding="utf-8")
        closure.code_fingerprint.cache_clear()
        hashes.append(closure.code_fingerprint("fantoccini.one"))
    assert (hashes[0] != hashes[1]) == counts


def bare(text: str) -> str:
    """What Python's parser makes of a module, without strings that stand alone."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value = ast.Constant(isinstance(node.value.value, str) or node.value.value)
    return ast.dump(tree)


def test_nothing_but_words_is_left_out():
    """18.1: Python's own parser reads the same program from what is hashed."""
    for file in closure.closure(compiled.SOURCE_MODULES):
        text = file.read_text(encoding="utf-8")
        assert bare(significant_python(text)) == bare(text), file


def test_strings_keep_what_looks_like_words():
    kept = 'x = [\n    """a""",\n    """# b"""\n]\ny = "# c"\n\nz = """\n\n# d\n"""'
    assert significant_python(kept) == kept.replace("\n\nz", "\nz")
    assert significant_cpp('a("// b");  // c\n\n/* d\n */ e(\'"\');\n') == 'a("// b");\n  e(\'"\');'
