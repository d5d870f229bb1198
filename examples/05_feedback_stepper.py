"""Close a feedback loop: hold a hand at its height while the end of the string moves sideways.

A control law receives the state and returns the winch's acceleration 100 times per second. Without
it the hand rises and falls with the string's end. Writes out/feedback.csv.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
HAND = np.array([0.3, 0.0, 0.0])  # in the frame of the lower arm [m]


def hand(x: fan.State) -> tuple[float, float]:
    """Height of the hand [m] and its rate [m/s]."""
    pose = arm.pose(x, "lower")
    R, r = pose[:3, :3], pose[:3, 3]
    v, w = np.split(arm.body_velocity(x, "lower"), 2)  # in the body's frame
    return (r + R @ HAND)[2], (R @ (v + np.cross(w, HAND)))[2]


HEIGHT = hand(x0)[0]


def wander(x: fan.State) -> dict[str, float]:
    """Moves the string's end back and forth with a period of 2 s [m/s^2]; the winch is at rest."""
    return {"hand.x": 0.8 * np.cos(np.pi * x.t)}


def hold(x: fan.State) -> dict[str, float]:
    """Likewise, and lets out string if the hand is too high or rises."""
    z, rate = hand(x)
    return wander(x) | {"hand.length": 400.0 * (z - HEIGHT) + 40.0 * rate}


for name, law in (("winch at rest", wander), ("feedback", hold)):
    stepper = arm.stepper(x0, method=fan.TimeStepping(dt=0.001))
    states = stepper.run(t_end=4.0, law=law, rate=100)
    errors = [abs(hand(x)[0] - HEIGHT) for x in states]
    print(f"{name}: the hand stays within {1000 * max(errors):.2f} mm of its height")

rows = np.array([(x.t, *x.q_K, *hand(x)) for x in states])
header = "t,hand.x,hand.length,z,zdot"
np.savetxt(out / "feedback.csv", rows, delimiter=",", comments="", header=header)
print("wrote", out / "feedback.csv")
