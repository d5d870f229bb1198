"""Pages have one builder and formulas one place: a second one fails here."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fantoccini.base import catenary, polynomial, rotation, unit
from fantoccini.output.html import Page, Table

SOURCE = Path(__file__).resolve().parents[1] / "src" / "fantoccini"
MARKUP = re.compile(r"<(html|body|h[1-6]|p|div|span|table|tr|td|th|ul|li|img|svg|style)\b")


def constants(tree: ast.AST) -> Iterator[str]:
    """The texts of a module, without docstrings."""
    documented = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in documented
        ):
            yield node.value


def test_only_the_builder_writes_markup():
    writers = {
        file.relative_to(SOURCE).as_posix()
        for file in SOURCE.rglob("*.py")
        if any(MARKUP.search(text) for text in constants(ast.parse(file.read_text("utf-8"))))
    }
    assert writers == set()


def test_every_text_of_a_page_is_escaped():
    hostile = "<b onload='x'>\"&\x1b\ud800"
    page = Page(hostile, hostile)
    for add in (page.section, page.subsection, page.text, page.note):
        add(hostile)
    page.verdict(hostile, holds=False)
    page.items([hostile])
    page.table(Table((hostile, "right>"), ((hostile, hostile),), frozenset({0})))
    text = page.to_html()
    assert "<b" not in text.replace("<body", "") and "\x1b" not in text
    assert text.encode("utf-8").count(b"&lt;b onload") == 11


@pytest.mark.parametrize("add", ["text", "note"])
def test_empty_texts_are_left_out(add):
    page = Page("a", "b")
    getattr(page, add)("")
    page.items([])
    assert not {"<p", "<ul"} & set(re.findall(r"<\w+", page.to_html()))


# A line of each formula that a second implementation would probably contain.
FORMULAS = {
    "catenary: ln(sinh(u) / u) and its slope": (r"log1p\(-np\.exp\(|tanh\(u\)", {"hanging"}),
    "minimum jerk": (r"10(\.0)? - 15(\.0)? \* |10(\.0)?, -15(\.0)?, 6|1\.875", {"polynomial"}),
    "matrix to quaternion": (r"1(\.0)? \+ \w+ - \w+ - \w+\b|spatial\.transform", {"rotation"}),
    "quaternion to matrix": (r"1(\.0)? - \(?yy \+ zz|1(\.0)? - 2(\.0)? \* \(y", {"rotation"}),
    "rotation about an axis": (r"\(1(\.0)? - \w+(\(\w+\))?\) \* (\w+) @ \3", {"rotation"}),
    "skew matrix": (r"\[0(\.0)?, -(\w+(\[\w\])?), \w+(\[\w\])?\], \[\2, 0", {"rotation"}),
    "nearest whole turn": (r"round\(.*/ (math\.tau|\(?2(\.0)? \* np\.pi)", {"rotation"}),
    "quaternion product": (r"p_?w \* q_?v|\bw[01] \* w[01] - x[01] \* x[01]", {"rotation"}),
    "perpendicular vector": (r"np\.eye\(3\)\[np\.argmin\(np\.abs\(", {"vectors"}),
}


@pytest.mark.parametrize("formula", FORMULAS)
def test_a_formula_is_implemented_once(formula):
    pattern, home = FORMULAS[formula]
    places = {
        file.relative_to(SOURCE).as_posix()
        for file in SOURCE.rglob("*.py")
        if re.search(pattern, file.read_text("utf-8"))
    }
    assert places == {f"base/{name}.py" for name in home}


def test_the_quaternion_of_a_matrix_is_the_one_of_scipy():
    rng = np.random.default_rng(0)
    q = rotation.normalised(rng.normal(size=(2, 500, 4)) * [1.0, 1.0, 1e-9, 1.0])
    R = rotation.matrix(q)
    peer = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat()[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(rotation.quaternion(R), peer.reshape(q.shape), rtol=0, atol=1e-15)
    np.testing.assert_allclose(rotation.quaternion(R[0, 0]), rotation.quaternion(R)[0, 0])


def test_the_smallest_rotation_turns_one_vector_into_another():
    rng = np.random.default_rng(1)
    a, b = unit(rng.normal(size=(2, 300, 3)))
    b[:100] = -a[:100]
    turn = rotation.shortest(a, b)
    np.testing.assert_allclose(rotation.apply(rotation.matrix(turn), a), b, rtol=0, atol=1e-14)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))
    np.testing.assert_allclose(np.linalg.norm(rotation.log(turn), axis=1), angle, atol=1e-7)
    np.testing.assert_array_equal(rotation.shortest(a[0], b), rotation.shortest(a[[0]], b))


def test_a_rotation_about_an_axis_is_the_exponential_of_its_vector():
    rng = np.random.default_rng(2)
    axis, angle = unit(rng.normal(size=(50, 3))), rng.uniform(-4.0, 4.0, 50)
    R = rotation.about(axis, np.cos(angle), np.sin(angle))
    wanted = rotation.matrix(rotation.exp(angle[:, None] * axis))
    np.testing.assert_allclose(R, wanted, rtol=0, atol=4e-15)
    rows = rotation.about_rows(axis[0].tolist(), np.cos(angle[0]), np.sin(angle[0]))
    np.testing.assert_allclose(rows, wanted[0], rtol=0, atol=4e-15)


def test_a_minimum_jerk_move_keeps_its_bounds_and_no_shorter_one_does():
    s = np.linspace(0.0, 1.0, 10_001)
    way, rate, curve = polynomial.minimum_jerk(s)
    ends = [x[[0, -1]].tolist() for x in (way, rate, curve)]
    assert ends == [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]
    np.testing.assert_allclose(np.gradient(way, s)[1:-1], rate[1:-1], atol=1e-6)
    np.testing.assert_allclose(np.gradient(rate, s)[1:-1], curve[1:-1], atol=1e-5)
    for speed, acceleration in ((1.0, 100.0), (100.0, 1.0)):
        T = polynomial.minimum_jerk_duration(0.5, speed, acceleration)
        used = max(0.5 * rate.max() / T / speed, 0.5 * curve.max() / T**2 / acceleration)
        assert used == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("slack", [1e-5, 0.1, 10.0])
def test_a_catenary_has_its_length_and_its_ends(slack):
    rng = np.random.default_rng(3)
    along = rng.normal(size=(20, 3))
    along[0, :2] = 0.0
    span, flat = np.linalg.norm(along, axis=1), np.hypot(along[:, 0], along[:, 1])
    a, first, last = catenary(along, (1.0 + slack) * span)
    np.testing.assert_allclose(last - first, (1.0 + slack) * span, rtol=1e-14)
    rise = np.hypot(a, last) - np.hypot(a, first)
    np.testing.assert_allclose(rise, along[:, 2], rtol=0, atol=1e-9)
    wide = a * (np.arcsinh(last / a) - np.arcsinh(first / a))
    np.testing.assert_allclose(wide[1:], flat[1:], rtol=1e-8)
