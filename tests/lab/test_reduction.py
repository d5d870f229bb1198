"""Section VI on puppets whose kinetic energy, symmetric products and ties are known."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import fantoccini as fan
from fantoccini import puppets
from fantoccini.base.errors import PuppetError
from fantoccini.lab import reduction
from fantoccini.lab.reduction import kinetic_energy, symmetric_products, tracking
from fantoccini.lab.reduction_states import (
    displaced,
    drive_inertia,
    fit_strings,
    in_metres,
    mean_length,
    metric,
    random_states,
    taut_states,
    without_drives,
)
from lab.toys import CART, HELD, LIFTED, RADIAL, TURNED, WINCH

pytestmark = pytest.mark.medium


def sample_states(puppet, n=4, seed=1):
    return random_states(puppet, n, np.random.default_rng(seed))


def christoffel_products(metric, q, n_forces):
    """<grad q_i, grad q_j> by Christoffel's symbols, for the last coordinates, as a function."""
    n, G, m = len(q), sp.simplify(metric.inv()), metric
    christoffel_symbols = [
        [
            [(m[k, i].diff(q[j]) + m[k, j].diff(q[i]) - m[i, j].diff(q[k])) / 2 for k in range(n)]
            for j in range(n)
        ]
        for i in range(n)
    ]

    def covariant_derivative(X, Y):
        connection = sp.zeros(n, 1)
        for i in range(n):
            for j in range(n):
                connection += X[i] * Y[j] * G * sp.Matrix(christoffel_symbols[i][j])
        return Y.jacobian(sp.Matrix(q)) * X + connection

    fields = [G[:, k] for k in range(n - n_forces, n)]
    return sp.lambdify(
        [q],
        [[covariant_derivative(X, Y) + covariant_derivative(Y, X) for Y in fields] for X in fields],
    )


def test_the_rod_on_a_trolley_has_the_products_of_christoffels_symbols():
    cart = fan.loads(CART)
    theta, _ = q = sp.symbols("theta s", real=True)
    c = sp.cos(theta)
    inertia = 0.7
    metric = sp.Matrix([[sp.Rational(7, 20), c / 2], [c / 2, 3 + sp.Float(inertia)]])
    expected_products = christoffel_products(metric, q, 1)
    for x in sample_states(cart):
        products, outside_share = symmetric_products(cart, x, np.array([inertia]))
        expected = np.array(expected_products([x.q_D[0], x.q_K[0]]), dtype=float)[0, 0, :, 0]
        assert products[:, 0, 0] == pytest.approx(expected, abs=1e-13)
        assert outside_share > 0.1


def test_a_bob_on_a_winch_has_the_products_of_its_constraint_surface():
    """Coordinates on h = 0 are theta, x and L: xb = x + L sin(theta), zb = -L cos(theta)."""
    winch, inertia = fan.loads(WINCH), np.array([0.6, 0.9])
    theta, x, length = q = sp.symbols("theta x L")
    position = sp.Matrix([x + length * sp.sin(theta), -length * sp.cos(theta)])
    J = position.jacobian(q)
    metric = J.T * J / 2 + sp.diag(0, *inertia.tolist())
    expected_products = christoffel_products(metric.applyfunc(sp.nsimplify), q, 2)
    to_configuration = sp.lambdify([q], sp.Matrix.vstack(J, sp.Matrix([[0, 1, 0], [0, 0, 1]])))
    rng = np.random.default_rng(2)
    for state, rows in taut_states(winch, 4, rng):
        assert list(rows) == [0]
        angle = np.arctan2(state.q_D[0] - state.q_K[0], -state.q_D[1])
        coordinates = [angle, *state.q_K]
        products, outside_share = symmetric_products(winch, state, inertia, rows)
        expected = np.array(expected_products(coordinates), dtype=float)[..., 0]
        assert products == pytest.approx(
            np.einsum("lm,ijm->lij", to_configuration(coordinates), expected), abs=1e-12
        )
        # The winch alone has <X, X> = 0: G_LL = 1 / (m + J). The carriage does not.
        winch_products, _ = symmetric_products(winch, state, np.array([1e12, 0.9]), rows)
        assert np.linalg.norm(winch_products[:, 1, 1]) < 1e-10
        assert outside_share > 0.05


def test_the_products_of_turning_joints_are_the_gradient_of_the_driven_block():
    """The part outside of the span is d(M^-1)_KK/dq_D, in the metric of M_DD, by differences."""
    puppet = fan.loads(TURNED)
    n, inertia, h = puppet.coordinates.n_vD, np.array([0.5] * 3 + [0.02] * 3), 1e-5
    for x in sample_states(puppet, 2):
        products, outside_share = symmetric_products(puppet, x, inertia)
        M = metric(puppet, x, inertia)
        gradient = []
        for change in h * np.eye(n + 6)[:n]:
            displaced_states = [displaced(puppet, x, sign * change) for sign in (1, -1)]
            up, down = (np.linalg.inv(metric(puppet, y, inertia))[n:, n:] for y in displaced_states)
            gradient.append((up - down) / (2 * h))
        # Part of a covector on the puppet that forces on the drives cannot produce.
        covector = np.einsum("ab,bij->aij", M, products)[:n]
        assert covector == pytest.approx(np.array(gradient), abs=2e-8)
        assert outside_share > 0.01


def test_a_driven_bar_has_a_metric_of_its_own_and_products_inside():
    """M_KK of the bar on its free joint turns with it: the products are inside, and not 0."""
    bar = puppets.marionette_bar()
    x = sample_states(bar, 1)[0]
    products, outside_share = symmetric_products(bar, x, np.full(6, 0.1))
    assert np.max(np.abs(products)) > 1e-3
    assert outside_share < 1e-13


def test_a_slider_on_a_turning_arm_is_block_diagonal_and_yet_not_separate():
    energy = kinetic_energy(radial := fan.loads(RADIAL), sample_states(radial))
    assert energy.coupling == 0.0 and energy.coupled == ()
    assert energy.M_DD_change > 0.1 and energy.M_KK_change == 0.0


def test_the_coupling_of_the_cart_is_m_l_cos_theta():
    energy = kinetic_energy(cart := fan.loads(CART), sample_states(cart))
    cosines = [abs(np.cos(x.q_D[0])) for x in sample_states(cart)]
    assert energy.coupling == pytest.approx(0.5 * max(cosines) / np.sqrt(0.35 * 3.0))
    assert energy.coupled == ("swing", "trolley")
    # v . M_KD M_DD^-1 M_DK v / v . M_KK v
    assert energy.impact_share == pytest.approx(energy.coupling**2)


def test_drives_weigh_as_much_as_the_puppet():
    hand, winch = fan.loads(TURNED), fan.loads(WINCH)
    assert list(in_metres(hand)[hand.coordinates.n_vD :]) == 3 * [True] + 3 * [False]
    assert mean_length(hand) == 1.0
    assert drive_inertia(hand) == pytest.approx((0.7, 0.7 * 0.1**2))  # the hand is driven
    assert mean_length(winch) == pytest.approx(np.hypot(0.3, 1.0))
    assert drive_inertia(winch, 2.0)[0] == 1.0


def test_winches_that_pull_on_one_bob_from_both_sides_are_tied():
    puppet = fan.loads(HELD)
    x = fit_strings(puppet, puppet.state())
    with_both = tracking(puppet, x, np.ones(2), np.array([0, 1]))
    assert with_both.tied == ("above", "below") and with_both.pulls_apart
    assert with_both.min_acceleration == pytest.approx(0.0, abs=1e-14)
    with_one = tracking(puppet, x, np.ones(2), np.array([0]))
    # Mass 0.5 on a winch of inertia 1: it accelerates at 1 / 1.5 of the rate without the mass.
    assert with_one.tied == () and with_one.min_acceleration == pytest.approx(1 / 1.5, abs=1e-14)


def test_drives_of_the_file_are_replaced():
    drives = "drives:\n  - {on: line.length, mass: 2.0}\n"
    without_file_drives = without_drives(fan.loads(WINCH + drives))
    assert without_file_drives.coordinates.v_K == ("line.x", "line.length")
    assert without_file_drives.coordinates.n_vD == 2


def test_a_puppet_without_a_mechanism_is_a_mistake():
    with pytest.raises(PuppetError, match="no coordinate is driven"):
        fan.lab.validate_reduction(puppets.string_pendulum())


def test_a_drive_keeps_the_part_of_its_acceleration_that_the_bob_leaves():
    winch = fan.loads(WINCH)
    for x, rows in taut_states(winch, 3, np.random.default_rng(0)):
        result = tracking(winch, x, np.array([2.0, 2.0]), rows)
        direction = np.array([x.q_D[0] - x.q_K[0], x.q_D[1]]) / x.q_K[1]
        # The bob is moved along the string alone, by (-d_x, -1) of the drives' accelerations.
        a = np.array([direction[0], 1.0])
        G = np.linalg.inv(2.0 * np.eye(2) + 0.5 * np.outer(a, a))
        assert result.min_acceleration == pytest.approx(2.0 * np.linalg.eigvalsh(G)[0], abs=1e-13)


@pytest.mark.parametrize("name", ["arm2d", "arm3d", "crane", "marionette_bar", "stand6"])
def test_bundled_puppets_are_separate_and_their_drives_track(name, monkeypatch):
    monkeypatch.setattr(reduction, "N_STATES", 2)
    report = fan.lab.validate_reduction(getattr(puppets, name)())
    assert [c.holds for c in report.claims] == [True, True, True, True, False]
    assert report.valid and report.conclusion.startswith("yes")


CLAIMS = {
    "cart": (CART, [False, True, False, None, None], "% of a driven coordinate's kinetic energy"),
    "radial": (RADIAL, [True, False, True, None, None], "yes: the mixed model is exact"),
    "winch": (WINCH, [True, True, True, True, False], "yes: the mixed model is exact"),
    "held": (HELD, [True, True, True, False, True], "no: the drives can pull above and below"),
    "turned": (TURNED, [False, False, False, None, None], "a jump of v_K"),
    "lifted": (LIFTED, [True, True, True, False, True], "tied strings go slack"),
}


@pytest.mark.parametrize(("text", "holds", "answer"), CLAIMS.values(), ids=CLAIMS)
def test_the_claims_say_what_fails(text, holds, answer):
    report = fan.lab.validate_reduction(fan.loads(text))
    assert [c.holds for c in report.claims] == holds
    assert answer in report.conclusion
