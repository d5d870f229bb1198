"""The C99 export compiles with strict warnings and returns the numbers of the equations."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from fantoccini import puppets
from fantoccini.kernel.codegen import c99_files
from fantoccini.kernel.codegen.orders import shown
from fantoccini.kernel.contract import FUNCTIONS
from fantoccini.model.puppet import load
from harness import Model
from oracles.random_trees import description

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wmissing-prototypes"]
COMPILER = shutil.which("gcc") or shutil.which("cc")
TOLERANCE = 1e-13

EXPORTED = [name for name, function in FUNCTIONS.items() if function.exported]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.long,
    pytest.mark.skipif(COMPILER is None, reason="no C compiler on the path"),
]


def described(seed: int) -> Model:
    """A random puppet with every kind of joint, limit, spring and drag."""
    return Model(description(seed, 14, strings=3, limits=True, drag=True))


def bundled(name: str) -> Model:
    return Model.of(load(puppets.path(name)))


def wiring(functions) -> str:
    """A program that reads the arguments of every function from stdin and prints its results."""
    lines = ["#include <stdio.h>", '#include "fan_model.h"', "", *_HELPERS, "int main(void)", "{"]
    for name, f in functions.items():
        names = [*f.name_in(), *f.name_out()]
        sizes = [f.numel_in(i) for i in range(f.n_in())]
        sizes += [f.numel_out(i) for i in range(f.n_out())]
        lines.append("  {")
        lines += [f"    double x{i}[{max(1, n)}] = {{0.0}};" for i, n in enumerate(sizes)]
        lines += [f"    take(x{i}, {n});" for i, n in enumerate(sizes[: f.n_in()])]
        arguments = [f"x{i}" for i in range(len(names))]
        lines.append(f"    fan_{name}({', '.join(arguments)});")
        lines += [f"    give(x{f.n_in() + i}, {n});" for i, n in enumerate(sizes[f.n_in() :])]
        lines.append("  }")
    return "\n".join([*lines, "  return 0;", "}", ""])


_HELPERS = (
    "static void take(double *x, int n)",
    "{",
    "  int i;",
    '  for (i = 0; i < n; ++i) if (scanf("%lf", &x[i]) != 1) printf("missing ");',
    "}",
    "static void give(const double *x, int n)",
    "{",
    "  int i;",
    '  for (i = 0; i < n; ++i) printf("%.17g\\n", x[i]);',
    "}",
)


def compiled(folder: Path, main: str, *flags: str) -> Path:
    program = folder / Path(main).stem
    command = [COMPILER, *STRICT, *flags, main, "fan_model.c", "-lm", "-o", str(program)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]
    return program


def write(folder: Path, model: Model) -> None:
    for name, text in c99_files(model.equations).items():
        (folder / name).write_text(text, encoding="ascii")


def arguments(model: Model, seed: int) -> dict[str, np.ndarray]:
    """Random values for every argument of the functions."""
    rng, state = np.random.default_rng(seed), model.random(seed)
    n = model.table.n_vD
    functions = model.equations
    values = {name: getattr(state, name) for name in ("q_D", "v_D", "q_K", "v_K", "acc_K")}
    values |= {"acc_D": rng.normal(size=n), "u_D": rng.normal(size=n), "x": rng.normal(size=n)}
    values |= {
        "lam": rng.normal(size=len(model.tree.strings)),
        "wrench": rng.normal(size=(6, len(model.tree.links))),
        "p": model.p,
    }
    dynamics = functions["dynamics"]
    arguments = {name: values[name] for name in dynamics.name_in()}
    return values | {"L": np.array(dynamics(**arguments)["L"])}


@pytest.mark.parametrize(
    ("make", "which", "flag"),
    [
        (bundled, "arm2d", "-O1"),
        (bundled, "marionette", "-O0"),
        (described, 4, "-O0"),
        (described, 9, "-O1"),
    ],
)
def test_the_exported_functions_agree_with_the_equations(make, which, flag, tmp_path):
    """Some warnings need -O1; the longest texts, generated in the same way, are compiled without
    it.
    """
    model = make(which)
    functions = {name: model.equations[name] for name in EXPORTED}
    write(tmp_path, model)
    (tmp_path / "wiring.c").write_text(wiring(functions), encoding="ascii")
    program = compiled(tmp_path, "wiring.c", flag)
    for seed in range(2):
        values = arguments(model, seed)
        fed, expected = [], []
        for function in functions.values():
            fed += [np.ravel(values[n], order="F") for n in function.name_in()]
            results = function(**{n: values[n] for n in function.name_in()})
            expected += [np.ravel(np.array(results[n]), order="F") for n in function.name_out()]
        words = "\n".join(repr(float(x)) for x in np.concatenate(fed))
        printed = subprocess.run([program], input=words, capture_output=True, text=True, check=True)
        assert "missing" not in printed.stdout
        printed_values = np.array(printed.stdout.split(), dtype=float)
        at = 0
        for block in expected:
            part, at = printed_values[at : at + len(block)], at + len(block)
            scale = max(1.0, np.max(np.abs(block), initial=0.0))
            assert np.max(np.abs(part - block), initial=0.0) <= TOLERANCE * scale
        assert at == len(printed_values)


@pytest.mark.parametrize("name", ["arm2d", "string_pendulum", "crane"])
def test_the_example_runs_anywhere(name, tmp_path):
    write(tmp_path, bundled(name))
    program = compiled(tmp_path, "example.c", "-Wconversion", "-Wshadow")
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    lines = printed.splitlines()
    assert [line.split(":")[0] for line in lines] == [
        "h",
        "potential energy [J]",
        "acc_D without strings",
    ]
    assert "nan" not in "".join(lines)


def test_a_cpp_program_can_include_the_header(tmp_path):
    model = bundled("string_pendulum")
    write(tmp_path, model)
    cxx = shutil.which("g++") or shutil.which("c++")
    if cxx is None:
        pytest.skip("no C++ compiler on the path")
    command = [cxx, "-std=c++17", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++"]
    subprocess.run([*command, "fan_model.h"], cwd=tmp_path, check=True)


def test_the_header_documents_every_argument_of_every_function():
    model = described(4)
    header = c99_files(model.equations)["fan_model.h"]
    for name in EXPORTED:
        function = model.equations[name]
        comment = re.search(rf"/\* fan_{name}: (.*?)\*/\nvoid fan_{name}\(", header, re.DOTALL)
        assert comment, name
        for argument in function.name_in():
            assert re.search(rf"^ \*   in  {argument} +\S", comment[1], re.MULTILINE)
        for result in function.name_out():
            assert re.search(rf"^ \*   out {result} +\S", comment[1], re.MULTILINE)


def test_the_header_lists_the_entries_in_the_order_of_the_equations():
    model = bundled("marionette")
    header = c99_files(model.equations)["fan_model.h"]
    for what in ("q_D", "v_D", "q_K", "v_K"):
        listed = re.search(rf"/\* {what}: .*?\n(.*?) \*/", header, re.DOTALL)[1]
        entries = re.findall(r"^ \* +(\d+)  (\S+) \[", listed, re.MULTILINE)
        assert [name for _, name in entries] == list(getattr(model.table, what))
        assert [int(k) for k, _ in entries] == list(range(len(entries)))


@pytest.mark.parametrize(
    "name", ["*/ int x; /*", "a\nb", "a*b", 'a"b', "a\\", "??/", "é", "", "a b", "%s", "$(x)"]
)
def test_a_name_that_could_leave_its_comment_is_refused(name):
    with pytest.raises(ValueError, match="cannot stand in generated text"):
        shown(name)


def test_no_name_of_the_file_becomes_an_identifier():
    model = bundled("arm2d")
    files = c99_files(model.equations)
    code = re.sub(r"/\*.*?\*/", "", "".join(files.values()), flags=re.DOTALL)
    words = set(re.findall(r"[A-Za-z_][A-Za-z0-9_]*", code))
    names = {part for n in (*model.table.q_D, *model.table.q_K) for part in n.split(".")}
    names |= {"arm2d", *(link.name for link in model.tree.links), *model.tree.parameters}
    # `hand.x` and the vector x of fan_solve_factor are unrelated.
    assert (names - {"x"}) & words == set()
