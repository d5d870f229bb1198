"""Compiled derivatives of the smooth pieces of event-driven runs, against central differences."""

import numpy as np

import fantoccini as fan


def test_derivatives_of_a_piece_are_those_of_its_end():
    marionette = fan.puppets.marionette()
    t, model, rng = marionette.coordinates, marionette.model, np.random.default_rng(0)
    x, n, k = marionette.rest({}), t.n_vD, t.n_vK
    acc_K, length, step = 0.3 * rng.standard_normal(k), 0.1, 1e-5
    change = rng.standard_normal((3, k))
    scalars = np.array(t.scalars_K)
    held = marionette.forward_dynamics(x, acc_K)[1][None] > 0.0

    def flow(s):
        q_K = x.q_K.copy()
        q_K[scalars[:, 0]] += s * change[0][scalars[:, 1]]
        starts = {
            "q_D": x.q_D[None], "v_D": x.v_D[None], "q_K": q_K[None],
            "v_K": (x.v_K + s * change[1])[None], "acc_K": (acc_K + s * change[2])[None],
            "length": np.array([length]),
        }  # fmt: skip
        return model.compiled.step_derivatives.flow(
            starts, held, np.array([12]), model.p[None], None, 1
        )

    by_inputs = flow(0.0)[2][0][n:, 2 * n : 2 * n + 3 * k] @ change.ravel()
    found = (flow(step)[1] - flow(-step)[1])[0] / (2.0 * step)
    assert np.max(np.abs(found)) > 0.1
    assert np.max(np.abs(found - by_inputs)) < 1e-8 * np.max(np.abs(found))
