"""The benchmark of chains and massless strings measures plausible figures."""

import dataclasses

import numpy as np
import pytest
from benchmarks.string_model import report
from benchmarks.string_model.measure import measure
from benchmarks.string_model.subject import ARM

pytestmark = pytest.mark.medium


@pytest.fixture(scope="module")
def both_models():
    massless, hand_path = measure(ARM, ARM.massless(), None)
    return massless, measure(ARM, ARM.chained(pieces=2), hand_path)[0]


def test_a_chain_brings_fast_motions_and_short_steps(both_models):
    massless, chain = both_models
    assert (massless.dof, chain.dof) == (4, 7)
    # One mass of 0.5 g between two springs of stiffness EA / (0.5 m) = 10 kN/m.
    assert chain.fastest == pytest.approx(np.sqrt(2 * 10_000 / 5e-4), rel=0.01)
    assert massless.fastest < 20
    assert 1.4 < chain.largest_step * chain.fastest < 2.2
    assert massless.largest_step > 20 * chain.largest_step
    assert chain.steps > 50 * massless.steps


def test_a_chain_stretches_and_its_hand_is_elsewhere(both_models):
    massless, chain = both_models
    assert massless.stretch < 1e-9
    assert 1e-5 < chain.stretch < 1e-3
    assert 1e-5 < chain.error < 1e-3


def test_the_text_holds_both_tables(both_models, monkeypatch):
    monkeypatch.setattr(
        report, "measure_models", lambda *_: [("massless", "-", both_models[0])] * 6
    )
    monkeypatch.setattr(report, "PUPPET", dataclasses.replace(report.PUPPET, pieces=(4,)))
    text = report.chain_table()
    assert text.count("| massless |") == 12
    assert "{" not in text
