"""The sources of a library follow a rule: a module, and all its imports."""

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
    """They are read from the text; Python's own parser finds no others."""
    for file in PACKAGE.rglob("*.py"):
        wanted = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and not node.level:
                wanted |= {(node.module, alias.name) for alias in node.names}
            elif isinstance(node, ast.Import):
                wanted |= {(alias.name, None) for alias in node.names}
        imported = {asked for asked, _ in closure.imports_of(file)}
        assert wanted <= imported, file


def test_modules_that_compute_numbers_count_and_views_do_not():
    """Compiled code contains the inertia of shapes; the former list omitted their module."""
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


def test_lazy_imports_are_followed():
    """Packages with lazy names have a stub: without it, stale entries would stay in the cache."""
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
def test_the_hash_changes_only_with_imported_names(package, file, counts):
    """Only the imported names of a package count."""
    before = closure.code_fingerprint("fantoccini.one")
    (package / file).write_text("x = 1\n", encoding="utf-8")
    closure.code_fingerprint.cache_clear()
    assert (closure.code_fingerprint("fantoccini.one") != before) == counts


def test_a_package_counts_where_it_defines_a_name_itself(package):
    """Then all its imports count too."""
    files = {f.relative_to(package).as_posix() for f in closure.closure(["fantoccini.asks"])}
    assert files == {"asks.py", "two/__init__.py", "own.py", "two/a.py", "two/b.py", "late.py"}


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ('"""In other\nwords."""\n\n# A comment.\nfrom fantoccini.two import a  # x\n', False),
        ('"""One."""\nfrom fantoccini.two import a\nx = 1\n', True),
    ],
)
def test_comments_and_docstrings_do_not_change_the_hash(package, text, counts):
    """An edit of comments and docstrings compiles nothing."""
    hashes = []
    for written in ('"""One."""\nfrom fantoccini.two import a\n', text):
        (package / "one.py").write_text(written, encoding="utf-8")
        closure.code_fingerprint.cache_clear()
        hashes.append(closure.code_fingerprint("fantoccini.one"))
    assert (hashes[0] != hashes[1]) == counts


def bare(text: str) -> str:
    """Syntax tree of a module, without strings as statements."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value = ast.Constant(isinstance(node.value.value, str) or node.value.value)
    return ast.dump(tree)


def test_only_comments_and_docstrings_are_left_out():
    """Python's own parser reads the same program from the hashed text."""
    for file in closure.closure(compiled.SOURCE_MODULES):
        text = file.read_text(encoding="utf-8")
        assert bare(significant_python(text)) == bare(text), file


def test_strings_keep_text_that_looks_like_comments():
    text = 'x = [\n    """a""",\n    """# b"""\n]\ny = "# c"\n\nz = """\n\n# d\n"""'
    assert significant_python(text) == text.replace("\n\nz", "\nz")
    assert significant_cpp('a("// b");  // c\n\n/* d\n */ e(\'"\');\n') == 'a("// b");\n  e(\'"\');'
