"""Combined runs of players, pauses, and random plays."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.plays.random_plays import random_play
from ruamel.yaml import YAML

import fantoccini as fan
from fantoccini.theatre.gestures.body_parts import BodyParts
from fantoccini.theatre.gestures.ends import Ends
from fantoccini.theatre.gestures.stepping import Step
from fantoccini.theatre.gestures.walking import step_gesture
from fantoccini.theatre.plays.settling import Swing, best_pause
from plays.conftest import Plays

pytestmark = pytest.mark.medium


def test_players_together_move_as_in_a_run_of_the_whole_stage(plays: Plays):
    play = plays.compile("{who: pierrot, does: wave}\n{who: columbine, does: clap, when: 1}")
    verification = fan.theatre.verify_play(play)
    stage_run = fan.simulate(play.marionette, play.x0, play.inputs)
    t = np.linspace(0.0, verification.run.t[-1], 200)
    combined_samples, stage_samples = verification.run.resample(t), stage_run.resample(t)
    assert np.max(np.abs(combined_samples.q_K - stage_samples.q_K)) < 1e-12
    # Two integrations with different steps: catches of strings determine the difference.
    assert np.max(np.abs(combined_samples.q_D - stage_samples.q_D)) < 1e-4
    assert np.max(np.abs(combined_samples.tension.values - stage_samples.tension.values)) < 0.02
    sums = {name: float(verification.run.ledger[name][-1]) for name in ("work", "residual")}
    assert sums["work"] == pytest.approx(float(stage_run.ledger["work"][-1]), abs=1e-4)
    assert abs(sums["residual"]) < 1e-6
    kinds = [(event.kind, event.name) for event in stage_run.events if event.name]
    assert {name for _, name in kinds} == {e.name for e in verification.run.events if e.name}


@pytest.fixture(scope="module", name="after_a_walk")
def _after_a_walk() -> tuple[fan.Marionette, fan.State, fan.theatre.Gesture]:
    puppet = fan.puppets.marionette()
    hangs = puppet.rest()
    walk = step_gesture(Ends(BodyParts.for_puppet(puppet), hangs), [Step(0.1)] * 3)
    inputs = walk.inputs(hangs, speed=1.5, acceleration=12.0)
    run = fan.simulate(puppet, hangs, inputs, method="timestepping")
    return puppet, run.state(len(run) - 1).replace(t=0.0), walk


def test_the_gradient_of_swing_by_the_pause_agrees_with_differences():
    puppet = fan.puppets.marionette()
    hangs = puppet.rest()
    # Gentle enough that no string snaps taut, so that the cost is smooth.
    ends = [name for name in puppet.coordinates.q_K if name.endswith(".x")]
    push = fan.theatre.Gesture.from_points(puppet, {name: [(0, 0), (1.0, 0.01)] for name in ends})
    run = fan.simulate(puppet, hangs, push.inputs(hangs), method="timestepping")
    x = run.state(len(run) - 1).replace(t=0.0)
    swing = Swing(puppet, x, push.motion, 1.0)
    h = 1e-5
    for p in (0.1231, 0.4561, 0.77713):
        _, (slope,) = swing.cost(p, gradient=True)
        difference = (swing.cost(p + h)[0] - swing.cost(p - h)[0]) / (2.0 * h)
        assert slope == pytest.approx(difference, rel=1e-5, abs=1e-9)


def test_a_pause_uses_the_swing_of_the_walk_before(
    after_a_walk: tuple[fan.Marionette, fan.State, fan.theatre.Gesture],
):
    puppet, x, walk = after_a_walk
    pause_time, speed_before, speed_after = best_pause(puppet, x, walk.motion, 1.0)
    assert 0.0 <= pause_time <= 1.0
    assert speed_after < speed_before
    costs = [Swing(puppet, x, walk.motion, 1.0).cost(p)[0] for p in np.linspace(0.0, 1.0, 21)]
    assert Swing(puppet, x, walk.motion, 1.0).cost(pause_time)[0] < 1.3 * min(costs)


@pytest.mark.parametrize("seed", [1, 3, 11])
@pytest.mark.slow
def test_a_random_play_compiles_and_is_verified(plays: Plays, seed: int):
    path = plays.folder / "random.yaml"
    YAML().dump(random_play(seed), path)
    play = fan.load_play(path)
    verification = fan.theatre.verify_play(play)
    assert verification, verification.faults
    assert all(cue.refused or cue.marks for cue in play.cues)
    assert len(play.changes) == sum(bool(cue.refused) for cue in play.cues)
