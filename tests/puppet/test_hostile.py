"""Reading any file ends soon, in a puppet or in located problems."""

from __future__ import annotations

import itertools
import time

import pytest
from hypothesis import given, settings, strategies as st
from tests.puppet.strategies import KINDS

from fantoccini import puppets
from fantoccini.base.documents.limits import LIMITS
from fantoccini.base.documents.located import Located, read_located, validate
from fantoccini.base.errors import FileError, InputError, PuppetError
from fantoccini.model.puppet import Puppet, json_schema, load, loads

pytestmark = pytest.mark.medium

_ANCHORS = "abcdefghij"
BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{new}: &{new} [{', '.join(['*' + old] * 9)}]\n" for old, new in itertools.pairwise(_ANCHORS)
)

HOSTILE = {
    "ten megabytes": ("#" * 10_000_000, None, "larger than 2 MB"),
    "an alias bomb": (BOMB, 5, "aliases repeat more than"),
    "an alias of itself": ("a: &a [*a]", 1, "needs an anchor before it"),
    "an alias as a key": ("a: &a b\n*a : 1", 2, "an alias cannot be a key"),
    "lists in lists": ("puppet: p\nbodies: " + "[" * 3000, 2, "nested deeper than 40 levels"),
    "mappings in mappings": (
        "a:\n" + "".join(" " * i + "a:\n" for i in range(1, 99)),
        41,
        "nested",
    ),
    "values without end": ("bodies: [" + "1," * 150_000 + "1]", 1, "more than 100000 values"),
    "code in a tag": ("puppet: !!python/object/apply:os.system [ls]", 1, "tags are not read"),
    "a list": ("- a\n- b\n", 1, "needed: a mapping"),
    "a word": ("hello", 1, "needed: a mapping"),
    "nothing": ("", 1, "the file is empty"),
    "only a comment": ("# nothing\n", 1, "the file is empty"),
    "Latin-1": (b"puppet: p\n# caf\xe9\n", 2, "found the byte 0xe9; the file must be UTF-8"),
    "UTF-16": ("puppet: p\n".encode("utf-16"), 1, "must be UTF-8"),
    "a zero byte": ("puppet: p\nbodies:\n  - name: \0\n", 3, "is not allowed"),
    "tabs": ("puppet: p\nbodies:\n\t- name: a\n", 3, "found a tab"),
    "an open bracket": ("puppet: p\nbodies: [", 2, "not YAML"),
    "a huge number": ("puppet: p\nfloor: 1" + "0" * 5000, 2, "needed: a finite number"),
}


@pytest.mark.parametrize(("text", "line", "message"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_text_ends_in_a_located_problem(text, line, message) -> None:
    start = time.perf_counter()
    with pytest.raises(PuppetError) as caught:
        loads(text, "bad.yaml")
    assert time.perf_counter() - start < 30.0
    located = [(p.line, p.message) for p in caught.value.mistakes if message in p.message]
    assert [at for at, _ in located] == [line], caught.value.mistakes


def test_a_large_file_is_refused_before_it_is_read_whole(tmp_path) -> None:
    path = tmp_path / "large.yaml"
    with path.open("wb") as stream:
        stream.truncate(100 * LIMITS.max_file_bytes)
    with pytest.raises(PuppetError, match="larger than 2 MB"):
        load(path)


def test_a_long_list_of_mistakes_is_cut_and_counted() -> None:
    text = "puppet: p\nbodies:\n" + "".join(f"  - {{name: b{i}, mass: -1}}\n" for i in range(500))
    with pytest.raises(PuppetError) as caught:
        loads(text)
    assert len(caught.value.mistakes) == LIMITS.max_mistakes + 1
    assert caught.value.mistakes[0].line == 3
    assert caught.value.mistakes[-1].message == "and 400 more"


def test_messages_stay_on_one_line_and_show_no_control_characters() -> None:
    text = 'puppet: "a\\n\\e[31m*/"\n"k\\n\\e": "x"\nbodies: [{name: a, "\\r": 1}]\n'
    with pytest.raises(PuppetError) as caught:
        loads(text, "bad.yaml")
    assert len(caught.value.mistakes) == 3
    assert all(str(p).isprintable() for p in caught.value.mistakes)


def test_a_few_aliases_are_welcome() -> None:
    text = """\
puppet: p
bodies:
  - name: a
    shapes: &ball [{type: sphere, radius: 0.1, mass: 1}]
  - {name: b, shapes: *ball}
"""
    first, second = loads(text).bodies
    assert first.shapes == second.shapes


def test_scalars_are_read_as_yaml_1_2_says() -> None:
    data = read_located("[1, -2, 1e-3, .5, 1., 010, 0x1F, yes, on, true, ~, '1', 1_0]", "f").data
    assert data == [1, -2, 1e-3, 0.5, 1.0, 10, "0x1F", "yes", "on", True, None, "1", "1_0"]


def test_other_files_can_ask_for_their_own_error() -> None:
    with pytest.raises(InputError):
        read_located("a: [", "inputs.yaml", error=InputError)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes_end_in_a_file_error(raw: bytes) -> None:
    with pytest.raises(FileError):
        loads(raw)


@settings(max_examples=150, deadline=None)
@given(st.text(alphabet="ab:-[]{}&*!?|>'\"#%@`,~ \n\t0.1e\\<=", max_size=60))
def test_any_punctuation_ends_in_a_file_error(text: str) -> None:
    with pytest.raises(FileError):
        loads(text)


_KEYS = sorted(
    {key for part in json_schema()["$defs"].values() for key in part["properties"]}
    | set(json_schema()["properties"])
    | {"a", "b", "left", "right", "world", "x", "xz", *KINDS, "box", "sphere", "capsule"}
)
_TOP = sorted(json_schema()["properties"])
_LEAVES = st.one_of(
    st.sampled_from(_KEYS), st.none(), st.booleans(), st.integers(-2, 2), st.floats(), st.text()
)
_TREES = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(_KEYS), inner, max_size=5)
    ),
    max_leaves=25,
)


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(st.sampled_from(_TOP), _TREES, max_size=9))
def test_any_data_under_known_keys_ends_in_a_puppet_or_a_file_error(data: dict) -> None:

    try:
        validate(Puppet, Located(data, "any.yaml"), PuppetError)
    except PuppetError as error:
        assert error.mistakes


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_puppet_with_one_line_damaged_ends_in_a_puppet_or_a_file_error(data) -> None:
    lines = puppets.path("arm3d").read_text().splitlines()
    k = data.draw(st.integers(0, len(lines) - 1))
    words = lines[k].split(" ")
    w = data.draw(st.integers(0, len(words) - 1))
    words[w] = data.draw(st.sampled_from(["", "-1", ".nan", "[]", "{}", "null", "'", "x", "- a"]))
    lines[k] = " ".join(words)
    try:
        loads("\n".join(lines))
    except PuppetError as error:
        assert error.mistakes


DRIVEN = """puppet: p
bodies:
  - {name: a, joint: {type: prismatic, axis: [1, 0, 0], driven: true}, mass: 1}
strings:
  - {name: s, path: [{body: a}, {driven: [x, 3], at: [0, 0, 1]}], length: 1}
drives: [{on: [VALUE], mass: 1}]
"""


@pytest.mark.parametrize("value", ["3", "null", "{a: 1}", "zzz.qqqqq"])
def test_names_of_driven_coordinates_that_are_no_texts(value) -> None:
    with pytest.raises(PuppetError, match=r"drives\[0\]\.on\[0\]") as caught:
        loads(DRIVEN.replace("VALUE", value))
    assert "object at" not in str(caught.value)


def test_unclear_points_are_not_the_same_point() -> None:
    bad = "[{parameter: NAME, value: x}, 0, 0]"
    point = "{body: bob, at: " + bad + "}"
    twice = ", ".join(point.replace("NAME", name) for name in ("u", "w"))
    text = "puppet: p\nbodies:\n  - {name: bob, joint: {type: free}, mass: 1}\n"
    path = "[" + twice + ", {world: [0, 0, 1]}]"
    with pytest.raises(PuppetError) as caught:
        loads(text + "strings:\n  - {name: s, path: " + path + ", length: 2}\n")
    assert "same point" not in str(caught.value)
