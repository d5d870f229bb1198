"""Files of users are read in one way."""

from __future__ import annotations

import ast
import importlib
import json
import math
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel, Field, ValidationError, field_validator

import fantoccini
from fantoccini.base import FileError
from fantoccini.base.documents import (
    ANGLES,
    KEYS,
    LENGTHS,
    UNCLEAR,
    Document,
    Kind,
    Located,
    Mistakes,
    Model,
    Positive,
    document_schema,
    parse_document,
    quantity_schema,
    raise_if_any,
    read_document,
    valid_parts,
    validation_error,
    without_unit,
)

pytestmark = pytest.mark.medium

SOURCE = Path(fantoccini.__file__).parent
LAYER = SOURCE / "base" / "documents"


def subclasses(cls: type) -> set[type]:
    return {sub for own in cls.__subclasses__() for sub in {own, *subclasses(own)}}


@pytest.fixture(scope="module")
def models() -> set[type]:
    """Every pydantic model of the package."""
    for module in pkgutil.walk_packages([str(SOURCE)], "fantoccini."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    return {m for m in subclasses(BaseModel) if m.__module__.startswith("fantoccini.")}


def test_yaml_is_parsed_in_one_place():
    readers = re.compile(r"^\s*(import|from) (ruamel|yaml)\b", re.MULTILINE)
    readers_found = {
        p for p in SOURCE.rglob("*.py") if readers.search(p.read_text(encoding="utf-8"))
    }
    assert readers_found and all(path.is_relative_to(LAYER) for path in readers_found), (
        readers_found
    )


def trees() -> Iterator[tuple[str, ast.Module]]:
    """Every file of the package, with its path there."""
    for path in sorted(SOURCE.rglob("*.py")):
        yield path.relative_to(SOURCE).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def test_mistakes_are_collected_by_one_class():
    """No other class raises errors from its own list."""
    collectors = {
        name
        for name, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "error"
        and any(isinstance(part, ast.Attribute) and part.attr == "findings" for part in node.args)
    }
    assert collectors == {"base/documents/mistakes.py"}
    mistakes = Mistakes(Located(file="a.yaml", lines={("b",): 7}))
    mistakes.raise_if_any()
    mistakes.add(("b", 0), "wrong")
    assert mistakes(("c",), lambda: float("x")) is None and mistakes(("c",), lambda: 3) == 3
    with pytest.raises(FileError, match=r"a\.yaml:7: b\[0\]: wrong") as error:
        mistakes.need(("d",), lambda: 4)
    assert [m.key for m in error.value.mistakes] == ["c", "b[0]"] and len(mistakes) == 2


def test_units_are_read_in_one_place():
    """One module has the patterns of texts with units."""
    pattern = re.compile(r"\bmm\|cm|\(deg\|rad|deg\|rad\)|radians\(float|\bcm.?: *1e-2")
    readers_found = {
        p for p in SOURCE.rglob("*.py") if pattern.search(p.read_text(encoding="utf-8"))
    }
    assert {path.relative_to(LAYER).as_posix() for path in readers_found} == {"units.py"}
    assert without_unit("-1.5e1 cm", LENGTHS) == -0.15
    assert without_unit(" 30deg", ANGLES) == pytest.approx(math.pi / 6)
    for other in ("30 deg", "3 mm2", "mm", "3", 3.0, None, "3 km"):
        assert without_unit(other, LENGTHS) == other
    allowed = quantity_schema(LENGTHS, ANGLES)["anyOf"][1]["pattern"]
    assert re.match(allowed, "12 cm") and not re.match(allowed, "12 kg")


def test_checks_of_a_puppet_know_its_parts():
    """Only plain data, as written in the file, has any type."""
    untyped = {
        f"{name}: {argument.arg}"
        for name, tree in trees()
        if re.match(r"model/puppet/(check|parts|chain)", name)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        for argument in node.args.args
        if argument.annotation is not None and ast.unparse(argument.annotation) == "Any"
    }
    assert untyped == {"model/puppet/check_coordinates.py: value"}


def test_every_schema_has_one_base(models):
    assert {m for m in models if not issubclass(m, Model)} == set()


def test_every_kind_of_file_is_one_document_with_a_schema(models):
    kinds = [m for m in models if issubclass(m, Document) and hasattr(m, "kind")]
    assert sorted(m.kind.name for m in kinds) == sorted(set(KEYS.values()))
    for model in kinds:
        schema = json.loads(json.dumps(document_schema(model)))
        assert schema["title"] == f"fantoccini {model.kind.name}"
        assert schema["additionalProperties"] is False
        assert model.kind.key in schema["properties"]


class Part(Model):
    size: Positive = 1.0
    label: str = ""
    below: tuple[Part, ...] = ()

    @field_validator("below")
    @classmethod
    def _differ(cls, below: tuple[Part, ...]) -> tuple[Part, ...]:
        raise_if_any(
            ((i, "size"), "twice") for i in range(1, len(below)) if below[i] == below[i - 1]
        )
        return below


class Stage(Document):
    kind = Kind("stand", "a stand has `stand` and `parts`")

    stand: str
    parts: dict[str, Part] = Field(default_factory=dict)


def test_mistakes_of_validators_stand_at_their_keys():
    text = "stand: s\nparts:\n  a:\n    below:\n    - {size: 1}\n    - {size: 1}\n  b: {size: 0}\n"
    with pytest.raises(FileError) as error:
        parse_document(text, Stage, name="s.yaml")
    assert [str(m) for m in error.value.mistakes] == [
        "s.yaml:6: parts.a.below[1].size: twice",
        "s.yaml:7: parts.b.size: found 0; needed: a positive number",
    ]


def test_a_document_is_the_same_from_a_file_a_text_and_python(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("stand: s\n\nparts: {a: {}}\n", encoding="utf-8")
    read = read_document(path, Stage)
    assert (
        read
        == parse_document("parts: {a: {}}\nstand: s\n", Stage)
        == Stage(stand="s", parts={"a": {}})
    )
    assert read.located.line(("parts", "a")) == 3 and read.located.folder == tmp_path
    with pytest.raises(FileError, match=r"<python>: parts\.a\.size: found -1"):
        Stage(stand="s", parts={"a": {"size": -1}})


def test_a_file_of_another_kind_is_named():
    with pytest.raises(FileError, match="this is a puppet file; a stand has `stand` and `parts`"):
        parse_document("puppet: p\nbodies: []\n", Stage)


def test_the_valid_parts_of_data_with_mistakes_can_be_checked():
    data = {"size": 2, "label": "a", "below": [{"size": -1, "label": "b"}, 5, {"label": 3}]}
    whole = valid_parts(Part, data, Located())
    assert (whole.size, whole.label) == (2.0, "a")
    first, second, third = whole.below
    assert (first.size, first.label) == (UNCLEAR, "b")
    assert second is UNCLEAR and second.below.label is UNCLEAR and not list(second.below)
    assert (third.size, third.label) == (1.0, UNCLEAR)


def test_refuse_does_nothing_without_mistakes():
    raise_if_any([])
    with pytest.raises(ValidationError):
        raise_if_any([((), "wrong")])
    assert validation_error("wrong").message() == "wrong"
