"""``python -m docs.architecture``: writes docs/architecture.md and the drawing of the pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "fantoccini"
PAGE = ROOT / "docs" / "architecture.md"
PICTURE = ROOT / "docs" / "pictures" / "pipeline.svg"

PACKAGES = {
    "base": (
        "utilities for every other package",
        "errors, arrays, rotations, polynomials, files; "
        "`documents`: YAML, JSON schemas, mistakes with their line numbers",
    ),
    "model": (
        "description of a puppet",
        "`puppet`: its file; `scene`; `meshes`; `tree`: links, rows, coordinates; `body_map.py`: "
        "trunk, head, limbs and their strings; `puppets`: bundled files",
    ),
    "motion": (
        "states, inputs and trajectories: data only, no simulation",
        "`state.py`; `input.py`: piecewise polynomials through waypoints; `trajectory.py`: "
        "samples and events of a run",
    ),
    "kernel": (
        "from equations of motion to compiled functions",
        "`contract`: functions shared by Python and C++; `equations`: symbolic; `codegen`: to C++; "
        "`build`: compiler and cache; `runtime`: ctypes; `cpp`: integrators, impulses, solvers",
    ),
    "dynamics": (
        "simulation and analysis of a puppet",
        "`compiled`: functions of a state such as tensions, and the ODE between events; "
        "`steppers`: runs advanced step by step; `derivatives`; `equilibrium`: rest, vibration "
        "modes; `body_map`: which bodies are limbs; `marionette`: the public class; `simulation`: "
        "whole runs; `clearance`: distances; `mujoco`: MJCF export, and runs in MuJoCo",
    ),
    "control": (
        "motion planning and optimal control",
        "`tasks`: goals, costs, bounds, files; `optimal`: optimise, follow, MPC, reach, tune; "
        "`problems`: tasks prepared for searches, rollouts; `planning`: search among obstacles",
    ),
    "theatre": (
        "gestures, motion capture, plays, live performance",
        "`script`: files of scores and plays, their cues, verbs and times; `gestures`: gestures, "
        "and scores that time them in beats; `capture`: BVH files; `retarget`: clips transferred "
        "to puppets; `cast`: players, props; `pathfinding`: walks on the stage; `plays`: plays "
        "compiled and verified; `perform`: live performance",
    ),
    "lab": (
        "identification and parameter studies",
        "`identification`: from records of motion; `sweeps`: parameter studies; "
        "`reduction.py`: the kinematic reduction",
    ),
    "stand": (
        "stands: machines with motors that move a puppet",
        "`stand_file.py`; `check.py`: whether the axes can follow a run; `step_loss.py`: "
        "lost steps of stepper motors; `points.py`: set points; `gcode_text.py`; `streaming.py`: "
        "G-code over a serial port; `sending.py`: packets over a network; `stands`: bundled files",
    ),
    "output": (
        "pictures, films, reports; formats of other programs",
        "`view`: pictures, plots, films; `html`: pages; `reports`; `animation`: glTF, USD, BVH "
        "export; `exchange`: MJCF and URDF import",
    ),
    "app": (
        "command line and browser pages",
        "`cli`: commands; `cli_support`: arguments and messages; `web`: starts the right page; "
        "`pages`: drawing and replay in the browser; `live`: pages with a live puppet",
    ),
}
"""Purpose and contents of each package, in the order of imports."""

CODE_PATHS = {
    "From a puppet file to its compiled library": (
        ("model/puppet/files.py", "load", "text to a validated `Puppet`"),
        ("model/tree/construction.py", "grow", "links, rows, coordinates"),
        (
            "dynamics/compiled/libraries.py",
            "Libraries",
            "one library for each purpose, when needed",
        ),
        (
            "kernel/equations/system.py",
            "System",
            "Eqs. 1 to 11 of the paper (`docs/equations.md`), symbolically",
        ),
        ("kernel/codegen/libraries.py", "generate", "C++ of the model around `kernel/cpp`"),
        ("kernel/build/cache.py", "obtain", "compiled, or from the cache"),
        ("kernel/runtime/compiled.py", "Library", "loaded"),
    ),
    "From an Input to a run in C++": (
        ("motion/input.py", "Input", "waypoints to quintic pieces"),
        (
            "motion/binding.py",
            "bound",
            "coordinates that the input does not name hold their start values",
        ),
        ("dynamics/simulation/run.py", "simulate", "start, input and options are checked"),
        ("kernel/runtime/compiled.py", "Run", "passes arrays to C++, returns samples and events"),
        (
            "kernel/cpp/fantoccini/runs/drive.hpp",
            "Drive",
            "evaluates q_K, v_K, acc_K at a given time",
        ),
        ("kernel/cpp/fantoccini/event/run.hpp", "EventRun", "steps, events"),
        (
            "kernel/cpp/fantoccini/event/closed_rows.hpp",
            "ClosedRows",
            "impulses of catches, the next active set",
        ),
    ),
    "From a play file to its run": (
        ("theatre/script/reading.py", "read_script", "the file to cues, each with its verb's keys"),
        ("theatre/plays/reading.py", "Script", "its cast, and its cues in time"),
        (
            "theatre/plays/compiling.py",
            "load_play",
            "places and simulates the cues, until every requirement holds",
        ),
        ("theatre/plays/placing.py", "place_cues", "cues get times, places and walks"),
        (
            "theatre/plays/runs.py",
            "runs_of",
            "event-driven run of each company, the puppets and props that may touch one another",
        ),
        (
            "theatre/plays/verifying.py",
            "verify_play",
            "runs the whole play and checks every requirement",
        ),
    ),
    "From a captured clip to a run": (
        ("theatre/capture/bvh.py", "load_bvh", "joints of a skeleton over time"),
        ("theatre/retarget/mapping.py", "load_mapping", "its joints to parts of a person"),
        (
            "theatre/retarget/retargeting.py",
            "retarget_clip",
            "nearest hanging pose for every frame",
        ),
        ("theatre/retarget/following.py", "follow_clip", "motions of the hands, and the run"),
    ),
}
"""Files in the order of the flow of data, with a function or class of each."""


@dataclass(frozen=True)
class Task:
    """An extension and the files it touches.

    Attributes:
        title: name of the extension.
        steps: (instruction, files relative to ``src/fantoccini``, or to the repository if they
            begin with a slash).
    """

    title: str
    steps: tuple[tuple[str, tuple[str, ...]], ...]


_PLACING = ("theatre/plays/placing.py", "theatre/plays/handling.py")

TASKS = (
    Task(
        "a quantity, evaluated for a state",
        (
            ("declare its arguments and results", ("kernel/contract/functions.py",)),
            ("return its expression from `_NAME`", ("kernel/equations/functions.py",)),
            ("derive it, if the system does not have it yet", ("kernel/equations/system.py",)),
            ("evaluate it", ("dynamics/marionette/marionette.py",)),
        ),
    ),
    Task(
        "a joint type",
        (
            (
                "schema: the type, its keys, and other programs' names for it",
                (
                    "model/puppet/joint.py",
                    "model/puppet/words.py",
                    "model/puppet/check_coordinates.py",
                ),
            ),
            ("its mirror image", ("model/puppet/mirror.py",)),
            (
                "its coordinates, and its numerical forward kinematics",
                ("model/tree/joints.py", "model/tree/placement.py", "model/tree/inertia.py"),
            ),
            (
                "motion subspace and relative motion",
                (
                    "kernel/equations/kinematics.py",
                    "kernel/equations/inertia.py",
                    "kernel/equations/coriolis.py",
                ),
            ),
            (
                "spring and limits, if it has any",
                ("kernel/equations/system.py", "kernel/equations/rows.py"),
            ),
            (
                "its motion by a hand, and the bounds of planned motions",
                ("theatre/perform/handle.py", "control/problems/feasible.py"),
            ),
            (
                "export to MuJoCo, and import from it",
                (
                    "dynamics/mujoco/joints.py",
                    "dynamics/mujoco/mjcf_model.py",
                    "output/exchange/mjcf_bodies.py",
                ),
            ),
        ),
    ),
    Task(
        "a kind of string that is a constraint (such as a wire)",
        (
            (
                "schema: its keys, and which of them exclude each other",
                ("model/puppet/elements.py",),
            ),
            (
                "its row",
                (
                    "model/tree/structure.py",
                    "model/tree/construction.py",
                    "kernel/equations/rows.py",
                ),
            ),
            (
                "a flag of the generated model, which the solvers read",
                (
                    "kernel/codegen/tables.py",
                    "kernel/cpp/fantoccini/model/evaluation.hpp",
                    "kernel/cpp/fantoccini/solvers/active_set.hpp",
                ),
            ),
            (
                "bounds on its tension for the functions of a state",
                ("dynamics/compiled/compiled_puppet.py",),
            ),
            (
                "print it in `info`; export it to MuJoCo or raise an error",
                ("app/cli/info.py", "dynamics/mujoco/mjcf_model.py"),
            ),
        ),
    ),
    Task(
        "a kind of string that exerts a force (such as a chain)",
        (
            ("schema: its keys", ("model/puppet/elements.py", "model/puppet/chain.py")),
            (
                "its row, and links if it has masses",
                ("model/tree/structure.py", "model/tree/construction.py", "model/tree/chains.py"),
            ),
            ("energy and gradient", ("kernel/equations/elastic.py",)),
            ("the longest stable step", ("dynamics/compiled/checks.py",)),
            (
                "draw it; export it to MuJoCo or raise an error",
                ("output/view/geometry.py", "dynamics/mujoco/mjcf_model.py"),
            ),
        ),
    ),
    Task(
        "a method of integration",
        (
            (
                "the step, its trajectory with the interface that the common loop of fixed-step "
                "methods calls, and a header that exports it to Python",
                (
                    "kernel/cpp/fantoccini/variational/step.hpp",
                    "kernel/cpp/fantoccini/variational/trajectory.hpp",
                    "kernel/cpp/fantoccini/runs/stepping.hpp",
                    "kernel/cpp/fantoccini/interface/variational.hpp",
                ),
            ),
            (
                "a library of its own",
                ("kernel/codegen/libraries.py", "dynamics/compiled/libraries.py"),
            ),
            ("its options", ("dynamics/compiled/methods.py",)),
            ("validation of the start state", ("dynamics/compiled/checks.py",)),
            (
                "checks of its results",
                ("dynamics/steppers/soundness.py", "dynamics/simulation/batch_verdicts.py"),
            ),
            ("its name on the command line", ("app/cli_support/options.py",)),
        ),
    ),
    Task(
        "a bundled puppet",
        (
            (
                "the file, and a function of the same name",
                ("model/puppets/arm2d.yaml", "dynamics/marionette/puppets.py"),
            ),
            ("a performance of it", ("model/puppets/performances/toss.yaml",)),
            ("its picture and film (`make gallery`)", ("/docs/gallery.py",)),
        ),
    ),
    Task(
        "a kind of file that users write",
        (
            ("its model, a `Document`", ("stand/stand_file.py",)),
            ("the key that identifies its kind", ("base/documents/document.py",)),
            ("its JSON Schema", ("app/cli/app.py",)),
        ),
    ),
    Task(
        "a verb of plays",
        (
            ("its keys, and their messages", ("theatre/script/cues.py",)),
            (
                "its requirements, the parts it moves, and its verification",
                ("theatre/script/verbs.py",),
            ),
            ("place it, as a gesture, as a walk, or with props", _PLACING),
            ("its gesture, if it is not a bundled one", ("theatre/plays/sitting.py",)),
            ("check its run", ("theatre/plays/failures.py",)),
            ("describe it", ("/docs/plays.md",)),
        ),
    ),
    Task(
        "a command",
        (
            ("declare it and its help; import the module inside the function", ("app/cli/app.py",)),
            (
                "declare its arguments in the same file, or in a class if there are many",
                ("app/cli_support/arguments.py",),
            ),
            ("do the work in a module of its own", ("app/cli/check.py",)),
            ("describe it and every option, which a test checks", ("/docs/cli.md",)),
            ("list it", ("/tests/cli/test_arguments.py",)),
        ),
    ),
    Task(
        "a kind of file that `fantoccini show` opens",
        (
            ("recognise it", ("app/web/page.py",)),
            ("show it: live, or as a replay", ("app/live/live.py", "app/pages/replay.py")),
            ("write it as one file", ("app/pages/export.py",)),
        ),
    ),
    Task(
        "a format of animations",
        (
            (
                "a line of `FORMATS`, with the library that it needs",
                ("output/animation/formats.py",),
            ),
            ("its function `write(scene, path)`", ("output/animation/usd.py",)),
            ("describe it", ("/docs/export.md", "/docs/cli.md")),
        ),
    ),
    Task(
        "a page of the docs",
        (
            ("write it; link it from the README", ("/docs/install.md", "/README.md")),
            ("place it in the navigation", ("/mkdocs.yml",)),
        ),
    ),
    Task(
        "a name of the public API",
        (
            ("list it", ("__init__.pyi",)),
            ("give a new package a title in the reference", ("/docs/site/reference.py",)),
        ),
    ),
)
"""Extensions; if a folder has several similar files, the named file is the example to copy."""


SEPARATE_SOLVERS = (
    (
        "rest of a puppet",
        "dynamics/equilibrium/equilibrium.py",
        "rest",
        "q_D and tensions, for given q_K",
        "from any start, with contact, chains and drives; needs only the library that every puppet "
        "has",
    ),
    (
        "rest as a function of hands and parameters",
        "kernel/cpp/fantoccini/search/hanging.hpp",
        "Hanging",
        "the same",
        "it solves the equations of `rest`, but with exact derivatives with respect to q_K and "
        "parameters, for thousands of poses per second. It has its own library, without contact. "
        "It starts at a result of `rest`, and all its poses are equilibria",
    ),
    (
        "pose nearest to a goal",
        "control/problems/balance.py",
        "nearest_equilibrium",
        "q_D, q_K and tensions",
        "least squares of forces and goal residuals together, since the pose need not be an "
        "equilibrium; no library to compile. SciPy computes the tensions in a third of the time "
        "of a call of the compiled solver; the results agree to rounding",
    ),
    (
        "stance of a puppet",
        "control/problems/standing.py",
        "stance",
        "none",
        "no solver: a pose of `nearest_equilibrium`, a `rest` above it, and lowering runs",
    ),
)
"""Problem, file, name, unknowns, and the reason why it is not one with the one before."""


def page() -> str:
    """The text of docs/architecture.md."""
    apart = [
        f"| {problem} | `{file}` (`{name}`) | {unknowns} | {reason} |"
        for problem, file, name, unknowns, reason in SEPARATE_SOLVERS
    ]
    packages = [
        f"| `{name}` | {purpose} | {contents} |" for name, (purpose, contents) in PACKAGES.items()
    ]
    walks = []
    for title, steps in CODE_PATHS.items():
        path = " → ".join(f"`{file}` (`{name}`): {does}" for file, name, does in steps)
        walks.append(f"- **{title}.** {path}.")
    tasks = [
        f"| {task.title} | {'; '.join(f'{step}: {files(names)}' for step, names in task.steps)} |"
        for task in TASKS
    ]
    return _TEXT.format(
        packages="\n".join(packages),
        walks="\n".join(walks),
        apart="\n".join(apart),
        tasks="\n".join(tasks),
    )


def files(names: tuple[str, ...]) -> str:
    """The files of a step as the page names them."""
    return ", ".join(f"`{name.removeprefix('/')}`" for name in names)


_TEXT = """# Architecture

After this page you know what each of the eleven packages contains, how data flows through them, and
which files to change for common extensions.

The last column names sub-packages, and modules where the name ends in `.py`. A package imports only
from packages above it in this table, and only names that the `__init__` of a package or sub-package
exports. `tests/test_architecture.py` enforces both rules. The one exception is `base/drawing.py`,
which imports `output` when a method that draws (`run.plot()`) is called.

| Package | Purpose | Contents |
|---|---|---|
{packages}

![From the puppet file to a compiled library, from states and inputs to trajectories, and the
packages built on them](pictures/pipeline.svg)

The integrators, the complementarity solver and the planner's rollouts are C++ templates in
`kernel/cpp/fantoccini`, compiled for each puppet with its dimensions as constants. They advance one
trajectory, or several at once in SIMD lanes. A folder there includes only from itself and from
the folders before it in this list: `math`, `solvers`, `model`, `collision`, `contact`, `runs`,
`event`, `timestepping`, `variational`, `derivatives`, `search`, `interface`
(`tests/cpp/test_include_order.py`).

## Four paths through the code

Paths are relative to `src/fantoccini`.

{walks}

## Equilibria

Nearly every task is done in one place only (`tests/test_one_of_each*.py`). Equilibria are computed
in several places, which differ in their unknowns or in the library that they need. Paths are
relative to `src/fantoccini`.

| Problem | Where | Unknowns | Why it is separate |
|---|---|---|---|
{apart}

## Common extensions

Paths are relative to `src/fantoccini`; `README.md`, `mkdocs.yml` and paths that begin with `docs/`
or `tests/` are relative to the root of the repository. If a folder has several similar files, the
named file is the example to copy. Every extension also needs a test, a line in `CHANGELOG.md` and a
section in the docs.

| To add | Change |
|---|---|
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
    style = f'fill="{FILLS[kind]}" stroke="{LINES[kind]}"'
    return (
        f'<rect x="{x}" y="{y}" width="{width}" height="56" rx="6" {style}/>'
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
        ("code", "puppet", "model: schema"),
        ("code", "tree", "model: links"),
        ("code", "equations", "kernel: CasADi"),
        ("code", "codegen", "kernel: C++, C99"),
        ("code", "build", "kernel: compiler"),
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
        box(740, middle, width, "code", "runtime", "kernel: ctypes"),
        arrow((800, top + 56), (800, middle - 2)),
        text(808, 134, "library"),
        box(452, middle, 168, "code", "dynamics", "functions of a state"),
        arrow((740, middle + 28), (622, middle + 28)),
        arrow((368, top + 56), (368, 128), (490, 128), (490, middle - 2)),
        text(376, 122, "tree"),
        arrow((540, top + 56), (540, middle - 2)),
        text(548, 134, "interpreted functions"),
        box(20, middle, 168, "data", "State, Input", "motion"),
        box(452, low, 168, "code", "dynamics", "runs and batches"),
        arrow((536, middle + 56), (536, low - 2)),
        arrow((104, middle + 56), (104, low + 28), (450, low + 28)),
        box(692, low, 168, "data", "Trajectory", "events, tensions, ledger"),
        arrow((620, low + 28), (690, low + 28)),
        label(20, last - 20, "built on it"),
    ]
    fronts = (
        ("control", "plans, optima"),
        ("theatre", "plays, live"),
        ("lab", "numbers"),
        ("stand", "motors"),
        ("output", "pictures, formats"),
        ("app", "commands, browser"),
    )
    for k, (name, line) in enumerate(fronts):
        parts.append(box(20 + 142 * k, last, 130, "front", name, line))
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
