"""Printed equations look like those of a textbook, and are the puppet's equations."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.kernel.equations.printing import BOUNDS, Printable, decimal, printable
from fantoccini.model.puppet import loads

pytestmark = pytest.mark.medium

GOLDEN = Path(__file__).parent / "golden"
"""Prints of small puppets; FANTOCCINI_UPDATE=1 writes them again, for a review."""

# Two tilted hinges on a driven slide that carries mass, springs, damping, drag, a limit, a string
# over two segments of fixed length, and parameters as divisors.
CART = """\
puppet: cart
gravity: [0, 0.3, -9.81]
bodies:
  - name: cart
    joint: {type: prismatic, axis: [1, 0, 0], driven: true}
    mass: 2
  - name: pole
    parent: cart
    joint:
      type: revolute
      axis: [0.6, 0.8, 0]
      orientation: {rpy: [0.3, -0.2, 0.7]}
      damping: 0.1
      spring: {stiffness: {parameter: k, value: 3.0}, rest: 0.2}
      limits: {lower: -60 deg, upper: 60 deg}
    mass: {parameter: theta_1, value: 0.7}
    com: [0.1, 0.2, {parameter: c, value: -0.3}]
    inertia: [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]
    drag: {linear: 0.2, quadratic: 0.3, angular: 0.01}
  - name: bob
    parent: pole
    joint: {type: revolute, axis: [0, 1, 0], at: [0, 0, -0.5]}
    mass: 0.4
    com: [0, 0, -0.25]
    inertia: [0.01, 0.01, 0.001]
strings:
  - name: line
    path: [{body: bob, at: [0, 0, -0.5]}, {body: cart, at: [0.2, 0, 0]}, {world: [0, 0, 2]}]
    length: {parameter: length, value: 4.0}
springs:
  - name: band
    between: [{body: bob}, {world: [1, 0, 0]}]
    stiffness: 5
    rest: 0.3
    damping: 0.2
"""


def _cart() -> fan.Marionette:
    return fan.Marionette(loads(CART, "cart.yaml"))


PUPPETS = {
    "arm2d": fan.puppets.arm2d,
    "arm3d": fan.puppets.arm3d,
    "crane": fan.puppets.crane,
    "string_pendulum": fan.puppets.string_pendulum,
    "cart": _cart,
}


def random_state(marionette: fan.Marionette, rng: np.random.Generator) -> fan.State:
    """A state far from any symmetry, with unit quaternions."""
    table = marionette.coordinates
    q_D, q_K = rng.normal(size=table.n_qD), rng.normal(size=table.n_qK)
    for q, places in ((q_D, table.quaternions_D), (q_K, table.quaternions_K)):
        for k, _ in places:
            q[k : k + 4] /= np.linalg.norm(q[k : k + 4])
    v_D, v_K = rng.normal(size=table.n_vD), rng.normal(size=table.n_vK)
    return fan.State(0.0, q_D, v_D, q_K, v_K, np.zeros(marionette.tree.n_rows, dtype=bool))


def numbers(page: Printable, marionette: fan.Marionette, x: fan.State) -> dict[str, np.ndarray]:
    """Every object of a page, evaluated by SymPy's own printer to Python."""
    arrays = {**vars(x), "p": marionette.p}
    values_of_symbols: dict[sp.Symbol, float] = {}
    for name, symbols in page.notation.symbols.items():
        values_of_symbols.update(zip(symbols, map(float, arrays[name]), strict=True))
    for symbol, meaning in page.lengths:
        values_of_symbols[symbol] = float(
            sp.lambdify(list(values_of_symbols), meaning, "math")(*values_of_symbols.values())
        )
    evaluate = sp.lambdify(list(values_of_symbols), list(page.objects.values()), "numpy")
    values = evaluate(*values_of_symbols.values())
    return dict(zip(page.objects, map(np.asarray, values), strict=True))


@pytest.mark.parametrize("name", PUPPETS)
def test_the_printed_equations_are_the_puppets(name) -> None:
    marionette = PUPPETS[name]()
    page = printable(marionette.equations)
    rng = np.random.default_rng(7)
    for _ in range(3):
        x = random_state(marionette, rng)
        values = numbers(page, marionette, x)
        expected = {
            "M": marionette.mass_matrix(x),
            "M_DK": marionette.mass_matrix_DK(x),
            "C": marionette.interpreted("coriolis", x).C,
            "g": marionette.gravity(x)[:, None],
            "f": marionette.damping(x)[:, None],
            "h": marionette.constraint(x)[:, None],
            "A_D": marionette.A_D(x),
            "A_K": marionette.A_K(x),
            "T": marionette.kinetic_energy(x),
            "V": marionette.potential_energy(x),
        }
        for key, value in expected.items():
            scale = max(1.0, float(np.max(np.abs(value), initial=0.0)))
            assert values[key].size == np.size(value), key
            np.testing.assert_allclose(
                values[key].reshape(np.shape(value)), value, rtol=0, atol=1e-11 * scale, err_msg=key
            )


def test_the_lagrangian_is_that_of_the_puppet() -> None:
    marionette = fan.puppets.arm2d()
    page = printable(marionette.equations)
    x = random_state(marionette, np.random.default_rng(1))
    values = numbers(page, marionette, x)
    assert values["T"] - values["V"] == pytest.approx(marionette.lagrangian(x), abs=1e-12)
    assert page.lagrangian == page.objects["T"] - page.objects["V"]


def test_arm2d_has_the_textbooks_form() -> None:
    page = printable(fan.puppets.arm2d().equations)
    theta_1, theta_2, m1, m2 = sp.symbols("theta_1 theta_2 m1 m2", real=True)
    assert page.objects["M"][1, 1] == sp.Rational("0.0225") * m2 + sp.Rational("0.0006")
    g = page.objects["g"]
    assert g[1] == sp.Rational("1.4715") * m2 * sp.cos(theta_1 + theta_2)
    assert g[0].has(sp.cos(theta_1), sp.cos(theta_1 + theta_2), m1)
    assert not page.objects["M"].has(theta_1)
    assert all(
        not entry.has(sp.sin(theta_1) * sp.cos(theta_2)) for entry in [*page.objects["A_D"], g[0]]
    )
    assert str(decimal(sp.Rational(1, 8) * sp.sqrt(theta_1))) == "0.125*sqrt(theta_1)"


def test_a_parameter_with_the_name_of_a_symbol_gets_another_symbol() -> None:
    notation = printable(_cart().equations).notation
    symbols = [s for part in notation.symbols.values() for s in part]
    assert len(set(symbols)) == len(symbols)
    assert sorted(notation.names.values())[-1] == "theta_1"


def check_golden(name: str, text: str) -> None:
    file = GOLDEN / name
    if os.environ.get("FANTOCCINI_UPDATE"):
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")


def test_arm2d_on_a_page() -> None:
    check_golden("arm2d.txt", fantoccini("equations", "arm2d").stdout)


def test_arm2d_in_latex() -> None:
    check_golden("arm2d.tex", fantoccini("equations", "arm2d", "--latex").stdout)


@pytest.mark.parametrize("name", ["arm3d", "crane"])
def test_a_page_is_not_wider_than_its_lines(name) -> None:
    lines = fantoccini("equations", name).stdout.splitlines()
    assert max(map(len, lines)) <= 110


def test_a_terminal_without_greek_gets_ascii() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "fantoccini.app.cli.app", "equations", "arm2d"],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        check=True,
    )
    text = done.stdout.decode("ascii")
    assert "0.045*cos(theta_2)" in text
    assert "\\u" not in text


def test_a_large_puppet_is_referred_to_export() -> None:
    result = fantoccini("equations", "marionette")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert "C: " in result.stderr and "fantoccini export marionette DIR" in result.stderr
    assert f"up to {BOUNDS.operations} are printed" in result.stderr


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs LaTeX")
def test_the_latex_compiles(tmp_path) -> None:
    body = fantoccini("equations", "arm2d", "--latex").stdout
    source = "\\documentclass{article}\\usepackage{amsmath}\\begin{document}\n"
    (tmp_path / "a.tex").write_text(source + body + "\\end{document}\n")
    subprocess.run(["pdflatex", "-interaction=batchmode", "a.tex"], cwd=tmp_path, check=True)


MOTORS = """\
puppet: motors
bodies:
  - {name: bob, joint: {type: translation, axes: [x, z]}, mass: 0.4}
  - name: crank
    joint: {type: revolute, axis: [0, -1, 0], driven: true}
    mass: 0.1
    com: [0, 0, -0.2]
strings:
  - {name: line, path: [{body: bob}, {driven: [x], at: [0, 0, 1]}], length: driven}
drives:
  - {on: line.x, mass: 0.7, control: {type: computed_torque, bandwidth: {parameter: w, value: 9}}}
  - {on: line.length, inertia: 4.0e-5, drum: 0.02, motor: {type: stepper, torque: 0.4}}
  - on: crank
    inertia: 2.0e-5
    gear: 20
    motor: {type: dc, constant: 0.05, current: 1.5, resistance: 4, voltage: 12}
    control: {type: pd, stiffness: 40, damping: 1}
"""


def test_motors_have_their_laws_on_the_page(tmp_path) -> None:
    file = tmp_path / "motors.yaml"
    file.write_text(MOTORS)
    page = fantoccini("equations", str(file)).stdout
    lines = [" ".join(line.split()) for line in page.splitlines()]
    assert "r₂ line.command.x driven" in lines
    assert "r₃ line.command.length driven" in lines
    assert any(line.endswith("= u + f_M + A_D^T lambda, tension = -lambda >= 0") for line in lines)
    page = " ".join(lines)
    for law in (
        "line.x M a + c + friction by inverse dynamics, a = rddot + 2 zeta w edot + w^2 e, w = w",
        "L line.length n 0.4 sin(50 n e), command in steps of 2 pi / (3200 n); n = 1 / 0.02",
        "θ crank 40 e + 1 edot = n 0.05 i where |i| <= 1.5 and |4 i + 0.05 n v| <= 12; n = 20",
    ):
        assert law in page
