"""The bundled performance meets the requirements on a marionette from a file to a picture."""

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.perform.demo import DURATION, performance


@pytest.fixture(scope="module")
def run(marionette):
    return fan.simulate(marionette, *performance(marionette), method="event")


def slack_spells(run, string):
    """(begin, end) of the times at which a string is slack before it is taut again."""
    taut = run.taut[string]
    begins = np.flatnonzero(~taut[1:] & taut[:-1]) + 1
    ends = np.flatnonzero(taut[1:] & ~taut[:-1]) + 1
    return [(run.t[b], run.t[ends[ends > b][0]]) for b in begins if np.any(ends > b)]


def test_it_is_the_papers_marionette(marionette):
    table = marionette.coordinates
    assert (table.n_vD, len(marionette.tree.strings), table.n_vK) == (25, 7, 21)


def test_it_reaches_its_end(run):
    assert run.status is fan.Status.DONE
    assert run.t[-1] == DURATION


def test_a_string_is_slack_for_a_while_and_snaps_taut(run):
    begin, end = max(slack_spells(run, "head"), key=lambda spell: spell[1] - spell[0])
    assert end - begin >= 0.1
    caught = [e for e in run.events if e.name == "head" and e.kind == "catch" and e.t == end]
    assert caught and caught[0].impulse > 0 and caught[0].speed > 0


def test_taut_strings_keep_their_lengths(marionette, run):
    lengths = marionette.string_lengths(run.q_D, run.q_K)
    points = marionette.string_points(run.q_D, run.q_K).values()
    paths = np.stack([np.sum(np.linalg.norm(np.diff(p, axis=1), axis=2), axis=1) for p in points])
    stretch = paths.T - lengths
    assert np.max(np.abs(stretch[run.taut.values])) < 1e-10
    assert np.max(stretch) < 1e-10


def test_the_ledger_closes(run):
    assert np.max(np.abs(run.ledger["residual"])) < 1e-8
    assert run.ledger["impact"][-1] > 1e-3


def test_strings_only_pull(run):
    assert np.min(run.tension.values) >= 0.0
    assert not np.any(run.tension.values[~run.taut.values])


def test_the_hand_goes_up_and_the_puppet_walks_and_bows(marionette, run):
    then = run.resample(np.array([0.0, 1.4, 6.9, 8.0]))
    poses = marionette.poses(then.q_D, then.q_K)
    hand, torso, head = (marionette.link_index(n) for n in ("forearm_right", "torso", "skull"))
    assert poses[1, hand, 2, 3] - poses[0, hand, 2, 3] > 0.05
    assert poses[2, torso, 0, 3] - poses[0, torso, 0, 3] > 0.1
    assert poses[3, head, 2, 2] < 0.8 < poses[0, head, 2, 2]


def test_time_stepping_follows_it(marionette, run):
    """Until the first step, before any catch, both methods give the same motion."""
    x0, inputs, _ = performance(marionette)
    differences = []
    for dt in (0.004, 0.002, 0.001):
        stepped = fan.simulate(marionette, x0, inputs, 3.0, method=fan.TimeStepping(dt=dt))
        every = round(0.2 / dt)
        run_at_steps = run.resample(stepped.t[::every])
        differences.append(np.max(np.abs(stepped.q_D[::every] - run_at_steps.q_D)))
    assert differences[2] < 5e-3
    assert 1.6 < differences[0] / differences[1] < 2.6
    assert 1.6 < differences[1] / differences[2] < 2.6
