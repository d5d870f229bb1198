"""Momentum about the centre of mass is the sum over the bodies, for arrays and in lanes too."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from cpp.toolchain import compile_program, run_program, write_model
from fantoccini.model.tree import link_inertia, link_poses
from harness import Model
from oracles.random_trees import description


@pytest.mark.parametrize("seed", range(4))
def test_momentum_is_the_sum_over_the_bodies(seed):
    model = Model(description(seed, 12, driven=0.3))
    x = model.random(seed)
    poses = link_poses(model.tree.links, x.q_D[None], x.q_K[None], float)[0]
    V = model.first_output("body_velocity", x).T
    parts = []
    for link, (v, w), pose in zip(model.tree.links, V.reshape(-1, 2, 3), poses, strict=True):
        m, com, inertia = link_inertia(link, float)
        R, r = pose[:, :3], pose[:, 3]
        parts.append((m, r + R @ com, m * R @ (v + np.cross(w, com)), R @ inertia @ w))
    centre = sum(m * c for m, c, _, _ in parts) / sum(m for m, *_ in parts)
    linear = sum(p for _, _, p, _ in parts)
    angular = sum(np.cross(c - centre, p) + own for _, c, p, own in parts)
    momenta = model.first_output("momentum", x)[:, 0]
    np.testing.assert_allclose(momenta, [*linear, *angular], rtol=1e-11, atol=1e-11)


def states(puppet: fan.Marionette, n: int) -> list[fan.State]:
    rng, x = np.random.default_rng(0), puppet.rest()
    return [
        x.replace(v_D=rng.normal(size=x.v_D.shape), v_K=rng.normal(size=x.v_K.shape))
        for _ in range(n)
    ]


def test_many_states_at_once():
    puppet = fan.puppets.crane()
    many = states(puppet, 5)
    states_of_all = {
        n: np.array([getattr(x, n) for x in many]) for n in ("q_D", "v_D", "q_K", "v_K")
    }
    momenta = puppet.library.evaluate("momentum", **states_of_all, p=puppet.p).momentum
    np.testing.assert_array_equal(momenta, [puppet.momentum(x) for x in many])


def test_lanes(tmp_path):
    write_model("crane", tmp_path)
    flags = ("-O1", "-march=native", "-Wno-maybe-uninitialized", "-Wno-uninitialized")
    program = compile_program("momentum.cpp", tmp_path, *flags)
    puppet = fan.puppets.crane()
    many = states(puppet, 8)
    words = [part for x in many for part in (x.q_D, x.v_D, x.q_K, x.v_K)]
    text = "\n".join(repr(float(x)) for x in np.concatenate([*words, puppet.p]))
    momenta = np.array(run_program(program, text).split(), dtype=float).reshape(8, 2, 6)
    np.testing.assert_allclose(momenta[:, 0], momenta[:, 1], rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(momenta[:, 1], [puppet.momentum(x) for x in many], atol=1e-13)
