"""A prop handed over in an event-driven run, which lasts a tenth of the motion."""

import numpy as np
from test_props import handed, handle_in, met

import fantoccini as fan


def test_a_ball_is_handed_over_event_driven():
    scene, pair = handed("ball", "right", (0.0, 0.0, 0.0))
    x0, both = scene.rest(), pair.giver + pair.receiver
    run = fan.simulate(scene, x0, both.inputs(x0), t_end=13.0)
    assert run.status is fan.Status.DONE
    assert set(met(run, "ball")) == {"pierrot.forearm_right", "columbine.forearm_left"}
    assert met(run, "ball")["pierrot.forearm_right"][1] < 9.0
    assert np.abs(run.ledger["residual"]).max() < 1e-9
    assert 0.03 < -handle_in(scene, run, "ball", "columbine.forearm_left")[-1, 2] < 0.11
