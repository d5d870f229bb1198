"""``python -m docs.architecture``: writes docs/architecture.md and the drawing of the pipeline."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "fantoccini"
PAGE = ROOT / "docs" / "architecture.md"
PICTURE = ROOT / "docs" / "pictures" / "pipeline.svg"

PACKAGES = {
    "errors": "Errors that name the place and the remedy, and the statuses a run can end with.",
    "arrays": "Type aliases for arrays, named after their shape.",
    "files": "Writes files that appear whole or not at all.",
    "datagrams": "Sockets for datagrams to one machine, unless all of a network are meant.",
    "media": "Finds ffmpeg and reads sound files with it.",
    "progress": "Progress callbacks, and the bar on a terminal.",
    "meshes": "Mesh files: triangles, colours of their materials, and the closed pieces they make.",
    "puppet": "The puppet schema: reads, checks and writes YAML files.",
    "scene": "Scenes: puppets, props, obstacles and a floor, assembled into one puppet.",
    "tree": "Links in topological order, one-sided rows, and the coordinate table.",
    "contract": "Declares once what Python and the compiled code share: functions, structures.",
    "equations": "Derives Eqs. 1 to 11 symbolically with CasADi, from the tree.",
    "codegen": "Writes the equations as C++ for this machine, or as C99 for export.",
    "build": "Compiles generated code and keeps it in the cache; the only user of a compiler.",
    "motion": "States, inputs, trajectories and events: plain data, and their files.",
    "runtime": "Loads the compiled library and calls it through ctypes.",
    "marionette": "The model (tree, parameters, winches, libraries), its algorithms, the facade.",
    "puppets": "The bundled puppets, and performances for them.",
    "simulation": "Runs, batches and their sensitivities.",
    "clearance": "Distances of a puppet from obstacles, from other puppets and from itself.",
    "optimal": "Optimal control: the motion of least cost within bounds, event-driven.",
    "gestures": "Gestures: short motions of part of a puppet that are changed, added and joined.",
    "capture": "Motion capture: skeletons and their motion from BVH files.",
    "retarget": "Hanging poses and motions of a puppet that come nearest to captured motion.",
    "plays": "Plays written as text, compiled to motions of several puppets, and verified.",
    "lab": "Studies of one puppet: may driven coordinates be inputs (the paper's Section VI)?",
    "sweeps": "One study over many cases, on threads or a Ray cluster, with a store.",
    "demo": "Inputs of bundled performances.",
    "perform": "The live engine: targets of hands become inputs in real time; recordings.",
    "exchange": "Puppets in MuJoCo's format and simulated there; imports of MJCF and URDF.",
    "planning": "Searches for inputs that reach a goal, improves them, follows them with LQR.",
    "stand": "Stands: files, axes bound to driven coordinates, and whether they can do a run.",
    "identification": "Numbers of a puppet from records of its motion, with their errors.",
    "view": "Pictures, plots and films without a display.",
    "animation": "Motions as animations for other programs: glTF, OpenUSD, BVH, tables.",
    "web": "The page in the browser: live play, replay, plans, one-file export.",
    "cli": "The command `fantoccini`.",
}
"""One sentence for each package, in the order in which packages may import each other."""


@dataclass(frozen=True)
class Task:
    """An extension and the files it touches.

    Attributes:
        title: what is added.
        steps: (what to do, files relative to ``src/fantoccini``, or to the repository where they
            begin with a slash).
    """

    title: str
    steps: tuple[tuple[str, tuple[str, ...]], ...]


TASKS = (
    Task("a quantity, evaluated for a state", (
        ("declare its arguments and results", ("kernel/contract/functions.py",)),
        ("return its expression from `_NAME`", ("kernel/equations/functions.py",)),
        ("derive it, if the system does not have it yet", ("kernel/equations/system.py",)),
        ("evaluate it", ("dynamics/compiled/quantities.py",)),
    )),
    Task("a joint type", (
        ("schema: the type, its keys, and the words of other programs for it",
         ("model/puppet/joint.py", "model/puppet/words.py", "model/puppet/check_coordinates.py")),
        ("its mirror image", ("model/puppet/mirror.py",)),
        ("its coordinates, and its pose as numbers",
         ("model/tree/joints.py", "model/tree/placement.py", "model/tree/inertia.py")),
        ("motion subspace and relative motion",
         ("kernel/equations/kinematics.py", "kernel/equations/inertia.py", "kernel/equations/coriolis.py")),
        ("spring and limits, if it has any", ("kernel/equations/system.py", "kernel/equations/rows.py")),
        ("how a hand moves it, and the bounds of planned motions",
         ("theatre/perform/handle.py", "control/problems/feasible.py")),
        ("its counterpart in MuJoCo, there and back",
         ("dynamics/mujoco/joints.py", "dynamics/mujoco/mjcf_model.py", "output/exchange/mjcf_bodies.py")),
    )),
    Task("a kind of string that is a constraint (as a wire)", (
        ("schema: its keys, and which of them exclude each other", ("model/puppet/schema.py",)),
        ("its row", ("model/tree/structure.py", "model/tree/construction.py", "kernel/equations/rows.py")),
        ("a flag of the generated model, which the solvers read",
         ("kernel/codegen/model.py", "kernel/cpp/fantoccini/model/evaluation.hpp",
          "kernel/cpp/fantoccini/solvers/active_set.hpp")),
        ("bounds on its tension for the functions of a state", ("dynamics/compiled/model.py",)),
        ("show it, translate it or refuse it", ("app/cli/info.py", "dynamics/mujoco/mjcf_model.py")),
    )),
    Task("a kind of string that is a force (as a chain)", (
        ("schema: its keys", ("model/puppet/schema.py", "model/puppet/chain.py")),
        ("its row, and links if it has masses",
         ("model/tree/structure.py", "model/tree/construction.py", "model/tree/chains.py")),
        ("energy and gradient", ("kernel/equations/elastic.py",)),
        ("the longest stable step", ("dynamics/compiled/checks.py",)),
        ("draw it, translate it or refuse it", ("output/view/geometry.py", "dynamics/mujoco/mjcf_model.py")),
    )),
    Task("a method of integration", (
        ("the step, and a header that exports it to Python",
         ("kernel/cpp/fantoccini/variational/step.hpp", "kernel/cpp/fantoccini/interface/variational.hpp")),
        ("a library of its own", ("kernel/codegen/libraries.py", "dynamics/compiled/libraries.py")),
        ("its options", ("dynamics/compiled/methods.py",)),
        ("validation of the start state", ("dynamics/compiled/checks.py",)),
        ("checks of its results", ("dynamics/simulation/run.py", "dynamics/simulation/batch.py")),
        ("its name on the command line", ("app/console/options.py",)),
    )),
    Task("a bundled puppet", (
        ("the file, and a function of the same name",
         ("model/puppets/arm2d.yaml", "puppets/__init__.py")),
        ("a performance of it", ("model/puppets/performances/toss.yaml",)),
        ("its picture and film (`make gallery`)", ("/docs/gallery.py",)),
    )),
    Task("a command", (
        ("declare arguments and help; import the module inside the function", ("app/cli/app.py",)),
        ("do the work in a module of its own", ("app/cli/check.py",)),
        ("describe it; a test looks for every option", ("/docs/cli.md",)),
        ("list it", ("/tests/cli/test_arguments.py",)),
    )),
    Task("something that `fantoccini show` can open", (
        ("recognise it", ("app/web/page.py",)),
        ("show it: live, or as a replay", ("app/live/live.py", "app/pages/replay.py")),
        ("write it as one file", ("app/pages/export.py",)),
    )),
    Task("a format of animations", (
        ("a line of `FORMATS`, with the library that it needs", ("output/animation/formats.py",)),
        ("its function `write(scene, path)`", ("output/animation/usd.py",)),
        ("describe it", ("/docs/export.md", "/docs/cli.md")),
    )),
    Task("a page of the docs", (
        ("write it; link it from the README where it helps", ("/docs/install.md", "/README.md")),
        ("place it in the navigation", ("/mkdocs.yml",)),
    )),
    Task("a name of the public API", (
        ("list it", ("__init__.pyi",)),
        ("give a new package a title in the reference", ("/docs/site/reference.py",)),
    )),
)  # fmt: skip
"""Where a task names one file of several alike, it is the example to copy."""


def imports() -> dict[str, list[str]]:
    """The packages that each package imports, anywhere in its files, in the order of PACKAGES."""
    found: dict[str, set[str]] = {name: set() for name in PACKAGES}
    for file in PACKAGE.rglob("*.py"):
        owner = file.relative_to(PACKAGE).with_suffix("").parts[0]
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if owner in found and isinstance(node, ast.ImportFrom) and node.module:
                parts = node.module.split(".")
                if parts[0] == "fantoccini":
                    names = parts[1:2] or [alias.name for alias in node.names]
                    found[owner] |= {name for name in names if name in found}
    return {owner: [n for n in PACKAGES if n in names - {owner}] for owner, names in found.items()}


def page() -> str:
    """The text of docs/architecture.md."""
    found = imports()
    rows = [
        f"| `{name}` | {sentence} | {', '.join(f'`{n}`' for n in found[name]) or '-'} |"
        for name, sentence in PACKAGES.items()
    ]
    tasks = []
    for task in TASKS:
        tasks.append(f"### {task.title[0].upper() + task.title[1:]}\n")
        for step, files in task.steps:
            tasks.append(f"- {step[0].upper() + step[1:]}: {', '.join(map(shown, files))}")
        tasks.append("")
    return _TEXT.format(packages="\n".join(rows), tasks="\n".join(tasks).rstrip())


def shown(file: str) -> str:
    """A file of a task as the page names it."""
    return f"`{file[1:]}`" if file.startswith("/") else f"`{file}`"


_TEXT = """# Architecture

After this page you know how a puppet file becomes motion, which package does which part, and which
files to touch for the common extensions.

## The pipeline

![From the puppet file to a compiled library, from states and inputs to trajectories, and the front
ends](pictures/pipeline.svg)

A puppet goes through the upper row once. `puppet` reads the file, `tree` orders its links and
coordinates, `equations` derives the equations of motion symbolically, `codegen` writes them as C++,
and `build` compiles them together with the runtime's headers in `cpp/`. The library is cached by
the hash of everything it depends on, so a known puppet loads without derivation.

`runtime` calls the library; no other package uses ctypes. A `Marionette` holds the tree, the
equations and the libraries. It computes functions of a state; `simulation` computes runs. States,
inputs and trajectories are plain data in `motion`, without reference to the library.

The integrators, the complementarity solver and the search motions of the planner are C++ templates
in `kernel/cpp/fantoccini`, compiled for each puppet with its sizes as constants. They advance one
trajectory, or several in the lanes of the processor's vectors from the same source.

## Packages

Each package imports only from those above it in this table; `tests/test_architecture.py` enforces
that. Methods that draw (`run.plot()`, `marionette.show()`) import `view` or `web` when they are
called.

| Package | Does | Imports |
|---|---|---|
{packages}

`kernel/cpp/fantoccini` holds the C++ headers. Each folder includes only from itself and from those before
it: `math`, `contract.hpp`, `solvers`, `model`, `collision`, `contact`, `runs`, `event`,
`timestepping`, `variational`, `derivatives`, `search`, `interface`.
`tests/cpp/test_include_order.py` enforces that. `tests/`, `docs/`, `examples/` and `benchmarks/`
lie outside the package.

## What to touch to add ...

Paths are relative to `src/fantoccini` unless they begin with `docs`, `tests` or a file of the root.
Every extension also needs a test, a line in `CHANGELOG.md` and the page of the guide that describes
it. Where one of several similar files is named, copy it.

{tasks}
"""


# -- the drawing ---------------------------------------------------------------------------------

WIDTH, HEIGHT = 880, 462
FILLS = {"data": "#fff7e6", "code": "#e8eef7", "front": "#eaf4ea"}
LINES = {"data": "#b9822b", "code": "#44679f", "front": "#4b8a53"}


def box(x: int, y: int, width: int, kind: str, name: str, *lines: str) -> str:
    """A box with a name and smaller lines below it."""
    middle, top = x + width // 2, y + (22 if lines else 33)
    small = "".join(
        f'<text x="{middle}" y="{top + 15 * (k + 1)}" class="s">{line}</text>'
        for k, line in enumerate(lines)
    )
    look = f'fill="{FILLS[kind]}" stroke="{LINES[kind]}"'
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="56" rx="6" {look}/>'
        f'<text x="{middle}" y="{top}" class="n">{name}</text>{small}'
    )


def arrow(*points: tuple[int, int]) -> str:
    """A polyline with a head at its end."""
    path = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline points="{path}" class="a" marker-end="url(#head)"/>'


def drawing() -> str:
    """The pipeline as SVG."""
    top, middle, low, last = 44, 164, 272, 382
    upper = (
        ("data", "puppet file", "YAML"),
        ("code", "puppet", "schema, checks"),
        ("code", "tree", "links, coordinates"),
        ("code", "equations", "CasADi"),
        ("code", "codegen", "C++, C99"),
        ("code", "build", "compiler, cache"),
    )
    step, width = 144, 120
    parts = [label(20, 30, "once for each puppet"), label(20, middle - 14, "every call")]
    for k, (kind, name, line) in enumerate(upper):
        parts.append(box(20 + step * k, top, width, kind, name, line))
        if k:
            parts.append(
                arrow((20 + step * k - (step - width), top + 28), (18 + step * k, top + 28))
            )
    parts += [
        box(740, middle, width, "code", "runtime", "ctypes"),
        arrow((800, top + 56), (800, middle - 2)),
        text(808, 134, "library"),
        box(452, middle, 168, "code", "marionette", "functions of a state"),
        arrow((740, middle + 28), (622, middle + 28)),
        arrow((368, top + 56), (368, 128), (490, 128), (490, middle - 2)),
        text(376, 122, "tree"),
        arrow((540, top + 56), (540, middle - 2)),
        text(548, 134, "interpreted functions"),
        box(20, middle, 168, "data", "State, Input", "motion"),
        box(452, low, 168, "code", "simulation", "runs and batches"),
        arrow((536, middle + 56), (536, low - 2)),
        arrow((104, middle + 56), (104, low + 28), (450, low + 28)),
        box(692, low, 168, "data", "Trajectory", "events, tensions, ledger"),
        arrow((620, low + 28), (690, low + 28)),
        label(20, last - 20, "built on it"),
    ]
    fronts = (
        ("sweeps", "many cases"),
        ("perform", "live engine"),
        ("planning", "goals, LQR"),
        ("lab", "Section VI"),
        ("exchange", "MuJoCo"),
        ("view", "pictures, film"),
        ("web", "browser"),
        ("cli", "commands"),
    )
    for k, (name, line) in enumerate(fronts):
        parts.append(box(20 + 106 * k, last, 98, "front", name, line))
    parts += [
        arrow((536, low + 56), (536, last - 14)),
        arrow((776, low + 56), (776, last - 14)),
        '<line x1="20" y1="370" x2="860" y2="370" class="a"/>',
    ]
    return _SVG.format(width=WIDTH, height=HEIGHT, body="\n".join(parts))


def label(x: int, y: int, words: str) -> str:
    return f'<text x="{x}" y="{y}" class="l">{words}</text>'


def text(x: int, y: int, words: str) -> str:
    return f'<text x="{x}" y="{y}" class="t">{words}</text>'


_SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">
<style>
text {{ font-family: sans-serif; fill: #222; }}
.n {{ font-size: 15px; font-weight: bold; text-anchor: middle; }}
.s {{ font-size: 12px; text-anchor: middle; }}
.t {{ font-size: 12px; }}
.l {{ font-size: 13px; font-style: italic; fill: #666; }}
.a {{ fill: none; stroke: #555; stroke-width: 1.5; }}
</style>
<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7"
orient="auto"><path d="M0,0 L8,4 L0,8 z" fill="#555"/></marker></defs>
<rect width="{width}" height="{height}" fill="#ffffff"/>
{body}
</svg>
"""


def main() -> None:
    PICTURE.write_text(drawing(), encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
