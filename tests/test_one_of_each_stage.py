"""The theatre has one base class of cues, one table of verbs, and one timeline."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from fantoccini import theatre
from fantoccini.base.documents import Model
from fantoccini.theatre.cast import Actor, Corrections
from fantoccini.theatre.gestures import (
    CuePart,
    Hands,
    LatenessPolicy,
    MotionSequence,
    PendingCue,
    PerformedScript,
    Performer,
    PlacedCue,
)
from fantoccini.theatre.plays.placing import Placement
from fantoccini.theatre.plays.rounds import Results, Round
from fantoccini.theatre.plays.stage_state import StageState
from fantoccini.theatre.script import (
    STYLE_WORDS,
    VERBS,
    CueFile,
    PlayFile,
    ScoreFile,
    Timeline,
    file_key,
)

pytestmark = pytest.mark.medium


def models() -> Iterator[type[Model]]:
    """Every model class that the theatre defines."""
    for info in pkgutil.walk_packages(theatre.__path__, f"{theatre.__name__}."):
        module = importlib.import_module(info.name)
        classes = [part for part in vars(module).values() if isinstance(part, type)]
        yield from (
            part
            for part in classes
            if issubclass(part, Model) and part.__module__ == module.__name__
        )


def cue_types(annotation: object) -> Iterator[type[CueFile]]:
    if isinstance(annotation, type):
        if issubclass(annotation, CueFile):
            yield annotation
        return
    for part in get_args(annotation):
        yield from cue_types(part)


def test_each_verb_is_a_key_of_one_kind_of_cue():
    """Only one model that is no cue has such a key: the gesture file, for its name `gesture`."""
    parts = {key: [part for part in models() if key in part.model_fields] for key in VERBS}
    parts["gesture"] = [part for part in parts["gesture"] if part.__name__ != "GestureFile"]
    assert parts == {key: [verb.cue] for key, verb in VERBS.items()}


def test_all_cues_are_of_the_table():
    with_verbs = {part for part in models() if issubclass(part, CueFile) and part.verb}
    assert with_verbs == {verb.cue for verb in VERBS.values()}


def test_only_cues_are_timed_by_marks_or_moments():
    timed = {part for part in models() if {"on", "when", "may_wait"} & {*part.model_fields}}
    assert {part.__name__ for part in timed if not issubclass(part, CueFile)} == {
        "PropFile",
        "ShotFile",
    }


def test_scores_and_plays_take_the_verbs_of_the_table():
    (lanes,) = [ScoreFile.model_fields["lanes"].annotation]
    acts = PlayFile.model_fields["acts"].annotation
    (act,) = [part for part in get_args(acts) if isinstance(part, type)]
    cues = [*cue_types(lanes), *cue_types(act.model_fields["cues"].annotation)]  # type: ignore[attr-defined]
    assert sorted(part.verb for part in cues if part.verb) == sorted(VERBS)


@pytest.mark.parametrize("key", VERBS)
def test_names_of_a_verb_are_keys_of_its_cues(key: str):
    verb = VERBS[key]
    assert {*verb.name_kinds} <= {*verb.cue.model_fields}
    assert verb.cue.verb == key and file_key(key) not in STYLE_WORDS


def sources() -> Iterator[tuple[str, ast.Module]]:
    """Path and syntax tree of every source file of the theatre."""
    root = Path(theatre.__path__[0])
    for path in sorted(root.rglob("*.py")):
        yield path.relative_to(root).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and (getattr(node.func, "id", "") == name or getattr(node.func, "attr", "") == name)
    ]


def test_scores_and_plays_have_one_reader():
    """Only `script/reading.py` reads their files."""
    readers = {
        name
        for name, tree in sources()
        for call in calls(tree, "read_document")
        if {"kind", "ScoreFile", "PlayFile"} & {getattr(arg, "id", "") for arg in call.args}
    }
    assert readers == {"script/reading.py"}


def test_there_is_one_timeline_and_one_order_of_placing():
    timelines = {name for name, tree in sources() if calls(tree, "Timeline")}
    assert timelines == {"script/timeline.py"}
    sorting_modules = {name for name, tree in sources() if calls(tree, "TopologicalSorter")}
    assert sorting_modules <= {"script/times.py"}
    heap_modules = {name for name, tree in sources() if calls(tree, "heappop")}
    assert {name for name in heap_modules if not name.startswith("pathfinding/")} == {
        "script/timeline.py"
    }


def test_scores_and_plays_have_one_performer():
    """Only the performer places cues on the timeline; it and its callers create placed cues."""
    used = {name for name, tree in sources() if calls(tree, "Performer")}
    assert used == {"gestures/placing.py", "plays/placing.py"}
    for kind in ("PendingCue", "PlacedCue", "PerformedScript"):
        callers = {name for name, tree in sources() if calls(tree, kind)}
        assert callers, kind
        assert callers <= {"gestures/performing.py", "gestures/placing.py", "plays/placing.py"}
    placing = [
        (name, call)
        for name, tree in sources()
        for call in calls(tree, "place")
        if isinstance(call.func, ast.Attribute)
        and getattr(call.func.value, "attr", getattr(call.func.value, "id", "")) == "timeline"
    ]
    assert {name for name, _ in placing} == {"gestures/performing.py"}


def test_late_cues_are_judged_by_policies():
    """A score reports them and a play refuses them; there is no other difference."""
    users = {
        name: calls(tree, "LatenessPolicy")
        for name, tree in sources()
        if calls(tree, "LatenessPolicy")
    }
    assert {name: len(policies) for name, policies in users.items()} == {
        "gestures/placing.py": 1,
        "plays/placing.py": 1,
    }


def test_transitions_are_timed_in_one_place():
    """Only the search for a free lane asks for a transition's time in gestures, casts and plays."""
    callers = {name for name, tree in sources() if calls(tree, "lead_time")}
    assert {name for name in callers if name.startswith(("plays/", "cast/", "gestures/"))} == {
        "gestures/performing.py"
    }


def test_the_other_side_is_named_in_one_place():
    """Only one module defines a constant with the words left and right."""
    modules = [
        name
        for name, tree in sources()
        if name.startswith(("cast/", "plays/"))
        for node in tree.body
        if isinstance(node, ast.Assign)
        and {part.value for part in ast.walk(node.value) if isinstance(part, ast.Constant)}
        == {"left", "right"}
    ]
    assert modules == ["cast/contacts.py"]


PLACING_VALUES = (
    Actor,
    Hands,
    Results,
    MotionSequence,
    StageState,
    CuePart,
    PerformedScript,
    Performer,
    PlacedCue,
    Placement,
)


@pytest.mark.parametrize(
    "kind", [*PLACING_VALUES, LatenessPolicy, Round, Timeline, PendingCue, Corrections]
)
def test_values_of_placing_are_immutable(kind: type):
    assert dataclasses.is_dataclass(kind) and kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
    for field in dataclasses.fields(kind):
        assert not re.match(r"(list|dict|set)", str(field.type)), field


def test_gestures_are_varied_in_one_place():
    """Scores, plays and buttons of the live page have the same variations in the same order."""
    variations = ("mirrored", "scaled", "repeated")
    app = Path(theatre.__path__[0]).parent / "app"
    pages = [(p.name, ast.parse(p.read_text(encoding="utf-8"))) for p in app.rglob("*.py")]
    varied = {
        name
        for name, tree in [*sources(), *pages]
        for call in (call for variation in variations for call in calls(tree, variation))
        if isinstance(call.func, ast.Attribute)
    }
    assert varied == {"gestures/styling.py"}
    modules = {
        name
        for name, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript) and getattr(node.value, "id", "") == "STYLE_WORDS"
    }
    assert modules == {"gestures/styling.py"}
